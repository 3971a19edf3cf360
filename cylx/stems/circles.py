"""Circles in a layer of a plot: the best one about each place, for each range of sizes.

A layer is seen from above. For each range of sizes, a factor of two wide, it is thinned to cells of a twentieth of the
largest diameter, so that a stem near a scanner and one far from it have alike many points. A window about each place is
searched by circles through three of its points. The samples depend on the place alone, and a circle counts only in the
window that its centre lies in: so a part of a plot gives the circles that the whole gives there.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import solve_in_place

CELLS_A_DIAMETER = 20
TRIPLES = 240
"""Circles tried in a window."""
TOLERANCE = 1.3
"""Distance from a circle up to which a point supports it, in cells."""
SECTORS = 24
LEAST_SECTORS = 4
"""A circle is seen in so many sectors at least: 60 degrees."""
LEAST_POINTS = 8
MOST_INSIDE = 0.6
"""Points well inside a circle, as a share of those on it, of which there may not be more."""
MOST_IN_WINDOW = 2000


def find_circles(xy: FloatArray, largest: float) -> FloatArray:
    """Return circles in a layer whose diameters are between half of the largest and the largest.

    Parameters
    ----------
    xy : ndarray of shape (n, 2)
        Points of the layer, metres, from an origin that is a multiple of all cells.
    largest : float
        Greatest diameter, metres.

    Returns
    -------
    ndarray of shape (k, 4)
        Centre, radius, and score: the share of the sectors in which it is seen, less the share of points inside.
    """
    cell = largest / CELLS_A_DIAMETER
    thin = _thinned(xy, cell)
    if len(thin) < LEAST_POINTS:
        return np.empty((0, 4))
    side = 0.5 * largest
    bins = np.floor(thin / side).astype(np.int64)
    keys = _key(bins[:, 0], bins[:, 1])
    order = np.argsort(keys, kind="stable")
    thin, keys = np.ascontiguousarray(thin[order]), keys[order]
    steps = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    unique = np.unique(bins, axis=0)
    windows = np.unique((unique[:, None] + steps).reshape(-1, 2), axis=0)
    rows = np.stack([_key(windows[:, 0] + i, windows[:, 1]) for i in (-1, 0, 1)], axis=1)
    starts = np.searchsorted(keys, rows - 1, side="left")
    ends = np.searchsorted(keys, rows + 1, side="right")
    enough = (ends - starts).sum(axis=1) >= LEAST_POINTS
    out = np.zeros((int(enough.sum()), 4))
    _search(thin, windows[enough], starts[enough], ends[enough], side, cell, out)
    return out[out[:, 3] > 0.0]


def _key(i: IndexArray, j: IndexArray) -> IndexArray:
    return np.asarray((i << 32) + j + (1 << 31))


def _thinned(xy: FloatArray, cell: float) -> FloatArray:
    """Return the middle of the points of each cell, in the order of the cells."""
    if not len(xy):
        return xy
    cells = np.floor(xy / cell).astype(np.int64)
    _, inverse, counts = np.unique(_key(cells[:, 0], cells[:, 1]), return_inverse=True, return_counts=True)
    return np.column_stack([np.bincount(inverse, xy[:, d]) / counts for d in (0, 1)])


@njit(cache=True, nogil=True)
def _search(
    xy: FloatArray,
    windows: IndexArray,
    starts: IndexArray,
    ends: IndexArray,
    side: float,
    cell: float,
    out: FloatArray,
) -> None:
    """Fill in the best circle of each window; its score stays 0 where there is none."""
    px, py = np.empty(MOST_IN_WINDOW), np.empty(MOST_IN_WINDOW)
    circle = np.empty(3)
    seen = np.zeros(SECTORS)
    for w in range(len(windows)):
        n = 0
        for row in range(3):
            for i in range(starts[w, row], ends[w, row]):
                if n < MOST_IN_WINDOW:
                    px[n], py[n] = xy[i, 0], xy[i, 1]
                    n += 1
        low_x, low_y = windows[w, 0] * side, windows[w, 1] * side
        state = np.uint64(windows[w, 0] * 73856093 ^ windows[w, 1] * 19349663) * np.uint64(2) + np.uint64(1)
        record = 0.0
        tolerance = TOLERANCE * cell
        for _ in range(TRIPLES):
            state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
            a = np.int64((state >> np.uint64(33)) % np.uint64(n))
            state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
            b = np.int64((state >> np.uint64(33)) % np.uint64(n))
            state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
            c = np.int64((state >> np.uint64(33)) % np.uint64(n))
            bx, by, cx, cy = px[b] - px[a], py[b] - py[a], px[c] - px[a], py[c] - py[a]
            det = 2.0 * (bx * cy - by * cx)
            if abs(det) < 1e-12:
                continue
            bb, cc = bx * bx + by * by, cx * cx + cy * cy
            x, y = (cy * bb - by * cc) / det, (bx * cc - cx * bb) / det
            r = math.sqrt(x * x + y * y)
            x, y = x + px[a], y + py[a]
            if not (0.45 * side <= r <= 1.05 * side):
                continue
            if not (low_x <= x < low_x + side and low_y <= y < low_y + side):
                continue
            score = 0.0
            for i in range(n):
                e = (math.sqrt((px[i] - x) ** 2 + (py[i] - y) ** 2) - r) / tolerance
                if e < -1.0:
                    score -= 0.5
                elif e < 1.0:
                    score += 1.0 - e * e
            if score > record:
                record = score
                circle[0], circle[1], circle[2] = x, y, r
        if record <= 0.0:
            continue
        _refine(px, py, n, circle, tolerance)
        out[w, 3] = _judge(px, py, n, circle, tolerance, seen)
        out[w, 0], out[w, 1], out[w, 2] = circle[0], circle[1], circle[2]


@njit(cache=True, nogil=True)
def _refine(px: FloatArray, py: FloatArray, n: int, circle: FloatArray, tolerance: float) -> None:
    """Move a circle to the least squares of the points near it, with weights that fall off to twice the tolerance."""
    matrix, right = np.empty((3, 3)), np.empty(3)
    x, y, r = circle[0], circle[1], circle[2]
    for _ in range(4):
        for a in range(3):
            right[a] = 0.0
            for b in range(3):
                matrix[a, b] = 0.0
        for i in range(n):
            dx, dy = px[i] - x, py[i] - y
            d = math.sqrt(dx * dx + dy * dy) + 1e-300
            e = (d - r) / (2.0 * tolerance)
            if abs(e) >= 1.0:
                continue
            weight = (1.0 - e * e) ** 2
            u, v = dx / d, dy / d
            matrix[0, 0] += weight * u * u
            matrix[0, 1] += weight * u * v
            matrix[1, 1] += weight * v * v
            matrix[0, 2] += weight * u
            matrix[1, 2] += weight * v
            matrix[2, 2] += weight
            right[0] += weight * (d - r) * u
            right[1] += weight * (d - r) * v
            right[2] += weight * (d - r)
        matrix[1, 0], matrix[2, 0], matrix[2, 1] = matrix[0, 1], matrix[0, 2], matrix[1, 2]
        if not solve_in_place(matrix, right):
            return
        x, y, r = x + right[0], y + right[1], r + right[2]
    if abs(r - circle[2]) < 0.3 * circle[2] and (x - circle[0]) ** 2 + (y - circle[1]) ** 2 < (0.3 * circle[2]) ** 2:
        circle[0], circle[1], circle[2] = x, y, r


@njit(cache=True, nogil=True)
def _judge(px: FloatArray, py: FloatArray, n: int, circle: FloatArray, tolerance: float, seen: FloatArray) -> float:
    """Return the score of a circle, 0 if it is none."""
    for s in range(SECTORS):
        seen[s] = 0.0
    on, inside = 0, 0
    x, y, r = circle[0], circle[1], circle[2]
    for i in range(n):
        dx, dy = px[i] - x, py[i] - y
        e = math.sqrt(dx * dx + dy * dy) - r
        if e < -1.5 * tolerance:
            inside += 1
        elif e < 1.5 * tolerance:
            on += 1
            seen[int((math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * SECTORS) % SECTORS] = 1.0
    sectors = 0.0
    for s in range(SECTORS):
        sectors += seen[s]
    if sectors < LEAST_SECTORS or inside > MOST_INSIDE * on:
        return 0.0
    return max(0.0, sectors / SECTORS - inside / max(1.0, on + inside))
