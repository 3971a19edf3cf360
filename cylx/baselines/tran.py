"""Tran, Cao and Laurendeau: cylinders grown from seeds by their normals, and mean shift over all of them.

After T.-T. Tran, V.-T. Cao and D. Laurendeau, "Extraction of cylinders and estimation of their parameters from point
clouds", Computers & Graphics 46 (2015), from the paper's description of it: points on curved surface are selected; from
the neighbourhood of each, the axis comes from the normals, radius and position from a circle fitted to the points
projected along it; this is repeated, with more inliers each time; valid cylinders are clustered by mean shift. The
paper sets alpha = 50, beta = 0.95, ten iterations, and 50 neighbours for the normals (in its tests of outliers 100, and
200 to start from).

Our readings: alpha is the fewest points of a valid cylinder (`min_support`; `min_coverage_deg` reads it as an angle),
and beta the share of the points near its surface whose normals agree with it. A seed is on curved surface if the
normals about it spread along one direction rather than two. The neighbourhood grows by half its radius per iteration.
Mean shift measures angle, offset and radius of two cylinders at the location of the first one, each with its own
bandwidth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cylx.baselines.limits import Limits
from cylx.baselines.normals import normals_for
from cylx.baselines.proposal import Proposal
from cylx.config import TranConfig
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cells import Cells
from cylx.geometry.circle import fit_circle
from cylx.geometry.coverage import covered_angle
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, axis_basis, canonical_direction, cylinder_coordinates
from cylx.records import Frame

DRAWN = 4
"""Points drawn per seed wanted; those on flat surface are not used."""
GROWTH = 1.5
"""Factor of the neighbourhood's radius per iteration."""
ENOUGH_OF_A_NEIGHBOURHOOD = 2000
"""Maximum number of points of a neighbourhood used for a fit."""
SHIFTS = 50
STILL = 1e-4
"""In bandwidths; the iteration ends with a shift shorter than this."""


class Grown(NamedTuple):
    """A valid cylinder grown from a seed.

    Parameters
    ----------
    model : ndarray of shape (7,)
    ends : ndarray of shape (2, 3)
        Its lowest and highest inlier.
    """

    model: FloatArray
    ends: FloatArray


def find_by_growing(
    frame: Frame,
    limits: Limits,
    config: TranConfig,
    *,
    rng: np.random.Generator,
    threads: int,
) -> Iterator[Proposal]:
    """Find cylinders as modes of many grown from seeds, the mode of most of them first.

    Parameters
    ----------
    frame : Frame
    limits : Limits
    config : TranConfig
        Resolved.
    rng : numpy.random.Generator
    threads : int
        Does not change the result.

    Yields
    ------
    Proposal

    Raises
    ------
    ConfigError
        If open3d cannot be imported.
    """
    garden = _Garden(frame, normals_for("tran", frame.points, config.neighbours), limits.radii, config)
    drawn = rng.permutation(len(frame.points))[: DRAWN * config.seeds]
    starts = garden.curved_starts(drawn)[: config.seeds]
    with ThreadPoolExecutor(threads) as pool:
        grown = [one for one in pool.map(garden.grow, starts) if one is not None]
    grown = [one for one in grown if limits.admit(one.model[DIRECTION])]
    modes = shift_to_modes(
        np.array([one.model for one in grown]).reshape(-1, 7), math.radians(config.bandwidth_deg), config.bandwidth
    )
    for model, members in modes:
        if len(members) >= max(1.0, config.min_share * len(grown)):
            ends = np.concatenate([grown[k].ends for k in members])
            yield Proposal.spanning(model[POINT], model[DIRECTION], float(model[RADIUS]), ends, len(members))


class _Garden:
    """The oriented points that cylinders are grown on.

    Parameters
    ----------
    frame : Frame
    normals : ndarray of shape (N, 3)
    radii : tuple of float
        Least and greatest radius, frame units.
    config : TranConfig
        Resolved.
    """

    def __init__(self, frame: Frame, normals: FloatArray, radii: tuple[float, float], config: TranConfig) -> None:
        self._points = frame.points
        self._normals = normals
        self._radii = radii
        self._config = config
        self._distance = (config.distance or 0.0) / frame.spacing
        self._cells = Cells(frame.points, frame.codes)
        self._tree = cKDTree(frame.points)

    def curved_starts(self, drawn: IndexArray) -> list[IndexArray]:
        """Return the neighbourhoods of those points about which the normals spread along one direction."""
        wanted = min(self._config.start_neighbours, len(self._points))
        starts = []
        for near in self._tree.query(self._points[drawn], k=wanted)[1].reshape(len(drawn), -1):
            normals = self._normals[near]
            normals = normals * np.where(normals @ normals[0] < 0.0, -1.0, 1.0)[:, None]
            spreads = np.linalg.eigvalsh(np.cov(normals.T))
            if spreads[2] >= self._config.min_curvature * spreads[1]:
                starts.append(near)
        return starts

    def grow(self, start: IndexArray) -> Grown | None:
        """Fit a cylinder and collect its inliers in turns; return None if it is not valid."""
        place = self._points[start[0]]
        reach = float(np.linalg.norm(self._points[start] - place, axis=1).max())
        inliers, agreement = start, 0.0
        model = np.empty(7)
        for _ in range(self._config.iterations):
            if len(inliers) < 6:
                return None
            fitted = self._fit(inliers[:: max(1, len(inliers) // ENOUGH_OF_A_NEIGHBOURHOOD)], place)
            if fitted is None:
                return None
            model = fitted
            reach *= GROWTH
            inliers, agreement = self._gather(model, place, reach)
        if len(inliers) < self._config.min_support or agreement < self._config.min_agreement:
            return None
        heights, _, angles = cylinder_coordinates(self._points[inliers], model[POINT], model[DIRECTION])
        if covered_angle(angles) < math.radians(self._config.min_coverage_deg):
            return None
        return Grown(model, self._points[inliers[[int(heights.argmin()), int(heights.argmax())]]])

    def _fit(self, inliers: IndexArray, place: FloatArray) -> FloatArray | None:
        """Return the cylinder with its axis across all normals, and with a circle that fits the projected points."""
        normals = self._normals[inliers]
        direction = canonical_direction(np.linalg.eigh(normals.T @ normals)[1][:, 0])
        across = np.column_stack(axis_basis(direction))
        circle = fit_circle((self._points[inliers] - place) @ across)
        if circle is None or not self._radii[0] <= circle[1] <= self._radii[1]:
            return None
        return np.concatenate([place + across @ circle[0], direction, [circle[1]]])

    def _gather(self, model: FloatArray, place: FloatArray, reach: float) -> tuple[IndexArray, float]:
        """Return the points near the surface and the seed whose normals agree, and their share of all near points."""
        radius = float(model[RADIUS])
        inner, outer = max(0.0, radius - self._distance), radius + self._distance
        near = self._cells.near_cylinder(model, -reach, reach, inner, outer)
        away = self._points[near] - place
        near = near[np.einsum("ij,ij->i", away, away) < reach * reach]
        across = np.column_stack(axis_basis(model[DIRECTION]))
        offsets = (self._points[near] - model[POINT]) @ across
        cosines = np.abs(np.einsum("ij,ij->i", offsets, self._normals[near] @ across)) / np.hypot(*offsets.T)
        agree = cosines > math.cos(math.radians(self._config.normal_angle_deg))
        return near[agree], float(agree.mean()) if len(agree) else 0.0


def shift_to_modes(models: FloatArray, angle: float, length: float) -> list[tuple[FloatArray, IndexArray]]:
    """Cluster cylinders by mean shift under a Gaussian kernel.

    Parameters
    ----------
    models : ndarray of shape (n, 7)
        Point of the axis, unit direction, radius; the point is the location of the cylinder.
    angle, length : float
        Bandwidths: of axis angles, radians; of offsets and radii, in radii.

    Returns
    -------
    list of (ndarray of shape (7,), ndarray of int64)
        Each mode, and the cylinders that lead to it; the mode of most cylinders first.
    """
    modes: list[FloatArray] = []
    members: list[list[int]] = []
    for k in range(len(models)):
        mode = _shifted(models[k], models, angle, length)
        known = [i for i, other in enumerate(modes) if _squared_distances(mode, other[None], angle, length)[0] < 1.0]
        if known:
            members[known[0]].append(k)
        else:
            modes.append(mode)
            members.append([k])
    order = sorted(range(len(modes)), key=lambda i: -len(members[i]))
    return [(modes[i], np.array(members[i])) for i in order]


def _shifted(model: FloatArray, models: FloatArray, angle: float, length: float) -> FloatArray:
    """Move a cylinder to the weighted mean of those around it until it stays."""
    for _ in range(SHIFTS):
        weights = np.exp(-0.5 * _squared_distances(model, models, angle, length))
        weights /= weights.sum()
        signs = np.where(models[:, DIRECTION] @ model[DIRECTION] < 0.0, -1.0, 1.0)
        direction = canonical_direction((weights * signs) @ models[:, DIRECTION])
        point = weights @ _feet(model[POINT], models)
        moved = np.concatenate([point, direction, [weights @ models[:, RADIUS]]])
        still = _squared_distances(model, moved[None], angle, length)[0] < STILL**2
        model = moved
        if still:
            break
    return model


def _squared_distances(model: FloatArray, models: FloatArray, angle: float, length: float) -> FloatArray:
    """Return squared distances of cylinders (n, 7) from one, in bandwidths, shape (n,)."""
    cosines = np.clip(np.abs(models[:, DIRECTION] @ model[DIRECTION]), 0.0, 1.0)
    offsets = np.linalg.norm(_feet(model[POINT], models) - model[POINT], axis=1)
    scale = length * model[RADIUS]
    return np.asarray(
        (np.arccos(cosines) / angle) ** 2 + (offsets / scale) ** 2 + ((models[:, RADIUS] - model[RADIUS]) / scale) ** 2
    )


def _feet(point: FloatArray, models: FloatArray) -> FloatArray:
    """Return the nearest points to a point on the axes of cylinders (n, 7), shape (n, 3)."""
    along = ((point - models[:, POINT]) * models[:, DIRECTION]).sum(axis=1)
    return np.asarray(models[:, POINT] + along[:, None] * models[:, DIRECTION])
