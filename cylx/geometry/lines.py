"""Lines in space: common perpendicular, parallelism, and fit."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import cross, symmetric_eigen

LEAST_POINTS_OF_LINE = 8
"""Maximum number of points used to fit a line."""

PARALLEL = 1e-8
"""Below this angle, in radians, rounding errors of the directions exceed the error of taking the lines as parallel."""


def common_perpendicular(
    first_points: FloatArray, first_directions: FloatArray, second_points: FloatArray, second_directions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the feet, the angle and the axis of the shortest motion from one line to another, for pairs of lines.

    The sign of a direction does not matter, so the angle is at most a right angle.

    Parameters
    ----------
    first_points, second_points : ndarray of shape (..., 3)
        A point of each line.
    first_directions, second_directions : ndarray of shape (..., 3)
        Unit vectors.

    Returns
    -------
    first_feet, second_feet : ndarray of shape (..., 3)
        m1 and m2 of section 3.1: the points of the lines that are closest to each other. For parallel lines the foot is
        the first line's point.
    angle : ndarray of shape (...)
        beta, in [0, pi / 2]; by the arc tangent, which is accurate everywhere. The paper's arc sine is inaccurate near
        a right angle.
    axis : ndarray of shape (..., 3)
        s, unit, orthogonal to both lines; the rotation by `angle` about it turns the first direction into the second.
    """
    sign = np.where((first_directions * second_directions).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    turned = sign * second_directions
    cosine = (first_directions * turned).sum(-1, keepdims=True)
    normal = cross(first_directions, turned)
    # for nearly parallel lines, rounding errors along the lines are a large part of the cross product
    normal -= (normal * first_directions).sum(-1, keepdims=True) * first_directions
    sine = np.linalg.norm(normal, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)
    parallel = angle < PARALLEL
    across = second_points - first_points
    square = np.where(parallel, 1.0, sine * sine)
    # as determinants: differences of dot products lose all their digits for nearly parallel lines
    t1 = (cross(across, turned) * normal).sum(-1, keepdims=True) / square
    t2 = (cross(across, first_directions) * normal).sum(-1, keepdims=True) / square
    t1 = np.where(parallel, 0.0, t1)
    t2 = np.where(parallel, -(across * turned).sum(-1, keepdims=True), t2)
    helper = np.zeros_like(first_directions)
    np.put_along_axis(helper, np.abs(first_directions).argmin(-1)[..., None], 1.0, axis=-1)
    arbitrary = cross(first_directions, helper)
    arbitrary = arbitrary / np.linalg.norm(arbitrary, axis=-1, keepdims=True)
    axis = np.where(parallel, arbitrary, normal / np.where(parallel, 1.0, sine))
    return (
        first_points + t1 * first_directions,
        second_points + t2 * turned,
        np.where(parallel, 0.0, angle)[..., 0],
        axis,
    )


def are_along(directions: FloatArray, axis: ArrayLike, tolerance: float) -> MaskArray:
    """Return which directions are parallel to an axis within an angle; signs do not matter.

    Parameters
    ----------
    directions : ndarray of shape (..., 3)
    axis : array_like of shape (3,)
        Of any length except zero.
    tolerance : float
        Greatest angle, radians; a right angle accepts all.

    Returns
    -------
    ndarray of shape (...), bool

    Examples
    --------
    >>> are_along(np.array([[0.0, 0.1, -1.0], [0.0, 1.0, 1.0]]), (0, 0, 2), np.radians(10))
    array([ True, False])
    """
    line = np.array(axis, dtype=np.float64)
    line /= np.abs(line).max()  # so that its square neither overflows nor underflows
    sine = np.linalg.norm(cross(directions, line), axis=-1)
    return np.asarray(np.arctan2(sine, np.abs(directions @ line)) <= tolerance, dtype=np.bool_)


@njit(cache=True, nogil=True)
def fit_line(xyz: FloatArray, n: int, reach: float, place: FloatArray, direction: FloatArray) -> tuple[float, float]:
    """Fit a line to the points xyz[:, :n] within `reach` of zero, trimmed twice; fill `place` and `direction` (3,).

    Returns
    -------
    across, along : float
        Root mean square distances from the line, and from its middle along it; infinite and 1 with too few points.
    """
    matrix, vectors, total = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    chosen = np.empty(n, np.bool_)
    direction[0], direction[1], direction[2] = 1.0, 0.0, 0.0
    width, across, along = math.inf, math.inf, 1.0
    for _ in range(3):
        total[0], total[1], total[2], count = 0.0, 0.0, 0.0, 0
        for i in range(n):
            square = xyz[0, i] ** 2 + xyz[1, i] ** 2 + xyz[2, i] ** 2
            chosen[i] = square < reach * reach and off_line(xyz, i, place, direction) <= width
            if chosen[i]:
                count += 1
                for d in range(3):
                    total[d] += xyz[d, i]
        if count < LEAST_POINTS_OF_LINE:
            return math.inf, 1.0
        for d in range(3):
            place[d] = total[d] / count
            for e in range(3):
                matrix[d, e] = 0.0
        for i in range(n):
            if chosen[i]:
                for d in range(3):
                    for e in range(3):
                        matrix[d, e] += (xyz[d, i] - place[d]) * (xyz[e, i] - place[e]) / count
        symmetric_eigen(matrix, vectors)
        longest = 0
        for d in range(1, 3):
            if matrix[d, d] > matrix[longest, longest]:
                longest = d
        along = math.sqrt(max(matrix[longest, longest], 1e-300))
        across = math.sqrt(max(matrix[0, 0] + matrix[1, 1] + matrix[2, 2] - matrix[longest, longest], 0.0))
        for d in range(3):
            direction[d] = vectors[d, longest]
        width = 2.5 * across + 1e-9 * along  # points may lie on the line exactly
    return across, along


@njit(cache=True, nogil=True)
def off_line(xyz: FloatArray, i: int, mean: FloatArray, direction: FloatArray) -> float:
    """Return the distance of point i from a line."""
    dx, dy, dz = xyz[0, i] - mean[0], xyz[1, i] - mean[1], xyz[2, i] - mean[2]
    along = dx * direction[0] + dy * direction[1] + dz * direction[2]
    return math.sqrt(max(0.0, dx * dx + dy * dy + dz * dz - along * along))
