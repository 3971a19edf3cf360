"""Quadrics over the nearest points of each point: a normal for each, and the cylinder that osculates its surface there.

A patch of the nearest points crosses an edge if there is one nearby. But of all patches that hold a point, one lies on
its side of the edge as a rule, and that is the one with the least residuals (Kuwahara's filter, 1976, on surfaces).
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit
from cylx.geometry.morton import gather_ball
from cylx.geometry.numerics import fill_basis, solve_in_place, sort_in_place, symmetric_eigen
from cylx.geometry.quadric import fill_osculating

SIZE = 16
"""Points of a patch."""
LEAST_SIZE = 10
"""A quadric has six terms; fewer points tell nothing of the scatter about it."""
CAPACITY = 512
TERMS = 15
"""Numbers of a patch: centre (3), normal (3), quadric (6), scale, scatter, radius."""


@njit(cache=True, nogil=True)
def fit_patches(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    which: IndexArray,
    reach: float,
    most: float,
    patches: FloatArray,
    members: IndexArray,
) -> None:
    """Fit a quadric over the nearest points of some points.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order.
    cells, starts, side
        As for `gather_ball`.
    which : ndarray of shape (m,)
        Indices of the points.
    reach, most : float
        Radius of the ball the nearest points are looked for in at first, and the greatest it may become.
    patches : ndarray of shape (m, 15)
        Filled: centre, normal, terms of the quadric over the plane in units of the scale, scale, standard deviation
        about it (infinite without a fit), radius.
    members : ndarray of shape (m, 16)
        Filled with the points of each patch; -1 where there are fewer.
    """
    found, squares, ordered = np.empty(CAPACITY, np.int64), np.empty(CAPACITY), np.empty(CAPACITY)
    matrix, vectors, gram = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 6))
    terms, row, frame, local = np.empty(6), np.empty(6), np.empty((2, 3)), np.empty((3, SIZE))
    for s in range(len(which)):
        patches[s, 13] = math.inf
        center, ball, n = points[which[s]], reach, 0
        while True:
            n = gather_ball(points, cells, starts, side, center, ball, found)
            if n >= SIZE or ball >= most:
                break
            ball = min(1.5 * ball, most)
        for a in range(n):
            square = 0.0
            for d in range(3):
                square += (points[found[a], d] - center[d]) ** 2
            squares[a] = ordered[a] = square
        sort_in_place(ordered, n)
        limit, k = ordered[min(n, SIZE) - 1], np.int64(0)  # a bare 0 is a kind of its own
        for a in range(n):
            if squares[a] <= limit and k < SIZE:
                members[s, k] = found[a]
                k += 1
        for a in range(k, SIZE):
            members[s, a] = -1
        if k < LEAST_SIZE or limit <= 0.0:
            continue
        _fit_patch(points, members[s], k, math.sqrt(limit), matrix, vectors, gram, terms, row, frame, local, patches[s])


@njit(cache=True, nogil=True)
def _fit_patch(
    points: FloatArray,
    members: IndexArray,
    k: int,
    scale: float,
    matrix: FloatArray,
    vectors: FloatArray,
    gram: FloatArray,
    terms: FloatArray,
    row: FloatArray,
    frame: FloatArray,
    local: FloatArray,
    patch: FloatArray,
) -> None:
    _fit_own_plane(points, members, k, matrix, vectors, patch)
    fill_basis(patch[3:6], frame)
    for a in range(6):
        terms[a] = 0.0
        for b in range(6):
            gram[a, b] = 0.0
    for i in range(k):
        x, y, z = 0.0, 0.0, 0.0
        for d in range(3):
            offset = (points[members[i], d] - patch[d]) / scale
            x += offset * frame[0, d]
            y += offset * frame[1, d]
            z += offset * patch[3 + d]
        local[0, i], local[1, i], local[2, i] = x, y, z
        row[0], row[1], row[2], row[3], row[4], row[5] = x * x, x * y, y * y, x, y, 1.0
        for a in range(6):
            terms[a] += row[a] * z
            for b in range(6):
                gram[a, b] += row[a] * row[b]
    for a in range(6):
        gram[a, a] += 1e-9
    if not solve_in_place(gram, terms):
        return
    total = 0.0
    for i in range(k):
        x, y = local[0, i], local[1, i]
        rest = local[2, i] - (terms[0] * x * x + terms[1] * x * y + terms[2] * y * y + terms[3] * x + terms[4] * y)
        total += (rest - terms[5]) ** 2
    for a in range(6):
        patch[6 + a] = terms[a]
    patch[12], patch[13], patch[14] = scale, scale * math.sqrt(total / (k - 6)), scale


@njit(cache=True, nogil=True)
def _fit_own_plane(
    points: FloatArray, members: IndexArray, k: int, matrix: FloatArray, vectors: FloatArray, patch: FloatArray
) -> None:
    """Fill in the middle of a patch and the normal of its plane."""
    for d in range(3):
        total = 0.0
        for a in range(k):
            total += points[members[a], d]
        patch[d] = total / k
    for d in range(3):
        for e in range(3):
            total = 0.0
            for a in range(k):
                total += (points[members[a], d] - patch[d]) * (points[members[a], e] - patch[e])
            matrix[d, e] = total
    symmetric_eigen(matrix, vectors)
    least = 0
    for a in range(1, 3):
        if matrix[a, a] < matrix[least, least]:
            least = a
    for d in range(3):
        patch[3 + d] = vectors[d, least]


@njit(cache=True, nogil=True)
def choose_patches(
    points: FloatArray,
    which: IndexArray,
    places: IndexArray,
    patches: FloatArray,
    members: IndexArray,
    owners: IndexArray,
    normals: FloatArray,
) -> None:
    """Choose for each point the patch with the least scatter that holds it, and the normal of that patch there.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    which : ndarray of shape (m,)
        The points about which the patches are.
    places : ndarray of shape (N,)
        Where in `which` a point is; -1 if it is not.
    patches, members : ndarray of shape (m, 15), (m, 16)
        From `fit_patches`.
    owners : ndarray of shape (m,)
        Filled: the patch chosen for each; -1 if there is none.
    normals : ndarray of shape (m, 3)
        Filled with unit normals, either way; zero if there is none.
    """
    frame = np.empty((2, 3))
    best = np.empty(len(which))
    for s in range(len(which)):
        owners[s], best[s] = -1, math.inf
    for s in range(len(which)):
        for a in range(members.shape[1]):
            i = members[s, a]
            if i >= 0 and places[i] >= 0 and patches[s, 13] < best[places[i]]:
                best[places[i]] = patches[s, 13]
                owners[places[i]] = s
    for s in range(len(which)):
        for d in range(3):
            normals[s, d] = 0.0
        if owners[s] >= 0:
            patch = patches[owners[s]]
            fill_basis(patch[3:6], frame)
            x, y, scale = 0.0, 0.0, patch[12]
            for d in range(3):
                offset = (points[which[s], d] - patch[d]) / scale
                x += offset * frame[0, d]
                y += offset * frame[1, d]
            gx = 2.0 * patch[6] * x + patch[7] * y + patch[9]
            gy = patch[7] * x + 2.0 * patch[8] * y + patch[10]
            length = math.sqrt(1.0 + gx * gx + gy * gy)
            for d in range(3):
                normals[s, d] = (patch[3 + d] - gx * frame[0, d] - gy * frame[1, d]) / length


@njit(cache=True, nogil=True)
def osculating_of(patch: FloatArray, terms: FloatArray, frame: FloatArray, model: FloatArray) -> bool:
    """Fill `model` (7,) with the cylinder that osculates a patch at its centre; False if the patch is not curved."""
    fill_basis(patch[3:6], frame)
    for a in range(3):
        terms[a] = patch[6 + a] / patch[12]
    terms[3], terms[4], terms[5] = patch[9], patch[10], patch[11] * patch[12]
    return fill_osculating(terms, patch[:3], patch[3:6], frame, model)
