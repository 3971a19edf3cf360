"""Along a run: a reducer at an end of a pipe, and the pipe behind it that was too short to be found alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis
from cylx.runs.pipes import ON_SURFACE, End, Pipe, Surroundings, turned
from cylx.runs.refitting import is_borne_out, refit
from cylx.runs.trials import fill_reducer_scores

RATIOS = (0.45, 0.55, 0.65, 0.73, 0.8, 0.87, 1.15, 1.25, 1.37, 1.53, 1.8, 2.2)
"""Radii of the pipe behind the reducer that are tried, in those of the pipe before it."""
LENGTHS = (0.8, 1.3, 1.8, 2.5, 3.3)
"""Lengths of the reducer that are tried, in the larger radius."""
BEFORE = (-4.0, -3.0, -2.2, -1.5, -1.0, -0.5, 0.0, 0.4)
"""Where the reducer is tried to begin, in radii from the end: pipes may have been found too long."""
SIDES = 8
"""Sides to which an eccentric reducer is tried."""
AHEAD = 12.0
STEP = 0.25
SHELL = 0.3
MOST_POINTS = 500
LEAST_AHEAD, REACH = 12, 4.0
"""Free points so many radii ahead of an end, without which no pipe goes on there."""
LEAST_SCORE, LEAST_BEHIND = 20.0, 10
"""Gain over the pipe alone in log-likelihood, and points of the pipe behind the reducer."""
LEAST_LENGTH = 0.6
"""Of the pipe behind the reducer, in its radii."""


class _Tried(NamedTuple):
    """A reducer that was tried: its score, the ratio of the radii, and the pipe behind it."""

    score: float
    times: float
    begin: float
    end: float
    radius: float
    shift: tuple[float, float]


def narrowed(pipe: Pipe, end: End, near: Surroundings) -> tuple[Pipe, float] | None:
    """Find the pipe of another radius that goes on from an end of a pipe behind a reducer; None if there is none.

    Also return by how much the points ahead of the end speak for both of them, as log-likelihood ratio.

    Parameters
    ----------
    pipe : Pipe
    end : {'start', 'end'}
    near : Surroundings
    """
    place, axis, radius = pipe.at(end), pipe.outward(end), pipe.radius
    back = max(-0.6 * pipe.length, BEFORE[0] * radius)
    indices = near.about(place, axis, back, AHEAD * radius, 2.6 * radius)
    indices = indices[near.free(indices, (pipe.label,))]
    away = near.points[indices] - place
    first, second = axis_basis(axis)
    x, a, b = away @ axis, away @ first, away @ second
    ahead = (x > 0.1 * radius) & (x < REACH * radius) & (np.hypot(a, b) < 2.3 * radius)
    if ahead.sum() < LEAST_AHEAD:
        return None
    some = slice(None, None, max(1, len(x) // MOST_POINTS))
    found = _best(x[some], a[some], b[some], pipe, back, len(x) / max(len(x[some]), 1))
    if found is None:
        return None
    low, high, other, shift, score = found
    start = place + low * axis + shift[0] * first + shift[1] * second
    stop = place + high * axis + shift[0] * first + shift[1] * second
    label = near.new_label()
    new = Pipe(*turned(start, stop), other, pipe.spread, pipe.covariance, label)
    fitted = refit(new, near.points[indices])
    if fitted is None or abs(fitted.radius - other) > 0.1 * other:
        return None
    on = near.on(fitted, (pipe.label,))
    short = len(on) < LEAST_BEHIND or fitted.length < LEAST_LENGTH * fitted.radius
    if short or not is_borne_out(fitted, near.points[indices], LEAST_BEHIND):
        return None
    return replace(fitted, spread=pipe.spread), score


def _best(
    x: FloatArray, a: FloatArray, b: FloatArray, pipe: Pipe, back: float, weight: float
) -> tuple[float, float, float, tuple[float, float], float] | None:
    """Return where the pipe behind the best reducer begins and ends, its radius, how far aside it is, and a score."""
    radius, spread = pipe.radius, pipe.spread
    shell = max(SHELL * radius, 2.0 * ON_SURFACE * spread)
    ratio = math.log(2.0 * shell / (math.sqrt(2.0 * math.pi) * spread))
    step = STEP * radius
    rows = np.clip(((x - back) / step).astype(np.int64), 0, None)
    count = int(rows.max(initial=0)) + 1

    def gains(errors: FloatArray) -> FloatArray:
        return np.where(np.abs(errors) < shell, np.maximum(ratio - 0.5 * (errors / spread) ** 2, -ratio), 0.0)

    plain = np.cumsum(np.bincount(rows, weights=gains(np.hypot(a, b) - radius), minlength=count))
    alone = float(plain.max(initial=0.0))

    local, surface = np.column_stack([x, a, b]), np.array([radius, spread, shell, ratio])

    def tried(ratios: Sequence[float], lengths: Sequence[float], befores: Sequence[float], sides: int) -> list[_Tried]:
        rows = [
            (times, before * radius, long * max(radius, times * radius), times * radius, *shift)
            for times in ratios
            for long in lengths
            for before in befores
            if before * radius >= back
            for shift in _shifts(abs(times - 1.0) * radius, sides)
        ]
        scores = np.empty((len(rows), 2))
        fill_reducer_scores(local, np.array(rows).reshape(-1, 6)[:, 1:], surface, back, step, scores)
        return [
            _Tried(score, times, begin + length, stop, other, (first, second))
            for (times, begin, length, other, first, second), (score, stop) in zip(rows, scores.tolist(), strict=True)
            if stop - begin - length >= LEAST_LENGTH * other
        ]

    first = max(tried(RATIOS, LENGTHS[1::2], BEFORE[::2], 4), default=None)
    if first is None or (first.score - alone) * weight < 0.3 * LEAST_SCORE:
        return None
    place = RATIOS.index(first.times)
    best = max([first, *tried(RATIOS[max(place - 1, 0) : place + 2], LENGTHS, BEFORE, SIDES)])
    if (best.score - alone) * weight < LEAST_SCORE:
        return None
    behind = plain[min(max(int(-back / step) - 1, 0), len(plain) - 1)] if back < 0 else 0.0
    return best.begin, best.end, best.radius, best.shift, (best.score - float(behind)) * weight


def _shifts(offset: float, sides: int) -> list[tuple[float, float]]:
    """Return how far a reducer may shift across its axis: not at all, or to one of several sides."""
    angles = np.arange(sides) * (2.0 * math.pi / sides)
    return [(0.0, 0.0), *((offset * math.cos(t), offset * math.sin(t)) for t in angles)]
