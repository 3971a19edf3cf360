"""Points in Morton order: a linear octree without a tree.

Along the Morton (Z-order) curve the points of a cube of side 2^k are one contiguous run, for every k. So one sort gives
the voxels and cells of all octaves, and an order of the points that does not depend on the input order.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit

BITS = 21
"""Bits per axis: 3 x 21 fit a signed 64-bit integer."""
GOLDEN = np.int64(-7046029254386353131)
"""2^64 over the golden ratio, as a signed integer: the multiplier of Fibonacci hashing."""


@njit(cache=True, nogil=True)
def interleave(value: int) -> int:
    """Spread the lowest 21 bits of `value` so that two zero bits follow each."""
    value &= 0x1FFFFF
    value = (value | (value << 32)) & 0x1F00000000FFFF
    value = (value | (value << 16)) & 0x1F0000FF0000FF
    value = (value | (value << 8)) & 0x100F00F00F00F00F
    value = (value | (value << 4)) & 0x10C30C30C30C30C3
    return (value | (value << 2)) & 0x1249249249249249


@njit(cache=True, nogil=True)
def _fill_codes(points: FloatArray, unit: float, most: float, codes: IndexArray) -> None:
    for i in range(len(points)):
        x = int(min(max(points[i, 0], 0.0), most) / unit)
        y = int(min(max(points[i, 1], 0.0), most) / unit)
        z = int(min(max(points[i, 2], 0.0), most) / unit)
        codes[i] = (interleave(x) << 2) | (interleave(y) << 1) | interleave(z)


def morton_codes(points: FloatArray, unit: float, most: float | None = None) -> IndexArray:
    """Return the Morton code of each point's cell.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Coordinates in [0, 2^21 unit).
    unit : float
        Side of the smallest cell.
    most : float, optional
        Coordinates are clipped to zero and this.

    Returns
    -------
    ndarray of shape (N,), int64
        Code of the cell; `code >> 3 k` is that of the enclosing cell of side `unit * 2^k`.

    Raises
    ------
    ValueError
        If a point lies outside the cube that the codes cover.
    """
    if most is None and len(points) and not (points.min() >= 0 and points.max() < unit * 2**BITS):
        raise ValueError("coordinates must lie in [0, 2^21 unit)")
    codes = np.empty(len(points), np.int64)
    _fill_codes(points, unit, math.inf if most is None else most, codes)
    return codes


@njit(cache=True, nogil=True)
def find_cell(cells: IndexArray, code: int) -> int:
    """Return the position of `code` among the sorted `cells`; -1 if that cell is empty."""
    low, high = 0, len(cells)
    while low < high:
        middle = (low + high) >> 1
        if cells[middle] < code:
            low = middle + 1
        else:
            high = middle
    return low if low < len(cells) and cells[low] == code else -1


@njit(cache=True, nogil=True)
def gather_ball(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    center: FloatArray,
    radius: float,
    found: IndexArray,
) -> int:
    """Collect the points within `radius` of `center`, in the order of the cells.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order.
    cells, starts : ndarray
        Occupied cells of one level and their runs, from `cell_starts`.
    side : float
        Side of these cells.
    center : ndarray of shape (3,)
    radius : float
    found : ndarray of shape (capacity,)
        Filled with indices of points.

    Returns
    -------
    int
        Number of points found; the search ends when `found` is full.
    """
    n = 0
    square = radius * radius
    top = 0x1FFFFF
    x0, x1 = max(0, int((center[0] - radius) / side)), min(top, int(max(0.0, center[0] + radius) / side))
    y0, y1 = max(0, int((center[1] - radius) / side)), min(top, int(max(0.0, center[1] + radius) / side))
    z0, z1 = max(0, int((center[2] - radius) / side)), min(top, int(max(0.0, center[2] + radius) / side))
    for ix in range(x0, x1 + 1):
        gx = max(0.0, max(ix * side - center[0], center[0] - (ix + 1) * side))
        code_x = interleave(ix) << 2
        for iy in range(y0, y1 + 1):
            gy = max(0.0, max(iy * side - center[1], center[1] - (iy + 1) * side))
            code_xy = code_x | (interleave(iy) << 1)
            for iz in range(z0, z1 + 1):
                gz = max(0.0, max(iz * side - center[2], center[2] - (iz + 1) * side))
                if gx * gx + gy * gy + gz * gz > square:
                    continue
                cell = find_cell(cells, code_xy | interleave(iz))
                if cell < 0:
                    continue
                for i in range(starts[cell], starts[cell + 1]):
                    dx, dy, dz = points[i, 0] - center[0], points[i, 1] - center[1], points[i, 2] - center[2]
                    if dx * dx + dy * dy + dz * dz < square:
                        if n == len(found):
                            return n
                        found[n] = i
                        n += 1
    return n


def cell_starts(codes: IndexArray, level: int) -> tuple[IndexArray, IndexArray]:
    """Return the occupied cells of one level, and where the run of points of each begins.

    Parameters
    ----------
    codes : ndarray of shape (N,), sorted
        Morton codes.
    level : int
        Cells have the side `unit * 2^level`.

    Returns
    -------
    cells : ndarray of shape (C,)
        Sorted codes of the occupied cells, `code >> 3 level`.
    starts : ndarray of shape (C + 1,)
        Points `starts[c]:starts[c + 1]` lie in cell c.
    """
    keys = codes >> (3 * level)
    first = np.flatnonzero(np.concatenate(([True], keys[1:] != keys[:-1]))) if len(keys) else np.zeros(0, np.int64)
    return keys[first], np.concatenate((first, [len(codes)])).astype(np.int64)


def group(codes: IndexArray, level: int, keep: MaskArray) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Return the kept points, the occupied cells of one level, and where the run of kept points of each begins.

    Parameters
    ----------
    codes : ndarray of shape (N,), sorted
    level : int
        Cells have the side `unit * 2^level`.
    keep : ndarray of shape (N,), bool

    Returns
    -------
    members : ndarray of shape (n,)
        Indices of the kept points, ascending.
    cells : ndarray of shape (C,)
    starts : ndarray of shape (C + 1,)
        Members `starts[c]:starts[c + 1]` lie in cell c.
    """
    members = np.empty(np.count_nonzero(keep), np.int64)
    cells, starts = np.empty(len(members), np.int64), np.empty(len(members) + 1, np.int64)
    count = _group(codes, 3 * level, keep, members, cells, starts)
    return members, cells[:count].copy(), starts[: count + 1].copy()


@njit(cache=True, nogil=True)
def _group(
    codes: IndexArray,
    shift: int,
    keep: MaskArray,
    members: IndexArray,
    cells: IndexArray,
    starts: IndexArray,
) -> int:
    n, count = 0, 0
    for i in range(len(codes)):
        if keep[i]:
            cell = codes[i] >> shift
            if count == 0 or cells[count - 1] != cell:
                cells[count], starts[count] = cell, n
                count += 1
            members[n] = i
            n += 1
    starts[count] = n
    return count


def thin(codes: IndexArray, level: int, keep: MaskArray | None = None) -> IndexArray:
    """Pick one point of each occupied cell, pseudo-randomly by the cell's code.

    Parameters
    ----------
    codes : ndarray of shape (N,), sorted
    level : int
        Cells have the side `unit * 2^level`.
    keep : ndarray of shape (N,), bool, optional
        Points to choose from; all by default.

    Returns
    -------
    ndarray of int64
        Indices of the chosen points, ascending.
    """
    chosen = np.arange(len(codes)) if keep is None else np.flatnonzero(keep)
    return chosen[pick_one(*cell_starts(codes[chosen], level))]


def pick_one(cells: IndexArray, starts: IndexArray) -> IndexArray:
    """Return one index of each cell's run, pseudo-randomly by the cell's code, shape (C,)."""
    # a multiplicative hash: the choice depends only on the place, not on the order of the points or on a generator
    hashed = ((cells * GOLDEN) & 0x7FFFFFFFFFFFFFFF) >> 32
    return np.asarray(starts[:-1] + hashed % np.diff(starts), dtype=np.int64)
