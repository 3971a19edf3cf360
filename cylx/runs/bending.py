"""Elbows between two pipes whose axes meet: proposed by their axes, fitted to the points between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.runs.bend import Bend
from cylx.runs.bend_evidence import FURTHEST_TURN, LEAST_INLIERS, WIDEST_BEND, FittedBend, judged
from cylx.runs.bend_fit import refined
from cylx.runs.meetings import Meeting
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings
from cylx.runs.trials import fill_radius_costs

MOST_POINTS, FEW_POINTS = 900, 300
"""Points in a fit, and in the trials before it."""
TRIED = 28
"""Bend radii that are tried before the fit."""
LOOSE = 0.02
"""Standard deviation of a tilt from which the axis of a pipe is hardly known, radians."""
SAY = 0.8
"""Share of a pipe whose points say together with those of a bend how its axis lies, if that is hardly known."""
SHORTEST = 1.5
"""Points of so many radii of the centre line, at least, tell a bend between known pipes: also those of the pipes."""
NEARBY = 3.0
"""Bends that begin within so many radii of the ends of their pipes come first."""
SHARPEST = math.radians(100.0)
"""Mitres of a greater angle are none."""


def fit_meeting(
    meeting: Meeting, pipes: Sequence[Pipe], near: Surroundings, furthest: float = FURTHEST_TURN
) -> FittedBend | None:
    """Fit the bend of two ends to the points about it; None if it does not fit.

    Parameters
    ----------
    meeting : Meeting
    pipes : sequence of Pipe
        Those it is of.
    near : Surroundings
    furthest : float
        If it turns by more, in radians, its surface is that of a torus.

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
    few = points[:: max(1, len(points) // FEW_POINTS)]
    costs = _costs(meeting.bend, tried, few, radius, spread)
    best = int(costs.argmin())
    fine = np.linspace(tried[max(best - 1, 0)], tried[min(best + 1, TRIED)], 17)
    costs = _costs(meeting.bend, fine, few, radius, spread)
    bend = replace(meeting.bend, bend_radius=float(fine[costs.argmin()]))
    _, distances = bend.coordinates(points)
    about = points[np.abs(distances - radius) < max(0.3 * radius, 2.0 * ON_SURFACE * spread)]
    says = SAY * one.length if is_loose(one) else 0.0, SAY * two.length if is_loose(two) else 0.0
    solved = refined(bend, one, two, radius, about, spread, says=says)
    found = judged(meeting.pipes, meeting.ends, solved, indices, near, spread, SHORTEST, furthest)
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
    corner = np.stack([bend.meeting, bend.first, bend.second, bend.normal, bend.inward])
    costs = np.empty(len(radii))
    # a larger bend is shorter, so that costs count all points that are on any of them
    fill_radius_costs(points, corner, bend.angle, radii, radius, ON_SURFACE * spread, costs)
    return costs
