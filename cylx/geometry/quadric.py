"""The quadric over a small piece of surface, and the cylinder that osculates it.

Over its own plane a small piece of surface is z = a x^2 + b x y + c y^2 + d x + e y + f. The shape operator of this
quadric has the principal curvatures and directions; for a cylinder one curvature is 0, along the axis, and the other 1
/ r. So a single small least-squares problem gives axis, radius and position, without normals.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.geometry.small_matrices import fill_frame, solve_in_place, symmetric_eigen

FloatArray = NDArray[np.float64]


@njit(cache=True, nogil=True)
def fit_plane(
    points: FloatArray,
    n: int,
    noise: float,
    center: FloatArray,
    normal: FloatArray,
    matrix: FloatArray,
    vectors: FloatArray,
) -> float:
    """Fit a plane to points[:n] by principal components, trimmed three times; fill `center` (3,) and `normal` (3,).

    Returns
    -------
    float
        Share of the points within three noises, 0 if those that are do not scatter like noise: an arc of a thin pipe is
        flat within three noises, too.
    """
    width = math.inf
    for _ in range(4):
        mx, my, mz, count = 0.0, 0.0, 0.0, 0
        for i in range(n):
            if width < math.inf and abs(_height(points, i, center, normal)) >= width:
                continue
            mx, my, mz, count = mx + points[i, 0], my + points[i, 1], mz + points[i, 2], count + 1
        if count < 10:
            return 0.0
        mx, my, mz = mx / count, my / count, mz / count
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            if width < math.inf and abs(_height(points, i, center, normal)) >= width:
                continue
            x, y, z = points[i, 0] - mx, points[i, 1] - my, points[i, 2] - mz
            xx, xy, xz = xx + x * x, xy + x * y, xz + x * z
            yy, yz, zz = yy + y * y, yz + y * z, zz + z * z
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
    inside, squares = 0, 0.0
    for i in range(n):
        height = _height(points, i, center, normal)
        if abs(height) < 3.0 * noise:
            inside += 1
            squares += height * height
    if inside == 0 or math.sqrt(squares / inside) > noise * (1.2 + 1.5 / math.sqrt(2.0 * inside)):
        return 0.0
    return float(inside / n)


@njit(cache=True, nogil=True)
def _height(points: FloatArray, i: int, center: FloatArray, normal: FloatArray) -> float:
    dx, dy, dz = points[i, 0] - center[0], points[i, 1] - center[1], points[i, 2] - center[2]
    return float(dx * normal[0] + dy * normal[1] + dz * normal[2])


@njit(cache=True, nogil=True)
def osculating_cylinder(
    points: FloatArray,
    n: int,
    noise: float,
    center: FloatArray,
    normal: FloatArray,
    model: FloatArray,
    gram: FloatArray,
    terms: FloatArray,
    frame: FloatArray,
    heights: FloatArray,
) -> bool:
    """Fit a quadric over a plane to points[:n] and fill `model` (7,) with the cylinder that osculates it.

    Parameters
    ----------
    center, normal : ndarray of shape (3,)
        The plane, from `fit_plane`.
    gram, terms, frame, heights : ndarray of shape (6, 6), (6,), (2, 3), (>= n,)
        Scratch.

    Returns
    -------
    bool
        False if there are too few points or the surface is not curved.
    """
    fill_frame(normal, frame)
    row = np.empty(6)
    width = math.inf
    for _ in range(4):
        for a in range(6):
            terms[a] = 0.0
            for b in range(6):
                gram[a, b] = 0.0
        count = 0
        for i in range(n):
            if width < math.inf and abs(heights[i]) > width:
                continue
            z = _fill_row(points, i, center, normal, frame, row)
            for a in range(6):
                terms[a] += row[a] * z
                for b in range(a + 1):
                    gram[a, b] += row[a] * row[b]
            count += 1
        if count < 10:
            return False
        for a in range(6):
            for b in range(a + 1, 6):
                gram[a, b] = gram[b, a]
        if not solve_in_place(gram, terms):
            return False
        total, count = 0.0, 0
        for i in range(n):
            z = _fill_row(points, i, center, normal, frame, row)
            inside = width == math.inf or abs(heights[i]) <= width
            for a in range(6):
                z -= terms[a] * row[a]
            heights[i] = z
            if inside:
                total += abs(z)
                count += 1
        width = max(2.5 * noise, 2.5 * total / count)  # two standard deviations, from the mean deviation
    return _fill_model(terms, center, normal, frame, model)


@njit(cache=True, nogil=True)
def _fill_row(
    points: FloatArray, i: int, center: FloatArray, normal: FloatArray, frame: FloatArray, row: FloatArray
) -> float:
    """Fill the row of the design matrix of point i, and give its height over the plane."""
    dx, dy, dz = points[i, 0] - center[0], points[i, 1] - center[1], points[i, 2] - center[2]
    x = dx * frame[0, 0] + dy * frame[0, 1] + dz * frame[0, 2]
    y = dx * frame[1, 0] + dy * frame[1, 1] + dz * frame[1, 2]
    row[0], row[1], row[2], row[3], row[4], row[5] = x * x, x * y, y * y, x, y, 1.0
    return float(dx * normal[0] + dy * normal[1] + dz * normal[2])


@njit(cache=True, nogil=True)
def _fill_model(
    terms: FloatArray, center: FloatArray, normal: FloatArray, frame: FloatArray, model: FloatArray
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
        model[3 + d] = frame[0, d] * ax + frame[1, d] * ay + normal[d] * (gx * ax + gy * ay)
        length += model[3 + d] ** 2
    length = math.sqrt(length)
    for d in range(3):
        model[3 + d] /= length
        model[d] = (normal[d] - gx * frame[0, d] - gy * frame[1, d]) / slant
        along += model[d] * model[3 + d]
    inward = 0.0
    for d in range(3):
        model[d] -= along * model[3 + d]
        inward += model[d] ** 2
    inward = math.sqrt(inward)
    for d in range(3):
        model[d] = center[d] + normal[d] * terms[5] + model[d] / (inward * strong)
    model[6] = 1.0 / abs(strong)
    return True
