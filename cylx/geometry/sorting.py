"""Order statistics as scalar loops, quick to compile."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@njit(cache=True, nogil=True)
def sort_in_place(values: FloatArray, n: int) -> None:
    """Sort values[:n], ascending: Shell's method with Knuth's gaps, quick to compile."""
    gap = 1
    while gap < n // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, n):
            value, j = values[i], i
            while j >= gap and values[j - gap] > value:
                values[j] = values[j - gap]
                j -= gap
            values[j] = value
        gap //= 3


@njit(cache=True, nogil=True)
def median_of_positive(values: FloatArray, n: int, scratch: FloatArray) -> float:
    """Give the median of those of values[:n] that are positive; 0 if there are none."""
    m = np.int64(0)  # of a literal a kernel of its own would be compiled
    for i in range(n):
        if values[i] > 0.0:
            scratch[m] = values[i]
            m += 1
    if m == 0:
        return 0.0
    sort_in_place(scratch, m)
    return float(0.5 * (scratch[(m - 1) // 2] + scratch[m // 2]))
