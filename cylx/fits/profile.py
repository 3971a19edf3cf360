"""The profile of a rounded edge: two lines and the arc that touches both, fitted as one.

Near an end of the arc the line that it goes on into is within the noise of it. A circle fitted to what looks like the
arc takes points of the lines, and comes out too large. Here the circle and the directions of its two tangents are
fitted at once to all points, each point to what is nearest: five unknowns, whatever the lines enclose, a slot's half
turn included, and robustly, as other surfaces come near.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.fits.profile_sums import CENTER_Y, FIRST, LAST, OWN, explained, is_straight, lean, seen, settle
from cylx.geometry.arrays import FloatArray
from cylx.geometry.numerics import solve_in_place

LEAST_ON_LINE, LEAST_ON_ARC = 12, 12
"""Points of a line and of the arc."""
LINE_LENGTHS = 0.4, 0.55, 0.75, 1.0, 1.4, 2.0, 3.0
"""The lines count up to so many radii of the first circle past where they touch the arc: as far as they go on so."""
LAST_TO_START, TELLING = 4, 2.0
"""Lines are first this short, as far as they have points and are longer, in radii, than so many roots of the deviation
in radii: on less of it a bend is not seen."""
FIRST_LENGTH = 1.0
"""The same while it is looked for where to set out from."""
OPENINGS = np.radians([45.0, 70.0, 100.0, 140.0, 180.0])
"""Angles of the arc from which the fit sets out."""
ALIKE = 1.2
"""Fits whose points scatter up to this factor more than those of the best one may be better, as they have more."""
ENOUGH_TO_START = 600
"""Points that suffice to choose where to set out from."""


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
        How much smaller the sum of squared residuals is than that of the first circle between the same directions, and
        than that of the lines alone, which meet in an edge or go on, in squared deviations.
    chi_square : float
        Mean square of the residuals of what lies about the arc, in squared deviations, clipped.
    reaches : ndarray of shape (2,)
        Length of the lines at the first and the last end of the arc.
    """

    center: FloatArray
    radius: float
    middle: float
    opening: float
    gain: float
    edge_gain: float
    chi_square: float
    reaches: FloatArray


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
    some = np.ascontiguousarray(local[:: 1 + len(local) // ENOUGH_TO_START])
    reaches = np.full(2, FIRST_LENGTH * radius)
    starts = []
    for opening in OPENINGS:
        started = np.array([0.0, 0.0, radius, -0.5 * opening, 0.5 * opening])
        if settle(some, started, radius, reaches, deviation):
            starts.append((*explained(some, started, reaches, deviation), started))
    closest = min((scatter for _, scatter, _ in starts), default=0.0)
    # a circle too large may pass by more points, and scatters more
    alike = [(cost, started) for cost, scatter, started in starts if scatter <= ALIKE * closest]
    best = min(alike, key=lambda one: one[0], default=(0.0, None))[1]
    if best is None or not _grow(local, best, radius, reaches, deviation):
        return None
    upper, lower, on_arc, about, squares, edge = seen(local, best, reaches, deviation)
    if min(upper, lower) < LEAST_ON_LINE or min(on_arc, about) < LEAST_ON_ARC:
        return None
    least, _ = explained(local, best, reaches, deviation)
    first = np.array([0.0, 0.0, radius, best[FIRST], best[LAST]])
    gain = explained(local, first, reaches, deviation)[0] - least
    center = best[: CENTER_Y + 1] @ turn
    rotation, opening = 0.5 * (best[FIRST] + best[LAST]), 0.5 * (best[LAST] - best[FIRST])
    return Profile(
        center, float(best[OWN]), middle + float(rotation), float(opening), gain, edge, squares / about, reaches
    )


def _grow(local: FloatArray, profile: FloatArray, radius: float, reaches: FloatArray, deviation: float) -> bool:
    """Fit a profile in place, its lines as long as they are straight; return whether it is one."""
    least = TELLING * math.sqrt(deviation / radius)
    start = profile.copy()
    for first, shortest in enumerate(LINE_LENGTHS[:LAST_TO_START]):
        if shortest < least and first + 1 < LAST_TO_START:
            continue
        profile[:], reaches[:] = start, shortest * radius
        if settle(local, profile, radius, reaches, deviation) and _has_lines(local, profile, reaches, deviation):
            break
    else:
        return False
    goes_on = [True, True]
    for length in LINE_LENGTHS[first + 1 :]:
        further = length * radius
        for side in (0, 1):
            goes_on[side] &= is_straight(local, profile, side, reaches[side], further, deviation)
            if goes_on[side]:
                reaches[side] = further
        if not any(goes_on):
            break
        if not settle(local, profile, radius, reaches, deviation):
            return False
    return True


def _has_lines(local: FloatArray, profile: FloatArray, reaches: FloatArray, deviation: float) -> bool:
    """Return whether there are enough points on both lines clear of the arc."""
    upper, lower, *_ = seen(local, profile, reaches, deviation)
    return min(upper, lower) >= LEAST_ON_LINE


def tilt_of(points: FloatArray, heights: FloatArray, profile: Profile, deviation: float) -> FloatArray:
    """Return how much the axis leans against the points of a profile, in its plane, per unit of height.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
    heights : ndarray of shape (n,)
        Along the axis, from the middle.
    profile : Profile
    deviation : float
        Standard deviation of the points about the profile.

    Returns
    -------
    ndarray of shape (2,)
        Zero if the points do not tell.
    """
    own = np.array(
        [*profile.center, profile.radius, profile.middle - profile.opening, profile.middle + profile.opening]
    )
    matrix, right = np.zeros((2, 2)), np.zeros(2)
    lean(np.ascontiguousarray(points), heights, own, profile.reaches, deviation, matrix, right)
    return right if solve_in_place(matrix, right) else np.zeros(2)
