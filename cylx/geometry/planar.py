"""Points that lie on a plane with many of their nearest neighbours, and the normals of these planes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.morton import gather_ball
from cylx.geometry.numerics import sort_in_place

PLANE_SIZE = 32
"""Nearest points of which those on a plane are counted."""
PLANE_SHARE = 0.45
"""Share of them that makes it one: at a straight edge, half of them lie on either plane."""
INNER_SHARE = 0.7
"""Share of them about a point that lies within a plane, and not at its edge."""
PLANE_WIDTH = 0.005
"""They lie within this share of the radius of the neighbourhood, or within three noises."""
SIZE = 16
"""Nearest points of which pairs span the planes that are tried."""
CAPACITY = 512


@njit(cache=True, nogil=True)
def find_planar(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    which: IndexArray,
    reach: float,
    most: float,
    noise: float,
    normals: NDArray[np.float32],
    planar: MaskArray,
) -> None:
    """Fill in the normals of the points that lie on a plane with many of their nearest neighbours.

    Of planes through the point and two of its neighbours, the one with most points about it is that of the surface.

    Parameters
    ----------
    points, cells, starts, side, which, reach, most
        As for `fit_patches`.
    noise : float
        Standard deviation of the points about their surface.
    normals : ndarray of shape (m, 3), float32
        Filled; zero for a point on no plane, or at an edge of one, where something else may go on.
    planar : ndarray of shape (m,), bool
        Filled: whether a point is on a plane.
    """
    found, squares, ordered = np.empty(CAPACITY, np.int64), np.empty(CAPACITY), np.empty(CAPACITY)
    local, normal = np.empty((PLANE_SIZE, 3)), np.empty(3)
    for s in range(len(which)):
        for d in range(3):
            normals[s, d] = 0.0
        center, ball, n = points[which[s]], reach, 0
        while True:
            n = gather_ball(points, cells, starts, side, center, ball, found)
            if n >= PLANE_SIZE or ball >= most:
                break
            ball = min(1.5 * ball, most)
        for a in range(n):
            squares[a] = ordered[a] = _square(points, found[a], center)
        sort_in_place(ordered, n)
        limit, closest, k = ordered[min(n, PLANE_SIZE) - 1], ordered[min(n, SIZE) - 1], 0
        for turn in range(2):  # the nearer half first: pairs of it span the planes
            for a in range(n):
                near = squares[a] <= closest
                if squares[a] <= limit and k < PLANE_SIZE and near == (turn == 0) and found[a] != which[s]:
                    for d in range(3):
                        local[k, d] = points[found[a], d] - center[d]
                    k += 1
        tolerance, top = max(3.0 * noise, PLANE_WIDTH * math.sqrt(limit)), 0
        half = min(k, SIZE - 1)
        for a in range(half):
            for b in range(a + 1, half):
                if not _fill_cross(local[a], local[b], normal):
                    continue
                count = 0
                for c in range(k):
                    height = local[c, 0] * normal[0] + local[c, 1] * normal[1] + local[c, 2] * normal[2]
                    count += 1 if abs(height) < tolerance else 0
                if count > top:
                    top = count
                    if count >= INNER_SHARE * k:
                        for d in range(3):
                            normals[s, d] = normal[d]
            if top > 0.8 * k:
                break
        planar[s] = top >= PLANE_SHARE * PLANE_SIZE


@njit(cache=True, nogil=True)
def _square(points: FloatArray, i: int, center: FloatArray) -> float:
    """Return the square of the distance of a point from a place."""
    x, y, z = points[i, 0] - center[0], points[i, 1] - center[1], points[i, 2] - center[2]
    return float(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def _fill_cross(one: FloatArray, other: FloatArray, normal: FloatArray) -> bool:
    """Fill in the unit normal of the plane through zero and two points; False if they are nearly in line with it."""
    normal[0] = one[1] * other[2] - one[2] * other[1]
    normal[1] = one[2] * other[0] - one[0] * other[2]
    normal[2] = one[0] * other[1] - one[1] * other[0]
    length = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    size = math.sqrt((one[0] ** 2 + one[1] ** 2 + one[2] ** 2) * (other[0] ** 2 + other[1] ** 2 + other[2] ** 2))
    if length <= 0.3 * size:
        return False
    for d in range(3):
        normal[d] /= length
    return True
