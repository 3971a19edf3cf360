"""Runs as they were built, as an offer: axes that meet, angles that are round, pieces in line, one radius a size.

What is measured moves only as far as its uncertainty allows. Each constraint that would move it further is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis
from cylx.geometry.lines import common_perpendicular
from cylx.records import CylinderFit, Elbow, Fitting, Junction, PipeRun, Piping, Reducer
from cylx.records.piping import Adjustment
from cylx.runs.answer import turn_ends
from cylx.runs.bend import Bend
from cylx.runs.pipes import OTHER, Pipe, tilted

ROUND_ANGLES = tuple(math.radians(angle) for angle in (15.0, 22.5, 30.0, 45.0, 60.0, 67.5, 75.0, 90.0))
"""Angles of fittings that are made."""
MOST = 3.5
"""A constraint that is violated by more standard deviations is refused."""
MOST_MOVED = 25.0
"""Square of the distance that a cylinder may move, in its standard deviations, of four parameters."""
LEAST_ANGLE_SD, LEAST_OFFSET_SD = math.radians(0.02), 0.002
"""What pipes deviate from straight lines, whatever the covariance says: radians, and radii."""
STEPS = 4

Measure = Callable[[list[tuple[FloatArray, FloatArray]]], float]


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """Something that holds of the axes of two pipes of a run if it is as it was built.

    Parameters
    ----------
    fitting : int
    what : {'angle_deg', 'meeting', 'line'}
    pipes : tuple of int
    measure : callable
        From middles and directions of the pipes to what is 0 if it holds.
    value, target : float
        What is reported: of the measured pipes, and if it holds.
    """

    fitting: int
    what: str
    pipes: tuple[int, int]
    measure: Measure
    value: float
    target: float


def fit_runs(cylinders: Sequence[CylinderFit], piping: Piping) -> tuple[tuple[CylinderFit, ...], Piping]:
    """Move cylinders so that their runs are as they were built, where the uncertainties allow.

    Parameters
    ----------
    cylinders : sequence of CylinderFit
        Scene units.
    piping : Piping
        Their fittings and runs.

    Returns
    -------
    cylinders : tuple of CylinderFit
        Moved; `measured` has the shapes before.
    piping : Piping
        With fittings that touch them, and the adjustments, those that were refused included.
    """
    if not cylinders:
        return (), piping
    origin = np.mean([fit.cylinder.point for fit in cylinders], axis=0)
    pipes = [_certain(Pipe.of(i, fit, origin, 0.0)) for i, fit in enumerate(cylinders)]
    new, fittings, told = list(pipes), list(piping.fittings), []
    for run in piping.runs:
        asked = [one for k in run.fittings for one in _constraints(k, piping.fittings[k], pipes)]
        moved, adjustments = _solved(run, asked, pipes)
        told += adjustments
        for i, pipe in moved.items():
            new[i] = pipe
        told += _one_radius(run, new)
    for k, fitting in enumerate(piping.fittings):
        if any(new[i] is not pipes[i] for i in fitting.joins):
            fittings[k] = _touching(fitting, new, origin)
    changed = {i for i, pipe in enumerate(new) if pipe.is_turned}
    fittings = [turn_ends(fitting, changed) for fitting in fittings]
    runs = [_with_turned_ends(run, changed) for run in piping.runs]
    out = []
    for fit, old, pipe in zip(cylinders, pipes, new, strict=True):
        same = pipe is old
        out.append(fit if same else replace(fit, cylinder=pipe.cylinder(origin), measured=fit.measured or fit.cylinder))
    return tuple(out), replace(piping, fittings=tuple(fittings), runs=tuple(runs), adjustments=tuple(told))


def _with_turned_ends(run: PipeRun, changed: set[int]) -> PipeRun:
    ends = [replace(one, end=OTHER[one.end]) if one.cylinder in changed else one for one in run.open_ends]
    return replace(run, open_ends=tuple(ends))


def _certain(pipe: Pipe) -> Pipe:
    """Return a pipe no more certain than pipes are straight."""
    offset, tilt = (LEAST_OFFSET_SD * pipe.radius) ** 2, LEAST_ANGLE_SD**2
    return replace(pipe, covariance=pipe.covariance + np.diag([offset, offset, tilt, tilt, offset]))


def _constraints(index: int, fitting: Fitting, pipes: Sequence[Pipe]) -> Iterator[Constraint]:
    """Yield what should hold of the pipes of a fitting."""
    if isinstance(fitting, Elbow | Junction) and len(fitting.joins) >= 2:
        main = fitting.joins[0]
        for other in fitting.joins[1:]:
            pair = main, other
            yield Constraint(index, "meeting", pair, _skew, abs(_skew(_axes(pair, pipes))), 0.0)
            sign = 1.0 if float(pipes[main].direction @ pipes[other].direction) >= 0 else -1.0
            angle = _turn(_axes(pair, pipes), sign)
            target = min(ROUND_ANGLES, key=lambda one: abs(one - angle))
            yield Constraint(
                index,
                "angle_deg",
                pair,
                lambda axes, target=target, sign=sign: _turn(axes, sign) - target,  # type: ignore[misc]  # bound now
                math.degrees(angle),
                math.degrees(target),
            )
    elif len(fitting.joins) == 2 and "side" not in fitting.ends:
        pair = fitting.joins[0], fitting.joins[1]
        concentric = not isinstance(fitting, Reducer) or fitting.concentric
        for part in range(4 if concentric else 2):
            measure = _in_line(part, pipes[pair[0]])
            yield Constraint(index, "line", pair, measure, abs(measure(_axes(pair, pipes))), 0.0)


def _axes(pair: Sequence[int], pipes: Sequence[Pipe]) -> list[tuple[FloatArray, FloatArray]]:
    return [(pipes[i].middle, pipes[i].direction) for i in pair]


def _skew(axes: list[tuple[FloatArray, FloatArray]]) -> float:
    """Return the signed distance of two axes."""
    (one, first), (two, second) = axes
    across = np.cross(first, second)
    return float((two - one) @ across) / max(float(np.linalg.norm(across)), 1e-12)


def _turn(axes: list[tuple[FloatArray, FloatArray]], sign: float) -> float:
    """Return the angle of the first axis and of the second times a sign: smooth, also at a right angle."""
    first, second = axes[0][1], axes[1][1]
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), sign * float(first @ second))


def _in_line(part: int, pipe: Pipe) -> Measure:
    """Return a part of what is 0 for axes in line: two of the directions, and two of their distance halfway."""
    basis = axis_basis(pipe.direction)

    def measure(axes: list[tuple[FloatArray, FloatArray]]) -> float:
        (one, first), (two, second) = axes
        second = second if float(first @ second) > 0 else -second
        if part < 2:
            return float((second - first) @ basis[part])
        place = 0.5 * (one + two)
        feet = [point + float((place - point) @ axis) * axis for point, axis in ((one, first), (two, second))]
        return float((feet[1] - feet[0]) @ basis[part - 2])

    return measure


def _solved(run: PipeRun, asked: list[Constraint], pipes: Sequence[Pipe]) -> tuple[dict[int, Pipe], list[Adjustment]]:
    """Return the pipes of a run that move, and what came of each constraint."""
    place = {i: 4 * k for k, i in enumerate(run.cylinders)}
    covariance = np.zeros((4 * len(place), 4 * len(place)))
    for i, first in place.items():
        covariance[first : first + 4, first : first + 4] = pipes[i].covariance[:4, :4]
    nothing = np.zeros(len(covariance))
    rows = [_row(one, nothing, pipes, place) for one in asked]
    deviations = [math.sqrt(max(float(row @ covariance @ row), 1e-300)) for _, row in rows]
    kept = [k for k, (value, _) in enumerate(rows) if abs(value) <= MOST * deviations[k]]
    while kept:
        state = _state([asked[k] for k in kept], covariance, pipes, place)
        worst = max(place.values(), key=lambda first: _moved_by(state, covariance, first))
        if _moved_by(state, covariance, worst) <= MOST_MOVED:
            break
        owner = next(i for i, first in place.items() if first == worst)
        about = [k for k in kept if owner in asked[k].pipes] or kept
        kept.remove(max(about, key=lambda k: abs(rows[k][0]) / deviations[k]))
    else:
        state = nothing
    moved = {}
    for i, first in place.items():
        change = state[first : first + 4]
        if np.any(change != 0.0):
            moved[i] = _moved(pipes[i], change)
    told = [
        Adjustment(one.fitting, one.what, one.pipes, one.value, one.target, _sd_of(one, deviations[k]), k in kept)
        for k, one in enumerate(asked)
    ]
    return moved, told


def _sd_of(one: Constraint, deviation: float) -> float:
    return math.degrees(deviation) if one.what == "angle_deg" else deviation


def _moved_by(state: FloatArray, covariance: FloatArray, first: int) -> float:
    part = state[first : first + 4]
    return float(part @ np.linalg.solve(covariance[first : first + 4, first : first + 4], part))


def _row(one: Constraint, state: FloatArray, pipes: Sequence[Pipe], place: dict[int, int]) -> tuple[float, FloatArray]:
    """Return the value of a constraint, and its derivatives."""

    def value(change: FloatArray) -> float:
        return one.measure([tilted(pipes[i], change[place[i] : place[i] + 4]) for i in one.pipes])

    base, row = value(state), np.zeros(len(state))
    for i in one.pipes:
        small = np.array([1e-5 * pipes[i].radius] * 2 + [1e-6] * 2)
        for d in range(4):
            moved = state.copy()
            moved[place[i] + d] += small[d]
            row[place[i] + d] = (value(moved) - base) / small[d]
    return base, row


def _state(asked: list[Constraint], covariance: FloatArray, pipes: Sequence[Pipe], place: dict[int, int]) -> FloatArray:
    """Return the most likely changes of the axes with which the constraints hold."""
    state = np.zeros(len(covariance))
    for _ in range(STEPS):
        rows = [_row(one, state, pipes, place) for one in asked]
        values, jacobian = np.array([value for value, _ in rows]), np.array([row for _, row in rows])
        normal = jacobian @ covariance @ jacobian.T
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        # constraints of a loop may say the same
        inner = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-9)
        state = -covariance @ jacobian.T @ ((inner @ ((values - jacobian @ state) / scale)) / scale)
    return np.asarray(state, dtype=np.float64)


def _moved(pipe: Pipe, change: FloatArray) -> Pipe:
    middle, direction = tilted(pipe, change)
    half = 0.5 * pipe.length * direction
    return replace(pipe, start=middle - half, end=middle + half)


def _one_radius(run: PipeRun, pipes: list[Pipe]) -> Iterator[Adjustment]:
    """Give the cylinders of a size one radius; yield what came of it."""
    for size in run.sizes:
        for i in size.cylinders if len(size.cylinders) > 1 else ():
            pipe = pipes[i]
            sd = math.sqrt(max(float(pipe.covariance[4, 4]), 0.0))
            applied = abs(pipe.radius - size.radius) <= MOST * max(math.hypot(sd, size.std), 1e-300)
            yield Adjustment(None, "radius", (i,), pipe.radius, size.radius, sd, applied)
            if applied:
                pipes[i] = replace(pipe, radius=size.radius)


def _touching(fitting: Fitting, pipes: list[Pipe], origin: FloatArray) -> Fitting:
    """Return a fitting at the axes of pipes that moved; the pipes end where it begins."""
    joined = [pipes[i] for i in fitting.joins]
    if isinstance(fitting, Elbow):
        one, two = joined
        first = one.outward("end" if fitting.ends[0] == "end" else "start")
        second = -two.outward("end" if fitting.ends[1] == "end" else "start")
        feet = common_perpendicular(one.middle, first, two.middle, second)[:2]
        bend = Bend(0.5 * (feet[0] + feet[1]), first, second, fitting.bend_radius)
        for i, end, place in zip(fitting.joins, fitting.ends, (bend.start, bend.end), strict=True):
            if end != "side":
                pipes[i] = pipes[i].with_end(end, place)
        return replace(
            fitting,
            center=bend.center + origin,
            normal=bend.normal,
            angle=bend.angle,
            radius=0.5 * (one.radius + two.radius),
            start=bend.start + origin,
            end=bend.end + origin,
        )
    if isinstance(fitting, Junction):
        main, branch = joined[0], joined[1]
        feet = common_perpendicular(main.middle, main.direction, branch.middle, branch.direction)[:2]
        angle = _turn([(main.middle, main.direction), (branch.middle, branch.direction)], 1.0)
        angle = min(angle, math.pi - angle)
        return replace(fitting, center=feet[0] + origin, angle=angle)
    return fitting
