"""The points of a plot by upright columns, so that those about an axis are found without a look at the others."""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit

SIDE = 0.5
"""Side of a column, metres."""
THIN = 0.01
"""Points are thinned to cells of this side before anything is fitted to them, metres: the noise of a good scanner."""


class Columns:
    """Points in columns.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Metres.
    """

    def __init__(self, points: FloatArray) -> None:
        self.points = points
        self._corner = np.floor(points[:, :2].min(axis=0) / SIDE).astype(np.int64)
        cells = np.floor(points[:, :2] / SIDE).astype(np.int64) - self._corner
        self._shape = tuple(int(n) for n in cells.max(axis=0) + 1)
        flat = cells[:, 0] * self._shape[1] + cells[:, 1]
        counts = np.bincount(flat, minlength=self._shape[0] * self._shape[1])
        self._starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self._order = np.empty(len(points), np.int64)
        _sort_by_count(flat, self._starts[:-1].copy(), self._order)

    def about(self, start: FloatArray, end: FloatArray, reach: float) -> IndexArray:
        """Return the points of all columns within a distance of the line between two places (2,) or (3,)."""
        low = np.floor((np.minimum(start[:2], end[:2]) - reach) / SIDE).astype(np.int64) - self._corner
        high = np.floor((np.maximum(start[:2], end[:2]) + reach) / SIDE).astype(np.int64) - self._corner
        low, high = np.maximum(low, 0), np.minimum(high, np.array(self._shape) - 1)
        parts = [np.empty(0, np.int64)]
        for i in range(int(low[0]), int(high[0]) + 1):
            first, last = i * self._shape[1] + int(low[1]), i * self._shape[1] + int(high[1])
            if last >= first:
                parts.append(self._order[self._starts[first] : self._starts[last + 1]])
        return np.concatenate(parts)


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
