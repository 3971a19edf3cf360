"""Points in cells with bounding balls: find the points near a line without testing every point."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import RADIUS, UX, UY, UZ
from cylx.geometry.kernels import njit
from cylx.geometry.morton import BITS, cell_starts

RUNS_IN_BLOCK = 32
"""Runs in a block; most blocks can be skipped as a whole."""


class Cells:
    """A cloud in Morton order, cut into runs of neighbouring points.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order.
    codes : ndarray of shape (N,)
        Sorted Morton codes.
    occupancy : int
        Approximate number of points in a run.
    """

    def __init__(self, points: FloatArray, codes: IndexArray, occupancy: int = 32) -> None:
        self.points = points
        level = 0
        while level < BITS and occupancy * (np.count_nonzero(np.diff(codes >> (3 * level))) + 1) > len(codes):
            level += 1
        _, self._starts = cell_starts(codes, level)
        self._balls = _balls_of(points, self._starts)
        self._blocks = _balls_of(points, np.append(self._starts[:-1:RUNS_IN_BLOCK], self._starts[-1]))

    def near_cylinder(self, model: FloatArray, low: float, high: float, inner: float, outer: float) -> IndexArray:
        """Return the points between two heights and two distances from an axis.

        Parameters
        ----------
        model : ndarray of shape (7,)
            A point of the axis, where heights are zero, its unit direction, and a radius that is ignored.
        low, high : float
            Least and greatest height.
        inner, outer : float
            Least and greatest distance from the axis.

        Returns
        -------
        ndarray of int64
            Ascending indices.
        """
        runs = np.empty(len(self._balls), np.int64)
        count, most = _find_runs(self._blocks, self._balls, self._starts, model, low, high, inner, outer, runs)
        found = np.empty(most, np.int64)
        n = _gather_near(self.points, self._starts, runs[:count], model, low, high, inner, outer, found)
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
        """Return the points near a cylinder's surface, about `most` of them, whose mark is below a limit.

        Parameters
        ----------
        model : ndarray of shape (7,)
            Middle of the axis, unit direction, radius.
        half, width : float
            Half the height, and the greatest distance from the surface.
        most : int or None
            Approximate number of points to return, evenly picked; None for all.
        marks : ndarray of shape (N,)
        limit : float

        Returns
        -------
        ndarray of shape (n, 3)
        """
        near = self.near_cylinder(
            model, -half, half, max(0.0, float(model[RADIUS]) - width), float(model[RADIUS]) + width
        )
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


def _balls_of(points: FloatArray, starts: IndexArray) -> FloatArray:
    """Return centre and radius of a ball about each run of points, shape (C, 4)."""
    balls = np.empty((len(starts) - 1, 4))
    _fill_balls(points, starts, balls)
    return balls


@njit(cache=True, nogil=True)
def _fill_balls(points: FloatArray, starts: IndexArray, balls: FloatArray) -> None:
    for c in range(len(balls)):
        for d in range(3):
            low, high = math.inf, -math.inf
            for i in range(starts[c], starts[c + 1]):
                low, high = min(low, points[i, d]), max(high, points[i, d])
            balls[c, d] = 0.5 * (low + high)
        square = 0.0
        for i in range(starts[c], starts[c + 1]):
            dx, dy, dz = points[i, 0] - balls[c, 0], points[i, 1] - balls[c, 1], points[i, 2] - balls[c, 2]
            square = max(square, dx * dx + dy * dy + dz * dz)
        balls[c, 3] = math.sqrt(square)


@njit(cache=True, nogil=True)
def _apart(
    x: float, y: float, z: float, reach: float, model: FloatArray, low: float, high: float, inner: float, outer: float
) -> bool:
    """Return whether a ball of radius `reach` lies completely outside the hollow cylinder."""
    dx, dy, dz = x - model[0], y - model[1], z - model[2]
    height = dx * model[UX] + dy * model[UY] + dz * model[UZ]
    if height < low - reach or height > high + reach:
        return True
    square = max(0.0, dx * dx + dy * dy + dz * dz - height * height)
    if square > (outer + reach) ** 2:
        return True
    return inner > reach and square < (inner - reach) ** 2


@njit(cache=True, nogil=True)
def _find_runs(
    blocks: FloatArray,
    balls: FloatArray,
    starts: IndexArray,
    model: FloatArray,
    low: float,
    high: float,
    inner: float,
    outer: float,
    runs: IndexArray,
) -> tuple[int, int]:
    """Fill in the runs that may have points in the hollow cylinder; return their number, and the number of points."""
    count, most = 0, 0
    for b in range(len(blocks)):
        if _apart(blocks[b, 0], blocks[b, 1], blocks[b, 2], blocks[b, 3], model, low, high, inner, outer):
            continue
        for c in range(b * RUNS_IN_BLOCK, min((b + 1) * RUNS_IN_BLOCK, len(balls))):
            if not _apart(balls[c, 0], balls[c, 1], balls[c, 2], balls[c, 3], model, low, high, inner, outer):
                runs[count] = c
                count += 1
                most += starts[c + 1] - starts[c]
    return count, most


@njit(cache=True, nogil=True)
def _gather_near(
    points: FloatArray,
    starts: IndexArray,
    runs: IndexArray,
    model: FloatArray,
    low: float,
    high: float,
    inner: float,
    outer: float,
    found: IndexArray,
) -> int:
    n = 0
    for c in runs:
        for i in range(starts[c], starts[c + 1]):
            if not _apart(points[i, 0], points[i, 1], points[i, 2], 0.0, model, low, high, inner, outer):
                found[n] = i
                n += 1
    return n
