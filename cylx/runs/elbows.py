"""Elbows: those of all meetings that are supported best, the axes they tell, and pipes as they are between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import canonical_direction
from cylx.records import Elbow
from cylx.runs.bend_evidence import FURTHEST_TURN, FittedBend
from cylx.runs.bend_fit import bend_of
from cylx.runs.bending import NEARBY, fit_meeting, gap_before, is_loose
from cylx.runs.meetings import Meeting, meetings
from cylx.runs.pipes import End, Pipe, Surroundings, axis_change, tilted
from cylx.runs.refitting import OTHER_RADIUS, refit
from cylx.runs.tracing import BY_AXES, Trace, trust

SHORT, LOOSE_OFFSET, LOOSE_TILT = 4.0, 0.1, 0.05
"""The axis of a pipe shorter than so many radii is taken for uncertain by so many radii, and radians."""
AGAIN = 0.2
"""A pipe that lost so many radii of its length to fittings is fitted again without what it lost."""
OTHER_END: dict[End, End] = {"start": "end", "end": "start"}
BETTER = 0.8
"""An axis moves with a fit that leaves it less than this share of its deviations."""


def add_bends(
    trace: Trace, near: Surroundings, only: frozenset[int] | None = None, furthest: float = FURTHEST_TURN
) -> int:
    """Add the elbows between pipes whose axes meet, or `only` those of some pipes; return their number.

    Those that turn by more than `furthest`, in radians, are added only if they are clearly one and not two.
    """
    tried = []
    for meeting in meetings(trace.pipes, trace.closed, only):
        fitted = fit_meeting(meeting, [trace.pipes[i] for i in meeting.pipes], near, furthest)
        if fitted is not None:
            gap = gap_before(fitted, trace.pipes) / fitted.radius
            tried.append(((gap > NEARBY, -fitted.lengthwise, -len(fitted.indices), meeting.pipes), meeting, fitted))
    accepted: list[tuple[Meeting, FittedBend]] = []
    lost: dict[tuple[int, End], float] = {}
    for _, meeting, fitted in sorted(tried, key=lambda one: one[0]):
        losses = _losses(fitted, trace.pipes)
        # what both its ends lose cannot be more than there is of a pipe
        left = (trace.pipes[i].length - loss - lost.get((i, OTHER_END[end]), 0.0) for (i, end), loss in losses.items())
        if not losses.keys() & lost.keys() and min(left) > 0.0:
            lost.update(losses)
            accepted.append((meeting, fitted))
    add_fitted(trace, _together(accepted, trace.pipes, near))
    return len(accepted)


def _losses(one: FittedBend, pipes: list[Pipe]) -> dict[tuple[int, End], float]:
    """Return by how much each of two pipes is shorter with a bend between them: less than 0 if it gets longer."""
    places = one.bend.start, one.bend.end
    return {
        (i, end): float((pipes[i].at(end) - place) @ pipes[i].outward(end))
        for i, end, place in zip(one.pipes, one.ends, places, strict=True)
    }


def add_fitted(trace: Trace, found: list[FittedBend]) -> None:
    """Add elbows, with the axis of each pipe as the fit has it that knows it best; pipes end where elbows begin."""
    before = list(trace.pipes)
    for one in found:
        for k, index in enumerate(one.pipes):
            pipe = with_axis(before[index], one.shifts[k], one.covariances[k])
            known = trace.pipes[index]
            if float(np.trace(pipe.covariance[2:4, 2:4])) < float(np.trace(known.covariance[2:4, 2:4])):
                trace.pipes[index] = pipe
    nothing = np.zeros(8)
    for one in found:
        first, second = (trace.pipes[index] for index in one.pipes)
        bend, _ = bend_of(first, second, (one.ends[0], one.ends[1]), nothing, one.bend.bend_radius)
        _add_bend(trace, replace(one, bend=bend))


def _together(found: list[tuple[Meeting, FittedBend]], pipes: list[Pipe], near: Surroundings) -> list[FittedBend]:
    """Return bends fitted again where a pipe is short between two of them: each knows what the other says of it."""
    said: dict[int, list[tuple[int, Pipe]]] = {}
    for number, (_, fitted) in enumerate(found):
        for k, index in enumerate(fitted.pipes):
            if is_loose(pipes[index]):
                told = moved_axis(pipes[index], fitted.shifts[k], fitted.covariances[k])
                said.setdefault(index, []).append((number, told))
    out = []
    for number, (meeting, fitted) in enumerate(found):
        known = [
            next((pipe for other, pipe in said.get(index, []) if other != number), pipes[index])
            for index in fitted.pipes
        ]
        changed = any(pipe is not pipes[index] for pipe, index in zip(known, fitted.pipes, strict=True))
        again = fit_meeting(meeting, known, near) if changed else None
        if again is None:
            out.append(fitted)
            continue
        # what it says of the pipes is told from where they are now
        shifts = np.array(
            [
                axis_change(pipes[index], pipe, change)
                for index, pipe, change in zip(fitted.pipes, known, again.shifts, strict=True)
            ]
        )
        out.append(replace(again, shifts=shifts))
    return out


def trim(trace: Trace, near: Surroundings) -> list[Pipe]:
    """Return the pipes as they are between the fittings found so far: fitted to the points there, and no others."""
    out = []
    near.unclaim()
    for k, pipe in enumerate(trace.pipes):
        near.release(pipe)
        lost = trace.starts[k].length - pipe.length if k < len(trace.starts) else 0.0
        fitted = refit(pipe, near.points[near.on(pipe)]) if lost > AGAIN * pipe.radius else None
        if fitted is not None and abs(fitted.radius - pipe.radius) > OTHER_RADIUS * pipe.radius:
            fitted = None
        out.append(_loosened(fitted or pipe))
    return out


def _loosened(pipe: Pipe) -> Pipe:
    """Return a pipe that is short with an axis that is hardly known: its ends may be of the fittings beside it."""
    if pipe.length > SHORT * pipe.radius:
        return pipe
    offset, tilt = (LOOSE_OFFSET * pipe.radius) ** 2, LOOSE_TILT**2
    return replace(pipe, covariance=pipe.covariance + np.diag([offset, offset, tilt, tilt, 0.0]))


def _add_bend(trace: Trace, one: FittedBend) -> None:
    """Add an elbow, and let its pipes end where it begins."""
    bend = one.bend
    for index, end, place in zip(one.pipes, one.ends, (bend.start, bend.end), strict=True):
        trace.pipes[index] = trace.pipes[index].with_end(end, place)
    fitting = Elbow(
        joins=one.pipes,
        ends=one.ends,
        confidence=max(BY_AXES, trust(len(one.indices), one.lengthwise, one.inside)),
        inliers=len(one.indices),
        rms=one.rms,
        coverage=one.coverage,
        std=one.std,
        center=bend.center,
        normal=bend.normal,
        bend_radius=bend.bend_radius,
        angle=bend.angle,
        radius=one.radius,
        start=bend.start,
        end=bend.end,
    )
    trace.add(fitting, one.indices)


def with_axis(pipe: Pipe, change: FloatArray, covariance: FloatArray) -> Pipe:
    """Return a pipe after a fit with its neighbour, if the fit knows its axis clearly better than before."""
    if float(np.trace(covariance[2:4, 2:4])) > BETTER**2 * float(np.trace(pipe.covariance[2:4, 2:4])):
        return pipe
    return moved_axis(pipe, change, covariance)


def moved_axis(pipe: Pipe, change: FloatArray, covariance: FloatArray) -> Pipe:
    """Return a pipe with its axis moved by offsets and tilts, and the covariance of these."""
    middle, direction = tilted(pipe, change)
    if float(canonical_direction(direction) @ direction) < 0:  # its ends, and its covariance, go by the sign
        return pipe
    joined = pipe.covariance.copy()
    joined[:4, :4] = covariance
    joined[4, :4] = joined[:4, 4] = 0.0
    half = 0.5 * pipe.length * direction
    return replace(pipe, start=middle - half, end=middle + half, covariance=joined)
