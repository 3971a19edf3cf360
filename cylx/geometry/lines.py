"""Lines in space: their common perpendicular, and whether they are parallel to an axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

PARALLEL = 1e-8
"""Below this angle, in radians, rounding of the directions costs more than taking the lines for parallel."""


def common_perpendicular(
    first_points: FloatArray, first_directions: FloatArray, second_points: FloatArray, second_directions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Give the feet, the angle and the axis of the shortest motion from one line to another, for pairs of lines.

    Directions are taken up to sign, so the angle is at most a right angle.

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
        beta, in [0, pi / 2]; by the arc tangent, which is exact everywhere: the paper's arc sine is not near a right
        angle.
    axis : ndarray of shape (..., 3)
        s, unit, orthogonal to both lines; the rotation by `angle` about it turns the first direction into the second.
    """
    sign = np.where((first_directions * second_directions).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    turned = sign * second_directions
    cosine = (first_directions * turned).sum(-1, keepdims=True)
    normal = np.cross(first_directions, turned)
    # rounding along the lines is much of the cross product of nearly parallel ones
    normal -= (normal * first_directions).sum(-1, keepdims=True) * first_directions
    sine = np.linalg.norm(normal, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)
    parallel = angle < PARALLEL
    across = second_points - first_points
    square = np.where(parallel, 1.0, sine * sine)
    # as determinants: in differences of dot products nearly parallel lines lose all their digits
    t1 = (np.cross(across, turned) * normal).sum(-1, keepdims=True) / square
    t2 = (np.cross(across, first_directions) * normal).sum(-1, keepdims=True) / square
    t1 = np.where(parallel, 0.0, t1)
    t2 = np.where(parallel, -(across * turned).sum(-1, keepdims=True), t2)
    helper = np.zeros_like(first_directions)
    np.put_along_axis(helper, np.abs(first_directions).argmin(-1)[..., None], 1.0, axis=-1)
    arbitrary = np.cross(first_directions, helper)
    arbitrary = arbitrary / np.linalg.norm(arbitrary, axis=-1, keepdims=True)
    axis = np.where(parallel, arbitrary, normal / np.where(parallel, 1.0, sine))
    return (
        first_points + t1 * first_directions,
        second_points + t2 * turned,
        np.where(parallel, 0.0, angle)[..., 0],
        axis,
    )


def are_along(directions: FloatArray, axis: ArrayLike, tolerance: float) -> NDArray[np.bool_]:
    """Tell which directions are parallel to an axis within an angle; signs do not matter.

    Parameters
    ----------
    directions : ndarray of shape (..., 3)
    axis : array_like of shape (3,)
        Of any length but zero.
    tolerance : float
        Greatest angle, radians; a right angle admits all.

    Returns
    -------
    ndarray of shape (...), bool

    Examples
    --------
    >>> are_along(np.array([[0.0, 0.1, -1.0], [0.0, 1.0, 1.0]]), (0, 0, 2), np.radians(10))
    array([ True, False])
    """
    line = np.array(axis, dtype=np.float64)
    line /= np.abs(line).max()  # so that its square neither overflows nor vanishes
    sine = np.linalg.norm(np.cross(directions, line), axis=-1)
    return np.asarray(np.arctan2(sine, np.abs(directions @ line)) <= tolerance, dtype=np.bool_)
