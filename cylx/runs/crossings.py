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
    k, lines = 0, _Lines(out)
    while k < len(out):
        main = _crossed(out, k, lines)
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
            lines = _Lines(out)
        else:
            k += 1
    return out


class _Lines:
    """The axes of pipes as arrays: which of them a pipe may cross is asked of all at once."""

    def __init__(self, pipes: Sequence[Pipe]) -> None:
        self.middles = np.array([pipe.middle for pipe in pipes]).reshape(-1, 3)
        self.directions = np.array([pipe.direction for pipe in pipes]).reshape(-1, 3)
        self.lengths = np.array([pipe.length for pipe in pipes])
        self.radii = np.array([pipe.radius for pipe in pipes])

    def about(self, pipe: Pipe) -> list[int]:
        """Return the pipes that are near enough, at an angle, with axes that pass no farther than a radius."""
        apart = self.middles - pipe.middle
        reach = 0.5 * (self.lengths + pipe.length) + np.maximum(self.radii, pipe.radius)
        normals = np.cross(self.directions, pipe.direction)
        square = np.einsum("ij,ij->i", normals, normals)
        near = np.einsum("ij,ij->i", apart, apart) <= reach**2
        near &= square > (0.99 * math.sin(CROSSING)) ** 2
        near &= np.einsum("ij,ij->i", apart, normals) ** 2 <= square * np.maximum(self.radii, pipe.radius) ** 2
        return [int(j) for j in np.flatnonzero(near)]


def _crossed(pipes: Sequence[Pipe], k: int, lines: _Lines) -> tuple[Pipe, tuple[FloatArray, float]] | None:
    """Return the pipe that a pipe goes through, where, and the sine of the angle between them; None for none."""
    pipe = pipes[k]
    for j in lines.about(pipe):
        main = pipes[j]
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
    lines = _Lines(pipes)
    for k, pipe in enumerate(pipes):
        for j in (one for one in lines.about(pipe) if one < k):
            main = pipes[j]
            equal = min(pipe.radius, main.radius) > EQUAL * max(pipe.radius, main.radius)
            if equal and not {j, k} & aside:
                found = crossing_of(pipe, main)
                if found is not None:
                    first, second = (j, k) if main.length >= pipe.length else (k, j)
                    yield first, second, *found
