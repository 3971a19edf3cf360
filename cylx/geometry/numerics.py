"""Numerics for the kernels: linear algebra of a few rows, order statistics, and flags for the order of sums.

All are scalar loops: no allocation, no LAPACK, fast to compile. A kernel that sums over points reads them as `xyz`,
shape (3, N), one coordinate per row. The compiler may not reorder sums or contract products: it would do so differently
where a kernel is compiled into another, and the last digits would depend on which kernels were kept by an earlier run.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit

NUMBERS: Final = {"nnan", "nsz"}
"""For minima and maxima of finite numbers: the compiler may take several at once, and the result is the same."""


@njit(cache=True, nogil=True)
def solve_in_place(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve the leading n x n system, n = len(right), by elimination with pivoting; the solution replaces `right`.

    Parameters
    ----------
    matrix : ndarray of shape (>= n, >= n)
        Overwritten.
    right : ndarray of shape (>= n,)
        Overwritten with the solution.

    Returns
    -------
    bool
        False if the matrix is singular to working precision.
    """
    n, largest = len(right), 0.0
    for i in range(n):
        largest = max(largest, abs(matrix[i, i]))
    for i in range(n):
        pivot = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[pivot, i]):
                pivot = k
        if abs(matrix[pivot, i]) <= 1e-14 * largest:
            return False
        if pivot != i:
            for j in range(i, n):
                matrix[i, j], matrix[pivot, j] = matrix[pivot, j], matrix[i, j]
            right[i], right[pivot] = right[pivot], right[i]
        for k in range(i + 1, n):
            factor = matrix[k, i] / matrix[i, i]
            for j in range(i, n):
                matrix[k, j] -= factor * matrix[i, j]
            right[k] -= factor * right[i]
    for i in range(n - 1, -1, -1):
        value = right[i]
        for j in range(i + 1, n):
            value -= matrix[i, j] * right[j]
        right[i] = value / matrix[i, i]
    return True


@njit(cache=True, nogil=True)
def symmetric_eigen(matrix: FloatArray, vectors: FloatArray) -> None:
    """Diagonalise a symmetric 3 x 3 matrix by Jacobi rotations.

    Parameters
    ----------
    matrix : ndarray of shape (3, 3)
        Overwritten; the eigenvalues are left on its diagonal, unordered.
    vectors : ndarray of shape (3, 3)
        Overwritten with the unit eigenvectors, one per column.
    """
    for i in range(3):
        for j in range(3):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        off = abs(matrix[0, 1]) + abs(matrix[0, 2]) + abs(matrix[1, 2])
        if off <= 1e-15 * (abs(matrix[0, 0]) + abs(matrix[1, 1]) + abs(matrix[2, 2])):
            return
        for p in range(2):
            for q in range(p + 1, 3):
                if matrix[p, q] == 0.0:
                    continue
                theta = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    a, b = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * a - s * b, s * a + c * b


@njit(cache=True, nogil=True)
def fill_basis(direction: FloatArray, basis: FloatArray) -> None:
    """Fill the rows of `basis` (2, 3) with unit vectors that make a right-handed basis with a unit direction (3,)."""
    x, y, z = direction[0], direction[1], direction[2]
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        a, b, c = 0.0, z, -y
    elif abs(y) <= abs(z):
        a, b, c = -z, 0.0, x
    else:
        a, b, c = y, -x, 0.0
    length = math.sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    basis[0, 0], basis[0, 1], basis[0, 2] = a, b, c
    basis[1, 0], basis[1, 1], basis[1, 2] = y * c - z * b, z * a - x * c, x * b - y * a


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b of vectors in the last axis, (..., 3) each; ten times faster than `numpy.cross` for few vectors."""
    if a.ndim == b.ndim == 1:  # the same numbers, without arrays of one number
        (x, y, z), (u, v, w) = a.tolist(), b.tolist()
        return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


@njit(cache=True, nogil=True)
def sort_in_place(values: FloatArray, n: int) -> None:
    """Sort values[:n] in ascending order: Shell's method with Knuth's gaps, fast to compile."""
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
    """Return the median of the positive numbers of values[:n]; 0 if there are none."""
    m = np.int64(0)  # a literal would be compiled as a separate kernel
    for i in range(n):
        if values[i] > 0.0:
            scratch[m] = values[i]
            m += 1
    if m == 0:
        return 0.0
    sort_in_place(scratch, m)
    return float(0.5 * (scratch[(m - 1) // 2] + scratch[m // 2]))
