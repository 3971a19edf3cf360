"""Pipes that are parts of fittings, such as the rims of flanges: they are no pipes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import Elbow, Flange, Inline, Junction, Reducer
from cylx.runs.pieces import is_twin
from cylx.runs.pipes import ENDS, Pipe
from cylx.runs.tracing import Trace
from cylx.runs.wider import LONGEST_RIM

MID_CONE = 1.5
"""A pipe between a wider and a narrower one is longer, in its radii; what is shorter is a piece of a reducer."""
WITHIN = 0.5
"""A piece of an elbow that was found as a cylinder has its axis within so many radii of the centre line."""
LEAST_LEFT, LEAST_ALONE, LEAST_POINTS = 0.7, 6.0, 8
"""A pipe that was found along a run has a length of so many radii, if nothing joins it any more, and so many points."""


def drop_parts(trace: Trace) -> Trace:
    """Return what was traced without the pipes that are parts of fittings, such as the rims of flanges."""
    joined = {pipe for fitting in trace.fittings for pipe in fitting.joins if fitting.kind not in _OF_ONE}
    parts = {k for k in trace.aside if trace.pipes[k].length < LONGEST_RIM * trace.pipes[k].radius} - joined
    for fitting in trace.fittings:
        if isinstance(fitting, Flange | Inline):
            axis = trace.pipes[fitting.joins[0]].direction
            low, high, reach = _extent_of(fitting, axis)
            for k, pipe in enumerate(trace.pipes):
                if k in fitting.joins or k in joined:
                    continue
                away = pipe.middle - 0.5 * (low + high)
                along = float(away @ axis)
                beside = float(np.linalg.norm(away - along * axis))
                inside = abs(along) + 0.4 * pipe.length < 0.5 * float(np.linalg.norm(high - low)) + 0.3 * reach
                if inside and beside + pipe.radius < 1.15 * reach:
                    parts.add(k)
    for fitting in trace.fittings:
        if isinstance(fitting, Elbow) and fitting.bend_radius > 0:
            parts |= {k for k, pipe in enumerate(trace.pipes) if k not in joined and _is_within(pipe, fitting)}
    parts |= {k for k in range(len(trace.pipes)) if _is_remnant(k, trace, k not in joined)}
    return _without(trace, parts)


def drop_twins(trace: Trace) -> Trace:
    """Return what was traced without pipes, found along a run, that are where another one of the same size is."""
    pipes, twins = trace.pipes, set[int]()
    for k, pipe in enumerate(pipes):
        if pipe.source is None:
            rivals = (j for j, other in enumerate(pipes) if j != k and j not in twins and _is_first(other, j, pipe, k))
            if any(is_twin(pipe, pipes[j]) for j in rivals):
                twins.add(k)
    return _without(trace, twins) if twins else trace


def drop_turned(trace: Trace) -> Trace:
    """Return what was traced without the fittings of turned parts, such as a pin with a cone, or a bottle.

    Of these, nothing but reducers joins pieces of one line, none of which is as long as a pipe.
    """
    group = list(range(len(trace.pipes)))
    for fitting in trace.fittings:
        old, new = {group[k] for k in fitting.joins}, group[fitting.joins[0]]
        group = [new if one in old else one for one in group]
    pipes = {group[k] for k, pipe in enumerate(trace.pipes) if pipe.length >= LEAST_ALONE * pipe.radius}
    others = {group[one.joins[0]] for one in trace.fittings if len(one.joins) > 1 and not isinstance(one, Reducer)}
    reduced = {group[one.joins[0]] for one in trace.fittings if isinstance(one, Reducer)}
    turned = reduced - pipes - others
    if not turned:
        return trace
    out = Trace(trace.pipes, trace.near, others=trace.others, followed=trace.followed)
    out.starts = trace.starts
    for fitting, points in zip(trace.fittings, trace.points, strict=True):
        if group[fitting.joins[0]] in turned:
            trace.near.label(points, -1)
        else:
            out.add(fitting, points)
    return out


def _is_first(one: Pipe, number: int, other: Pipe, index: int) -> bool:
    """Return whether of two pipes in one place the first is to be kept: one that was a cylinder, or the longer one."""
    return (one.source is not None, one.length, -number) > (other.source is not None, other.length, -index)


def _without(trace: Trace, parts: set[int]) -> Trace:
    """Return what was traced without some of its pipes, and the fittings that they had."""
    kept = [k for k in range(len(trace.pipes)) if k not in parts]
    number = {old: new for new, old in enumerate(kept)}
    near = trace.near
    for k in parts:
        near.label(np.flatnonzero(near.labels == trace.pipes[k].label), -1)
    others = frozenset(number[k] for k in trace.others if k in number)
    followed = {(number[k], end) for k, end in trace.followed if k in number}
    out = Trace([trace.pipes[k] for k in kept], near, others=others, followed=followed)
    for fitting, points in zip(trace.fittings, trace.points, strict=True):
        if parts.intersection(fitting.joins):
            near.label(points, -1)
            continue
        moved = replace(fitting, joins=tuple(number[k] for k in fitting.joins))
        if isinstance(moved, Junction):
            main, branches = (tuple(number[k] for k in group) for group in (moved.main, moved.branches))
            moved = replace(moved, main=main, branches=branches)
        out.add(moved, points)
    out.starts = [trace.starts[k] for k in kept if k < len(trace.starts)]
    return out


def _is_within(pipe: Pipe, elbow: Elbow) -> bool:
    """Return whether a pipe is a piece of an elbow that was found as a cylinder."""
    apart = np.array([pipe.start, pipe.middle, pipe.end]) - elbow.center
    high = apart @ elbow.normal
    out = np.sqrt(np.maximum(np.einsum("ij,ij->i", apart, apart) - high**2, 0.0))
    radial = (elbow.start - elbow.center) / elbow.bend_radius
    turn = np.arctan2(apart @ np.cross(elbow.normal, radial), apart @ radial)
    on = np.hypot(out - elbow.bend_radius, high) < WITHIN * elbow.radius
    slack = WITHIN * elbow.radius / elbow.bend_radius
    return bool(on.all() and (turn > -slack).all() and (turn < elbow.angle + slack).all())


def _is_remnant(index: int, trace: Trace, alone: bool) -> bool:
    """Return whether hardly anything is left of a pipe that was found along a run; `alone` if nothing joins it.

    Or whether it is a piece of one cone that was taken for a pipe between two.
    """
    pipe = trace.pipes[index]
    fittings = [trace.fittings[trace.taken[index, end]] for end in ENDS if (index, end) in trace.taken]
    at = sorted(one.kind for one in fittings)
    if at == ["reducer", "reducer"] and pipe.length < MID_CONE * pipe.radius:
        radii = sorted(trace.pipes[k].radius for one in fittings for k in one.joins if k != index)
        if radii[0] < pipe.radius < radii[-1]:
            return True
    # hardly more than a weld between a bend and a bend or a reducer is a pipe that joins them
    if pipe.source is not None or at in (["elbow", "elbow"], ["elbow", "reducer"]):
        return False
    least = LEAST_ALONE if alone else LEAST_LEFT
    return pipe.length < least * pipe.radius or len(trace.near.on(pipe)) < LEAST_POINTS


_OF_ONE = ("cap", "flange", "inline")


def _extent_of(fitting: Flange | Inline, axis: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return both ends of a fitting on its axis, and how far it reaches from it."""
    if isinstance(fitting, Flange):
        half = 0.5 * fitting.thickness * axis
        return fitting.center - half, fitting.center + half, fitting.radius
    return fitting.start, fitting.end, 0.5 * float(np.linalg.norm(fitting.end - fitting.start))
