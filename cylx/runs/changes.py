"""Where along a pipe its circle changes: two pipes of one line, as those of a flat reducer, may be taken for one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.circle import search_circle
from cylx.runs.pipes import ON_SURFACE, Pipe
from cylx.runs.refitting import differs, is_borne_out, refit
from cylx.runs.stretches import SHELL

WINDOW, LEAST_IN_WINDOW = 2.0, 24
"""Length of a window along the axis, in radii, and points in it; it is longer where there are fewer."""
SAMPLES = 80
"""Circles through three points that are tried for a window."""
SMALLEST, LARGEST = 0.35, 2.4
"""Radii of other circles, in that of the pipe."""
OFF = 0.2
"""Share of the points of a window that are not on the pipe from which another circle is looked for."""
CLEARLY = 15.0
"""Log-likelihood ratio of another circle against that of the pipe, for a run of windows."""
TRIED, ALIKE = 4, 0.12
"""Circles of windows that are tried on the others, and by how many radii those of one pipe differ: its axis tilts."""
LEAST_SIDE = 3.0
"""Length of either pipe, in its radii."""
LEAST_CHANGE = 0.08
"""The radii of two nominal sizes differ by more, in the smaller."""
_STRIDES = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
"""Steps of a sequence that fills a cube evenly (R3, Roberts 2018): three points of each circle, always the same."""


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """A part of the axis: its heights from the middle, its points, another circle, and what that explains better."""

    low: float
    high: float
    flat: FloatArray
    circle: FloatArray
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """Windows from one end of the pipe with one other circle, and what it explains better."""

    windows: list[_Window]
    circle: FloatArray
    gain: float


def changed(pipe: Pipe, points: FloatArray) -> tuple[Pipe, Pipe] | None:
    """Return the two pipes that a pipe is, if a part of it clearly has another circle than the rest; None if not.

    Parameters
    ----------
    pipe : Pipe
    points : ndarray of shape (N, 3)
        About it, and of no other pipe.
    """
    windows = _windows(pipe, points)
    run = max((_run_from(windows, pipe), _run_from(windows[::-1], pipe)), key=lambda one: one.gain)
    if run.gain < CLEARLY:
        return None
    at_start = run.windows[0] is windows[0]
    low, high = min(one.low for one in run.windows), max(one.high for one in run.windows)
    cut = high if at_start else low
    place = pipe.middle + cut * pipe.direction
    first, second = pipe.with_ends(pipe.start, place), pipe.with_ends(place, pipe.end)
    part, rest = (first, second) if at_start else (second, first)
    shift = run.circle[0] * pipe.basis[0] + run.circle[1] * pipe.basis[1]
    moved = replace(part, start=part.start + shift, end=part.end + shift, radius=float(run.circle[2]))
    other, own = refit(moved, points), refit(rest, points)
    if other is None or own is None or not differs(other, own):
        return None
    if abs(other.radius - own.radius) < LEAST_CHANGE * min(other.radius, own.radius):
        return None
    if min(other.length / other.radius, own.length / own.radius) < LEAST_SIDE or not is_borne_out(other, points):
        return None
    other, own = (replace(one, spread=pipe.spread) for one in (other, own))
    return (other, own) if at_start else (own, other)


def _windows(pipe: Pipe, points: FloatArray) -> list[_Window]:
    """Return the windows along a pipe, each with the best other circle."""
    away = points - pipe.middle
    heights = away @ pipe.direction
    order = np.argsort(heights, kind="stable")
    order = order[np.abs(heights[order]) <= 0.5 * pipe.length]
    heights = heights[order]
    flat = np.stack([away[order] @ pipe.basis[0], away[order] @ pipe.basis[1]])
    out, first = [], 0
    while first < len(order):
        last = max(int(np.searchsorted(heights, heights[first] + WINDOW * pipe.radius)), first + LEAST_IN_WINDOW)
        if len(order) - last < LEAST_IN_WINDOW:
            last = len(order)
        last = min(last, len(order))
        low, high = float(heights[first]), float(heights[last - 1])
        own = np.ascontiguousarray(flat[:, first:last])
        out.append(_Window(low, high, own, *_other_circle(own, pipe)))
        first = last
    return out


def _other_circle(flat: FloatArray, pipe: Pipe) -> tuple[FloatArray, float]:
    """Return the best other circle of the points of a window, and how much better than the pipe it explains them."""
    count, tolerance = flat.shape[1], ON_SURFACE * pipe.spread
    none = np.array([0.0, 0.0, pipe.radius])
    distances = np.hypot(flat[0], flat[1])
    about = distances < pipe.radius + max(SHELL * pipe.radius, tolerance)
    off = about & (np.abs(distances - pipe.radius) > tolerance)
    if count < LEAST_IN_WINDOW // 2 or off.sum() < OFF * about.sum():
        return none, 0.0
    shape = np.zeros(5)
    least, greatest = SMALLEST * pipe.radius, LARGEST * pipe.radius
    if search_circle(flat, count, _samples(count), tolerance, least, greatest, shape) <= 0.0:
        return none, 0.0
    circle = shape[:3].copy()
    return circle, _gain(flat, circle, pipe) - _gain(flat, none, pipe)


def _samples(count: int) -> IndexArray:
    """Return triples of points of a window."""
    steps = np.arange(1, SAMPLES + 1)[:, None] * np.array(_STRIDES)
    return np.asarray((steps % 1.0 * count).astype(np.int64))


def _gain(flat: FloatArray, circle: FloatArray, pipe: Pipe) -> float:
    """Return how much the points of a window speak for a circle; those within it speak against it."""
    errors = np.hypot(flat[0] - circle[0], flat[1] - circle[1]) - circle[2]
    shell = max(SHELL * pipe.radius, 2.0 * ON_SURFACE * pipe.spread)
    ratio = math.log(2.0 * shell / (math.sqrt(2.0 * math.pi) * pipe.spread))
    return float(np.where(errors < shell, np.maximum(ratio - 0.5 * (errors / pipe.spread) ** 2, -ratio), 0.0).sum())


def _run_from(windows: list[_Window], pipe: Pipe) -> _Run:
    """Return the windows from an end of the pipe that one other circle explains better, most of them clearly."""
    none = np.array([0.0, 0.0, pipe.radius])
    best = _Run([], none, 0.0)
    for one in sorted(windows, key=lambda one: -one.gain)[:TRIED]:
        if one.gain <= 0.0:
            break
        total, top, count = 0.0, 0.0, 0
        for k, window in enumerate(windows):
            alike = float(np.abs(window.circle - one.circle).max()) < ALIKE * pipe.radius
            here = _gain(window.flat, one.circle, pipe) - _gain(window.flat, none, pipe)
            total += max(here, window.gain) if alike else here
            if total > top:
                top, count = total, k + 1
        if top > best.gain:
            best = _Run(windows[:count], one.circle, top)
    return best
