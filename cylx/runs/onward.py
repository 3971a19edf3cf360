"""Along a run: what goes on from an end of a pipe, a bend into a pipe that was too short to be found alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis
from cylx.runs.bend import Bend
from cylx.runs.bend_evidence import FittedBend, judged
from cylx.runs.bend_fit import Solved, refined
from cylx.runs.elbows import add_bends, add_fitted
from cylx.runs.flatness import is_flat
from cylx.runs.narrowing import narrowed
from cylx.runs.pipes import ENDS, ON_SURFACE, End, Pipe, Surroundings, turned
from cylx.runs.prolonging import prolonged
from cylx.runs.tracing import Trace
from cylx.runs.trials import fill_bend_scores

AHEAD = 14.0
"""How far ahead is looked, in radii."""
TURNS = 24
"""Directions to which a bend is tried."""
RADII = (1.3, 1.8, 2.2, 2.6, 3.0, 3.6, 4.4, 5.4, 6.6, 8.2, 10.0, 12.0)
"""Bend radii that are tried, in radii of the pipe."""
BEFORE = (-0.8, -0.3, 0.2)
"""Where the bend is tried to begin, in radii from the end of the pipe."""
STEP = 0.25
"""Pieces of the centre line, in radii."""
SHELL = 0.3
"""Points within so many radii of the surface, but not on it, speak against it."""
MOST_POINTS, MOST_IN_FIT = 500, 800
FIRST, SECOND = 8, 3
"""How many bends are tried with several angles, and how many are fitted."""
LEAST_AHEAD = 12
"""Free points just ahead of an end, without which nothing goes on there."""
LEAST_SCORE = 25.0
"""Log-likelihood ratio of a bend and a pipe against nothing of the kind."""
LEAST_TURN = math.radians(10.0)
SLIGHT = math.radians(30.0)
"""Bends of a smaller angle may be reducers."""
SHARPEST_BEND = 0.5
"""Bend radius, in radii of the pipe: a mitre is taken for one only between pipes that are known."""
LEAST_STRAIGHT, LEAST_AFTER_SLIGHT = 0.5, 1.5
"""A pipe behind a bend is as long at least, in radii: behind any, and behind a slight one."""
LEAST_ON_STRAIGHT = 8
LOOSE_OFFSET, LOOSE_TILT = 0.2, 0.1
"""What is known of a pipe before it is fitted: standard deviations, in radii and radians."""


def follow_ends(trace: Trace, near: Surroundings) -> int:
    """Follow the free ends of pipes into bends and further pipes; return how many pipes were added.

    Parameters
    ----------
    trace : Trace
        Gets the bends and pipes.
    near : Surroundings
    """
    count = 0
    if near.cells is None:
        return count
    for index in range(len(trace.pipes)):
        for end in ENDS:
            if index in trace.aside or (index, end) in trace.taken or (index, end) in trace.followed:
                continue
            trace.followed.add((index, end))
            found = onward_bend(trace.pipes[index], index, end, len(trace.pipes), near)
            other = None
            if found is None or found[1].bend.angle < SLIGHT:
                other = narrowed(trace.pipes[index], end, near)
            if other is not None and (found is None or other[1] > found[2]):
                _add(trace, other[0], trace.pipes[index], near)
                count += 1
            elif found is not None:
                pipe, bend, _ = found
                trace.pipes.append(pipe)
                add_fitted(trace, [bend])
                _add(trace, trace.pipes.pop(), trace.pipes[index], near)
                # it may end at a pipe that is known: that one need not be followed
                add_bends(trace, near, frozenset({len(trace.pipes) - 1}))
                count += 1
    return count


def _add(trace: Trace, pipe: Pipe, before: Pipe, near: Surroundings) -> None:
    """Add a pipe that goes on from another, as far as its points go."""
    end: End = "end" if _apart(pipe.end, before) > _apart(pipe.start, before) else "start"
    trace.pipes.append(prolonged(pipe, end, near))
    near.label(near.on(trace.pipes[-1]), pipe.label)


def _apart(place: FloatArray, pipe: Pipe) -> float:
    """Return how far a place is from the nearer end of a pipe."""
    return min(float(np.linalg.norm(place - pipe.at(end))) for end in ENDS)


def onward_bend(
    pipe: Pipe, index: int, end: End, number: int, near: Surroundings
) -> tuple[Pipe, FittedBend, float] | None:
    """Find the bend at an end of a pipe, and the pipe that goes on from there; None if there is none.

    Also return by how much the points ahead of the end speak for both of them, as log-likelihood ratio.

    Parameters
    ----------
    pipe : Pipe
    index : int
        Its number.
    end : {'start', 'end'}
    number : int
        Of the pipe that is found.
    near : Surroundings
    """
    place, axis, radius = pipe.at(end), pipe.outward(end), pipe.radius
    reach = AHEAD * radius
    indices = near.about(place, axis, -1.0 * radius, reach, reach)
    indices = indices[near.free(indices, (pipe.label,))]
    points = near.points[indices]
    away = points - place
    heights = away @ axis
    beside = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - heights**2, 0.0))
    ahead = (heights > 0.1 * radius) & (heights < 1.6 * radius) & (beside < 1.6 * radius)
    if ahead.sum() < LEAST_AHEAD:
        return None
    some = points[:: max(1, len(points) // MOST_POINTS)]
    best: tuple[float, Solved, Pipe, float] | None = None
    for bend in _starts(pipe, place, axis, some, len(points) / max(len(some), 1)):
        one = _refined(pipe, bend, points, near)
        if one is not None and (best is None or one[0] > best[0]):
            best = one
    if best is None or best[0] < LEAST_SCORE:
        return None
    score, solved, loose, length = best
    bend = solved.bend
    first, last = turned(bend.end, bend.end + length * bend.second)
    joined: End = "start" if float((last - first) @ bend.second) > 0 else "end"
    covariance = loose.covariance.copy()
    covariance[:4, :4] = solved.covariance[4:8, 4:8]
    covariance[4, 4] = solved.covariance[8, 8]
    found = replace(loose, start=first, end=last, radius=solved.radius, covariance=covariance)
    along, distances = bend.coordinates(points)
    beyond = (along > bend.length) & (along < bend.length + length)
    if (beyond & (np.abs(distances - radius) < ON_SURFACE * pipe.spread)).sum() < LEAST_ON_STRAIGHT:
        return None
    fitted = judged((index, number), (end, joined), solved, indices, near, pipe.spread)
    if fitted is None or is_flat(found, near):
        return None
    # the new pipe is where the fit has it already
    shifts = fitted.shifts.copy()
    shifts[1] = 0.0
    return found, replace(fitted, shifts=shifts), score


def _refined(
    pipe: Pipe, bend: Bend, points: FloatArray, near: Surroundings
) -> tuple[float, Solved, Pipe, float] | None:
    """Fit a bend and the pipe behind it; return its score, the fit, that pipe before it, and its length."""
    radius, spread = pipe.radius, pipe.spread
    loose, length = _next_pipe(pipe, bend, points, near)
    if loose is None:
        return None
    _, distances = bend.coordinates(points)
    about = points[np.abs(distances - radius) < max(SHELL * radius, 2.0 * ON_SURFACE * spread)]
    some = about[:: max(1, len(about) // MOST_IN_FIT)]
    solved = refined(bend, pipe, loose, radius, some, spread, 12, (0.0, length))
    bend = solved.bend
    if bend.angle < LEAST_TURN or not SHARPEST_BEND * radius < bend.bend_radius < 1.2 * RADII[-1] * radius:
        return None
    length = _length_beyond(bend, radius, spread, points)
    if length < (LEAST_STRAIGHT if bend.angle > SLIGHT else LEAST_AFTER_SLIGHT) * radius:
        return None
    return _score(bend, radius, spread, points, length), solved, loose, length


def _starts(pipe: Pipe, place: FloatArray, axis: FloatArray, points: FloatArray, weight: float) -> list[Bend]:
    """Return the best of many bends that begin at an end of a pipe."""
    radius, spread = pipe.radius, pipe.spread
    first, second = axis_basis(axis)
    local = np.ascontiguousarray((points - place) @ np.stack([axis, first, second]).T)
    shell = max(SHELL * radius, 2.0 * ON_SURFACE * spread)
    ratio = math.log(2.0 * shell / (math.sqrt(2.0 * math.pi) * spread))
    turns = np.array([k * (2.0 * math.pi / TURNS) for k in range(TURNS)])
    sizes, befores = np.array([one * radius for one in RADII]), np.array([one * radius for one in BEFORE])
    scores, surface = np.empty((TURNS, len(RADII), 3)), np.array([radius, spread, shell, ratio])
    pieces, step = int(AHEAD / STEP), STEP * radius
    fill_bend_scores(local, turns, sizes, befores, surface, pieces, step, scores)
    found = [
        (float(score), float(turn), float(before), float(size), float(angle))
        for turn, row in zip(turns, scores, strict=True)
        for size, (score, before, angle) in zip(sizes, row, strict=True)
    ]
    found.sort(reverse=True)
    tried: list[tuple[float, float, float, Bend]] = []
    for score, turn, before, size, angle in found[:FIRST]:
        if score * weight < LEAST_SCORE:
            break
        inward = math.cos(turn) * first + math.sin(turn) * second
        start = place + before * axis
        angles = np.concatenate([np.linspace(0.35, 1.15, 9) * angle, [math.pi / 4.0, math.pi / 2.0]])
        best_of: tuple[float, float, float, Bend] | None = None
        for some in angles[(angles >= LEAST_TURN) & (angles <= 0.9 * math.pi)]:
            onward = math.cos(some) * axis + math.sin(some) * inward
            bend = Bend(start + size * math.tan(0.5 * some) * axis, axis, onward, size)
            length = _length_beyond(bend, radius, spread, points)
            one = (_score(bend, radius, spread, points, length), turn, size, bend)
            best_of = one if best_of is None or one[0] > best_of[0] else best_of
        if best_of is not None:
            tried.append(best_of)
    tried.sort(key=lambda one: -one[0])
    return [one[3] for one in tried[:SECOND]]


def _gains(bend: Bend, radius: float, spread: float, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where along a bend the points near its surface are, and how much each speaks for it."""
    along, distances = bend.coordinates(points)
    errors = np.abs(distances - radius)
    shell = max(SHELL * radius, 2.0 * ON_SURFACE * spread)
    counted = (errors < shell) & (along > 0.0)
    ratio = math.log(2.0 * shell / (math.sqrt(2.0 * math.pi) * spread))
    return along[counted], np.maximum(ratio - 0.5 * (errors[counted] / spread) ** 2, -ratio)


def _length_beyond(bend: Bend, radius: float, spread: float, points: FloatArray) -> float:
    """Return how long the pipe behind a bend is, by the points that speak for it."""
    along, gains = _gains(bend, radius, spread, points)
    beyond = along > bend.length
    if not beyond.any():
        return 0.0
    heights, gains = along[beyond] - bend.length, gains[beyond]
    order = np.argsort(heights, kind="stable")
    heights, total = heights[order], np.cumsum(gains[order])
    # a pipe ends at a hole that is longer than its diameter
    holes = np.flatnonzero(np.diff(np.concatenate([[0.0], heights])) > 3.0 * radius)
    last = int(holes[0]) if len(holes) else len(heights)
    if last == 0 or total[:last].max() <= 0:
        return 0.0
    return float(heights[int(total[:last].argmax())])


def _score(bend: Bend, radius: float, spread: float, points: FloatArray, length: float) -> float:
    """Return how much the points speak for a bend and a pipe of a length behind it."""
    along, gains = _gains(bend, radius, spread, points)
    return float(gains[along < bend.length + length].sum())


def _next_pipe(pipe: Pipe, bend: Bend, points: FloatArray, near: Surroundings) -> tuple[Pipe | None, float]:
    """Return the pipe behind a bend, before it is fitted, and its length."""
    radius = pipe.radius
    length = _length_beyond(bend, radius, pipe.spread, points)
    if length < 0.5 * LEAST_STRAIGHT * radius:
        return None, 0.0
    first, last = turned(bend.end, bend.end + length * bend.second)
    offset, tilt = (LOOSE_OFFSET * radius) ** 2, LOOSE_TILT**2
    covariance = np.diag([offset, offset, tilt, tilt, max(float(pipe.covariance[4, 4]), (0.005 * radius) ** 2)])
    return Pipe(first, last, radius, pipe.spread, covariance, near.new_label()), length
