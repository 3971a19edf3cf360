"""Which of the proposed fittings are there: each end of a pipe has one at most, the best supported first."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import canonical_direction
from cylx.records import Cap, Cross, Elbow, Fitting, Flange, Inline, Joint, Junction, Reducer
from cylx.runs.bend_fit import bend_of
from cylx.runs.bending import NEARBY, FittedBend, Meeting, fit_meeting, gap_before, is_loose, meetings
from cylx.runs.collars import Collar, collars_of
from cylx.runs.crossings import equal_crossings
from cylx.runs.facing import Facing, FittedCone, facing_ends, fit_reducer
from cylx.runs.junctions import Branching, branchings
from cylx.runs.pieces import OTHER_RADIUS, refit
from cylx.runs.pipes import ENDS, End, Pipe, Surroundings, axis_change, tilted
from cylx.runs.wider import wider_ones

THROUGH = 0.9
"""Confidence of a cross of two pipes of one radius that go through each other."""
CROSSING = 0.5
"""Branches that face each other meet the main within so many of its radii of each other."""
SHORT, LOOSE_OFFSET, LOOSE_TILT = 4.0, 0.1, 0.05
"""The axis of a pipe shorter than so many radii is taken for uncertain by so many radii, and radians."""
AGAIN = 0.2
"""A pipe that lost so many radii of its length to fittings is fitted again without what it lost."""
BY_AXES = 0.5
"""Confidence of a fitting that nothing but the axes tells."""
BETTER = 0.8
"""An axis moves with a fit that leaves it less than this share of its deviations."""


@dataclass(slots=True)
class Trace:
    """The pipes and fittings found so far.

    Parameters
    ----------
    pipes : list of Pipe
    near : Surroundings
    fittings : list of Fitting
        Their `joins` are indices of pipes.
    points : list of ndarray
        Indices of the points of each fitting.
    taken : dict of (int, {'start', 'end'}) to int
        Fitting at each end that has one.
    followed : set of (int, {'start', 'end'})
        Ends that were followed onward.
    starts : list of Pipe
        The pipes before any fitting was found.
    others : frozenset of int
        Cylinders that are no pipes: bores, and what is too rough.
    aside : set of int
        These, and the rims and covers of pipes.
    """

    pipes: list[Pipe]
    near: Surroundings
    fittings: list[Fitting] = field(default_factory=list)
    points: list[IndexArray] = field(default_factory=list)
    taken: dict[tuple[int, End], int] = field(default_factory=dict)
    followed: set[tuple[int, End]] = field(default_factory=set)
    starts: list[Pipe] = field(init=False)

    others: frozenset[int] = frozenset()
    aside: set[int] = field(init=False)

    def __post_init__(self) -> None:
        self.starts, self.aside = list(self.pipes), wider_ones(self.pipes) | self.others

    @property
    def closed(self) -> set[tuple[int, End]]:
        """Ends that have a fitting already, and those of cylinders that are no pipes."""
        return set(self.taken) | {(k, end) for k in self.aside for end in ENDS}

    def add(self, fitting: Fitting, points: IndexArray) -> None:
        """Add a fitting; the ends it joins are taken."""
        for pipe, end in zip(fitting.joins, fitting.ends, strict=True):
            if end != "side":
                self.taken[pipe, end] = len(self.fittings)
        self.fittings.append(fitting)
        self.points.append(points)
        self.near.label(points)

    def is_free(self, keys: Iterable[tuple[int, End]]) -> bool:
        """Return whether ends have no fitting yet."""
        return not any(key in self.taken for key in keys)


def trust(inliers: int, lengthwise: float, wrong: float = 0.0) -> float:
    """Return the confidence of a fitting: by its points, the share of its length they cover, and points against it."""
    return float(np.clip((1.0 - np.exp(-inliers / 10.0)) * (0.4 + 0.6 * lengthwise) * (1.0 - 0.5 * wrong), 0.0, 0.99))


def add_bends(trace: Trace, near: Surroundings, only: frozenset[int] | None = None) -> int:
    """Add the elbows between pipes whose axes meet, or `only` those of some pipes; return their number."""
    tried = []
    for meeting in meetings(trace.pipes, trace.closed, only):
        fitted = fit_meeting(meeting, [trace.pipes[i] for i in meeting.pipes], near)
        if fitted is not None:
            gap = gap_before(fitted, trace.pipes) / fitted.radius
            tried.append(((gap > NEARBY, -fitted.lengthwise, -len(fitted.indices), meeting.pipes), meeting, fitted))
    accepted: list[tuple[Meeting, FittedBend]] = []
    ends: set[tuple[int, End]] = set()
    for _, meeting, fitted in sorted(tried, key=lambda one: one[0]):
        keys = set(zip(fitted.pipes, fitted.ends, strict=True))
        if not keys & ends:
            ends |= keys
            accepted.append((meeting, fitted))
    add_fitted(trace, _together(accepted, trace.pipes, near))
    return len(accepted)


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
        confidence=trust(len(one.indices), one.lengthwise, one.inside) if len(one.indices) else BY_AXES,
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


def add_reducers(trace: Trace, near: Surroundings) -> int:
    """Add the reducers between ends of different radius that face each other; return their number."""
    pairs = (one for one in facing_ends(trace.pipes, trace.closed) if not one.same_size)
    tried = (fit_reducer(one, trace.pipes, near) for one in pairs)
    found = sorted((one for one in tried if one is not None), key=lambda one: (one.facing.gap, -len(one.indices)))
    count = 0
    for one in found:
        if trace.is_free(zip(one.facing.pipes, one.facing.ends, strict=True)):
            _add_reducer(trace, one)
            count += 1
    return count


def _add_reducer(trace: Trace, one: FittedCone) -> None:
    """Add a reducer, and let its pipes end where it begins."""
    facing = one.facing
    for index, end, place in zip(facing.pipes, facing.ends, (one.start, one.end), strict=True):
        trace.pipes[index] = trace.pipes[index].with_end(end, place)
    first, second = (trace.pipes[i] for i in facing.pipes)
    fitting = Reducer(
        joins=facing.pipes,
        ends=facing.ends,
        confidence=trust(len(one.indices), one.lengthwise) if len(one.indices) else BY_AXES,
        inliers=len(one.indices),
        rms=one.rms,
        coverage=one.coverage,
        std=one.std,
        start=one.start,
        end=one.end,
        start_radius=first.radius,
        end_radius=second.radius,
        offset=facing.offset,
        concentric=facing.offset < max(0.4 * abs(first.radius - second.radius), 2.0 * one.std.get("offset", 0.0)),
    )
    trace.add(fitting, one.indices)


def add_junctions(trace: Trace, near: Surroundings) -> int:
    """Add the tees and crosses; return their number."""
    found = list(branchings(trace.pipes, trace.closed, trace.aside, near))
    used: set[int] = set()
    count = 0
    for k, one in enumerate(found):
        if k in used:
            continue
        group = [one]
        for m in range(k + 1, len(found)):
            other = found[m]
            apart = float(np.linalg.norm(other.center - one.center))
            against = trace.pipes[one.branch].outward(one.end) @ trace.pipes[other.branch].outward(other.end)
            if (
                m not in used
                and other.main == one.main
                and apart < CROSSING * trace.pipes[one.main].radius
                and against < -0.9
            ):
                group.append(other)
                used.add(m)
                break
        _add_junction(trace, group, near)
        count += 1
    known = {frozenset(one.joins) for one in trace.fittings if isinstance(one, Junction)}
    for main, branch, center, sine in equal_crossings(trace.pipes, trace.aside):
        if frozenset((main, branch)) not in known:
            cross = Cross(
                joins=(main, branch),
                ends=("side", "side"),
                confidence=THROUGH,
                center=center,
                main=(main,),
                branches=(branch,),
                angle=math.asin(min(sine, 1.0)),
            )
            trace.add(cross, np.empty(0, np.int64))
            count += 1
    return count


def _add_junction(trace: Trace, group: list[Branching], near: Surroundings) -> None:
    """Add a tee, or a cross of two branchings."""
    first = group[0]
    branches = tuple(one.branch for one in group)
    contact = 1.0 / (1.0 + max(0.0, first.gap / trace.pipes[first.branch].radius - 1.0))
    kind = Junction if len(group) == 1 else Cross
    fitting = kind(
        joins=(first.main, *branches),
        ends=("side", *(one.end for one in group)),
        confidence=0.6 + 0.35 * contact,
        center=first.center,
        main=(first.main,),
        branches=branches,
        angle=first.angle,
        std=first.std,
    )
    trace.add(fitting, np.empty(0, np.int64))


def add_collars(trace: Trace, near: Surroundings) -> int:
    """Add the flanges on pipes, and what is between them; return their number."""
    count = 0
    for index in range(len(trace.pipes)):
        if index in trace.aside:
            continue
        shut = (index, "start") in trace.taken, (index, "end") in trace.taken
        for collar in collars_of(index, trace.pipes, near, shut):
            _add_collar(trace, index, collar)
            count += 1
    return count


def _add_collar(trace: Trace, index: int, collar: Collar) -> None:
    pipe = trace.pipes[index]
    if collar.kind == "flange":
        trace.add(
            Flange(
                joins=(index,),
                ends=(collar.where,),
                confidence=collar.confidence,
                inliers=len(collar.indices),
                rms=collar.rms,
                coverage=collar.coverage,
                std=collar.std,
                center=collar.center,
                axis=pipe.direction,
                radius=collar.radius,
                thickness=collar.thickness,
                pair=collar.pair,
            ),
            collar.indices,
        )
        return
    half = 0.5 * collar.thickness * pipe.direction
    trace.add(
        Inline(
            joins=(index,),
            ends=("side",),
            confidence=collar.confidence,
            inliers=len(collar.indices),
            coverage=collar.coverage,
            start=collar.center - half,
            end=collar.center + half,
        ),
        collar.indices,
    )


def add_gaps(trace: Trace, near: Surroundings) -> int:
    """Add what bridges gaps between ends of one size; return their number."""
    pairs = sorted(
        (one for one in facing_ends(trace.pipes, trace.closed) if one.same_size), key=lambda one: abs(one.gap)
    )
    count = 0
    for one in pairs:
        if trace.is_free(zip(one.pipes, one.ends, strict=True)):
            _add_gap(trace, one, near)
            count += 1
    return count


def _add_gap(trace: Trace, one: Facing, near: Surroundings) -> None:
    first, second = (trace.pipes[i] for i in one.pipes)
    start, end = first.at(one.ends[0]), second.at(one.ends[1])
    radius, axis = first.radius, first.outward(one.ends[0])
    inner = near.about(start, axis, 0.1 * one.gap, 0.9 * one.gap, 3.0 * radius, 1.2 * radius)
    inner = inner[near.free(inner)]
    tube = near.about(start, axis, 0.0, max(one.gap, 0.0), 1.1 * radius, 0.9 * radius)
    if len(inner) > 0.5 * near.density(first) * 2 * np.pi * radius * max(one.gap, 0.0) and len(inner) > 20:
        fitting: Fitting = Inline(
            joins=one.pipes, ends=one.ends, confidence=0.6, inliers=len(inner), start=start, end=end
        )
        trace.add(fitting, inner)
        return
    fitting = Joint(
        joins=one.pipes,
        ends=one.ends,
        confidence=0.5 + 0.4 / (1.0 + max(one.gap, 0.0) / (4.0 * radius)),
        start=start,
        end=end,
        length=float(np.linalg.norm(end - start)),
        assumed=len(tube) < 10 and one.gap > radius,
    )
    trace.add(fitting, np.empty(0, np.int64))


def add_caps(trace: Trace, near: Surroundings) -> int:
    """Add the caps of ends that nothing joins; return their number."""
    from cylx.runs.caps import fit_cap  # noqa: PLC0415

    count = 0
    for index, pipe in enumerate(trace.pipes):
        for end in ENDS:
            if (index, end) in trace.closed:
                continue
            cap = fit_cap(pipe, end, near)
            if cap is not None:
                fitting = Cap(
                    joins=(index,),
                    ends=(end,),
                    confidence=trust(len(cap.indices), cap.coverage),
                    inliers=len(cap.indices),
                    rms=cap.rms,
                    coverage=cap.coverage,
                    std={"center": cap.std},
                    center=cap.center,
                    axis=pipe.outward(end),
                    radius=pipe.radius,
                )
                trace.add(fitting, cap.indices)
                count += 1
    return count
