"""Frame -> candidates: circles about the directions that planes have, where curved surfaces are too short for windows.

The rim of a disc is a few points high, and what lies within a window about it is a plate above all. But most discs and
bores stand on a plate, and so the direction of their axis is known. Seen along it, all points of the wall lie on one
circle, whatever their height.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.morton import gather_ball
from cylx.geometry.numerics import fill_basis, symmetric_eigen
from cylx.records import Candidates, StageReport

MOST_DIRECTIONS = 6
"""Directions of planes that are tried."""
ALIKE = math.cos(math.radians(4.0))
"""Normals that enclose a smaller angle are those of one direction."""
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
NEAREST = 10
"""Points that show the tangent."""
MOST_SEEN = 1500
"""Points that suffice about a place."""
TRIALS, ENOUGH_TO_TRY = 30, 250
"""Second points that are tried, each on so many of the points."""
DEVIATIONS, SHARE = 3.0, 0.01
"""Points are on a circle within so many deviations and this share of the radius."""
LEAST_EXTENT = 4.0
"""Extent of a candidate along its axis in spacings, at least: its ends are to be found about a circle, too."""
WIDEST, CAPACITY = 6.0, 512
"""Spacings about a point in which it is asked for a plane, and points that are gathered."""
SECTORS = 24
LEAST_SECTORS, LEAST_ON, LEAST_CONTRAST = 6, 14, 2.5
"""Sectors of 24 and points that a circle has at least; and how many times denser points are on it than beside it."""


def find_rims(
    points: FloatArray,
    normals: NDArray[np.float32],
    directions: list[FloatArray],
    noise: float,
    radius_range: tuple[float, float],
    threads: int,
) -> tuple[Candidates, StageReport]:
    """Propose a cylinder for each circle about the direction of a plane.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Frame units.
    normals : ndarray of shape (n, 3), float32
        Unit normals, either way; zero where unknown.
    directions : list of ndarray of shape (3,)
        From `directions_of`.
    noise : float
        Standard deviation of the points.
    radius_range : tuple of float
    threads : int

    Returns
    -------
    candidates : Candidates
    report : StageReport
    """
    parts = []
    tried = 0
    for direction in directions:
        basis = np.empty((2, 3))
        fill_basis(direction, basis)
        which = np.flatnonzero(np.abs(normals @ direction.astype(np.float32)) < ACROSS)
        if len(which) < LEAST_ON:
            continue
        heights = points[which] @ direction
        order = np.argsort(heights, kind="stable")
        which, heights = which[order], heights[order]
        flat = np.ascontiguousarray(points[which] @ basis.T)
        seeds = np.arange(0, len(which), 1 + len(which) // MOST_SEEDS)
        rows = np.zeros((len(seeds), len(REACHES), 6))

        def look(part: slice, flat=flat, heights=heights, seeds=seeds, rows=rows) -> None:  # noqa: ANN001
            _find_circles(flat, heights, seeds[part], noise, *radius_range, rows[part])

        step = max(1, -(-len(seeds) // (8 * threads)))
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(look, [slice(first, first + step) for first in range(0, len(seeds), step)]))
        tried += len(seeds)
        for level, reach in enumerate(REACHES):
            own = rows[:, level]
            good = own[:, 2] > 0.0
            own = own[good]
            if not len(own):
                continue
            model = np.zeros((len(own), 9))
            model[:, :3] = own[:, :2] @ basis + own[:, 3:4] * direction
            model[:, 3:6], model[:, 6] = direction, own[:, 2]
            model[:, 7], model[:, 8] = own[:, 5], np.maximum(2.5 * own[:, 4], LEAST_EXTENT)
            parts.append(Candidates.of_windows(model, 0.5 * reach, points[which[seeds[good]]]))
    found = Candidates.joined(parts)
    return found, StageReport("rims", tried, len(found), {})


def normals_of_planes(
    points: FloatArray, cells: IndexArray, starts: IndexArray, side: float, flatness: FloatArray
) -> FloatArray:
    """Return the normals of planes at some of the points in flat windows, either way.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order.
    cells, starts, side
        As for `gather_ball`.
    flatness : ndarray of shape (N,)
        Radius of the largest flat window that holds a point, or 0.
    """
    which = np.flatnonzero(flatness > 0.0)
    which = which[:: 1 + len(which) // ENOUGH_NORMALS]
    normals = np.zeros((len(which), 3))
    _fill_normals(points, cells, starts, side, which, np.minimum(flatness[which], WIDEST), normals)
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
        found.append(direction)
        normals = normals[np.abs(normals @ direction) <= ALIKE]
    return found


@njit(cache=True, nogil=True)
def _find_circles(
    flat: FloatArray, heights: FloatArray, seeds: IndexArray, noise: float, least: float, greatest: float, rows: FloatArray
) -> None:
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
            stride, n, seen = 1 + totals[level] // MOST_SEEN, 0, 0
            for j in range(low, high):
                dx, dy = flat[j, 0] - flat[i, 0], flat[j, 1] - flat[i, 1]
                if dx * dx + dy * dy < reach * reach:
                    if seen % stride == 0 and n < MOST_SEEN:
                        x[n], y[n], z[n] = dx, dy, heights[j]
                        n += 1
                    seen += 1
            if n >= LEAST_ON and _fill_circle(
                x, y, z, n, reach, noise, max(RADII[0] * reach, least), min(RADII[1] * reach, greatest), rows[s, level]
            ):
                rows[s, level, 0] += flat[i, 0]
                rows[s, level, 1] += flat[i, 1]


@njit(cache=True, nogil=True)
def _fill_circle(
    x: FloatArray, y: FloatArray, z: FloatArray, n: int, reach: float, noise: float, least: float, most: float, row: FloatArray
) -> bool:
    """Fill in centre, radius, mean and half of the range of heights, and points of the best circle through zero."""
    # the tangent, from the points closest to zero
    limit = _closest(x, y, n, NEAREST)
    xx, xy, yy = 0.0, 0.0, 0.0
    for a in range(n):
        if x[a] * x[a] + y[a] * y[a] <= limit:
            xx += x[a] * x[a]
            xy += x[a] * y[a]
            yy += y[a] * y[a]
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    nx, ny = -math.sin(angle), math.cos(angle)
    if nx * nx * xx + 2.0 * nx * ny * xy + ny * ny * yy > 0.3 * (xx + yy):
        return False
    best, bx, by, br = 0, 0.0, 0.0, 0.0
    step, thin = max(1, n // TRIALS), 1 + n // ENOUGH_TO_TRY
    for a in range(0, n, step):
        square = x[a] * x[a] + y[a] * y[a]
        along = x[a] * nx + y[a] * ny
        if square < 0.04 * reach * reach or along == 0.0:
            continue
        signed = 0.5 * square / along
        radius = abs(signed)
        if radius < least or radius > most:
            continue
        cx, cy = signed * nx, signed * ny
        tolerance, count = DEVIATIONS * noise + 2.0 * SHARE * radius, 0
        for b in range(0, n, thin):
            count += 1 if abs(math.sqrt((x[b] - cx) ** 2 + (y[b] - cy) ** 2) - radius) < tolerance else 0
        if count > best:
            best, bx, by, br = count, cx, cy, radius
    if best * thin < LEAST_ON:
        return False
    for turn in range(4):
        bx, by, br = _refined(x, y, n, bx, by, br, DEVIATIONS * noise + SHARE * 0.5 ** min(turn, 2) * br)
        if not (least <= br <= most):
            return False
    return _fill_row(x, y, z, n, bx, by, br, DEVIATIONS * noise + 0.25 * SHARE * br, row)


@njit(cache=True, nogil=True)
def _closest(x: FloatArray, y: FloatArray, n: int, k: int) -> float:
    """Return the square of the distance of the k-th closest point to zero."""
    squares = np.empty(n)
    for a in range(n):
        squares[a] = x[a] * x[a] + y[a] * y[a]
    squares.sort()
    return float(squares[min(k, n) - 1])


@njit(cache=True, nogil=True)
def _refined(
    x: FloatArray, y: FloatArray, n: int, cx: float, cy: float, radius: float, tolerance: float
) -> tuple[float, float, float]:
    """Take one step of a least-squares fit of a circle to the points near it."""
    a00, a01, a02, a11, a12, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    b0, b1, b2 = 0.0, 0.0, 0.0
    for a in range(n):
        dx, dy = x[a] - cx, y[a] - cy
        distance = math.sqrt(dx * dx + dy * dy)
        residual = distance - radius
        if distance > 0.0 and abs(residual) < tolerance:
            ux, uy = dx / distance, dy / distance
            a00 += ux * ux
            a01 += ux * uy
            a02 += ux
            a11 += uy * uy
            a12 += uy
            a22 += 1.0
            b0 += ux * residual
            b1 += uy * residual
            b2 += residual
    det = a00 * (a11 * a22 - a12 * a12) - a01 * (a01 * a22 - a12 * a02) + a02 * (a01 * a12 - a11 * a02)
    if abs(det) < 1e-9 * max(a22, 1.0):
        return cx, cy, radius
    one = b0 * (a11 * a22 - a12 * a12) - a01 * (b1 * a22 - a12 * b2) + a02 * (b1 * a12 - a11 * b2)
    two = a00 * (b1 * a22 - b2 * a12) - b0 * (a01 * a22 - a12 * a02) + a02 * (a01 * b2 - b1 * a02)
    three = a00 * (a11 * b2 - a12 * b1) - a01 * (a01 * b2 - b1 * a02) + b0 * (a01 * a12 - a11 * a02)
    return cx + one / det, cy + two / det, radius + three / det


@njit(cache=True, nogil=True)
def _fill_row(
    x: FloatArray, y: FloatArray, z: FloatArray, n: int, cx: float, cy: float, radius: float, tolerance: float, row: FloatArray
) -> bool:
    """Fill in a circle if enough points lie on it, over enough of its turn, and few beside it."""
    filled = np.zeros(SECTORS, np.bool_)
    on, beside, low, high, total = 0, 0, math.inf, -math.inf, 0.0
    for a in range(n):
        dx, dy = x[a] - cx, y[a] - cy
        away = abs(math.sqrt(dx * dx + dy * dy) - radius)
        if away < tolerance:
            on += 1
            filled[int((math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * SECTORS) % SECTORS] = True
            low, high = min(low, z[a]), max(high, z[a])
            total += z[a]
        elif away < 3.0 * tolerance:
            beside += 1
    if on < LEAST_ON or filled.sum() < LEAST_SECTORS or 2.0 * on < LEAST_CONTRAST * beside:
        return False
    row[0], row[1], row[2], row[3], row[4], row[5] = cx, cy, radius, total / on, 0.5 * (high - low), on
    return True
