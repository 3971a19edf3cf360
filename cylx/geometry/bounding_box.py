"""The size of a cloud, in one pass over its points; NumPy takes several times as long along rows of three."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit


def box_of(points: FloatArray) -> FloatArray:
    """Return the least and the greatest coordinates, shape (2, 3)."""
    box = np.empty((2, 3))
    fixed = points.view()
    fixed.flags.writeable = False  # those of a cloud are: one kind of array, and one kernel
    _fill_box(fixed, box)
    return box


def extent_of(points: FloatArray) -> float:
    """Return the diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(box_of(points), axis=0)))


@njit(cache=True, nogil=True)
def _fill_box(points: FloatArray, box: FloatArray) -> None:
    for d in range(3):
        box[0, d], box[1, d] = math.inf, -math.inf
    for i in range(len(points)):
        for d in range(3):
            box[0, d], box[1, d] = min(box[0, d], points[i, d]), max(box[1, d], points[i, d])


@njit(cache=True, nogil=True)
def widest_deviation(points: FloatArray, low: FloatArray) -> float:
    """Return the mean absolute deviation from the mean, for the coordinate with the largest one."""
    widest = 0.0
    for d in range(3):
        mean, total = 0.0, 0.0
        for i in range(len(points)):
            mean += (points[i, d] - low[d]) / len(points)
        for i in range(len(points)):
            total += abs(points[i, d] - low[d] - mean)
        widest = max(widest, total / len(points))
    return widest


@njit(cache=True, nogil=True)
def fill_scatter(points: FloatArray, low: FloatArray, scale: float, scatter: FloatArray) -> None:
    """Fill in the covariance (3, 3) of the points times a scale, about their mean."""
    mean, count = np.zeros(3), len(points)
    for i in range(count):
        for d in range(3):
            mean[d] += (points[i, d] - low[d]) * scale / count
    for i in range(count):
        x = (points[i, 0] - low[0]) * scale - mean[0]
        y = (points[i, 1] - low[1]) * scale - mean[1]
        z = (points[i, 2] - low[2]) * scale - mean[2]
        scatter[0, 0] += x * x / count
        scatter[1, 0] += x * y / count
        scatter[1, 1] += y * y / count
        scatter[2, 0] += x * z / count
        scatter[2, 1] += y * z / count
        scatter[2, 2] += z * z / count
    scatter[0, 1], scatter[0, 2], scatter[1, 2] = scatter[1, 0], scatter[2, 0], scatter[2, 1]
