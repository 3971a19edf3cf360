"""Frame -> the directions that planes have: what stands on one, or is bored into it, has its axis along the normal.

Flat windows show large planes well. A plate that is thin compared with a window is flat in none, because a window sees
both its faces; there the plane through three points that has most others on it is the face.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit
from cylx.geometry.morton import cell_starts, gather_ball
from cylx.geometry.numerics import symmetric_eigen
from cylx.records import Explained, Frame, Nearby

MOST_DIRECTIONS = 6
"""Directions that are told from one kind of normals."""
MOST_OF_BOTH = 8
"""Directions of planes that are tried."""
ALIKE = math.cos(math.radians(4.0))
"""Normals that enclose a smaller angle are those of one direction."""
BESIDE, LEAST_BESIDE = math.cos(math.radians(15.0)), 0.5
"""A direction this near to another needs this share of its normals: edges show some that lean."""
LEAST_SHARE = 0.02
"""Share of the points on planes that make a direction."""
ENOUGH_NORMALS = 3000
"""Normals among which the directions are found."""
CELL_SIDE = 2.6
"""Side of the cells, spacings, as near as they have it."""
WIDEST, CAPACITY = 6.0, 512
"""Spacings about a point in which it is asked for a plane, and points that are gathered."""
FACES, FACE_PAIRS = 600, 40
"""Places at which a face is looked for, and pairs of points that are tried at each."""
FACE_REACH, FACE_NOISES = 8.0, 16.0
"""It is looked for among what lies within so many spacings or noises, whichever is more."""
TOLERANCE, LEAST_TOLERANCE = 2.5, 0.05
"""Points within so many noises, or spacings, are on it."""
LEAST_ON_FACE, LEAST_AREA, LEAST_WIDTH = 25, 0.25, 0.25
"""Points that make a face; the area that a pair spans with the place, in squared reaches; and its width (rms) the
narrower way, in reaches: a strip of a curved surface is narrower."""
MOST_BESIDE = 0.2
"""Points up to twice as far off as those on it, as a share of these: a curved surface goes on there."""
MOST_ABOUT, FACE_CAPACITY = 400, 4096
"""Points that suffice about a place, and points that are gathered."""


def directions_of_planes(frame: Frame, explained: Explained, nearby: Nearby | None) -> FloatArray:
    """Return the unit normals of the directions that planes have in a cloud, either way, shape (k, 3).

    Parameters
    ----------
    frame : Frame
    explained : Explained
        Its flat windows are pieces of planes.
    nearby : Nearby or None
        From `find_curved_patches`.
    """
    flat = _normals_of_windows(frame, explained.flatness)
    if nearby is not None:
        flat = np.concatenate([flat, nearby.normals[nearby.looked_at[nearby.within]].astype(np.float64)])
    found = directions_of(_normals_of_faces(frame))
    found += [one for one in directions_of(flat) if all(abs(one @ other) <= ALIKE for other in found)]
    return np.array(found[:MOST_OF_BOTH]).reshape(-1, 3)


def _normals_of_faces(frame: Frame) -> FloatArray:
    """Return the normals of the planes at some places that have most points about these, either way."""
    noise = frame.noise.least
    seeds = np.arange(0, len(frame.points), 1 + len(frame.points) // FACES)
    level = max(0, round(math.log2(CELL_SIDE / frame.unit)))
    cells, starts = cell_starts(frame.codes, level)
    normals = np.zeros((len(seeds), 3))
    reach, tolerance = max(FACE_REACH, FACE_NOISES * noise), max(TOLERANCE * noise, LEAST_TOLERANCE)
    _fill_faces(frame.points, cells, starts, frame.unit * 2.0**level, seeds, reach, tolerance, normals)
    return normals[np.any(normals != 0.0, axis=1)]


@njit(cache=True, nogil=True)
def _fill_faces(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    seeds: IndexArray,
    reach: float,
    tolerance: float,
    normals: FloatArray,
) -> None:
    found, local, normal = np.empty(FACE_CAPACITY, np.int64), np.empty((MOST_ABOUT + 1, 3)), np.empty(3)
    for s in range(len(seeds)):
        ball = reach
        n = gather_ball(points, cells, starts, side, points[seeds[s]], ball, found)
        while n == FACE_CAPACITY and ball > 0.2 * reach:
            ball *= 0.7
            n = gather_ball(points, cells, starts, side, points[seeds[s]], ball, found)
        stride, k = 1 + n // MOST_ABOUT, np.int64(0)  # a bare 0 is a kind of its own
        for a in range(0, n, stride):
            for d in range(3):
                local[k, d] = points[found[a], d] - points[seeds[s], d]
            k += 1
        seen = k >= LEAST_ON_FACE and _fill_best_plane(local, k, LEAST_AREA * ball * ball, tolerance, normal)
        if seen and _fill_refined(local, k, LEAST_WIDTH * ball, tolerance, normal):
            for d in range(3):
                normals[s, d] = normal[d]


@njit(cache=True, nogil=True)
def _fill_best_plane(local: FloatArray, k: int, area: float, tolerance: float, normal: FloatArray) -> bool:
    """Fill in the unit normal of the plane through zero and two of the points that has most points on it."""
    most = LEAST_ON_FACE - 1
    for pair in range(FACE_PAIRS):
        one, other = local[(7919 * pair + 13) % k], local[(104729 * pair + k // 2) % k]
        x = one[1] * other[2] - one[2] * other[1]
        y = one[2] * other[0] - one[0] * other[2]
        z = one[0] * other[1] - one[1] * other[0]
        length = math.sqrt(x * x + y * y + z * z)
        if length < area:
            continue
        count = 0
        for a in range(k):
            if abs(local[a, 0] * x + local[a, 1] * y + local[a, 2] * z) < tolerance * length:
                count += 1
        if count > most:
            most = count
            normal[0], normal[1], normal[2] = x / length, y / length, z / length
    return most >= LEAST_ON_FACE


@njit(cache=True, nogil=True)
def _fill_refined(local: FloatArray, k: int, width: float, tolerance: float, normal: FloatArray) -> bool:
    """Fit the normal of a plane to the points on it; False if they are no face of this width (rms)."""
    matrix, vectors, sums = np.empty((3, 3)), np.empty((3, 3)), np.empty(4)
    offset, narrow, beside = 0.0, 0.0, 0
    for _ in range(3):
        beside, sums[3] = 0, 0.0
        for d in range(3):
            sums[d] = 0.0
            for e in range(3):
                matrix[d, e] = 0.0
        for a in range(k):
            height = local[a, 0] * normal[0] + local[a, 1] * normal[1] + local[a, 2] * normal[2]
            if abs(height - offset) < tolerance:
                sums[3] += 1.0
                for d in range(3):
                    sums[d] += local[a, d]
                    for e in range(3):
                        matrix[d, e] += local[a, d] * local[a, e]
            elif abs(height - offset) < 2.0 * tolerance:
                beside += 1
        if sums[3] < LEAST_ON_FACE:
            return False
        for d in range(3):
            for e in range(3):
                matrix[d, e] = matrix[d, e] / sums[3] - sums[d] * sums[e] / sums[3] ** 2
        symmetric_eigen(matrix, vectors)
        least, most = 0, 0
        for d in range(1, 3):
            least = d if matrix[d, d] < matrix[least, least] else least
            most = d if matrix[d, d] > matrix[most, most] else most
        if least == most:
            return False
        narrow, offset = matrix[3 - least - most, 3 - least - most], 0.0
        for d in range(3):
            normal[d] = vectors[d, least]
            offset += normal[d] * sums[d] / sums[3]
    return narrow >= width * width and beside <= MOST_BESIDE * sums[3]


def _normals_of_windows(frame: Frame, flatness: FloatArray) -> FloatArray:
    """Return the normals of planes at some of the points in flat windows, either way."""
    level = max(0, round(math.log2(CELL_SIDE / frame.unit)))
    cells, starts = cell_starts(frame.codes, level)
    which = np.flatnonzero(flatness > 0.0)
    which = np.ascontiguousarray(which[:: 1 + len(which) // ENOUGH_NORMALS])  # one layout: one compiled kernel
    normals = np.zeros((len(which), 3))
    radii = np.minimum(flatness[which], WIDEST)
    _fill_normals(frame.points, cells, starts, frame.unit * 2.0**level, which, radii, normals)
    return normals[np.any(normals != 0.0, axis=1)]


@njit(cache=True, nogil=True)
def _fill_normals(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    which: IndexArray,
    radii: FloatArray,
    normals: FloatArray,
) -> None:
    found, matrix, vectors, middle = np.empty(CAPACITY, np.int64), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for s in range(len(which)):
        n = gather_ball(points, cells, starts, side, points[which[s]], radii[s], found)
        if n < 6:
            continue
        for d in range(3):
            middle[d] = 0.0
            for a in range(n):
                middle[d] += points[found[a], d] / n
        for d in range(3):
            for e in range(3):
                matrix[d, e] = 0.0
                for a in range(n):
                    matrix[d, e] += (points[found[a], d] - middle[d]) * (points[found[a], e] - middle[e])
        symmetric_eigen(matrix, vectors)
        least = 0
        for a in range(1, 3):
            if matrix[a, a] < matrix[least, least]:
                least = a
        for d in range(3):
            normals[s, d] = vectors[d, least]


def directions_of(normals: FloatArray) -> list[FloatArray]:
    """Return the directions that many normals have, either way."""
    normals = normals[:: 1 + len(normals) // ENOUGH_NORMALS]
    count = len(normals)
    found: list[FloatArray] = []
    sizes: list[int] = []
    while len(normals) >= max(LEAST_SHARE * count, 10.0) and len(found) < MOST_DIRECTIONS:
        tried = normals[:: 1 + len(normals) // 200]
        alike = np.abs(tried @ normals.T) > ALIKE
        best = int(alike.sum(axis=1).argmax())
        if alike[best].sum() < max(LEAST_SHARE * count, 10.0):
            break
        own = normals[alike[best]]
        for _ in range(3):
            _, vectors = np.linalg.eigh(own.T @ own)
            direction = vectors[:, 2]
            own = normals[np.abs(normals @ direction) > ALIKE]
        beside = [size for one, size in zip(found, sizes, strict=True) if abs(one @ direction) > BESIDE]
        if len(own) >= LEAST_BESIDE * max(beside, default=0):
            found.append(direction)
            sizes.append(len(own))
        normals = normals[np.abs(normals @ direction) <= ALIKE]
    return found
