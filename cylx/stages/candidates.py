"""Ellipse fits -> candidates: the two cylinders that intersect a plane in an ellipse, and their refinement."""

from __future__ import annotations

import math

import numpy as np

from cylx.config import CandidatesConfig
from cylx.fits.polish import move_to_foot, polish
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import RADIUS
from cylx.geometry.kernels import njit
from cylx.geometry.morton import cell_starts, gather_ball, thin
from cylx.records import Candidates, EllipseFit, Frame

MOST_POINTS_TO_POLISH = 4096
"""Maximum number of points used to polish a candidate."""


def axes_of(fit: EllipseFit) -> FloatArray:
    """Return the two possible axis directions of an ellipse (eq. 4).

    They are the plane's normal, rotated about the minor axis by plus or minus arccos(b / a), the angle of eq. 3.

    Returns
    -------
    ndarray of shape (2, 3)
    """
    ratio = fit.ellipse.semi_minor / fit.ellipse.semi_major
    major = fit.ellipse.major_axis
    minor = fit.plane.lift_vectors(np.array([-major[1], major[0]]))
    x, y, z = minor
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + math.sqrt(max(0.0, 1.0 - ratio * ratio)) * cross + (1.0 - ratio) * cross @ cross  # eq. 4
    return np.stack([turn @ fit.plane.normal, turn.T @ fit.plane.normal])


def propose_cylinders(slices: list[list[EllipseFit]]) -> Candidates:
    """Make two candidates from each ellipse: its centre, its semi-minor axis, and the two directions of eq. 4.

    Parameters
    ----------
    slices : list of list of EllipseFit
        The ellipses of each slice; all candidates of one slice exclude each other (eq. 5).

    Returns
    -------
    Candidates
    """
    models, parents, inliers = [], [], []
    for index, fits in enumerate(slices):
        for fit in fits:
            center = fit.plane.lift(fit.ellipse.center)
            for direction in axes_of(fit):
                models.append(np.concatenate([center, direction, [fit.ellipse.semi_minor]]))
                parents.append(index)
                inliers.append(fit.inliers)
    count = len(models)
    return Candidates(
        np.array(models).reshape(count, 7),
        np.array(parents, dtype=np.int64),
        np.zeros(count),
        np.array(inliers, dtype=np.int64),
        np.array(models).reshape(count, 7)[:, 6].copy(),
    )


def polish_candidates(
    candidates: Candidates, frame: Frame, radius_range: tuple[float, float], config: CandidatesConfig
) -> Candidates:
    """Fit each candidate to the points within two radii of its centre, and drop those that do not fit.

    Usually only the right one of an ellipse's two axes passes.

    Parameters
    ----------
    candidates : Candidates
    frame : Frame
    radius_range : tuple of float
        Least and greatest radius, frame units.
    config : CandidatesConfig

    Returns
    -------
    Candidates
    """
    rows = np.zeros((len(candidates), 9))
    rows[:, :7] = candidates.models
    kept = np.zeros(len(candidates), np.bool_)
    size_class = np.log2(np.maximum(candidates.radii / frame.window, 1.0)).astype(np.int64)
    for level in np.unique(size_class):
        sample = thin(frame.codes, frame.voxel_level + int(level))
        cells, starts = cell_starts(frame.codes[sample], frame.voxel_level + int(level) + 3)
        side = frame.unit * 2.0 ** (frame.voxel_level + int(level) + 3)
        noise = frame.noise.at(frame.window * 2.0 ** int(level))
        which = np.flatnonzero(size_class == level)
        part, good = rows[which], np.zeros(len(which), np.bool_)
        _polish(
            frame.points[sample], cells, starts, side, noise, *radius_range, config.min_inliers, config.min_share,
            part, good
        )  # fmt: skip
        rows[which], kept[which] = part, good
    return Candidates(
        rows[kept, :7].copy(),
        candidates.parents[kept],
        rows[kept, 8].copy(),
        rows[kept, 7].astype(np.int64),
        candidates.windows[kept],
    )


@njit(cache=True, nogil=True)
def _polish(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    noise: float,
    least: float,
    greatest: float,
    min_inliers: int,
    min_share: float,
    rows: FloatArray,
    kept: MaskArray,
) -> None:
    found, around = np.empty(MOST_POINTS_TO_POLISH, np.int64), np.empty((3, MOST_POINTS_TO_POLISH))
    quality, center = np.empty(3), np.empty(3)
    for c in range(len(rows)):
        model = rows[c, :7]
        first = model[RADIUS]
        for d in range(3):
            center[d] = model[d]
            model[d] = 0.0
        n = gather_ball(points, cells, starts, side, center, 2.0 * first, found)
        for a in range(n):
            for d in range(3):
                around[d, a] = points[found[a], d] - center[d]
        low, high = max(least, 0.5 * first), min(greatest, 2.0 * first)
        if polish(around, n, model, noise, low, high, min_inliers, min_share, 0.5 * first, quality) < 2:
            continue
        move_to_foot(model, center)
        rows[c, 7], rows[c, 8] = quality[0], quality[1]
        kept[c] = True
