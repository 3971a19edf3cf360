"""Frame -> candidates: circles about the directions that planes have, where curved surfaces are too short for windows.

The rim of a disc is a few points high, and what lies within a window about it is a plate above all. But most discs and
bores stand on a plate, and so the direction of their axis is known. Seen along it, all points of the wall lie on one
circle, whatever their height.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.circles import LEAST_ON, fill_circle
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import fill_basis
from cylx.records import Candidates, Frame, Nearby, StageReport

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


def find_rims(
    frame: Frame, directions: FloatArray, nearby: Nearby, radius_range: tuple[float, float], threads: int
) -> tuple[Candidates, StageReport]:
    """Propose a cylinder for each circle about the direction of a plane.

    Parameters
    ----------
    frame : Frame
    directions : ndarray of shape (k, 3)
        Of planes, from `cylx.stages.plane_directions`.
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
    lows = np.searchsorted(heights, heights[seeds] - HEIGHTS)
    highs = np.searchsorted(heights, heights[seeds] + HEIGHTS)
    rows = np.zeros((len(seeds), len(REACHES), 6))

    def look(part: slice) -> None:
        _find_circles(flat, heights, seeds[part], lows[part], highs[part], noise, *radius_range, rows[part])

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


@njit(cache=True, nogil=True)
def _find_circles(
    flat: FloatArray,
    heights: FloatArray,
    seeds: IndexArray,
    lows: IndexArray,
    highs: IndexArray,
    noise: float,
    least: float,
    greatest: float,
    rows: FloatArray,
) -> None:
    """Fill in the best circle through each seed, among the points from `lows` to `highs`; of radius zero if none."""
    x, y, z = np.empty(MOST_SEEN), np.empty(MOST_SEEN), np.empty(MOST_SEEN)
    totals = np.zeros(len(REACHES), np.int64)
    for s in range(len(seeds)):
        i, low, high = seeds[s], lows[s], highs[s]
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
