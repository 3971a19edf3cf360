"""Slices -> ellipse fits: every ellipse in a slice, by RANSAC and the direct least-squares fit (section 3.2)."""

from __future__ import annotations

import numpy as np

from cylx.config import EllipsesConfig
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.ellipse import Degenerate, search_ellipse
from cylx.geometry.kernels import njit
from cylx.records import EllipseFit, Slice


def fit_ellipses(
    section: Slice,
    config: EllipsesConfig,
    *,
    min_points: int,
    link: float,
    tolerance: float,
    radius_range: tuple[float, float],
    rng: np.random.Generator,
    refits: int = 3,
) -> list[EllipseFit]:
    """Find all ellipses of one slice: search each piece, remove the points that an ellipse explains, and repeat.

    Parameters
    ----------
    section : Slice
    config : EllipsesConfig
    min_points : int
        Pieces with fewer points are skipped.
    link : float
        Points nearer than this are connected.
    tolerance : float
        Distance within which a point supports an ellipse, frame units.
    radius_range : tuple of float
        Least and greatest semi-minor axis, which is the cylinder's radius.
    rng : numpy.random.Generator
        Generator for this slice only.
    refits : int
        Maximum number of direct fits of an ellipse to its support.

    Returns
    -------
    list of EllipseFit
    """
    found: list[EllipseFit] = []
    pieces = split_pieces(section.points, link) if config.pieces else [np.arange(len(section.points))]
    for piece in pieces:
        points = section.points[piece]
        while len(points) >= min_points and len(found) < config.max_per_slice:
            samples = rng.integers(len(points), size=(config.iterations, 5))
            fit = search_ellipse(points, samples, tolerance, radius_range, config.max_aspect, refits)
            if isinstance(fit, Degenerate):
                break
            ellipse, inliers = fit
            count = int(inliers.sum())
            if count < max(config.min_inliers, config.min_share * len(points)):
                break
            found.append(EllipseFit(ellipse, section.plane, count))
            points = points[~inliers]
    return found


def split_pieces(points: FloatArray, link: float) -> list[IndexArray]:
    """Split points of the plane into connected pieces: points in the same or adjoining squares of side `link`.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
    link : float

    Returns
    -------
    list of ndarray of int64
        Indices of the points of each piece; pieces are ordered by position, not by the order of the points.
    """
    if len(points) == 0:
        return []
    squares = np.floor((points - points.min(axis=0)) / link).astype(np.int64)
    width = int(squares[:, 1].max()) + 3
    keys, owner = np.unique(squares[:, 0] * width + squares[:, 1] + 1, return_inverse=True)
    rows, columns = [], []
    for step in (1, width - 1, width, width + 1):
        place = np.searchsorted(keys, keys + step)
        hit = np.flatnonzero(keys[np.minimum(place, len(keys) - 1)] == keys + step)
        rows.append(hit)
        columns.append(place[hit])
    roots = np.arange(len(keys))
    _join(np.concatenate(rows), np.concatenate(columns), roots)
    piece = np.unique(roots, return_inverse=True)[1][owner]
    order = np.argsort(piece, kind="stable")
    return [np.asarray(part) for part in np.split(order, np.cumsum(np.bincount(piece))[:-1])]


@njit(cache=True, nogil=True)
def _join(rows: IndexArray, columns: IndexArray, roots: IndexArray) -> None:
    """Set the root of all connected nodes to the smallest of them: union and find."""
    for e in range(len(rows)):
        a, b = rows[e], columns[e]
        while roots[a] != a:
            a = roots[a]
        while roots[b] != b:
            b = roots[b]
        roots[max(a, b)] = min(a, b)
    for i in range(len(roots)):
        roots[i] = roots[roots[i]]
