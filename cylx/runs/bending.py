"""Elbows between two pipes whose axes meet: proposed by their axes, fitted to the points between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.lines import common_perpendicular
from cylx.runs.bend import LEAST_TURN, Bend
from cylx.runs.bend_fit import Solved, refined
from cylx.runs.pipes import ENDS, ON_SURFACE, End, Pipe, Surroundings

REACH = 30.0
"""Ends further apart than this many radii are not joined by a bend."""
WIDEST_BEND = 14.0
"""Bends of a greater radius, in radii of the pipe, are bent pipes rather than elbows."""
SAME_RADIUS = 0.12
"""Radii of one pipe differ by less, beside their uncertainty."""
SKEW = 0.25
"""Axes meet if they pass each other within so many radii, beside their uncertainty."""
OVERSHOOT = 1.5
"""Straights may have been found so many radii too long: into the bend."""
LOW_TURN = 0.4
"""And over this, in radii, times the tangent of half the angle: a pipe hardly leaves a bend of a small angle."""
MOST_POINTS = 900
TRIED = 28
"""Bend radii that are tried before the fit."""
LOOSE = 0.02
"""Standard deviation of a tilt from which the axis of a pipe is hardly known, radians."""
SAY = 0.8
"""Share of a pipe whose points say together with those of a bend how its axis lies, if that is hardly known."""
NEARBY = 3.0
"""Bends that begin within so many radii of the ends of their pipes come first."""
SHARPEST = math.radians(100.0)
"""Mitres of a greater angle are none."""
BINS = 8
"""Pieces of the arc, at most, that are asked for points."""
LEAST_INLIERS = 10
LEAST_LENGTHWISE, LEAST_GOOD = 0.5, 0.8
"""Share of the pieces of the arc that must hold more points on it than beside it: of all, of those with points."""
ROUGH = 1.45
"""Points that scatter so many times more than those of the pipes are of no bend."""
MOST_INSIDE = 0.5
"""Points inside the tube, or just beside its surface, for each point on it."""
BESIDE = 0.3
"""Points within so many radii of the surface are just beside it."""


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


@dataclass(frozen=True, slots=True, eq=False)
class FittedBend:
    """A bend that was fitted to points.

    Parameters
    ----------
    pipes, ends
        As of the meeting.
    bend : Bend
    radius : float
        Of the tube.
    indices : ndarray of shape (n,)
        Points on the arc.
    rms : float
    lengthwise : float
        Share of the arc, in pieces, that has points.
    coverage : float
        Share of its surface that has points.
    inside : float
        Points inside the tube for each point on it.
    std : dict of str to float
    shifts : ndarray of shape (2, 4)
        By how much the axes of the pipes move: offsets and tilts.
    covariances : ndarray of shape (2, 4, 4)
        Of the two axes after the fit.
    """

    pipes: tuple[int, int]
    ends: tuple[End, End]
    bend: Bend
    radius: float
    indices: IndexArray
    rms: float
    lengthwise: float
    coverage: float
    inside: float
    std: dict[str, float]
    shifts: FloatArray
    covariances: FloatArray


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
    over = (OVERSHOOT + LOW_TURN / math.tan(0.5 * turn)) * radius
    if min(ahead) < -over or max(ahead) > REACH * radius:
        return None
    return Bend(0.5 * (feet[0] + feet[1]), first, second, 0.0), ahead


def fit_meeting(meeting: Meeting, pipes: Sequence[Pipe], near: Surroundings) -> FittedBend | None:
    """Fit the bend of two ends to the points about it; None if it does not fit.

    Parameters
    ----------
    meeting : Meeting
    pipes : sequence of Pipe
        Those it is of.
    near : Surroundings

    Returns
    -------
    FittedBend or None
    """
    one, two = pipes
    radius, spread = 0.5 * (one.radius + two.radius), max(one.spread, two.spread)
    slope = math.tan(0.5 * meeting.bend.angle)
    room = min(meeting.ahead[0] + 0.9 * one.length, meeting.ahead[1] + 0.9 * two.length)
    most = min(room / slope, WIDEST_BEND * radius)
    if near.cells is None:
        return _by_axes(meeting, one, two, slope)
    if most <= 0:
        return None
    reach = most * slope + 2.0 * radius
    indices = _zone(meeting.bend, reach, most, radius, (one.label, two.label), near)
    if len(indices) < LEAST_INLIERS:
        return None
    some = indices[:: max(1, len(indices) // MOST_POINTS)]
    points = near.points[some]
    tried = np.concatenate([[0.0], np.geomspace(min(0.4 * radius, most), most, TRIED)])
    costs = _costs(meeting.bend, tried, points, radius, spread)
    best = int(costs.argmin())
    fine = np.linspace(tried[max(best - 1, 0)], tried[min(best + 1, TRIED)], 17)
    costs = _costs(meeting.bend, fine, points, radius, spread)
    bend = replace(meeting.bend, bend_radius=float(fine[costs.argmin()]))
    _, distances = bend.coordinates(points)
    about = points[np.abs(distances - radius) < max(0.3 * radius, 2.0 * ON_SURFACE * spread)]
    says = SAY * one.length if is_loose(one) else 0.0, SAY * two.length if is_loose(two) else 0.0
    solved = refined(bend, one, two, radius, about, spread, says=says)
    found = judged(meeting.pipes, meeting.ends, solved, indices, near, spread)
    return None if found is None or _is_across(found, one, two, near) else found


def _is_across(found: FittedBend, one: Pipe, two: Pipe, near: Surroundings) -> bool:
    """Return whether other pipes are between the ends of two pipes and their bend, or it turns back with no radius."""
    if found.bend.bend_radius < 0.2 * found.radius and found.bend.angle > SHARPEST:
        return True
    for pipe, end, place in ((one, found.ends[0], found.bend.start), (two, found.ends[1], found.bend.end)):
        axis = pipe.outward(end)
        gap = float((place - pipe.at(end)) @ axis)
        if gap > NEARBY * pipe.radius:
            reach = ON_SURFACE * pipe.spread
            inner = max(0.0, pipe.radius - reach)
            tube = near.about(
                pipe.at(end), axis, 0.5 * pipe.radius, gap - 0.5 * pipe.radius, pipe.radius + reach, inner
            )
            foreign = ~near.free(tube, (one.label, two.label))
            if foreign.sum() > 0.5 * len(tube):
                return True
    return False


def is_loose(pipe: Pipe) -> bool:
    """Return whether the axis of a pipe is so uncertain that the points of a bend have to tell it."""
    return float(np.trace(pipe.covariance[2:4, 2:4])) > LOOSE**2


def gap_before(one: FittedBend, pipes: Sequence[Pipe]) -> float:
    """Return how far the ends of two pipes are from the bend between them, together."""
    places = one.bend.start, one.bend.end
    gaps = (
        float((place - pipes[i].at(end)) @ pipes[i].outward(end))
        for i, end, place in zip(one.pipes, one.ends, places, strict=True)
    )
    return sum(max(gap, 0.0) for gap in gaps)


def _by_axes(meeting: Meeting, one: Pipe, two: Pipe, slope: float) -> FittedBend | None:
    """Return the bend that begins at the nearer of two ends: all that is known without points."""
    radius = 0.5 * (one.radius + two.radius)
    bend_radius = max(min(meeting.ahead), 0.0) / slope
    if bend_radius > WIDEST_BEND * radius:
        return None
    bend, none = replace(meeting.bend, bend_radius=bend_radius), np.empty(0, np.int64)
    known = np.stack([pipe.covariance[:4, :4] for pipe in (one, two)])
    return FittedBend(meeting.pipes, meeting.ends, bend, radius, none, 0.0, 0.0, 0.0, 0.0, {}, np.zeros((2, 4)), known)


def _zone(bend: Bend, reach: float, most: float, radius: float, own: tuple[int, int], near: Surroundings) -> IndexArray:
    """Return the free points about all arcs of radii up to `most`."""
    deep = most * (1.0 / math.cos(0.5 * bend.angle) - 1.0) if bend.angle < math.pi - 0.2 else most
    outer = 1.8 * radius
    first = near.about(bend.meeting, bend.first, -reach, outer, outer)
    second = near.about(bend.meeting, bend.second, -outer, reach, outer)
    parts = [first, second]
    if deep > 0.2 * radius:
        inward = bend.second - bend.first
        inward /= np.linalg.norm(inward)
        wide = min(reach, 0.5 * bend.angle * most + radius)
        middle = bend.meeting + 0.5 * deep * inward
        parts.append(near.about(middle, bend.normal, -outer, outer, math.hypot(0.5 * deep + outer, wide)))
    indices = np.unique(np.concatenate(parts))
    return indices[near.free(indices, own)]


def _costs(bend: Bend, radii: FloatArray, points: FloatArray, radius: float, spread: float) -> FloatArray:
    """Return how badly bends of several radii explain points that some of them explain."""
    width = ON_SURFACE * spread
    squares = np.empty((len(radii), len(points)))
    for k, bend_radius in enumerate(radii):
        _, distances = replace(bend, bend_radius=float(bend_radius)).coordinates(points)
        squares[k] = np.minimum(((distances - radius) / width) ** 2, 1.0)
    # a larger bend is shorter, so that costs count all points that are on any of them
    return np.asarray(squares[:, (squares < 1.0).any(axis=0)].sum(axis=1))


def judged(
    pipes: tuple[int, int],
    ends: tuple[End, End],
    solved: Solved,
    indices: IndexArray,
    near: Surroundings,
    spread: float,
) -> FittedBend | None:
    """Return a fitted bend with its evidence; None if the points do not show it."""
    bend, radius = solved.bend, solved.radius
    if bend.bend_radius > 1.1 * WIDEST_BEND * radius:
        return None
    along, distances = bend.coordinates(near.points[indices])
    errors = distances - radius
    width = ON_SURFACE * spread + 0.01 * radius
    # of a mitre, the points about the corner
    margin = max(0.0, 0.5 * radius * math.tan(0.5 * bend.angle) - 0.5 * bend.length)
    on_arc = (along > -margin) & (along < bend.length + margin)
    inside = on_arc & (errors < -width - 0.1 * radius)
    own = on_arc & (np.abs(errors) < width)
    count = int(own.sum())
    beside = on_arc & (np.abs(errors) >= width) & (np.abs(errors) < max(BESIDE * radius, 2.0 * width))
    if count < LEAST_INLIERS or inside.sum() > MOST_INSIDE * count or beside.sum() > MOST_INSIDE * count:
        return None
    pieces = int(np.clip((bend.length + 2.0 * margin) / max(2.0 * near.spacing, 1e-12), 1, BINS))
    rows = np.clip(((along + margin) / (bend.length + 2.0 * margin) * pieces).astype(np.int64), 0, pieces - 1)
    on_it, off_it = (np.bincount(rows[which], minlength=pieces) for which in (own, inside | beside))
    # a bend that is two shows in pieces whose points are beside it
    good, filled = on_it > off_it, on_it + off_it > 0
    lengthwise = float(good.mean())
    one_bend = good.sum() >= LEAST_GOOD * filled.sum()
    rms = float(np.sqrt((errors[own] ** 2).mean()))
    if not one_bend or lengthwise < LEAST_LENGTHWISE or rms > ROUGH * math.hypot(spread, 0.005 * radius):
        return None
    coverage = _covered(bend, near.points[indices[own]], rows[own]) / (12.0 * pieces)
    turn = solved.covariance[2:4, 2:4] + solved.covariance[6:8, 6:8]
    std = {
        "bend_radius": math.sqrt(max(solved.covariance[9, 9], 0.0)),
        "angle_deg": math.degrees(math.sqrt(max(0.5 * np.trace(turn), 0.0))),
        "radius": math.sqrt(max(solved.covariance[8, 8], 0.0)),
    }
    return FittedBend(
        pipes,
        ends,
        bend,
        radius,
        indices[own],
        rms,
        lengthwise,
        coverage,
        float(inside.sum()) / count,
        std,
        solved.change.reshape(2, 4),
        np.stack([solved.covariance[:4, :4], solved.covariance[4:8, 4:8]]),
    )


def _covered(bend: Bend, points: FloatArray, rows: IndexArray) -> int:
    """Return how many cells of the surface of a bend hold points: each of its pieces has twelve about the tube."""
    radial = points - (bend.meeting if bend.bend_radius == 0 else bend.center)
    # angle about the tube: from the outside of the bend
    high = radial @ bend.normal
    out = np.hypot(radial @ bend.first, radial @ bend.inward) - bend.bend_radius
    sector = np.floor((np.arctan2(high, out) / (2 * math.pi) + 0.5) * 12).astype(np.int64) % 12
    return len(np.unique(rows * 12 + sector))
