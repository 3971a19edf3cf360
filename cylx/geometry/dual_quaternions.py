"""Unit dual quaternions: rigid motions as screws, their logarithm, their average (appendix A).

A dual quaternion is an array of shape (..., 8): the real quaternion (w, x, y, z), then the dual one. A motion has the
real part q0 and the dual part t q0 / 2, where t is the pure quaternion of the translation.
"""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.lines import common_perpendicular
from cylx.geometry.numerics import cross


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    """Multiply quaternions (..., 4)."""
    pw, pv, qw, qv = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    scalar = pw * qw - (pv * qv).sum(-1, keepdims=True)
    return np.concatenate([scalar, pw * qv + qw * pv + cross(pv, qv)], axis=-1)


def multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Multiply dual quaternions of shape (..., 8): the motion q first, then p."""
    real = _product(p[..., :4], q[..., :4])
    return np.concatenate([real, _product(p[..., :4], q[..., 4:]) + _product(p[..., 4:], q[..., :4])], axis=-1)


def conjugate(q: FloatArray) -> FloatArray:
    """Return the quaternion conjugate of both parts: the inverse of a unit dual quaternion."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0]))


def normalised(q: FloatArray) -> FloatArray:
    """Divide by the dual norm (A.1), so that the result is a rigid motion."""
    length = np.linalg.norm(q[..., :4], axis=-1, keepdims=True)
    real, dual = q[..., :4] / length, q[..., 4:] / length
    return np.concatenate([real, dual - (real * dual).sum(-1, keepdims=True) * real], axis=-1)


def screw(axis: FloatArray, foot: FloatArray, angle: FloatArray, shift: FloatArray) -> FloatArray:
    """Return the motion that rotates by `angle` about the line (foot, axis) and moves by `shift` along it (A.2).

    (A.2) as printed has the dual angle 2 beta + 2 eps |T|, whose half in the cosine would apply the motion twice; beta
    + eps |T| is meant.

    Parameters
    ----------
    axis, foot : ndarray of shape (..., 3)
        Unit direction and a point of the screw axis.
    angle, shift : ndarray of shape (...)
        Radians and length.

    Returns
    -------
    ndarray of shape (..., 8)
    """
    half, slide = 0.5 * np.asarray(angle)[..., None], 0.5 * np.asarray(shift)[..., None]
    cosine, sine = np.cos(half), np.sin(half)
    moment = cross(foot, axis)
    return np.concatenate(
        [cosine, sine * axis, -slide * sine, slide * cosine * axis + sine * moment],
        axis=-1,
    )


def logarithm(q: FloatArray) -> FloatArray:
    """Return the logarithm of unit dual quaternions: half the dual angle times the dual axis (A.3).

    Parameters
    ----------
    q : ndarray of shape (..., 8)

    Returns
    -------
    ndarray of shape (..., 6)
        Vector parts of the real and the dual quaternion; the scalar parts are zero. The sign of `q` is chosen so that
        the rotation is at most pi, the shorter of the two paths of (A.4).
    """
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:4], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    small = sine < 1e-12
    safe = np.where(small, 1.0, sine)
    factor = np.where(small, 1.0, half / safe)
    # d = slide along the axis; from the scalar dual part -d sin(half), and from the component of the dual
    # vector along the axis
    axis = q[..., 1:4] / safe
    slide = np.where(small, 0.0, -q[..., 4:5] / safe)
    moment = (q[..., 5:8] - slide * q[..., :1] * axis) / safe
    dual = np.where(small, q[..., 5:8], half * moment + slide * axis)
    return np.concatenate([factor * q[..., 1:4], dual], axis=-1)


def exponential(twist: FloatArray) -> FloatArray:
    """Return the unit dual quaternion whose logarithm is `twist`, shape (..., 6)."""
    half = np.linalg.norm(twist[..., :3], axis=-1, keepdims=True)
    small = half < 1e-12
    axis = twist[..., :3] / np.where(small, 1.0, half)
    slide = (axis * twist[..., 3:]).sum(-1, keepdims=True)
    moment = (twist[..., 3:] - slide * axis) / np.where(small, 1.0, half)
    cosine, sine = np.cos(half), np.sin(half)
    general = np.concatenate([cosine, sine * axis, -slide * sine, slide * cosine * axis + sine * moment], axis=-1)
    tiny = np.concatenate([np.ones_like(half), twist[..., :3], np.zeros_like(half), twist[..., 3:]], axis=-1)
    return np.where(small, tiny, general)


def line_screws(
    point: FloatArray, direction: FloatArray, points: FloatArray, directions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the smallest screw from one line to each of several (section 3.1, A.2).

    Parameters
    ----------
    point, direction : ndarray of shape (3,) or (..., 3)
        The line to move.
    points, directions : ndarray of shape (..., 3)
        The target lines.

    Returns
    -------
    motions : ndarray of shape (..., 8)
        Unit dual quaternions.
    angles, gaps : ndarray of shape (...)
        beta and |T|, the distance of the lines.
    """
    point, direction = np.broadcast_to(point, points.shape), np.broadcast_to(direction, directions.shape)
    feet, others, angle, axis = common_perpendicular(point, direction, points, directions)
    gap = others - feet
    length = np.linalg.norm(gap, axis=-1)
    # the axis of parallel lines is arbitrary: the motion is the translation itself
    aside = (angle == 0.0) & (length > 0.0)
    axis = np.where(aside[..., None], gap / np.where(aside, length, 1.0)[..., None], axis)
    # for nearly parallel lines the feet are uncertain, but not the distance along the common perpendicular
    shift = np.where(aside, length, ((points - point) * axis).sum(-1))
    return screw(axis, feet, angle, shift), angle, np.abs(shift)


def pairwise_screw_distances(points: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distance of eq. 1 and the gap |T| of all pairs of lines.

    Parameters
    ----------
    points, directions : ndarray of shape (M, 3)

    Returns
    -------
    distances : ndarray of shape (M, M)
        min(|log q|, |log -q|) (A.4): the Euclidean length of the 6 numbers of the logarithm.
    gaps : ndarray of shape (M, M)
        |T|, the distance of the lines.
    """
    count = len(points)
    distances, gaps = np.zeros((count, count)), np.zeros((count, count))
    for i in range(count):
        motions, _, gaps[i] = line_screws(points[i], directions[i], points, directions)
        distances[i] = np.linalg.norm(logarithm(motions), axis=-1)
    # the two directions of a pair differ by rounding only
    return 0.5 * (distances + distances.T), 0.5 * (gaps + gaps.T)


def blend(motions: FloatArray, weights: FloatArray, max_iterations: int = 20, tolerance: float = 1e-9) -> FloatArray:
    """Average motions by dual-quaternion iterative blending (step 3 of section 3.4).

    Parameters
    ----------
    motions : ndarray of shape (M, 8)
        Unit dual quaternions.
    weights : ndarray of shape (M,)
        Non-negative, of sum 1.
    max_iterations : int
    tolerance : float
        The iteration ends when a step is shorter.

    Returns
    -------
    ndarray of shape (8,)
        The motion from which the weighted mean of the logarithms vanishes.

    References
    ----------
    L. Kavan, S. Collins, C. O'Sullivan, J. Zara, Dual quaternions for rigid transformation blending, TCD-CS-2006-46.
    """
    lead = motions[int(np.argmax(weights))]
    aligned = np.where((motions[:, :4] @ lead[:4])[:, None] < 0, -motions, motions)
    mean = normalised(weights @ aligned)
    for _ in range(max_iterations):
        step = weights @ logarithm(multiply(conjugate(mean), aligned))
        mean = normalised(multiply(mean, exponential(step)))
        if np.linalg.norm(step) < tolerance:
            break
    return mean


def move_points(motion: FloatArray, points: FloatArray) -> FloatArray:
    """Apply a motion (8,) to points (..., 3)."""
    real, dual = motion[:4], motion[4:]
    translation = 2.0 * _product(dual, real * np.array([1.0, -1.0, -1.0, -1.0]))[1:]
    return turn_vectors(motion, points) + translation


def turn_vectors(motion: FloatArray, vectors: FloatArray) -> FloatArray:
    """Apply the rotation of a motion (8,) to vectors (..., 3)."""
    w, v = motion[0], motion[1:4]
    twice = 2.0 * cross(v, vectors)
    return np.asarray(vectors + w * twice + cross(v, twice))
