"""Pipes and fittings -> runs: what is connected, in which order, how long, and where it ends."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cylx.fits.nominal_radius import Catalogue, choose_entry
from cylx.geometry.arrays import FloatArray
from cylx.records import Elbow, Fitting, Inline, Joint, Junction, OpenEnd, PipeRun, PipeSize, Reducer
from cylx.records.piping import Openness
from cylx.runs.pipes import ENDS, ON_SURFACE, End, Pipe, Surroundings

LEVEL = math.radians(45.0)
"""Pipes steeper than this are no level ones."""
ONE_SIZE = 0.06
"""Radii of a run that differ by less are one size."""
BORDER = 2.0
"""An end so many radii from the border of the cloud leaves it."""


def find_runs(
    pipes: Sequence[Pipe],
    fittings: Sequence[Fitting],
    near: Surroundings,
    catalogue: Catalogue | None = None,
    names: Sequence[str | None] = (),
) -> tuple[PipeRun, ...]:
    """Return the runs, the longest first.

    Parameters
    ----------
    pipes : sequence of Pipe
    fittings : sequence of Fitting
        Their `joins` are indices of the pipes.
    near : Surroundings
    catalogue : Catalogue, optional
        Nominal radii.
    names : sequence of str or None
        Of the entries of the catalogue.
    """
    parents = list(range(len(pipes)))

    def root(i: int) -> int:
        while parents[i] != i:
            parents[i] = parents[parents[i]]
            i = parents[i]
        return i

    for fitting in fittings:
        for other in fitting.joins[1:]:
            parents[root(other)] = root(fitting.joins[0])
    groups: dict[int, list[int]] = {}
    for i in range(len(pipes)):
        groups.setdefault(root(i), []).append(i)
    by_group: dict[int, list[int]] = {key: [] for key in groups}
    for k, fitting in enumerate(fittings):
        by_group[root(fitting.joins[0])].append(k)
    runs = [_run(groups[key], by_group[key], pipes, fittings, near, catalogue, names) for key in groups]
    return tuple(sorted(runs, key=lambda run: (-run.length, run.cylinders)))


def _run(
    members: list[int],
    joined: list[int],
    pipes: Sequence[Pipe],
    fittings: Sequence[Fitting],
    near: Surroundings,
    catalogue: Catalogue | None,
    names: Sequence[str | None],
) -> PipeRun:
    order, used = walk(members, joined, fittings, pipes)
    taken = {(pipe, end) for k in joined for pipe, end in zip(fittings[k].joins, fittings[k].ends, strict=True)}
    ends = [OpenEnd(i, end, reason_of(pipes[i], end, near)) for i in order for end in ENDS if (i, end) not in taken]
    length = sum(pipes[i].length for i in members) + sum(length_of(fittings[k]) for k in joined)
    links = sum(len(fittings[k].joins) - 1 for k in joined)
    return PipeRun(
        tuple(order),
        tuple(used),
        float(length),
        slope_of(order, pipes, fittings, joined),
        sizes_of(order, joined, pipes, fittings, catalogue, names),
        tuple(ends),
        links - len(members) + 1,
    )


def walk(
    members: list[int], joined: list[int], fittings: Sequence[Fitting], pipes: Sequence[Pipe]
) -> tuple[list[int], list[int]]:
    """Return cylinders and fittings of a run in order: from an end of it ahead, and then the branches."""
    at: dict[int, list[int]] = {i: [] for i in members}
    for k in joined:
        for i in fittings[k].joins:
            at[i].append(k)

    def through(i: int) -> int:
        ends = {end for k in at[i] for pipe, end in zip(fittings[k].joins, fittings[k].ends, strict=True) if pipe == i}
        return len(ends - {"side"})

    # begin with the widest pipe that has an open end; branches begin at their junction
    first = min(members, key=lambda i: (through(i) >= 2, _is_branch(i, joined, fittings), -pipes[i].radius, i))
    order, used, stack, seen = [], [], [first], {first}
    while stack:
        i = stack.pop()
        order.append(i)
        along = sorted(at[i], key=lambda k: _place(fittings[k], pipes[i]))
        ahead: list[int] = []
        aside: list[int] = []
        for k in along:
            if k not in used:
                used.append(k)
            for other in fittings[k].joins:
                if other not in seen:
                    seen.add(other)
                    (aside if isinstance(fittings[k], Junction) else ahead).append(other)
        stack += [*reversed(aside), *reversed(ahead)]
    return order, used


def _is_branch(i: int, joined: list[int], fittings: Sequence[Fitting]) -> bool:
    found = (fittings[k] for k in joined)
    return any(isinstance(one, Junction) and i in one.branches for one in found)


def _place(fitting: Fitting, pipe: Pipe) -> float:
    """Return how far along a pipe a fitting is."""
    center = getattr(fitting, "center", None)
    if center is None or isinstance(fitting, Elbow):
        center = 0.5 * (fitting.start + fitting.end)  # type: ignore[attr-defined]
    return float((center - pipe.start) @ pipe.direction)


def length_of(fitting: Fitting) -> float:
    """Return the length of the centre line of a fitting that is between pipes, scene units."""
    if isinstance(fitting, Elbow):
        return fitting.bend_radius * fitting.angle
    if isinstance(fitting, Joint):
        return fitting.length
    if isinstance(fitting, Reducer) or (isinstance(fitting, Inline) and len(fitting.joins) == 2):
        return float(np.linalg.norm(fitting.end - fitting.start))
    return 0.0


def slope_of(order: list[int], pipes: Sequence[Pipe], fittings: Sequence[Fitting], joined: list[int]) -> float | None:
    """Return rise over horizontal distance of the level pipes, each in the direction of the walk."""
    rise = level = 0.0
    place: FloatArray | None = None
    for i in order:
        pipe = pipes[i]
        start, end = pipe.start, pipe.end
        if place is None:
            ahead = _joined_end(i, fittings, joined)
            start, end = (end, start) if ahead == "start" else (start, end)
        elif np.linalg.norm(end - place) < np.linalg.norm(start - place):
            start, end = end, start
        place = end
        across = float(np.hypot(*(end - start)[:2]))
        up = float(end[2] - start[2])
        if abs(up) < math.tan(LEVEL) * across:
            rise, level = rise + up, level + across
    return rise / level if level > 0 else None


def _joined_end(i: int, fittings: Sequence[Fitting], joined: list[int]) -> End | None:
    """Return the end at which the first pipe of a walk goes on."""
    for k in joined:
        for pipe, end in zip(fittings[k].joins, fittings[k].ends, strict=True):
            if pipe == i and end != "side" and len(fittings[k].joins) > 1:
                return end
    return None


def sizes_of(
    order: list[int],
    joined: list[int],
    pipes: Sequence[Pipe],
    fittings: Sequence[Fitting],
    catalogue: Catalogue | None = None,
    names: Sequence[str | None] = (),
) -> tuple[PipeSize, ...]:
    """Return the sizes of a run, the one of the greatest length first; a size is decided for all its pipes together."""
    groups: list[list[int]] = []
    for i in sorted(order, key=lambda i: pipes[i].radius):
        near = groups and pipes[i].radius - pipes[groups[-1][0]].radius < ONE_SIZE * pipes[i].radius + 2.0 * _sd(
            pipes[i]
        )
        if near:
            groups[-1].append(i)
        else:
            groups.append([i])
    out = []
    for group in groups:
        weights = np.array([1.0 / max(_sd(pipes[i]) ** 2, 1e-300) for i in group])
        radius = float((weights * [pipes[i].radius for i in group]).sum() / weights.sum())
        sd = float(1.0 / math.sqrt(weights.sum()))
        bends = [k for k in joined if isinstance(fittings[k], Elbow) and fittings[k].joins[0] in group]
        length = sum(pipes[i].length for i in group) + sum(length_of(fittings[k]) for k in bends)
        nominal = None
        if catalogue is not None:
            choice = choose_entry(radius, sd, catalogue)
            if choice.decision == "snapped" and choice.entry < len(names):
                nominal = names[choice.entry]
        members = tuple(i for i in order if i in group)
        out.append(PipeSize(radius, sd, float(length), members, nominal))
    return tuple(sorted(out, key=lambda size: (-size.length, size.cylinders)))


def _sd(pipe: Pipe) -> float:
    return math.sqrt(max(float(pipe.covariance[4, 4]), 0.0))


def reason_of(pipe: Pipe, end: End, near: Surroundings) -> Openness:
    """Return why nothing joins an end of a pipe.

    Parameters
    ----------
    pipe : Pipe
    end : {'start', 'end'}
    near : Surroundings
    """
    place, axis, radius = pipe.at(end), pipe.outward(end), pipe.radius
    beyond = place + BORDER * radius * axis
    if (beyond < near.low).any() or (beyond > near.high).any():
        return "leaves_cloud"
    # seen to end: its points go right up to the end, as densely as elsewhere, and stop
    reach = ON_SURFACE * pipe.spread
    last = near.about(place, axis, -2.0 * radius, 0.0, radius + reach, max(0.0, radius - reach))
    usual = near.density(pipe) * 2.0 * math.pi * radius * 2.0 * radius
    return "nothing_there" if usual > 0 and len(last) > 0.3 * usual else "hidden"
