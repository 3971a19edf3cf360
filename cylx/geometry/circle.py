"""The circle through points of a plane, found robustly."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


@njit(cache=True, nogil=True)
def search_circle(
    points: FloatArray,
    samples: IndexArray,
    tolerance: float,
    least: float,
    greatest: float,
    shape: FloatArray,
) -> float:
    """Fill `shape` (5,) with the circle through three of the points that has the most support.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
    samples : ndarray of shape (k, >= 3)
        Indices of points.
    tolerance : float
        Distance within which a point supports a circle.
    least, greatest : float
        Radii.
    shape : ndarray of shape (5,)
        Centre, radius twice, and 0: as the shape of an ellipse.

    Returns
    -------
    float
        The support: a sum over the points near it of one minus the squared distance over the squared tolerance.
    """
    record = 0.0
    for k in range(len(samples)):
        ax, ay = points[samples[k, 0], 0], points[samples[k, 0], 1]
        bx, by = points[samples[k, 1], 0] - ax, points[samples[k, 1], 1] - ay
        cx, cy = points[samples[k, 2], 0] - ax, points[samples[k, 2], 1] - ay
        det = 2.0 * (bx * cy - by * cx)
        if det == 0.0:
            continue
        b, c = bx * bx + by * by, cx * cx + cy * cy
        x, y = (cy * b - by * c) / det, (bx * c - cx * b) / det
        radius = math.sqrt(x * x + y * y)
        if not (least <= radius <= greatest):
            continue
        score = 0.0
        for i in range(len(points)):
            distance = math.sqrt((points[i, 0] - ax - x) ** 2 + (points[i, 1] - ay - y) ** 2) - radius
            if abs(distance) < tolerance:
                score += 1.0 - (distance / tolerance) ** 2
        if score > record:
            record = score
            shape[0], shape[1], shape[2], shape[3], shape[4] = ax + x, ay + y, radius, radius, 0.0
    return record
