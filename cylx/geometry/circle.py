"""The circle through points of a plane, with robust search."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import solve_in_place


@njit(cache=True, nogil=True)
def search_circle(
    xy: FloatArray,
    n: int,
    samples: IndexArray,
    tolerance: float,
    least: float,
    greatest: float,
    shape: FloatArray,
) -> float:
    """Fill `shape` (5,) with the circle through three of the points that has the most support.

    Parameters
    ----------
    xy : ndarray of shape (2, >= n)
    n : int
        Number of points.
    samples : ndarray of shape (k, >= 3)
        Indices of points.
    tolerance : float
        Distance within which a point supports a circle.
    least, greatest : float
        Radii.
    shape : ndarray of shape (5,)
        Centre, the radius twice, and 0, as in the shape of an ellipse.

    Returns
    -------
    float
        The support: the sum over the points near it of one minus the squared distance over the squared tolerance.
    """
    record = 0.0
    for k in range(len(samples)):
        ax, ay = xy[0, samples[k, 0]], xy[1, samples[k, 0]]
        bx, by = xy[0, samples[k, 1]] - ax, xy[1, samples[k, 1]] - ay
        cx, cy = xy[0, samples[k, 2]] - ax, xy[1, samples[k, 2]] - ay
        det = 2.0 * (bx * cy - by * cx)
        if det == 0.0:
            continue
        b, c = bx * bx + by * by, cx * cx + cy * cy
        x, y = (cy * b - by * c) / det, (bx * c - cx * b) / det
        radius = math.sqrt(x * x + y * y)
        if not (least <= radius <= greatest):
            continue
        score = _support(xy, n, ax + x, ay + y, radius, tolerance)
        if score > record:
            record = score
            shape[0], shape[1], shape[2], shape[3], shape[4] = ax + x, ay + y, radius, radius, 0.0
    return record


@njit(cache=True, nogil=True)
def _support(xy: FloatArray, n: int, x: float, y: float, radius: float, tolerance: float) -> float:
    score = 0.0
    for i in range(n):
        dx, dy = xy[0, i] - x, xy[1, i] - y
        ratio = (math.sqrt(dx * dx + dy * dy) - radius) / tolerance
        rest = 1.0 - ratio * ratio
        score += rest if rest > 0.0 else 0.0
    return score


def fit_circle(points: FloatArray, steps: int = 4) -> tuple[FloatArray, float] | None:
    """Fit a circle to points of the plane by least squares of the orthogonal distances, from Taubin's algebraic fit.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
    steps : int
        Gauss-Newton steps.

    Returns
    -------
    center : ndarray of shape (2,)
    radius : float

    None if the points lie on a line, or are fewer than three.
    """
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    center, radius = _taubin(points - middle)
    if not (math.isfinite(radius) and radius > 0.0):
        return None
    shape = np.array([*(middle + center), radius])
    return (shape[:2], float(shape[2])) if _improve(points, shape, steps) else None


@njit(cache=True, nogil=True)
def _improve(points: FloatArray, shape: FloatArray, steps: int) -> bool:
    """Move a circle, `shape` (3,) of centre and radius, to the least squares of the orthogonal distances."""
    matrix, right = np.empty((3, 3)), np.empty(3)
    for _ in range(steps):
        cc, cs, ss, c, s, rc, rs, r = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(len(points)):
            x, y = points[i, 0] - shape[0], points[i, 1] - shape[1]
            distance = math.sqrt(x * x + y * y) + 1e-300
            cosine, sine, residual = x / distance, y / distance, distance - shape[2]
            cc, cs, ss, c, s = cc + cosine * cosine, cs + cosine * sine, ss + sine * sine, c + cosine, s + sine
            rc, rs, r = rc + residual * cosine, rs + residual * sine, r + residual
        matrix[0, 0], matrix[0, 1], matrix[0, 2] = cc, cs, c
        matrix[1, 0], matrix[1, 1], matrix[1, 2] = cs, ss, s
        matrix[2, 0], matrix[2, 1], matrix[2, 2] = c, s, float(len(points))
        right[0], right[1], right[2] = rc, rs, r
        if not solve_in_place(matrix, right):
            return False
        for d in range(3):
            shape[d] += right[d]
        if not 0.0 < shape[2] < 1e12:
            return False
    return True


def _taubin(points: FloatArray) -> tuple[FloatArray, float]:
    """Return Taubin's circle of centred points by Newton's method on its characteristic polynomial (Chernov, 2010)."""
    x, y = points[:, 0], points[:, 1]
    z = x * x + y * y
    xx, yy, xy = float((x * x).mean()), float((y * y).mean()), float((x * y).mean())
    xz, yz, zz = float((x * z).mean()), float((y * z).mean()), float((z * z).mean())
    mean, area, spread = xx + yy, xx * yy - xy * xy, zz - (xx + yy) ** 2
    a3, a2 = 4.0 * mean, -3.0 * mean * mean - zz
    a1 = spread * mean + 4.0 * area * mean - xz * xz - yz * yz
    a0 = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) - spread * area
    root, value = 0.0, math.inf
    for _ in range(20):
        here = a0 + root * (a1 + root * (a2 + root * a3))
        slope = a1 + root * (2.0 * a2 + root * 3.0 * a3)
        if abs(here) >= abs(value) or slope == 0.0:
            break
        value, root = here, root - here / slope
    det = 2.0 * (root * root - root * mean + area)
    if det == 0.0:
        return np.zeros(2), math.inf
    center = np.array([xz * (yy - root) - yz * xy, yz * (xx - root) - xz * xy]) / det
    return center, math.sqrt(float(center @ center) + mean)
