"""Circles through a point among others of a plane: where the tangent is known, a second point tells one."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit

NEAREST = 10
"""Points that show the tangent."""
NOT_A_LINE = 0.3
"""Share of their spread across the tangent from which they show none."""
TRIALS, ENOUGH_TO_TRY = 30, 250
"""Second points that are tried, each on so many of the points."""
NEAR = 0.2
"""Share of the reach within which a second point tells nothing."""
DEVIATIONS, SHARE = 3.0, 0.01
"""Points are on a circle within so many deviations and this share of the radius; a quarter of it in the end."""
SECTORS = 24
LEAST_SECTORS, LEAST_ON, LEAST_CONTRAST = 6, 14, 2.5
"""Sectors of 24 and points that a circle has at least; and how many times denser points are on it than beside it."""


@njit(cache=True, nogil=True)
def fill_circle(
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    n: int,
    reach: float,
    noise: float,
    least: float,
    most: float,
    row: FloatArray,
) -> bool:
    """Fill in centre (2), radius, mean and half of the range of heights, and points of the best circle through zero.

    Parameters
    ----------
    x, y, z : ndarray
        Coordinates in the plane and heights over it; the first `n` count.
    n : int
    reach : float
        Distance from zero within which the points lie.
    noise : float
        Their standard deviation.
    least, most : float
        Limits of the radius.
    row : ndarray of shape (6,)

    Returns
    -------
    bool
        False, and nothing is to be read, if there is no circle.
    """
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
    if nx * nx * xx + 2.0 * nx * ny * xy + ny * ny * yy > NOT_A_LINE * (xx + yy):
        return False
    best, bx, by, br = 0, 0.0, 0.0, 0.0
    step, thin = max(1, n // TRIALS), 1 + n // ENOUGH_TO_TRY
    for a in range(0, n, step):
        square = x[a] * x[a] + y[a] * y[a]
        along = x[a] * nx + y[a] * ny
        if square < (NEAR * reach) ** 2 or along == 0.0:
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
    """Return the square of the distance of the k-th closest point to zero, of the last one if there are fewer."""
    nearest, m = np.empty(k), 0
    for a in range(n):
        square = x[a] * x[a] + y[a] * y[a]
        if m == k and square >= nearest[k - 1]:
            continue
        b = min(m, k - 1)
        while b > 0 and nearest[b - 1] > square:
            nearest[b] = nearest[b - 1]
            b -= 1
        nearest[b] = square
        m = min(m + 1, k)
    return float(nearest[m - 1])


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
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    n: int,
    cx: float,
    cy: float,
    radius: float,
    tolerance: float,
    row: FloatArray,
) -> bool:
    """Fill in a circle if enough points lie on it, over enough of its turn, and few beside it."""
    mask, sectors = 0, 0
    on, beside, low, high, total = 0, 0, math.inf, -math.inf, 0.0
    for a in range(n):
        dx, dy = x[a] - cx, y[a] - cy
        away = abs(math.sqrt(dx * dx + dy * dy) - radius)
        if away < tolerance:
            on += 1
            mask |= 1 << (int((math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * SECTORS) % SECTORS)
            low, high = min(low, z[a]), max(high, z[a])
            total += z[a]
        elif away < 3.0 * tolerance:
            beside += 1
    while mask:
        sectors += mask & 1
        mask >>= 1
    if on < LEAST_ON or sectors < LEAST_SECTORS or 2.0 * on < LEAST_CONTRAST * beside:
        return False
    row[0], row[1], row[2], row[3], row[4], row[5] = cx, cy, radius, total / on, 0.5 * (high - low), on
    return True
