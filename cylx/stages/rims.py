"""Frame -> candidates: circles about the directions that planes have, where curved surfaces are too short for windows.

The rim of a disc is a few points high, and what lies within a window about it is a plate above all. But most discs and
bores stand on a plate, and so the direction of their axis is known. Seen along it, all points of the wall lie on one
circle, whatever their height.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.circles import LEAST_ON, fill_circle
from cylx.geometry.kernels import njit
from cylx.geometry.morton import cell_starts, gather_ball
from cylx.geometry.numerics import fill_basis, symmetric_eigen
from cylx.records import Candidates, Explained, Frame, Nearby, StageReport

MOST_DIRECTIONS = 6
"""Directions of planes that are tried."""
ALIKE = math.cos(math.radians(4.0))
"""Normals that enclose a smaller angle are those of one direction."""
BESIDE, LEAST_BESIDE = math.cos(math.radians(15.0)), 0.5
"""A direction this near to another needs this share of its normals: edges show some that lean."""
LEAST_SHARE = 0.02
"""Share of the points on planes that make a direction."""
ENOUGH_NORMALS = 3000
"""Normals among which the directions are found."""
ACROSS = 0.5
"""Cosine to the direction from which a point lies on a cap, not on a wall."""
MOST_SEEDS = 3000
"""Places from which circles are looked for, for each direction."""
HEIGHTS = 8.0
"""Points within so many spacings along the direction are seen as one."""
REACHES = (4.0, 10.0, 25.0, 60.0)
"""Circles are looked for among what lies within so many spacings."""
RADII = 0.3, 1.1
"""Radii of them, as shares of the reach."""
MOST_SEEN = 1500
"""Points that suffice about a place."""
LEAST_EXTENT = 4.0
"""Extent of a candidate along its axis in spacings, at least: its ends are to be found about a circle, too."""
CELL_SIDE = 2.6
"""Side of the cells, spacings, as near as they have it."""
WIDEST, CAPACITY = 6.0, 512
"""Spacings about a point in which it is asked for a plane, and points that are gathered."""


def directions_of_planes(frame: Frame, explained: Explained, nearby: Nearby | None) -> FloatArray:
    """Return the unit normals of the directions that planes have in a cloud, either way, shape (k, 3).

    Parameters
    ----------
    frame : Frame
    explained : Explained
        Its flat windows are pieces of planes.
    nearby : Nearby or None
        From `find_curved_patches`.
    """
    normals = _normals_of_planes(frame, explained.flatness)
    if nearby is not None:
        normals = np.concatenate([normals, nearby.normals[nearby.looked_at[nearby.within]].astype(np.float64)])
    return np.array(directions_of(normals)).reshape(-1, 3)


def find_rims(
    frame: Frame, directions: FloatArray, nearby: Nearby, radius_range: tuple[float, float], threads: int
) -> tuple[Candidates, StageReport]:
    """Propose a cylinder for each circle about the direction of a plane.

    Parameters
    ----------
    frame : Frame
    directions : ndarray of shape (k, 3)
        Of planes, from `directions_of_planes`.
    nearby : Nearby
        From `find_curved_patches`.
    radius_range : tuple of float
    threads : int

    Returns
    -------
    candidates : Candidates
    report : StageReport
    """
    which = nearby.looked_at[~nearby.within]  # what lies within a plane is no wall
    parts, tried = [], 0
    for direction in directions:
        upright = which[np.abs(nearby.normals[which] @ direction.astype(np.float32)) < ACROSS]
        if len(upright) < LEAST_ON:
            continue
        found, looks = _about(frame.points[upright], direction, frame.noise.least, radius_range, threads)
        parts.append(found)
        tried += looks
    candidates = Candidates.joined(parts)
    without = tried - len(candidates)
    return candidates, StageReport("rims", tried, len(candidates), {"no circle": without} if without else {})


def _about(
    points: FloatArray, direction: FloatArray, noise: float, radius_range: tuple[float, float], threads: int
) -> tuple[Candidates, int]:
    """Propose cylinders about one direction; also say how many times one was looked for."""
    basis = np.empty((2, 3))
    fill_basis(direction, basis)
    heights = points @ direction
    order = np.argsort(heights, kind="stable")
    points, heights = points[order], heights[order]
    flat = np.ascontiguousarray(points @ basis.T)
    seeds = np.arange(0, len(points), 1 + len(points) // MOST_SEEDS)
    rows = np.zeros((len(seeds), len(REACHES), 6))

    def look(part: slice) -> None:
        _find_circles(flat, heights, seeds[part], noise, *radius_range, rows[part])

    step = max(1, -(-len(seeds) // (8 * threads)))
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(look, [slice(first, first + step) for first in range(0, len(seeds), step)]))
    parts = []
    for level, reach in enumerate(REACHES):
        good = rows[:, level, 2] > 0.0
        own = rows[good, level]
        models = np.zeros((len(own), 9))
        models[:, :3] = own[:, :2] @ basis + own[:, 3:4] * direction
        models[:, 3:6], models[:, 6] = direction, own[:, 2]
        models[:, 7], models[:, 8] = own[:, 5], np.maximum(2.5 * own[:, 4], LEAST_EXTENT)
        parts.append(Candidates.of_windows(models, 0.5 * reach, points[seeds[good]]))
    return Candidates.joined(parts), len(seeds) * len(REACHES)


def _normals_of_planes(frame: Frame, flatness: FloatArray) -> FloatArray:
    """Return the normals of planes at some of the points in flat windows, either way."""
    level = max(0, round(math.log2(CELL_SIDE / frame.unit)))
    cells, starts = cell_starts(frame.codes, level)
    which = np.flatnonzero(flatness > 0.0)
    which = np.ascontiguousarray(which[:: 1 + len(which) // ENOUGH_NORMALS])  # one layout: one compiled kernel
    normals = np.zeros((len(which), 3))
    radii = np.minimum(flatness[which], WIDEST)
    _fill_normals(frame.points, cells, starts, frame.unit * 2.0**level, which, radii, normals)
    return normals[np.any(normals != 0.0, axis=1)]


@njit(cache=True, nogil=True)
def _fill_normals(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    which: IndexArray,
    radii: FloatArray,
    normals: FloatArray,
) -> None:
    found, matrix, vectors, middle = np.empty(CAPACITY, np.int64), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for s in range(len(which)):
        n = gather_ball(points, cells, starts, side, points[which[s]], radii[s], found)
        if n < 6:
            continue
        for d in range(3):
            middle[d] = 0.0
            for a in range(n):
                middle[d] += points[found[a], d] / n
        for d in range(3):
            for e in range(3):
                matrix[d, e] = 0.0
                for a in range(n):
                    matrix[d, e] += (points[found[a], d] - middle[d]) * (points[found[a], e] - middle[e])
        symmetric_eigen(matrix, vectors)
        least = 0
        for a in range(1, 3):
            if matrix[a, a] < matrix[least, least]:
                least = a
        for d in range(3):
            normals[s, d] = vectors[d, least]


def directions_of(normals: FloatArray) -> list[FloatArray]:
    """Return the directions that many normals have, either way."""
    normals = normals[:: 1 + len(normals) // ENOUGH_NORMALS]
    count = len(normals)
    found: list[FloatArray] = []
    sizes: list[int] = []
    while len(normals) >= max(LEAST_SHARE * count, 10.0) and len(found) < MOST_DIRECTIONS:
        tried = normals[:: 1 + len(normals) // 200]
        alike = np.abs(tried @ normals.T) > ALIKE
        best = int(alike.sum(axis=1).argmax())
        if alike[best].sum() < max(LEAST_SHARE * count, 10.0):
            break
        own = normals[alike[best]]
        for _ in range(3):
            _, vectors = np.linalg.eigh(own.T @ own)
            direction = vectors[:, 2]
            own = normals[np.abs(normals @ direction) > ALIKE]
        beside = [size for one, size in zip(found, sizes, strict=True) if abs(one @ direction) > BESIDE]
        if len(own) >= LEAST_BESIDE * max(beside, default=0):
            found.append(direction)
            sizes.append(len(own))
        normals = normals[np.abs(normals @ direction) <= ALIKE]
    return found


@njit(cache=True, nogil=True)
def _find_circles(
    flat: FloatArray,
    heights: FloatArray,
    seeds: IndexArray,
    noise: float,
    least: float,
    greatest: float,
    rows: FloatArray,
) -> None:
    """Fill in the best circle through each seed for each reach; of radius zero where there is none."""
    x, y, z = np.empty(MOST_SEEN), np.empty(MOST_SEEN), np.empty(MOST_SEEN)
    totals = np.zeros(len(REACHES), np.int64)
    for s in range(len(seeds)):
        i = seeds[s]
        low = np.searchsorted(heights, heights[i] - HEIGHTS)
        high = np.searchsorted(heights, heights[i] + HEIGHTS)
        for level in range(len(REACHES)):
            totals[level] = 0
        for j in range(low, high):
            dx, dy = flat[j, 0] - flat[i, 0], flat[j, 1] - flat[i, 1]
            square = dx * dx + dy * dy
            for level in range(len(REACHES)):
                totals[level] += 1 if square < REACHES[level] * REACHES[level] else 0
        for level in range(len(REACHES)):
            reach = REACHES[level]
            if totals[level] < LEAST_ON or (level > 0 and totals[level] == totals[level - 1]):
                continue
            stride, n, seen = 1 + totals[level] // MOST_SEEN, np.int64(0), 0  # a bare 0 is a kind of its own
            for j in range(low, high):
                dx, dy = flat[j, 0] - flat[i, 0], flat[j, 1] - flat[i, 1]
                if dx * dx + dy * dy < reach * reach:
                    if seen % stride == 0 and n < MOST_SEEN:
                        x[n], y[n], z[n] = dx, dy, heights[j]
                        n += 1
                    seen += 1
            if n >= LEAST_ON and fill_circle(
                x, y, z, n, reach, noise, max(RADII[0] * reach, least), min(RADII[1] * reach, greatest), rows[s, level]
            ):
                rows[s, level, 0] += flat[i, 0]
                rows[s, level, 1] += flat[i, 1]
                break  # what is found from further away is the same, or something else
