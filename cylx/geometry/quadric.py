"""The quadric over a small piece of surface, and its osculating cylinder.

Over its own plane a small piece of surface is z = a x^2 + b x y + c y^2 + d x + e y + f. The shape operator of this
quadric gives the principal curvatures and directions. For a cylinder one curvature is 0, along the axis, and the other
is 1 / r. So one small least-squares problem gives axis, radius and position, without normals.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import RADIUS, UX
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import fill_basis, solve_in_place, symmetric_eigen


@njit(cache=True, nogil=True)
def fit_plane(
    xyz: FloatArray,
    n: int,
    noise: float,
    center: FloatArray,
    normal: FloatArray,
    matrix: FloatArray,
    vectors: FloatArray,
) -> float:
    """Fit a plane to xyz[:, :n] about zero by principal components, trimmed three times.

    Fills `center` (3,) and `normal` (3,).

    Returns
    -------
    float
        Share of the points within three noises. It is 0 if these points do not scatter like noise, as an arc of a thin
        pipe may also be flat within three noises.
    """
    width, sums = math.inf, np.empty(10)
    for d in range(3):
        center[d], normal[d] = 0.0, 0.0
    for _ in range(4):
        _fill_plane_sums(xyz, n, width, center, normal, sums)
        count = sums[0]
        if count < 10.0:
            return 0.0
        mx, my, mz = sums[1] / count, sums[2] / count, sums[3] / count
        xx, xy, xz, yy, yz, zz = sums[4], sums[5], sums[6], sums[7], sums[8], sums[9]
        # the points lie about zero, so subtracting the means from the sums loses little precision
        xx, xy, xz = xx - count * mx * mx, xy - count * mx * my, xz - count * mx * mz
        yy, yz, zz = yy - count * my * my, yz - count * my * mz, zz - count * mz * mz
        matrix[0, 0], matrix[0, 1], matrix[0, 2] = xx, xy, xz
        matrix[1, 0], matrix[1, 1], matrix[1, 2] = xy, yy, yz
        matrix[2, 0], matrix[2, 1], matrix[2, 2] = xz, yz, zz
        symmetric_eigen(matrix, vectors)
        least = 0
        for a in range(1, 3):
            if matrix[a, a] < matrix[least, least]:
                least = a
        center[0], center[1], center[2] = mx, my, mz
        for d in range(3):
            normal[d] = vectors[d, least]
        width = max(3.0 * noise, 2.0 * math.sqrt(max(matrix[least, least], 0.0) / count))
    inside, squares = _count_beside(xyz, n, 3.0 * noise, center, normal)
    if inside == 0.0 or math.sqrt(squares / inside) > noise * (1.2 + 1.5 / math.sqrt(2.0 * inside)):
        return 0.0
    return float(inside / n)


@njit(cache=True, nogil=True)
def _fill_plane_sums(
    xyz: FloatArray, n: int, width: float, center: FloatArray, normal: FloatArray, sums: FloatArray
) -> None:
    """Fill in number, sums, and sums of products (xx, xy, xz, yy, yz, zz) of the points within `width` of a plane."""
    cx, cy, cz, nx, ny, nz = center[0], center[1], center[2], normal[0], normal[1], normal[2]
    mx, my, mz, count = 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        x, y, z = xyz[0, i], xyz[1, i], xyz[2, i]
        one = 1.0 if abs((x - cx) * nx + (y - cy) * ny + (z - cz) * nz) < width else 0.0
        wx, wy, wz = one * x, one * y, one * z
        mx, my, mz, count = mx + wx, my + wy, mz + wz, count + one
        xx, xy, xz = xx + x * wx, xy + x * wy, xz + x * wz
        yy, yz, zz = yy + y * wy, yz + y * wz, zz + z * wz
    sums[0], sums[1], sums[2], sums[3] = count, mx, my, mz
    sums[4], sums[5], sums[6], sums[7], sums[8], sums[9] = xx, xy, xz, yy, yz, zz


@njit(cache=True, nogil=True)
def _count_beside(xyz: FloatArray, n: int, width: float, center: FloatArray, normal: FloatArray) -> tuple[float, float]:
    """Return the number of points within `width` of a plane, and the sum of their squared distances."""
    cx, cy, cz, nx, ny, nz = center[0], center[1], center[2], normal[0], normal[1], normal[2]
    count, squares = 0.0, 0.0
    for i in range(n):
        height = (xyz[0, i] - cx) * nx + (xyz[1, i] - cy) * ny + (xyz[2, i] - cz) * nz
        one = 1.0 if abs(height) < width else 0.0
        count += one
        squares += one * height * height
    return count, squares


@njit(cache=True, nogil=True)
def osculating_cylinder(
    xyz: FloatArray,
    n: int,
    noise: float,
    center: FloatArray,
    normal: FloatArray,
    model: FloatArray,
    gram: FloatArray,
    terms: FloatArray,
    basis: FloatArray,
    local: FloatArray,
) -> bool:
    """Fit a quadric over a plane to xyz[:, :n], and fill `model` (7,) with its osculating cylinder.

    Parameters
    ----------
    center, normal : ndarray of shape (3,)
        The plane, from `fit_plane`.
    gram, terms, basis, local : ndarray of shape (6, 6), (6,), (2, 3), (4, >= n)
        Scratch.

    Returns
    -------
    bool
        False if there are too few points or the surface is not curved.
    """
    fill_basis(normal, basis)
    for i in range(n):
        dx, dy, dz = xyz[0, i] - center[0], xyz[1, i] - center[1], xyz[2, i] - center[2]
        local[0, i] = dx * basis[0, 0] + dy * basis[0, 1] + dz * basis[0, 2]
        local[1, i] = dx * basis[1, 0] + dy * basis[1, 1] + dz * basis[1, 2]
        local[2, i] = dx * normal[0] + dy * normal[1] + dz * normal[2]
        local[3, i] = 0.0
    width = math.inf
    for _ in range(4):
        count = _fill_moments(local, n, width, gram, terms)
        if count < 10.0 or not solve_in_place(gram, terms):
            return False
        # two standard deviations, from the mean deviation
        width = max(2.5 * noise, 2.5 * _fill_residuals(local, n, width, terms) / count)
    return fill_osculating(terms, center, normal, basis, model)


@njit(cache=True, nogil=True)
def _fill_moments(local: FloatArray, n: int, width: float, gram: FloatArray, terms: FloatArray) -> float:
    """Fill the normal equations of a quadric over the plane from points whose last residual is within `width`."""
    x1, y1, x2, xy, y2 = 0.0, 0.0, 0.0, 0.0, 0.0
    x3, x2y, xy2, y3 = 0.0, 0.0, 0.0, 0.0
    x4, x3y, x2y2, xy3, y4 = 0.0, 0.0, 0.0, 0.0, 0.0
    z1, xz, yz, x2z, xyz, y2z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    count = 0.0
    for i in range(n):
        one = 1.0 if abs(local[3, i]) <= width else 0.0
        x, y, z = one * local[0, i], one * local[1, i], one * local[2, i]
        xx, product, yy = x * x, x * y, y * y
        x1, y1, x2, xy, y2 = x1 + x, y1 + y, x2 + xx, xy + product, y2 + yy
        x3, x2y, xy2, y3 = x3 + xx * x, x2y + xx * y, xy2 + x * yy, y3 + yy * y
        x4, x3y, x2y2, xy3, y4 = x4 + xx * xx, x3y + xx * product, x2y2 + xx * yy, xy3 + product * yy, y4 + yy * yy
        z1, xz, yz = z1 + z, xz + x * z, yz + y * z
        x2z, xyz, y2z = x2z + xx * z, xyz + product * z, y2z + yy * z
        count += one
    terms[0], terms[1], terms[2], terms[3], terms[4], terms[5] = x2z, xyz, y2z, xz, yz, z1
    gram[0, 0], gram[0, 1], gram[0, 2], gram[0, 3], gram[0, 4], gram[0, 5] = x4, x3y, x2y2, x3, x2y, x2
    gram[1, 1], gram[1, 2], gram[1, 3], gram[1, 4], gram[1, 5] = x2y2, xy3, x2y, xy2, xy
    gram[2, 2], gram[2, 3], gram[2, 4], gram[2, 5] = y4, xy2, y3, y2
    gram[3, 3], gram[3, 4], gram[3, 5] = x2, xy, x1
    gram[4, 4], gram[4, 5], gram[5, 5] = y2, y1, count
    for a in range(6):
        for b in range(a):
            gram[a, b] = gram[b, a]
    return count


@njit(cache=True, nogil=True)
def _fill_residuals(local: FloatArray, n: int, width: float, terms: FloatArray) -> float:
    """Fill in the residuals; return the sum of their sizes over the points whose last one was within `width`."""
    a, b, c, d, e, f = terms[0], terms[1], terms[2], terms[3], terms[4], terms[5]
    total = 0.0
    for i in range(n):
        x, y = local[0, i], local[1, i]
        z = local[2, i] - (a * x * x + b * x * y + c * y * y + d * x + e * y + f)
        total += abs(z) if abs(local[3, i]) <= width else 0.0
        local[3, i] = z
    return total


@njit(cache=True, nogil=True)
def fill_osculating(
    terms: FloatArray, center: FloatArray, normal: FloatArray, basis: FloatArray, model: FloatArray
) -> bool:
    """Turn the terms of a quadric into the osculating cylinder at the foot of the plane's centre."""
    gx, gy = terms[3], terms[4]
    slant = math.sqrt(1.0 + gx * gx + gy * gy)
    e, f, g = 1.0 + gx * gx, gx * gy, 1.0 + gy * gy
    h00, h01, h11 = 2.0 * terms[0], terms[1], 2.0 * terms[2]
    scale = 1.0 / ((e * g - f * f) * slant)
    # the shape operator: inverse of the first fundamental form times the second
    s00, s01 = (g * h00 - f * h01) * scale, (g * h01 - f * h11) * scale
    s10, s11 = (e * h01 - f * h00) * scale, (e * h11 - f * h01) * scale
    mean, det = 0.5 * (s00 + s11), s00 * s11 - s01 * s10
    root = math.sqrt(max(0.0, mean * mean - det))
    strong = mean + root if mean >= 0.0 else mean - root
    weak = 2.0 * mean - strong
    if abs(strong) < 1e-12:
        return False
    ax, ay = s01, weak - s00
    if abs(ax) + abs(ay) < 1e-9 * abs(strong):
        ax, ay = weak - s11, s10
    if abs(ax) + abs(ay) < 1e-12 * abs(strong):
        ax, ay = 1.0, 0.0
    length, along = 0.0, 0.0
    for d in range(3):
        model[UX + d] = basis[0, d] * ax + basis[1, d] * ay + normal[d] * (gx * ax + gy * ay)
        length += model[UX + d] ** 2
    length = math.sqrt(length)
    for d in range(3):
        model[UX + d] /= length
        model[d] = (normal[d] - gx * basis[0, d] - gy * basis[1, d]) / slant
        along += model[d] * model[UX + d]
    inward = 0.0
    for d in range(3):
        model[d] -= along * model[UX + d]
        inward += model[d] ** 2
    inward = math.sqrt(inward)
    for d in range(3):
        model[d] = center[d] + normal[d] * terms[5] + model[d] / (inward * strong)
    model[RADIUS] = 1.0 / abs(strong)
    return True
