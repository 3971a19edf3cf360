"""Chains of elbows with short pipes between them: which they are, and the points of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.records import Elbow
from cylx.runs.bend import Bend
from cylx.runs.bend_fit import bend_of
from cylx.runs.pipes import End, Pipe, Surroundings
from cylx.runs.tracing import Trace

SHORT = 6.0
"""The axis of a pipe shorter than so many radii is told together with the elbows at its ends."""
ABOUT = 0.6
"""Points within so many radii of the surface are looked at."""
MOST_POINTS = 1200
"""Of one elbow or pipe."""


@dataclass(slots=True, eq=False)
class Chain:
    """Pipes, and the elbows between them, with the points of each, and where each is in the vector of unknowns."""

    pipes: dict[int, Pipe]
    elbows: dict[int, Elbow]
    short: frozenset[int]
    arcs: dict[int, FloatArray]
    straights: dict[int, FloatArray]
    weights: dict[tuple[str, int], float]
    radius: float
    spread: float
    place: dict[int, int]
    bends: dict[int, int]


def chains_of(trace: Trace) -> list[tuple[list[int], list[int]]]:
    """Return the pipes and the elbows of each chain: elbows that share a short pipe are of one."""
    of_pipe: dict[int, list[int]] = {}
    for k, one in enumerate(trace.fittings):
        if isinstance(one, Elbow) and one.inliers > 0:
            for index in one.joins:
                of_pipe.setdefault(index, []).append(k)
    out, seen = [], set[int]()
    for index in sorted(of_pipe):
        if index in seen or not _is_short(trace.pipes[index]):
            continue
        pipes, elbows, open_ones = {index}, set[int](), [index]
        while open_ones:
            here = open_ones.pop()
            seen.add(here)
            for k in of_pipe[here]:
                elbows.add(k)
                for other in trace.fittings[k].joins:
                    if other not in pipes:
                        pipes.add(other)
                        if _is_short(trace.pipes[other]):
                            open_ones.append(other)
        out.append((sorted(pipes), sorted(elbows)))
    return out


def _is_short(pipe: Pipe) -> bool:
    return pipe.length < SHORT * pipe.radius


def gathered(trace: Trace, near: Surroundings, pipes: list[int], elbows: list[int]) -> Chain:
    """Return a chain with its points: those of its own pipes and elbows, and those that are free."""
    members = {index: trace.pipes[index] for index in pipes}
    bends = {k: trace.fittings[k] for k in elbows}
    short = frozenset(index for index in pipes if _is_short(trace.pipes[index]))
    labels = [pipe.label for pipe in members.values()]
    claimed = np.unique(np.concatenate([trace.points[k] for k in elbows]))
    known = {k: one for k, one in bends.items() if isinstance(one, Elbow)}
    sizes = [pipe.radius for index, pipe in members.items() if index not in short] or [
        one.radius for one in known.values()
    ]
    chain = Chain(
        members, known, short, {}, {}, {}, float(np.mean(sizes)), max(p.spread for p in members.values()), {}, {}
    )
    for k, one in known.items():
        found = _about(bend_between(one, trace.pipes), one.radius, near)
        own = near.free(found, labels) | np.isin(found, claimed)
        chain.arcs[k], chain.weights["arc", k] = _thinned(near.points[found[own]])
        chain.bends[k] = 4 * len(pipes) + 1 + len(chain.bends)
    for number, index in enumerate(pipes):
        chain.place[index] = 4 * number
        if index in short:
            pipe = members[index]
            half, outer = 0.5 * pipe.length + 0.5 * pipe.radius, (1.0 + ABOUT) * pipe.radius
            found = near.about(pipe.middle, pipe.direction, -half, half, outer, (1.0 - ABOUT) * pipe.radius)
            own = near.free(found, labels) | np.isin(found, claimed)
            chain.straights[index], chain.weights["pipe", index] = _thinned(near.points[found[own]])
    return chain


def _about(bend: Bend, radius: float, near: Surroundings) -> IndexArray:
    """Return all points about an arc."""
    outer = (1.0 + ABOUT) * radius
    low = max(0.0, bend.bend_radius - outer) if bend.angle < math.pi else 0.0
    if bend.bend_radius < outer:
        found = near.about(bend.meeting, bend.normal, -outer, outer, bend.tangent + 2.0 * outer)
    else:
        found = near.about(bend.center, bend.normal, -outer, outer, bend.bend_radius + outer, low)
    along, distances = bend.coordinates(near.points[found])
    on = (along > -0.5 * radius) & (along < bend.length + 0.5 * radius) & (np.abs(distances - radius) < ABOUT * radius)
    return found[on]


def _thinned(points: FloatArray) -> tuple[FloatArray, float]:
    """Return no more than so many points, and how many each of them stands for."""
    step = max(1, -(-len(points) // MOST_POINTS))
    some = np.ascontiguousarray(points[::step])
    return some, len(points) / max(len(some), 1)


def bend_between(one: Elbow, pipes: Mapping[int, Pipe] | Sequence[Pipe]) -> Bend:
    """Return the bend of an elbow between two pipes, with its bend radius."""
    ends = ends_of(one)
    return bend_of(pipes[one.joins[0]], pipes[one.joins[1]], ends, np.zeros(8), one.bend_radius)[0]


def ends_of(one: Elbow) -> tuple[End, End]:
    """Return the ends of pipes that an elbow joins."""
    first, second = one.ends
    assert first != "side"
    assert second != "side"
    return first, second
