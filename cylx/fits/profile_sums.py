"""The sums over the points of a profile: what each is nearest to, the steps of its fit, and what speaks for it."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import solve_in_place

NEAR_LINE = 2.5
"""Points within so many deviations are on a line."""
LEAST_STRETCH, MOST_OFF, CLOSE = 6, 3.0, 4.0
"""Points without which a line ends, deviations of their mean from it with which it ends, and deviations of each from it
up to which they are asked."""
AHEAD = 7.0
"""Variance of a line that ends there, at the next points, over that of the mean of its own."""
STRAIGHT_SHARE = 0.6
"""Share of what is about the next stretch of a line that must lie on it."""
CLEAR = 0.2
"""A line is known by what is further than this, in radii, past where it touches the arc."""
LEAST_TURN, MOST_TURN = math.radians(20.0), math.radians(300.0)
"""Angles that an arc may have."""
RADII = 0.3, 1.6
"""Least and greatest radius, as shares of that of the first circle."""
TUKEY = 4.685
"""Residuals of so many deviations and more have no weight."""
WIDER, NARROWED = 3.0, 0.7
"""The first weights are wider by this factor, and each step's narrower than the last one's."""
STEPS, SETTLED = 40, 1e-4
"""Steps at most; a step of less than this, in radii, is the last."""
LONGEST_STEP, WIDEST_TURN = 0.2, 0.15
"""Longest step of the circle, in radii, and of the directions, radians."""
CLIPPED = 3.0
"""Residuals count up to so many deviations."""
ABOUT = 0.35
"""What lies within so many radii of the arc is compared with it."""
CENTER_X, CENTER_Y, OWN, FIRST, LAST = range(5)
"""The unknowns: centre, radius, and the directions of the two ends of the arc."""
KNOWN = 7
"""Numbers that follow from the directions, the same for all points."""


@njit(cache=True, nogil=True)
def _place(x: float, y: float, profile: FloatArray, normals: FloatArray) -> tuple[int, float, float]:
    """Return what a point is nearest to, its residual, and how far it is past the end of the arc.

    What: 0 for the arc, 1 for the line at its last end, -1 for the one at its first.
    """
    x, y = x - profile[CENTER_X], y - profile[CENTER_Y]
    distance = math.sqrt(x * x + y * y)
    if x * normals[4] + y * normals[5] >= normals[6] * distance:  # nearer to the middle than an end of the arc is
        return 0, distance - profile[OWN], 0.0
    k = 2 if y * normals[4] - x * normals[5] > 0.0 else 0
    along = y * normals[k] - x * normals[k + 1]
    return (1 if k else -1), x * normals[k] + y * normals[k + 1] - profile[OWN], along if k else -along


@njit(cache=True, nogil=True)
def _fill_normals(profile: FloatArray, normals: FloatArray) -> None:
    """Fill in the directions of the two ends of the arc and of its middle, and the cosine of half its angle."""
    middle = 0.5 * (profile[FIRST] + profile[LAST])
    normals[0], normals[1] = math.cos(profile[FIRST]), math.sin(profile[FIRST])
    normals[2], normals[3] = math.cos(profile[LAST]), math.sin(profile[LAST])
    normals[4], normals[5] = math.cos(middle), math.sin(middle)
    normals[6] = math.cos(0.5 * (profile[LAST] - profile[FIRST]))


@njit(cache=True, nogil=True)
def settle(local: FloatArray, profile: FloatArray, radius: float, reaches: FloatArray, deviation: float) -> bool:
    """Fit a profile in place, by Gauss-Newton steps with Tukey's weights; return whether it is one."""
    matrix, right, row, normals = np.zeros((5, 5)), np.zeros(5), np.zeros(3), np.zeros(KNOWN)
    for step in range(STEPS):
        width = TUKEY * deviation * max(1.0, WIDER * NARROWED**step)
        matrix[:], right[:] = 0.0, 0.0
        _fill_normals(profile, normals)
        for i in range(len(local)):
            kind, residual, along = _place(local[i, 0], local[i, 1], profile, normals)
            if abs(residual) >= width or along < 0.0 or along > reaches[1 if kind > 0 else 0]:
                continue
            if kind == 0:
                x, y = local[i, 0] - profile[CENTER_X], local[i, 1] - profile[CENTER_Y]
                distance = max(residual + profile[OWN], 1e-12 * profile[OWN])
                row[CENTER_X], row[CENTER_Y], row[OWN] = -x / distance, -y / distance, -1.0
            else:
                k = 2 if kind > 0 else 0
                row[CENTER_X], row[CENTER_Y], row[OWN] = -normals[k], -normals[k + 1], -1.0
            weight = (1.0 - (residual / width) ** 2) ** 2
            for a in range(FIRST):
                right[a] -= weight * row[a] * residual
                for b in range(FIRST):
                    matrix[a, b] += weight * row[a] * row[b]
            if kind != 0:  # a line turns with its end of the arc alone
                end, turned = LAST if kind > 0 else FIRST, kind * along
                right[end] -= weight * turned * residual
                matrix[end, end] += weight * turned * turned
                for b in range(FIRST):
                    matrix[end, b] += weight * turned * row[b]
                    matrix[b, end] += weight * row[b] * turned
        for a in range(5):
            matrix[a, a] = matrix[a, a] * (1.0 + 1e-9) + 1e-12
        if not solve_in_place(matrix, right):
            return False
        share = 1.0
        for a in range(5):
            most = LONGEST_STEP * profile[OWN] if a <= OWN else WIDEST_TURN
            share = min(share, most / max(abs(right[a]), 1e-300))
        for a in range(5):
            profile[a] += share * right[a]
        opened = profile[LAST] - profile[FIRST]
        if not RADII[0] * radius < profile[OWN] < RADII[1] * radius or not LEAST_TURN < opened < MOST_TURN:
            return False
        moved = max(abs(right[CENTER_X]), abs(right[CENTER_Y]), abs(right[OWN]))
        if moved < SETTLED * profile[OWN] and WIDER * NARROWED**step < 1.0:
            break
    return True


@njit(cache=True, nogil=True)
def is_straight(
    local: FloatArray, profile: FloatArray, side: int, reach: float, further: float, deviation: float
) -> bool:
    """Return whether the line at one end of an arc goes on straight from one length to another."""
    normals = np.zeros(KNOWN)
    _fill_normals(profile, normals)
    own, near, close, total = 0, 0, 0, 0.0
    for i in range(len(local)):
        kind, residual, along = _place(local[i, 0], local[i, 1], profile, normals)
        if kind != 2 * side - 1 or along < 0.0 or along > further or abs(residual) >= 2.0 * CLOSE * deviation:
            continue
        if along <= reach:
            own += abs(residual) < CLOSE * deviation
            continue
        near += 1
        if abs(residual) < CLOSE * deviation:
            close += 1
            total += residual
    if close < LEAST_STRETCH or close < STRAIGHT_SHARE * near:
        return False
    variance = deviation**2 * (1.0 / close + AHEAD / max(own, 1))
    return bool(abs(total / close) <= MOST_OFF * math.sqrt(variance))


@njit(cache=True, nogil=True)
def lean(
    local: FloatArray,
    heights: FloatArray,
    profile: FloatArray,
    reaches: FloatArray,
    deviation: float,
    matrix: FloatArray,
    right: FloatArray,
) -> None:
    """Sum up the normal equations of the lean of the axis, with Tukey's weights."""
    normals, width = np.zeros(KNOWN), TUKEY * deviation
    _fill_normals(profile, normals)
    for i in range(len(local)):
        kind, residual, along = _place(local[i, 0], local[i, 1], profile, normals)
        if abs(residual) >= width or along < 0.0 or along > reaches[1 if kind > 0 else 0]:
            continue
        if kind == 0:
            x, y = local[i, 0] - profile[CENTER_X], local[i, 1] - profile[CENTER_Y]
            distance = max(residual + profile[OWN], 1e-12 * profile[OWN])
            x, y = x / distance, y / distance
        else:
            k = 2 if kind > 0 else 0
            x, y = normals[k], normals[k + 1]
        x, y = heights[i] * x, heights[i] * y
        weight = (1.0 - (residual / width) ** 2) ** 2
        matrix[0, 0] += weight * x * x
        matrix[0, 1] += weight * x * y
        matrix[1, 0] += weight * x * y
        matrix[1, 1] += weight * y * y
        right[0] += weight * x * residual
        right[1] += weight * y * residual


@njit(cache=True, nogil=True)
def explained(local: FloatArray, profile: FloatArray, reaches: FloatArray, deviation: float) -> tuple[float, float]:
    """Return the sum of squared residuals, clipped, in squared deviations, and the mean of those that are not clipped.

    In the sum, what is on no part of the profile counts as far.
    """
    normals = np.zeros(KNOWN)
    _fill_normals(profile, normals)
    total, own, count = 0.0, 0.0, 0
    for i in range(len(local)):
        kind, residual, along = _place(local[i, 0], local[i, 1], profile, normals)
        ratio = min(abs(residual) / deviation, CLIPPED)
        if along < 0.0 or along > reaches[1 if kind > 0 else 0]:
            ratio = CLIPPED
        total += ratio * ratio
        if ratio < CLIPPED:
            own += ratio * ratio
            count += 1
    return total, own / max(count, 1)


@njit(cache=True, nogil=True)
def seen(
    local: FloatArray, profile: FloatArray, reaches: FloatArray, deviation: float
) -> tuple[int, int, int, int, float, float]:
    """Return what speaks for a profile.

    Points on the upper and on the lower line, clear of the arc, on the arc, and about it; of these the sum of squares,
    clipped; and what the arc gains over its two lines.
    """
    normals = np.zeros(KNOWN)
    _fill_normals(profile, normals)
    upper, lower, on_arc, about = 0, 0, 0, 0
    squares, edge = 0.0, 0.0
    for i in range(len(local)):
        kind, residual, along = _place(local[i, 0], local[i, 1], profile, normals)
        near = abs(residual) < NEAR_LINE * deviation
        if kind == 0:
            on_arc += near
            if abs(residual) >= ABOUT * profile[OWN]:
                continue
            ratio = min(abs(residual) / deviation, CLIPPED)
            about += 1
            squares += ratio * ratio
            x, y = local[i, 0] - profile[CENTER_X], local[i, 1] - profile[CENTER_Y]
            one = abs(x * normals[0] + y * normals[1] - profile[OWN])
            two = abs(x * normals[2] + y * normals[3] - profile[OWN])
            flat = min(one / deviation, two / deviation, CLIPPED)
            edge += flat * flat - ratio * ratio
        elif near and CLEAR * profile[OWN] < along <= reaches[1 if kind > 0 else 0]:
            upper += kind > 0
            lower += kind < 0
    return upper, lower, on_arc, about, squares, edge
