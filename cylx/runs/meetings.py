"""Ends of pipes whose axes meet ahead of them: a bend may be between them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cylx.geometry.lines import common_perpendicular
from cylx.runs.bend import LEAST_TURN, Bend
from cylx.runs.pipes import ENDS, ON_SURFACE, End, Pipe

REACH = 30.0
"""Ends further apart than this many radii are not joined by a bend."""
SAME_RADIUS = 0.12
"""Radii of one pipe differ by less, beside their uncertainty."""
SKEW = 0.25
"""Axes meet if they pass each other within so many radii, beside their uncertainty."""
OVERSHOOT = 1.5
"""Straights may have been found so many radii too long: into the bend."""
LOW_TURN = 0.4
"""And over this, in radii, times the tangent of half the angle: a pipe hardly leaves a bend of a small angle."""

COMMON = 0.5
"""Straights may end so many radii beyond the last point that is on both of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Meeting:
    """Two ends whose axes meet.

    Parameters
    ----------
    pipes : tuple of int
    ends : tuple of {'start', 'end'}
    bend : Bend
        From the first pipe into the second, with no radius yet.
    ahead : tuple of float
        How far ahead of each end the axes meet; negative behind it.
    """

    pipes: tuple[int, int]
    ends: tuple[End, End]
    bend: Bend
    ahead: tuple[float, float]


def meetings(pipes: list[Pipe], taken: set[tuple[int, End]], only: frozenset[int] | None = None) -> Iterator[Meeting]:
    """Yield the pairs of free ends whose axes meet ahead of them, at an angle.

    Parameters
    ----------
    pipes : list of Pipe
    taken : set of (int, {'start', 'end'})
        Ends that have a fitting already.
    only : frozenset of int, optional
        Pipes of which each pair has one at least; by default any.
    """
    keys = [(i, end) for i in range(len(pipes)) for end in ENDS if (i, end) not in taken]
    if len(keys) < 2:
        return
    places = np.array([pipes[i].at(end) for i, end in keys])
    radii = np.array([pipes[i].radius for i, _ in keys])
    sd = np.array([math.sqrt(max(pipes[i].covariance[4, 4], 0.0)) for i, _ in keys])
    owners = np.array([i for i, _ in keys])
    for a, (i, end) in enumerate(keys):
        smaller = np.minimum(radii, radii[a])
        near = np.linalg.norm(places - places[a], axis=1) < REACH * smaller
        alike = np.abs(radii - radii[a]) < SAME_RADIUS * smaller + ON_SURFACE * np.hypot(sd, sd[a])
        wanted = owners > i
        if only is not None and i not in only:
            wanted &= np.isin(owners, list(only))
        for b in np.flatnonzero(near & alike & wanted):
            other = keys[int(b)]
            found = _meeting(pipes[i], end, pipes[other[0]], other[1])
            if found is not None:
                yield Meeting((i, other[0]), (end, other[1]), *found)


def _meeting(one: Pipe, end: End, two: Pipe, other: End) -> tuple[Bend, tuple[float, float]] | None:
    """Return the bend, without a radius, of two ends whose axes meet ahead of them."""
    first, second = one.outward(end), -two.outward(other)
    turn = math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))
    if not LEAST_TURN < turn < math.pi - LEAST_TURN:
        return None
    feet = common_perpendicular(one.at(end), first, two.at(other), second)[:2]
    radius = min(one.radius, two.radius)
    uncertain = math.hypot(one.axis_deviation(feet[0]), two.axis_deviation(feet[1]))
    if float(np.linalg.norm(feet[0] - feet[1])) > SKEW * radius + ON_SURFACE * uncertain:
        return None
    ahead = float((feet[0] - one.at(end)) @ first), float((two.at(other) - feet[1]) @ second)
    # two tubes of one size have points in common up to a radius over the tangent of half the angle behind the corner
    over = max(OVERSHOOT + LOW_TURN / math.tan(0.5 * turn), COMMON + 1.0 / math.tan(0.5 * turn)) * radius
    if min(ahead) < -over or max(ahead) > REACH * radius:
        return None
    return Bend(0.5 * (feet[0] + feet[1]), first, second, 0.0), ahead
