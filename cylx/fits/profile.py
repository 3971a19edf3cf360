"""The profile of a rounded edge: two lines and the arc that touches both, fitted as one.

Near an end of the arc the line that it goes on into is within the noise of it. A circle fitted to what looks like the
arc takes points of the lines, and comes out too large. The lines are seen over a length of their own and are known
well, and so the arc has one unknown left: its radius if the lines meet, the place of its centre if they are parallel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit

LEAST_ON_LINE = 12
"""Points of a line."""
NEAR_LINE = 2.5
"""Points within so many deviations are on a line."""
LINE_LENGTH = 2.0
"""The lines are looked for so many radii long past where they touch the arc."""
CLEAR = 0.35
"""A line is fitted to what is further than this, in radii, past where it touches the arc."""
SIDE_STEPS = np.radians(np.arange(8.0, 116.0, 3.0))
"""Half angles of the arc that are tried."""
OFFSETS = np.array([-1.5, 0.0, 1.5])
"""Distances of a line from the first circle that are tried, in deviations."""
LEAST_TURN, PARALLEL = math.radians(20.0), math.radians(172.0)
"""Turns between the lines that have an arc, and from which the lines are parallel."""
RADII = np.geomspace(0.35, 1.5, 30)
"""Radii that are tried, as shares of that of the first circle."""
CLIPPED = 3.0
"""Residuals count up to so many deviations."""
FINER = 3
"""Fits of a line to the points about the last one."""
ABOUT = 0.35
"""What lies within so many radii of the arc is compared with it."""


class Profile(NamedTuple):
    """An arc between two lines that touch it.

    Parameters
    ----------
    center : ndarray of shape (2,)
    radius : float
    middle : float
        Angle of the middle of the arc about its centre, radians.
    opening : float
        Half the angle of the arc, radians.
    gain, edge_gain : float
        How much smaller the sum of squared residuals is than that of the first circle with its lines, and than that
        of the sharp edge of the lines, in squared deviations.
    chi_square : float
        Mean square of the residuals of what lies about the arc, in squared deviations, clipped.
    """

    center: FloatArray
    radius: float
    middle: float
    opening: float
    gain: float
    edge_gain: float
    chi_square: float


class _Line(NamedTuple):
    """A line: unit normal, away from the arc's centre, and distance from zero."""

    normal: FloatArray
    offset: float


def fit_profile(points: FloatArray, radius: float, middle: float, deviation: float) -> Profile | None:
    """Fit an arc between two lines.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
        Points about a first circle, its centre at zero.
    radius : float
        Of the first circle.
    middle : float
        Angle of the middle of its arc, radians.
    deviation : float
        Standard deviation of the points about the profile.

    Returns
    -------
    Profile or None
        None if there are no two lines that touch.
    """
    turn = np.array([[math.cos(middle), math.sin(middle)], [-math.sin(middle), math.cos(middle)]])
    local = np.ascontiguousarray(points @ turn.T)  # the arc's middle is on the first axis
    upper, lower = _line_beside(local, radius, deviation, 1.0), _line_beside(local, radius, deviation, -1.0)
    if upper is None or lower is None:
        return None
    turned = math.acos(min(1.0, max(-1.0, float(upper.normal @ lower.normal))))
    if upper.normal[1] < lower.normal[1] or not turned > LEAST_TURN:
        return None
    rotation = math.atan2(upper.normal[1] + lower.normal[1], upper.normal[0] + lower.normal[0])
    if math.cos(rotation) < 0.0:  # the normals of a half turn nearly cancel each other
        rotation, turned = rotation + math.pi, 2.0 * math.pi - turned
    if turned > PARALLEL:
        found = _slide(local, radius, upper, lower, deviation)
    else:
        found = _grow(local, radius, upper, lower, deviation)
    if found is None:
        return None
    center, own, gain, edge_gain = found
    away = local - center
    distances = np.hypot(away[:, 0], away[:, 1])
    inner = away @ np.array([math.cos(rotation), math.sin(rotation)]) > math.cos(0.5 * turned) * distances
    residuals = (distances - own)[inner & (np.abs(distances - own) < ABOUT * own)]
    if len(residuals) < LEAST_ON_LINE:
        return None
    chi_square = float((np.minimum(np.abs(residuals) / deviation, CLIPPED) ** 2).mean())
    return Profile(center @ turn, own, middle + rotation, 0.5 * turned, gain, edge_gain, chi_square)


def _line_beside(local: FloatArray, radius: float, deviation: float, sign: float) -> _Line | None:
    """Return the line that touches the first circle on one side of its middle and has most points."""
    x, y = np.ascontiguousarray(local[:, 0]), sign * local[:, 1]
    place, offset = _most_on_line(x, y, np.cos(SIDE_STEPS), np.sin(SIDE_STEPS), OFFSETS * deviation, radius, deviation)
    if place < 0:
        return None
    normal = np.array([math.cos(SIDE_STEPS[place]), math.sin(SIDE_STEPS[place])])
    distance = radius + float(OFFSETS[offset]) * deviation
    own = np.column_stack([x, y])
    for _ in range(FINER):
        along = own @ np.array([-normal[1], normal[0]])
        on = (along > CLEAR * radius) & (along < LINE_LENGTH * radius)
        on &= np.abs(own @ normal - distance) < NEAR_LINE * deviation
        if on.sum() < LEAST_ON_LINE:
            return None
        center = own[on].mean(axis=0)
        _, _, axes = np.linalg.svd(own[on] - center, full_matrices=False)
        normal = axes[1] * math.copysign(1.0, float(axes[1] @ normal))
        distance = float(center @ normal)
    return _Line(np.array([normal[0], sign * normal[1]]), distance)


@njit(cache=True, nogil=True)
def _most_on_line(
    x: FloatArray,
    y: FloatArray,
    cosines: FloatArray,
    sines: FloatArray,
    offsets: FloatArray,
    radius: float,
    deviation: float,
) -> tuple[int, int]:
    """Return which of the touching lines, of an angle and an offset, has most points; negative if none has enough."""
    place, shift, most = -1, -1, LEAST_ON_LINE - 1
    counts = np.empty(len(offsets), np.int64)
    for a in range(len(cosines)):
        for b in range(len(offsets)):
            counts[b] = 0
        for i in range(len(x)):
            along = y[i] * cosines[a] - x[i] * sines[a]
            if CLEAR * radius < along < LINE_LENGTH * radius:
                height = x[i] * cosines[a] + y[i] * sines[a] - radius
                for b in range(len(offsets)):
                    if abs(height - offsets[b]) < NEAR_LINE * deviation:
                        counts[b] += 1
        for b in range(len(offsets)):
            if counts[b] > most:
                place, shift, most = a, b, counts[b]
    return place, shift


def _cost(local: FloatArray, center: FloatArray, radius: float, lines: tuple[_Line, _Line], deviation: float) -> float:
    """Return the sum of squared residuals about the profile, in squared deviations, clipped."""
    (upper, upper_offset), (lower, lower_offset) = lines
    return float(_sum_of_squares(local, center, radius, upper, upper_offset, lower, lower_offset, deviation))


@njit(cache=True, nogil=True)
def _sum_of_squares(
    local: FloatArray,
    center: FloatArray,
    radius: float,
    upper: FloatArray,
    upper_offset: float,
    lower: FloatArray,
    lower_offset: float,
    deviation: float,
) -> float:
    # along each line, away from the arc
    turn = lower[1] * upper[0] - lower[0] * upper[1]
    sign = -1.0 if turn > 1e-9 else 1.0
    back = 1.0 if abs(turn) < 1e-9 else -sign
    total = 0.0
    for i in range(len(local)):
        x, y = local[i, 0] - center[0], local[i, 1] - center[1]
        residual = abs(math.sqrt(x * x + y * y) - radius)
        if sign * (y * upper[0] - x * upper[1]) > 0.0:
            residual = min(residual, abs(local[i, 0] * upper[0] + local[i, 1] * upper[1] - upper_offset))
        if back * (y * lower[0] - x * lower[1]) > 0.0:
            residual = min(residual, abs(local[i, 0] * lower[0] + local[i, 1] * lower[1] - lower_offset))
        ratio = min(residual / deviation, CLIPPED)
        total += ratio * ratio
    return total


def _grow(
    local: FloatArray, radius: float, upper: _Line, lower: _Line, deviation: float
) -> tuple[FloatArray, float, float, float] | None:
    """Find the radius of the arc that touches two lines that meet."""
    matrix = np.array([upper.normal, lower.normal])

    def center_of(own: float) -> FloatArray:
        return np.linalg.solve(matrix, np.array([upper.offset - own, lower.offset - own]))

    def cost(own: float) -> float:
        return _cost(local, center_of(own), own, (upper, lower), deviation)

    tried = np.array([cost(share * radius) for share in RADII])
    best = int(tried.argmin())
    if best in (0, len(RADII) - 1):
        return None
    own = _least(cost, RADII[best - 1] * radius, RADII[best + 1] * radius)
    least = cost(own)
    return center_of(own), own, cost(radius) - least, cost(1e-3 * radius) - least


def _slide(
    local: FloatArray, radius: float, upper: _Line, lower: _Line, deviation: float
) -> tuple[FloatArray, float, float, float] | None:
    """Find the centre of the arc that touches two parallel lines."""
    across = upper.normal - lower.normal
    across /= np.linalg.norm(across)
    own = 0.5 * (upper.offset + lower.offset)
    if not 0.35 * radius < own < 1.5 * radius:
        return None
    along = np.array([across[1], -across[0]])
    along *= math.copysign(1.0, along[0])
    middle = (upper.offset - own) * across

    def cost(place: float) -> float:
        return _cost(local, middle + place * along, own, (upper, lower), deviation)

    places = np.linspace(-1.0, 1.0, 41) * radius
    tried = np.array([cost(place) for place in places])
    best = int(tried.argmin())
    if best in (0, len(places) - 1):
        return None
    place = _least(cost, places[best - 1], places[best + 1])
    least = cost(place)
    return middle + place * along, own, float(tried[20]) - least, float(tried.max()) - least


def _least(cost: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function of one minimum between two values is least (golden sections)."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    one, two = high - ratio * (high - low), low + ratio * (high - low)
    first, second = cost(one), cost(two)
    for _ in range(16):
        if first < second:
            high, two, second = two, one, first
            one = high - ratio * (high - low)
            first = cost(one)
        else:
            low, one, first = one, two, second
            two = low + ratio * (high - low)
            second = cost(two)
    return 0.5 * (low + high)
