"""The normal equations of a bend between two axes: what its points say of bend radius, tube radius and both axes."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arc import arc_place
from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit

PARAMETERS = 10
"""Two offsets and two tilts of the first axis, the same of the second, radius of the tube, bend radius."""


@njit(cache=True, nogil=True)
def fill_bend_frame(
    axes: FloatArray, signs: FloatArray, state: FloatArray, frame: FloatArray, skew: FloatArray
) -> tuple[float, float]:
    """Fill in the frame of the bend between two axes after small changes; return its bend radius and its angle.

    Parameters
    ----------
    axes : ndarray of shape (2, 4, 3)
        Of each pipe: middle, unit direction, and both vectors of its basis.
    signs : ndarray of shape (2,)
        1 where the direction of a pipe is that of the bend, else -1.
    state : ndarray of shape (10,)
        Changes of the axes, tube radius, bend radius.
    frame : ndarray of shape (6, 3)
        To be filled, as `fill_arc_coordinates` takes it.
    skew : ndarray of shape (3,)
        To be filled with the vector by which the axes pass each other.

    Returns
    -------
    bend_radius, angle : float
    """
    point, way = np.empty((2, 3)), np.empty((2, 3))
    for k in range(2):
        square = 0.0
        for d in range(3):
            first, second = axes[k, 2, d], axes[k, 3, d]
            point[k, d] = axes[k, 0, d] + state[4 * k] * first + state[4 * k + 1] * second
            way[k, d] = axes[k, 1, d] + state[4 * k + 2] * first + state[4 * k + 3] * second
            square += way[k, d] * way[k, d]
        length = math.sqrt(square)
        for d in range(3):
            way[k, d] /= length
    cosine, along, onto = 0.0, 0.0, 0.0
    for d in range(3):
        away = point[1, d] - point[0, d]
        cosine += way[0, d] * way[1, d]
        along += away * way[0, d]
        onto += away * way[1, d]
    sine = 1.0 - cosine * cosine
    reach, other = (along - cosine * onto) / sine, (cosine * along - onto) / sine
    radius = max(state[9], 0.0)
    cosine *= signs[0] * signs[1]
    across = np.empty(3)
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        across[d] = signs[0] * signs[1] * (way[0, e] * way[1, f] - way[0, f] * way[1, e])
    norm = math.sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2])
    angle = math.atan2(norm, cosine)
    tangent = radius * math.tan(0.5 * angle)
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        foot = point[0, d] + reach * way[0, d]
        skew[d] = foot - (point[1, d] + other * way[1, d])
        meeting = foot - 0.5 * skew[d]
        inward = signs[0] * (across[e] * way[0, f] - across[f] * way[0, e]) / norm
        frame[0, d] = meeting - tangent * signs[0] * way[0, d] + radius * inward
        frame[1, d], frame[2, d], frame[3, d] = signs[0] * way[0, d], -inward, across[d] / norm
        frame[4, d], frame[5, d] = meeting + tangent * signs[1] * way[1, d], signs[1] * way[1, d]
    return radius, angle


@njit(cache=True, nogil=True)
def fill_bend_normal(
    points: FloatArray,
    axes: FloatArray,
    signs: FloatArray,
    state: FloatArray,
    small: FloatArray,
    reach: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
) -> float:
    """Fill in the normal equations of the points of a bend, and of the distance of its axes; return its robust cost.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    axes, signs, state
        As `fill_bend_frame` takes them.
    small : ndarray of shape (10,)
        Steps of the derivatives.
    reach : ndarray of shape (7,)
        Standard deviation of the points; errors from which they have no say; up to how far before and behind the arc
        they have a full say; up to how much further, and how much, they have a lesser one; the standard deviation of
        the distance of the axes.
    normal, gradient : ndarray of shape (10, 10), (10,)
        To be filled.
    """
    spread, width, before, behind, margin, lesser, skewed = reach
    frames, skews = np.empty((PARAMETERS + 1, 6, 3)), np.empty((PARAMETERS + 1, 3))
    sizes, moved = np.empty((PARAMETERS + 1, 2)), np.empty(PARAMETERS)
    for k in range(PARAMETERS + 1):
        for d in range(PARAMETERS):
            moved[d] = state[d]
        if k > 0:
            moved[k - 1] += small[k - 1]
        sizes[k, 0], sizes[k, 1] = fill_bend_frame(axes, signs, moved, frames[k], skews[k])
    for a in range(PARAMETERS):
        gradient[a] = 0.0
        for b in range(PARAMETERS):
            normal[a, b] = 0.0
    row, cost, length = np.empty(PARAMETERS), 0.0, sizes[0, 0] * sizes[0, 1]
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        along, distance = arc_place(x, y, z, frames[0], sizes[0, 0], sizes[0, 1])
        error = distance - state[8]
        beside = max(-along - before, along - length - behind, 0.0)
        if beside > margin or (beside > 0.0 and lesser == 0.0):
            continue
        share = max(1.0 - (error / width) ** 2, 0.0)
        say = 1.0 if beside == 0.0 else lesser
        cost += say * (1.0 - share * share * share)
        if share == 0.0:
            continue
        weight = say * share * share / (spread * spread)
        for a in range(PARAMETERS):
            shifted = arc_place(x, y, z, frames[a + 1], sizes[a + 1, 0], sizes[a + 1, 1])[1]
            shifted -= state[8] + (small[8] if a == 8 else 0.0)
            row[a] = (shifted - error) / small[a]
        for a in range(PARAMETERS):
            gradient[a] += weight * row[a] * error
            for b in range(a + 1):
                normal[a, b] += weight * row[a] * row[b]
    for d in range(3):
        for a in range(PARAMETERS):
            row[a] = (skews[a + 1, d] - skews[0, d]) / small[a]
        for a in range(PARAMETERS):
            gradient[a] += row[a] * skews[0, d] / (skewed * skewed)
            for b in range(a + 1):
                normal[a, b] += row[a] * row[b] / (skewed * skewed)
    for a in range(PARAMETERS):
        for b in range(a):
            normal[b, a] = normal[a, b]
    return cost
