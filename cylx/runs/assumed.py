"""Bends that nothing is seen of: two open ends whose axes meet as far ahead of the one as of the other."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import Joint
from cylx.runs.bend import Bend
from cylx.runs.bend_evidence import WIDEST_BEND
from cylx.runs.meetings import Meeting, meetings
from cylx.runs.pipes import ON_SURFACE, End, Pipe, Surroundings
from cylx.runs.tracing import Trace

UNEQUAL = 0.15
"""An arc touches both axes as far from where they meet, within so many radii, beside how well each end is known."""
PASSING = 0.1
"""Axes pass each other within so many radii, beside their uncertainty."""
FOREIGN = 0.1
"""More points inside the tube, of those that its surface would have if all of it were seen, say it is not there."""
DENSE = 3.0
"""An end is known to so many mean distances of the points along its pipe."""
MOST, SHARE = 0.75, 2.0
"""Confidence of one that fits exactly, and how often as far off the next best of an end must be."""


def add_assumed(trace: Trace, near: Surroundings) -> int:
    """Bridge open ends by a bend that is hidden or missing, where no other end is in question; return their number.

    Without points there is nothing to tell where a pipe really ends, and elbows are those that the axes tell.

    Parameters
    ----------
    trace : Trace
        Gets a `Joint` for each.
    near : Surroundings
    """
    if near.cells is None:
        return 0
    spacings = [mean_distance(pipe, near) for pipe in trace.pipes]
    tried = []
    for meeting in meetings(trace.pipes, trace.closed):
        off = _misfit(meeting, trace.pipes, spacings)
        if off is not None:
            tried.append((off, meeting))
    tried.sort(key=lambda one: (one[0], one[1].pipes))
    count = 0
    for off, meeting in tried:
        keys = set(zip(meeting.pipes, meeting.ends, strict=True))
        rivals = [
            other for other, one in tried if one is not meeting and keys & set(zip(one.pipes, one.ends, strict=True))
        ]
        if off > 1.0 or not trace.is_free(keys) or any(other < SHARE * max(off, 0.25) for other in rivals):
            continue
        first, second = (trace.pipes[k] for k in meeting.pipes)
        bend = Bend(meeting.bend.meeting, meeting.bend.first, meeting.bend.second, _bend_radius(meeting))
        if not _is_empty(bend, first, second, near):
            continue
        trace.add(
            Joint(
                joins=meeting.pipes,
                ends=meeting.ends,
                confidence=MOST / (1.0 + off**2),
                start=first.at(meeting.ends[0]),
                end=second.at(meeting.ends[1]),
                length=bend.length,
                assumed=True,
            ),
            np.empty(0, np.int64),
        )
        count += 1
    return count


def mean_distance(pipe: Pipe, near: Surroundings) -> float:
    """Return the mean distance of the points of a pipe along its axis: so well its ends are known."""
    return pipe.length / max(len(near.on(pipe)), 1)


def _bend_radius(meeting: Meeting) -> float:
    return max(0.5 * sum(meeting.ahead), 0.0) / math.tan(0.5 * meeting.bend.angle)


def _misfit(meeting: Meeting, pipes: list[Pipe], spacings: list[float]) -> float | None:
    """Return how far two ends are from those of one arc, in what is allowed; None if they cannot be."""
    (one, two), ends = (pipes[k] for k in meeting.pipes), meeting.ends
    radius = min(one.radius, two.radius)
    if min(meeting.ahead) < -radius or _bend_radius(meeting) > WIDEST_BEND * radius:
        return None
    sure = DENSE * math.hypot(*(spacings[k] for k in meeting.pipes))
    unequal = abs(meeting.ahead[0] - meeting.ahead[1]) / (UNEQUAL * radius + sure)
    skew = _skew(meeting, one, two, ends)
    deviation = math.hypot(one.axis_deviation(meeting.bend.meeting), two.axis_deviation(meeting.bend.meeting))
    return max(unequal, skew / (PASSING * radius + ON_SURFACE * deviation))


def _skew(meeting: Meeting, one: Pipe, two: Pipe, ends: tuple[End, End]) -> float:
    """Return by how much two axes pass each other."""
    normal: FloatArray = meeting.bend.normal
    return abs(float((two.at(ends[1]) - one.at(ends[0])) @ normal))


def _is_empty(bend: Bend, one: Pipe, two: Pipe, near: Surroundings) -> bool:
    """Return whether there are hardly any points within the tube of a bend: something else may be there."""
    radius = 0.5 * (one.radius + two.radius)
    reach = 0.5 * float(np.linalg.norm(bend.end - bend.start)) + radius
    middle = 0.5 * (bend.start + bend.end)
    indices = near.about(middle, bend.normal, -radius, radius, reach)
    along, distances = bend.coordinates(near.points[indices])
    inside = (along > 0.0) & (along < bend.length) & (distances < 0.8 * radius)
    usual = max(near.density(one), near.density(two)) * 2.0 * math.pi * radius * max(bend.length, radius)
    return bool(inside.sum() <= max(2.0, FOREIGN * usual))
