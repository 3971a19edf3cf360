"""Circles of many layers -> axes of stems: straight lines that have a circle of about one size in most layers."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit

STEEPEST_LEAN = math.tan(math.radians(25.0))
ASIDE = 0.35
"""Centres are this near to an axis, in radii."""
SIMILAR = 1.3
"""Radii are one size up to this factor, a metre apart; taper and swell have their share in it."""
LEAST_LAYERS = 3
LEAST_SPAN = 0.8
"""Height between the lowest and the highest circle of an axis, metres."""
REACH = 2.0
"""Circles further apart than this along the vertical are no pair, metres."""
LEAST_SCORE = 1.5
"""Sum of the scores of the circles of an axis."""
LEAST_CIRCLE = 0.2
"""Score of a circle that counts."""
SIDE = 1.0
"""Side of the cells in which circles are looked up, metres."""


def find_axes(circles: FloatArray, layers: IndexArray) -> FloatArray:
    """Return the axes that circles of several layers have in common, the best first.

    Parameters
    ----------
    circles : ndarray of shape (k, 5)
        Centre, height above the ground, radius, score.
    layers : ndarray of shape (k,)
        Number of the layer of each.

    Returns
    -------
    ndarray of shape (m, 8)
        Place at height 0, slope along x and y, radius, score, lowest and highest circle.
    """
    circles, layers = _best_of_layers(circles, layers)
    if not len(circles):
        return np.empty((0, 8))
    out = np.zeros((len(circles), 8))
    keys = _cells_of(circles)
    _best_lines(circles, layers, keys, int(layers.max()) + 1, out)
    found = out[out[:, 5] >= LEAST_SCORE]
    return _distinct(found[np.lexsort((found[:, 1], found[:, 0], -found[:, 5]))])


def _cells_of(circles: FloatArray) -> IndexArray:
    """Return one number for the cell of each circle, (k,): neighbours along y have consecutive numbers."""
    i, j = np.floor(circles[:, 0] / SIDE).astype(np.int64), np.floor(circles[:, 1] / SIDE).astype(np.int64)
    return np.asarray((i << 32) + j)


def _best_of_layers(circles: FloatArray, layers: IndexArray) -> tuple[FloatArray, IndexArray]:
    """Return the circles in the order of cells, without those that are nearly a better one of their layer."""
    good = circles[:, 4] >= LEAST_CIRCLE
    circles, layers = circles[good], layers[good]
    order = np.lexsort((circles[:, 1], circles[:, 0], circles[:, 4], _cells_of(circles)))
    circles, layers = np.ascontiguousarray(circles[order]), layers[order]
    kept = np.ones(len(circles), np.bool_)
    _drop_doubles(circles, layers, _cells_of(circles), kept)
    return np.ascontiguousarray(circles[kept]), np.ascontiguousarray(layers[kept])


@njit(cache=True, nogil=True)
def _drop_doubles(circles: FloatArray, layers: IndexArray, keys: IndexArray, kept: MaskArray) -> None:
    for i in range(len(circles)):
        for row in range(-1, 2):
            middle = keys[i] + (row << 32)
            for j in range(np.searchsorted(keys, middle - 1), np.searchsorted(keys, middle + 2)):
                better = circles[j, 4] > circles[i, 4] or (circles[j, 4] == circles[i, 4] and j < i)
                if (
                    better
                    and layers[j] == layers[i]
                    and abs(circles[j, 3] - circles[i, 3]) < 0.2 * circles[i, 3]
                    and math.hypot(circles[j, 0] - circles[i, 0], circles[j, 1] - circles[i, 1]) < 0.2 * circles[i, 3]
                ):
                    kept[i] = False


@njit(cache=True, nogil=True)
def _best_lines(circles: FloatArray, layers: IndexArray, keys: IndexArray, count: int, out: FloatArray) -> None:
    """Fill in, for each circle, the best line through it and another one."""
    best = np.zeros(count)
    near = np.empty(len(circles), np.int64)
    for i in range(len(circles)):
        n = 0
        for row in range(-1, 2):
            middle = keys[i] + (row << 32)
            for j in range(np.searchsorted(keys, middle - 1), np.searchsorted(keys, middle + 2)):
                apart, factor = abs(circles[j, 2] - circles[i, 2]), circles[j, 3] / circles[i, 3]
                if (
                    layers[j] != layers[i]
                    and apart <= REACH
                    and 1.0 / SIMILAR <= factor <= SIMILAR
                    and math.hypot(circles[j, 0] - circles[i, 0], circles[j, 1] - circles[i, 1])
                    <= ASIDE * circles[i, 3] + STEEPEST_LEAN * apart
                ):
                    near[n] = j
                    n += 1
        for a in range(n):
            rise = circles[near[a], 2] - circles[i, 2]
            if abs(rise) < 0.5:
                continue
            sx = (circles[near[a], 0] - circles[i, 0]) / rise
            sy = (circles[near[a], 1] - circles[i, 1]) / rise
            if math.hypot(sx, sy) > STEEPEST_LEAN:
                continue
            for k in range(count):
                best[k] = 0.0
            best[layers[i]] = circles[i, 4]
            low = high = circles[i, 2]
            radius = circles[i, 3] * circles[i, 4]
            for b in range(n):
                j = near[b]
                x = circles[i, 0] + sx * (circles[j, 2] - circles[i, 2])
                y = circles[i, 1] + sy * (circles[j, 2] - circles[i, 2])
                if math.hypot(circles[j, 0] - x, circles[j, 1] - y) < ASIDE * circles[i, 3]:
                    if circles[j, 4] > best[layers[j]]:
                        radius += (circles[j, 4] - best[layers[j]]) * circles[j, 3]
                        best[layers[j]] = circles[j, 4]
                    low, high = min(low, circles[j, 2]), max(high, circles[j, 2])
            total, filled = 0.0, 0
            for k in range(count):
                total += best[k]
                filled += best[k] > 0.0
            if filled >= LEAST_LAYERS and high - low >= LEAST_SPAN and total > out[i, 5]:
                out[i, 0], out[i, 1] = circles[i, 0] - sx * circles[i, 2], circles[i, 1] - sy * circles[i, 2]
                out[i, 2], out[i, 3], out[i, 4], out[i, 5] = sx, sy, radius / total, total
                out[i, 6], out[i, 7] = low, high


def _distinct(axes: FloatArray) -> FloatArray:
    """Leave out axes that are nearly the same as a better one: as thick, and with their middles within each other."""
    middles = axes[:, :2] + axes[:, 2:4] * (0.5 * (axes[:, 6] + axes[:, 7]))[:, None]
    keys = _cells_of(middles)
    order = np.argsort(keys, kind="stable")
    kept = np.ones(len(axes), np.bool_)
    _drop_same(axes, keys, keys[order], order, kept)
    return axes[kept]


@njit(cache=True, nogil=True)
def _drop_same(axes: FloatArray, keys: IndexArray, by_cell: IndexArray, order: IndexArray, kept: MaskArray) -> None:
    for i in range(len(axes)):
        height = 0.5 * (axes[i, 6] + axes[i, 7])
        for row in range(-1, 2):
            middle = keys[i] + (row << 32)
            for k in range(np.searchsorted(by_cell, middle - 1), np.searchsorted(by_cell, middle + 2)):
                j = order[k]
                if j >= i or not kept[j]:
                    continue
                x = axes[i, 0] - axes[j, 0] + height * (axes[i, 2] - axes[j, 2])
                y = axes[i, 1] - axes[j, 1] + height * (axes[i, 3] - axes[j, 3])
                factor = axes[i, 4] / axes[j, 4]
                if math.hypot(x, y) < 0.5 * max(axes[i, 4], axes[j, 4]) and 1.0 / 1.5 < factor < 1.5:
                    kept[i] = False
