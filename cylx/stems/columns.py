"""The points of a plot in cells, so that those about an axis are found without a look at the others."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit

SIDE = 0.25
"""Side of a cell, metres."""
THIN = 0.01
"""Points are thinned to cells of this side before anything is fitted to them, metres: the noise of a good scanner."""


class Columns:
    """Points in cells.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Metres.
    """

    def __init__(self, points: FloatArray) -> None:
        self.points = points
        self._corner = np.floor(points.min(axis=0) / SIDE).astype(np.int64)
        self._shape = np.floor(points.max(axis=0) / SIDE).astype(np.int64) - self._corner + 1
        flat = np.empty(len(points), np.int64)
        _number_cells(points, self._corner, self._shape, flat)
        counts = np.bincount(flat, minlength=int(np.prod(self._shape)))
        self._starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self._order = np.empty(len(points), np.int64)
        _sort_by_count(flat, self._starts[:-1].copy(), self._order)

    def within(self, low: FloatArray, high: FloatArray) -> IndexArray:
        """Return the points of all cells that a box along the axes, between two corners (3,), touches."""
        first, last = self._cells(low, high)
        if (last < first).any():
            return np.empty(0, np.int64)
        parts = []
        for i in range(int(first[0]), int(last[0]) + 1):
            for j in range(int(first[1]), int(last[1]) + 1):
                row = (i * self._shape[1] + j) * self._shape[2]
                parts.append(self._order[self._starts[row + first[2]] : self._starts[row + last[2] + 1]])
        return np.concatenate(parts)

    def slab(self, center: FloatArray, direction: FloatArray, reach: float, half: float) -> FloatArray:
        """Return the points (n, 3) within a distance of an axis, and less than a height from a place on it."""
        out = self.points[self.within(center - reach - half, center + reach + half)]
        along = (out - center) @ direction
        square = ((out - center) ** 2).sum(axis=1) - along**2
        return np.asarray(out[(np.abs(along) < half) & (square < reach**2)])

    def _cells(self, low: FloatArray, high: FloatArray) -> tuple[IndexArray, IndexArray]:
        first = np.maximum(np.floor(low / SIDE).astype(np.int64) - self._corner, 0)
        return first, np.minimum(np.floor(high / SIDE).astype(np.int64) - self._corner, self._shape - 1)


@njit(cache=True, nogil=True)
def _number_cells(points: FloatArray, corner: IndexArray, shape: IndexArray, flat: IndexArray) -> None:
    for i in range(len(points)):
        number = 0
        for d in range(3):
            number = number * shape[d] + math.floor(points[i, d] / SIDE) - corner[d]
        flat[i] = number


@njit(cache=True, nogil=True)
def _sort_by_count(cells: IndexArray, next_place: IndexArray, order: IndexArray) -> None:
    for i in range(len(cells)):
        order[next_place[cells[i]]] = i
        next_place[cells[i]] += 1


def thinned(points: FloatArray) -> FloatArray:
    """Return one point (n, 3) for each cell of `THIN` that has any: the middle of its points."""
    if not len(points):
        return points
    cells = np.floor(points / THIN).astype(np.int64)
    cells -= cells.min(axis=0)
    span = cells.max(axis=0) + 1
    keys = (cells[:, 0] * span[1] + cells[:, 1]) * span[2] + cells[:, 2]
    order = np.lexsort((points[:, 0], keys))  # sums in an order that does not depend on that of the file
    points, keys = points[order], keys[order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(keys) > 0]))
    counts = np.diff(np.append(starts, len(keys)))
    return np.asarray(np.add.reduceat(points, starts, axis=0) / counts[:, None])
