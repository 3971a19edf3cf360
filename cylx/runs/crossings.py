"""Pipes that go through another are two branches of a cross: they are cut in two there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.lines import common_perpendicular
from cylx.runs.pipes import Pipe, Surroundings

CROSSING = math.radians(25.0)
"""Axes at a smaller angle do not cross."""
EQUAL = 0.95
"""Pipes of about one radius that cross stay as they are: nobody can tell which of them goes through."""
BESIDE = 0.3
"""Axes that cross meet within so many radii of the other."""


def split_crossings(pipes: list[Pipe], near: Surroundings) -> list[Pipe]:
    """Return the pipes with those cut in two that go through another: they are two branches that face each other."""
    out = list(pipes)
    k = 0
    while k < len(out):
        main = _crossed(out, k)
        if main is not None:
            pipe, (center, sine) = out[k], main[1]
            depth = main[0].radius / sine
            along = float((center - pipe.middle) @ pipe.direction)
            first = pipe.middle + (along - depth) * pipe.direction
            second = pipe.middle + (along + depth) * pipe.direction
            out[k] = pipe.with_ends(pipe.start, first)
            other = replace(pipe.with_ends(second, pipe.end), label=near.new_label(), source=None)
            near.release(out[k])
            near.label(near.on(other), other.label)
            out.append(other)
        else:
            k += 1
    return out


def _crossed(pipes: Sequence[Pipe], k: int) -> tuple[Pipe, tuple[FloatArray, float]] | None:
    """Return the pipe that a pipe goes through, where, and the sine of the angle between them; None for none."""
    pipe = pipes[k]
    for j, main in enumerate(pipes):
        if j == k or pipe.radius > EQUAL * main.radius:
            continue
        found = crossing_of(pipe, main)
        if found is not None:
            return main, found
    return None


def crossing_of(pipe: Pipe, main: Pipe) -> tuple[FloatArray, float] | None:
    """Return where a pipe goes through another, on its axis, and the sine of the angle; None if it does not."""
    apart = pipe.middle - main.middle
    if float(apart @ apart) > (0.5 * (pipe.length + main.length) + main.radius) ** 2:
        return None
    cosine = float(pipe.direction @ main.direction)
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    if sine < math.sin(CROSSING):
        return None
    feet = common_perpendicular(pipe.middle, pipe.direction, main.middle, main.direction)[:2]
    if float(np.linalg.norm(feet[0] - feet[1])) > BESIDE * main.radius:
        return None
    inside = abs(float((feet[0] - pipe.middle) @ pipe.direction)) < 0.5 * pipe.length - 2.0 * main.radius / sine
    on = abs(float((feet[1] - main.middle) @ main.direction)) < 0.5 * main.length - 1.5 * pipe.radius
    return (feet[1], sine) if inside and on else None


def equal_crossings(pipes: Sequence[Pipe], aside: set[int]) -> Iterator[tuple[int, int, FloatArray, float]]:
    """Yield the pairs of pipes of about one radius that go through each other, where, and the sine of the angle."""
    for k, pipe in enumerate(pipes):
        for j in range(k):
            main = pipes[j]
            equal = min(pipe.radius, main.radius) > EQUAL * max(pipe.radius, main.radius)
            if equal and not {j, k} & aside:
                found = crossing_of(pipe, main)
                if found is not None:
                    first, second = (j, k) if main.length >= pipe.length else (k, j)
                    yield first, second, *found
