"""The nearest neighbours of some points of a cloud in Morton order."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit
from cylx.geometry.morton import gather_ball


@njit(cache=True, nogil=True)
def _balls(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    size: int,
    near: IndexArray,
    radius: FloatArray,
) -> None:
    room = np.empty(len(points) if len(points) < 20000 else 20000, np.int64)
    squares, ordered = np.empty(len(points)), np.empty(size + 1)
    for s in range(len(sample)):
        center = points[sample[s]]
        reach, found = side, room
        n = gather_ball(points, cells, starts, side, center, reach, found)
        while n <= size:
            reach *= 1.5
            if reach > 12.0 * side:  # far from most others: there are more cells about it than points
                n, found = len(points), np.empty(len(points), np.int64)
                for i in range(n):
                    found[i] = i
            else:
                n = gather_ball(points, cells, starts, side, center, reach, found)
        for a in range(n):
            i = found[a]
            squares[a] = (
                (points[i, 0] - center[0]) ** 2 + (points[i, 1] - center[1]) ** 2 + (points[i, 2] - center[2]) ** 2
            )
        kept = 0
        for a in range(n):  # the smallest in order: far too many are gathered where strays make the cells too large
            if kept > size and squares[a] >= ordered[size]:
                continue
            j = min(kept, size)
            while j > 0 and ordered[j - 1] > squares[a]:
                ordered[j] = ordered[j - 1]
                j -= 1
            ordered[j] = squares[a]
            kept = min(kept + 1, size + 1)
        k = 0
        for strictly in (True, False):  # of points equally far, those that come first
            for a in range(n):
                if k <= size and (squares[a] < ordered[size] if strictly else squares[a] == ordered[size]):
                    near[s, k] = found[a]
                    k += 1
        radius[s] = math.sqrt(ordered[size])


def nearest_points(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    size: int,
    threads: int,
) -> tuple[IndexArray, FloatArray]:
    """Return the `size` nearest neighbours of each sample point, itself among them, and the distance of the last."""
    sample = np.ascontiguousarray(sample)  # or the kernel would be compiled for each layout
    near, radius = np.empty((len(sample), size + 1), np.int64), np.empty(len(sample))

    def work(part: slice) -> None:
        _balls(points, cells, starts, side, sample[part], size, near[part], radius[part])

    step = -(-len(sample) // threads)
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, [slice(first, first + step) for first in range(0, len(sample), step)]))
    return near, radius
