"""Points in cells with bounding balls: everything near a line, without looking at every point."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.geometry.morton import BITS, cell_starts

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class Cells:
    """A cloud in Morton order, cut into runs of neighbouring points.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order.
    codes : ndarray of shape (N,)
        Sorted Morton codes.
    occupancy : int
        Points a run should hold, roughly.
    """

    def __init__(self, points: FloatArray, codes: IndexArray, occupancy: int = 32) -> None:
        self.points = points
        level = 0
        while level < BITS and occupancy * (np.count_nonzero(np.diff(codes >> (3 * level))) + 1) > len(codes):
            level += 1
        _, self._starts = cell_starts(codes, level)
        count = len(self._starts) - 1
        self._centers, self._reaches = np.empty((count, 3)), np.empty(count)
        _fill_balls(points, self._starts, self._centers, self._reaches)

    def near_cylinder(self, model: FloatArray, low: float, high: float, inner: float, outer: float) -> IndexArray:
        """Give the points between two heights and two distances from an axis.

        Parameters
        ----------
        model : ndarray of shape (7,)
            A point of the axis, where heights are zero, its unit direction, and a radius that is not looked at.
        low, high : float
            Least and greatest height.
        inner, outer : float
            Least and greatest distance from the axis.

        Returns
        -------
        ndarray of int64
            Ascending indices.
        """
        most = _count_near(self._centers, self._reaches, self._starts, model, low, high, inner, outer)
        found = np.empty(most, np.int64)
        n = _gather_near(self.points, self._centers, self._reaches, self._starts, model, low, high, inner, outer, found)
        return found[:n]

    def surface_points(
        self,
        model: FloatArray,
        half: float,
        width: float,
        most: int | None,
        marks: FloatArray,
        limit: float,
    ) -> FloatArray:
        """Give the points near a cylinder's surface, about `most` of them, whose mark is below a limit.

        Parameters
        ----------
        model : ndarray of shape (7,)
            Middle of the axis, unit direction, radius.
        half, width : float
            Half the height, and the greatest distance from the surface.
        most : int or None
            Every so manyth point is taken.
        marks : ndarray of shape (N,)
        limit : float

        Returns
        -------
        ndarray of shape (n, 3)
        """
        near = self.near_cylinder(model, -half, half, max(0.0, float(model[6]) - width), float(model[6]) + width)
        stride = max(1, len(near) // most) if most else 1
        points = np.empty(((len(near) + stride - 1) // stride, 3))
        return points[: _copy_marked(self.points, near, stride, marks, limit, points)]


@njit(cache=True, nogil=True)
def _copy_marked(
    points: FloatArray, near: IndexArray, stride: int, marks: FloatArray, limit: float, out: FloatArray
) -> int:
    n = 0
    for a in range(0, len(near), stride):
        i = near[a]
        if marks[i] < limit:
            out[n, 0], out[n, 1], out[n, 2] = points[i, 0], points[i, 1], points[i, 2]
            n += 1
    return n


@njit(cache=True, nogil=True)
def _fill_balls(points: FloatArray, starts: IndexArray, centers: FloatArray, reaches: FloatArray) -> None:
    for c in range(len(reaches)):
        for d in range(3):
            low, high = math.inf, -math.inf
            for i in range(starts[c], starts[c + 1]):
                low, high = min(low, points[i, d]), max(high, points[i, d])
            centers[c, d] = 0.5 * (low + high)
        square = 0.0
        for i in range(starts[c], starts[c + 1]):
            dx, dy, dz = points[i, 0] - centers[c, 0], points[i, 1] - centers[c, 1], points[i, 2] - centers[c, 2]
            square = max(square, dx * dx + dy * dy + dz * dz)
        reaches[c] = math.sqrt(square)


@njit(cache=True, nogil=True)
def _apart(
    x: float, y: float, z: float, reach: float, model: FloatArray, low: float, high: float, inner: float, outer: float
) -> bool:
    """Tell whether a ball of radius `reach` lies outside the hollow cylinder altogether."""
    dx, dy, dz = x - model[0], y - model[1], z - model[2]
    height = dx * model[3] + dy * model[4] + dz * model[5]
    if height < low - reach or height > high + reach:
        return True
    square = max(0.0, dx * dx + dy * dy + dz * dz - height * height)
    if square > (outer + reach) ** 2:
        return True
    return inner > reach and square < (inner - reach) ** 2


@njit(cache=True, nogil=True)
def _count_near(
    centers: FloatArray,
    reaches: FloatArray,
    starts: IndexArray,
    model: FloatArray,
    low: float,
    high: float,
    inner: float,
    outer: float,
) -> int:
    most = 0
    for c in range(len(reaches)):
        if not _apart(centers[c, 0], centers[c, 1], centers[c, 2], reaches[c], model, low, high, inner, outer):
            most += starts[c + 1] - starts[c]
    return most


@njit(cache=True, nogil=True)
def _gather_near(
    points: FloatArray,
    centers: FloatArray,
    reaches: FloatArray,
    starts: IndexArray,
    model: FloatArray,
    low: float,
    high: float,
    inner: float,
    outer: float,
    found: IndexArray,
) -> int:
    n = 0
    for c in range(len(reaches)):
        if _apart(centers[c, 0], centers[c, 1], centers[c, 2], reaches[c], model, low, high, inner, outer):
            continue
        for i in range(starts[c], starts[c + 1]):
            if not _apart(points[i, 0], points[i, 1], points[i, 2], 0.0, model, low, high, inner, outer):
                found[n] = i
                n += 1
    return n
