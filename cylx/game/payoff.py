"""The payoff of pairs of cylinders: how well two candidates agree (section 3.1, eq. 1, 2, 5 and 6)."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylx.game.dynamics import SparsePayoff
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, UX, UY, UZ
from cylx.geometry.dual_quaternions import pairwise_screw_distances
from cylx.geometry.kernels import njit

PIECE = 4096
"""Candidates per task of a thread."""

CUT = 0.1
"""Local payoffs below this are zero."""
REACH_IN_RADII = 4.0
"""Candidates play against those within this many radii, or their own extent if that is larger."""


def screw_payoff(models: FloatArray, parents: IndexArray, scale: float, min_ratio: float) -> FloatArray:
    """Return the paper's payoff (eq. 2, 5 and 6) of all pairs, shape (M, M), with a zero diagonal.

    Lengths are in units of the median radius of the candidates, relative to the middle of their points, because eq. 1
    mixes radians with lengths and depends on the origin. The paper's own experiments, with a cylinder of radius 1 at
    the origin, are reproduced exactly.

    Parameters
    ----------
    models : ndarray of shape (M, 7)
        Points of the axes, unit directions, radii.
    parents : ndarray of shape (M,)
        Candidates of one parent are incompatible (eq. 5).
    scale : float
        Lambda of eq. 2.
    min_ratio : float
        p of eq. 2.
    """
    if len(models) == 0:
        return np.zeros((0, 0))
    unit = float(np.median(models[:, RADIUS]))
    middle = np.median(models[:, POINT], axis=0)
    radii = models[:, RADIUS] / unit
    distance, gap = pairwise_screw_distances((models[:, POINT] - middle) / unit, models[:, DIRECTION])
    ratio = np.minimum.outer(radii, radii) / np.maximum.outer(radii, radii)
    compatible = (gap < np.add.outer(radii, radii)) & (ratio > min_ratio) & (parents[:, None] != parents[None, :])
    return np.where(compatible, np.exp(-distance / scale), 0.0)  # eq. 2 and 5


def local_payoff(
    models: FloatArray,
    parents: IndexArray,
    extents: FloatArray,
    angle: float,
    offset: float,
    radius: float,
    min_ratio: float,
    threads: int = 1,
) -> SparsePayoff:
    """Return the payoffs of all pairs within reach: angle, offset at the candidates in radii, ratio of radii.

    Parameters
    ----------
    models : ndarray of shape (M, 7)
        Locations of the candidates, unit directions, radii.
    parents : ndarray of shape (M,)
        Candidates of one parent are incompatible.
    extents : ndarray of shape (M,)
        A candidate reaches as far as its extent, and at least four radii.
    angle, offset, radius : float
        Scales at which the payoff has fallen to 1/e: radians, radii, relative difference.
    min_ratio : float
        Candidates whose radii differ by more are incompatible.
    threads : int
        Does not change the result.

    Returns
    -------
    SparsePayoff
        exp(-sqrt((angle / a)^2 + (offset / o)^2 + ((1 - ratio) / p)^2)) if it exceeds 0.1, otherwise no entry.
    """
    least_ratio = max(min_ratio, 1.0 + math.log(CUT) * radius)
    # sorted by bins of the radius (only neighbouring bins can be compatible), then of the reach, then along x
    reaches = np.maximum(REACH_IN_RADII * models[:, RADIUS], extents)
    radius_bins = np.floor(np.log(models[:, RADIUS]) / -math.log(least_ratio)).astype(np.int64)
    keys = (radius_bins << 12) + np.floor(np.log2(reaches)).astype(np.int64) + 2048
    order = np.lexsort((models[:, 0], keys)).astype(np.int64)
    bins, starts = np.unique(keys[order], return_index=True)
    starts = np.append(starts, len(order)).astype(np.int64)
    widest = np.maximum.reduceat(reaches[order], starts[:-1]) if len(order) else reaches
    table = np.ascontiguousarray(models[order]), order, parents[order], extents[order], bins >> 12, starts, widest
    # one bin after the other, or pieces of it: the pieces do not depend on the number of threads
    pieces = [
        (int(b), int(first), int(min(first + PIECE, starts[b + 1])))
        for b in range(len(bins))
        for first in range(int(starts[b]), int(starts[b + 1]), PIECE)
    ]

    def work(piece: tuple[int, int, int]) -> tuple[IndexArray, IndexArray, FloatArray]:
        return _pairs(*table, *piece, least_ratio, (angle, offset, radius))

    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(work, pieces))
    counts = np.zeros(len(models) + 1, np.int64)
    for rows, columns, _ in found:
        _count(rows, columns, counts[1:])
    pointers = np.cumsum(counts)
    indices, payoffs, ends = np.empty(pointers[-1], np.int64), np.empty(pointers[-1]), pointers[:-1].copy()
    for rows, columns, values in found:
        _enter(rows, columns, values, ends, indices, payoffs)
    return SparsePayoff(pointers, indices, payoffs)


@njit(cache=True, nogil=True)
def _first_from(models: FloatArray, low: int, high: int, x: float) -> int:
    """Return the index of the first of the models low..high, sorted by x, that is not below `x`."""
    while low < high:
        middle = (low + high) >> 1
        if models[middle, 0] < x:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
def _pairs(
    models: FloatArray,
    order: IndexArray,
    parents: IndexArray,
    extents: FloatArray,
    bins: IndexArray,
    starts: IndexArray,
    widest: FloatArray,
    own: int,
    first: int,
    last: int,
    least_ratio: float,
    widths: tuple[float, float, float],
) -> tuple[IndexArray, IndexArray, FloatArray]:
    """Return the pairs of the candidates first..last of one bin with the candidates after them, also in later bins."""
    n, room = 0, 1024
    rows, columns, values = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room)
    for b in range(own, len(bins)):
        if bins[b] > bins[own] + 1:
            break
        # the mean radius of a pair may exceed the smaller one by this factor
        span = max(widest[own], widest[b]) / least_ratio
        for i in range(first, last):
            begin = i + 1 if b == own else _first_from(models, starts[b], starts[b + 1], models[i, 0] - span)
            for j in range(begin, starts[b + 1]):
                if models[j, 0] > models[i, 0] + span:
                    break
                if abs(models[j, 1] - models[i, 1]) > span or abs(models[j, 2] - models[i, 2]) > span:
                    continue
                reach = max(REACH_IN_RADII * 0.5 * (models[i, RADIUS] + models[j, RADIUS]), max(extents[i], extents[j]))
                value = _play(models[i], models[j], reach, least_ratio, widths)
                if value == 0.0 or parents[i] == parents[j]:
                    continue
                if n == room:
                    rows, columns = _grown(rows), _grown(columns)
                    values = _grown(values)
                    room *= 2
                rows[n], columns[n], values[n] = order[i], order[j], value
                n += 1
    return rows[:n], columns[:n], values[:n]


@njit(cache=True, nogil=True)
def _grown(values: NDArray[Any]) -> NDArray[Any]:
    """Return an array twice as long that begins with the same values."""
    out = np.empty(2 * len(values), values.dtype)
    for i in range(len(values)):
        out[i] = values[i]
    return out


@njit(cache=True, nogil=True)
def _count(rows: IndexArray, columns: IndexArray, counts: IndexArray) -> None:
    for k in range(len(rows)):
        counts[rows[k]] += 1
        counts[columns[k]] += 1


@njit(cache=True, nogil=True)
def _enter(
    rows: IndexArray,
    columns: IndexArray,
    values: FloatArray,
    ends: IndexArray,
    indices: IndexArray,
    payoffs: FloatArray,
) -> None:
    """Enter each pair into the rows of both, which have been filled up to `ends`."""
    for k in range(len(rows)):
        i, j = rows[k], columns[k]
        indices[ends[i]], payoffs[ends[i]] = j, values[k]
        indices[ends[j]], payoffs[ends[j]] = i, values[k]
        ends[i] += 1
        ends[j] += 1


@njit(cache=True, nogil=True)
def _play(
    one: FloatArray, other: FloatArray, reach: float, least_ratio: float, widths: tuple[float, float, float]
) -> float:
    """Return the payoff of two candidates, 0 if they are out of reach or incompatible."""
    bound = -math.log(CUT)
    dx, dy, dz = other[0] - one[0], other[1] - one[1], other[2] - one[2]
    square = dx * dx + dy * dy + dz * dz
    ratio = min(one[RADIUS], other[RADIUS]) / max(one[RADIUS], other[RADIUS])
    if square > reach * reach or ratio < least_ratio:
        return 0.0
    cx = one[UY] * other[UZ] - one[UZ] * other[UY]
    cy = one[UZ] * other[UX] - one[UX] * other[UZ]
    cz = one[UX] * other[UY] - one[UY] * other[UX]
    turn = math.sqrt(cx * cx + cy * cy + cz * cz)
    if turn > math.sin(min(1.5, bound * widths[0])):
        return 0.0
    a = dx * one[UX] + dy * one[UY] + dz * one[UZ]
    b = dx * other[UX] + dy * other[UY] + dz * other[UZ]
    shift = math.sqrt(max(0.0, square - a * a)) + math.sqrt(max(0.0, square - b * b))
    shift /= one[RADIUS] + other[RADIUS]
    strangeness = (math.asin(min(1.0, turn)) / widths[0]) ** 2 + (shift / widths[1]) ** 2
    strangeness += ((1.0 - ratio) / widths[2]) ** 2
    return math.exp(-math.sqrt(strangeness)) if strangeness <= bound * bound else 0.0
