"""All other fittings: which of the proposed ones are there, the best supported first."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import Cap, Cross, Fitting, Flange, Inline, Joint, Junction, Reducer
from cylx.runs.caps import fit_cap
from cylx.runs.collars import LONGEST_INLINE, collars_of
from cylx.runs.crossings import equal_crossings
from cylx.runs.facing import Facing, FittedCone, facing_ends, fit_reducer
from cylx.runs.junctions import Branching, branchings
from cylx.runs.pipes import ENDS, End, Surroundings, sectors_of
from cylx.runs.rings import Collar
from cylx.runs.saddles import saddle_of
from cylx.runs.tracing import BY_AXES, Trace, trust

THROUGH = 0.9
"""Confidence of a cross of two pipes of one radius that go through each other."""
PIECES, SECTORS = 6, 12
"""Pieces along a gap and sectors about it in which points are counted."""
CROSSING = 0.5
"""Branches that face each other meet the main within so many of its radii of each other."""


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
    for one in group:
        if one.gap < 0:
            trace.pipes[one.branch] = trace.pipes[one.branch].with_end(one.end, one.surface)
    seen = [saddle for saddle in (saddle_of(one, trace.pipes, near) for one in group) if saddle is not None]
    contact = 1.0 / (1.0 + max(0.0, first.gap / trace.pipes[first.branch].radius - 1.0))
    inliers = sum(one.inliers for one in seen)
    coverage = sum(one.coverage for one in seen) / max(len(seen), 1)
    filled = max((one.filled for one in seen), default=0.0)
    by_points = trust(inliers, coverage, filled) if seen else contact
    kind = Junction if len(group) == 1 else Cross
    fitting = kind(
        joins=(first.main, *branches),
        ends=("side", *(one.end for one in group)),
        confidence=BY_AXES + (0.95 - BY_AXES) * contact * by_points,
        inliers=inliers,
        rms=math.sqrt(sum(one.inliers * one.rms**2 for one in seen) / max(inliers, 1)),
        coverage=coverage,
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
    flanged = {key for key, k in trace.taken.items() if isinstance(trace.fittings[k], Flange)}
    pairs = sorted(
        (one for one in facing_ends(trace.pipes, trace.closed - flanged) if one.same_size), key=lambda one: abs(one.gap)
    )
    count = 0
    joined: set[tuple[int, End]] = set()
    for one in pairs:
        keys = set(zip(one.pipes, one.ends, strict=True))
        if keys & joined or not trace.is_free(keys - flanged):
            continue
        if keys & flanged:
            if one.gap > LONGEST_INLINE * max(_flange_at(trace, key).radius for key in keys & flanged):
                continue
            for key in keys & flanged:
                _carry_on(trace, key)
        _add_gap(trace, one, near)
        joined |= keys
        count += 1
    return count


def _flange_at(trace: Trace, key: tuple[int, End]) -> Flange:
    fitting = trace.fittings[trace.taken[key]]
    assert isinstance(fitting, Flange)
    return fitting


def _carry_on(trace: Trace, key: tuple[int, End]) -> None:
    """Let a pipe go on through the flange at an end of it, as something is beyond."""
    flange, (index, end) = _flange_at(trace, key), key
    trace.fittings[trace.taken.pop(key)] = replace(flange, ends=("side",), pair=True)
    pipe = trace.pipes[index]
    face = flange.center + 0.5 * flange.thickness * pipe.outward(end)
    if float((face - pipe.at(end)) @ pipe.outward(end)) > 0.0:
        trace.pipes[index] = pipe.with_end(end, face)


def _add_gap(trace: Trace, one: Facing, near: Surroundings) -> None:
    first, second = (trace.pipes[i] for i in one.pipes)
    start, end = first.at(one.ends[0]), second.at(one.ends[1])
    radius, axis = first.radius, first.outward(one.ends[0])
    inner = near.about(start, axis, 0.1 * one.gap, 0.9 * one.gap, 3.0 * radius, 1.2 * radius)
    inner = inner[near.free(inner)]
    tube = near.about(start, axis, 0.0, max(one.gap, 0.0), 1.1 * radius, 0.9 * radius)
    if len(inner) > 0.5 * near.density(first) * 2 * np.pi * radius * max(one.gap, 0.0) and len(inner) > 20:
        lengthwise, round_about = _spread_of(near.points[inner], start, axis, one.gap)
        fitting: Fitting = Inline(
            joins=one.pipes,
            ends=one.ends,
            confidence=trust(len(inner), lengthwise) * (0.5 + 0.5 * min(1.0, 2.0 * round_about)),
            inliers=len(inner),
            coverage=round_about,
            start=start,
            end=end,
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


def _spread_of(points: FloatArray, start: FloatArray, axis: FloatArray, gap: float) -> tuple[float, float]:
    """Return in what share of the pieces of a gap there are points, and in what share of the sectors about it."""
    heights = np.clip(((points - start) @ axis) / gap, 0.1, 0.899999)
    rows = ((heights - 0.1) / 0.8 * PIECES).astype(np.int64)
    sectors = sectors_of(points, start, axis, SECTORS)
    return len(np.unique(rows)) / PIECES, len(np.unique(sectors)) / SECTORS


def add_caps(trace: Trace, near: Surroundings) -> int:
    """Add the caps of ends that nothing joins, of pipes that something else joins to a run; return their number.

    A disc at the end of a cylinder alone says that it is closed, as pins and bosses are, and not that it is a pipe.
    """
    count = 0
    joined = {index for fitting in trace.fittings for index in fitting.joins}
    for index, pipe in enumerate(trace.pipes):
        if index not in joined:
            continue
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
