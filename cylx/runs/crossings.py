"""Pipes that go through another are two branches of a cross: they are cut in two there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.lines import common_perpendicular
from cylx.runs.pipes import Pipe, Surroundings

CROSSING = math.radians(25.0)
"""Axes at a smaller angle do not cross."""
THROUGH = 1.08
"""Radius of a pipe that goes through another, in the radius of that."""
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
        if j == k or pipe.radius > THROUGH * main.radius:
            continue
        if pipe.radius > 0.95 * main.radius and (pipe.length, k) > (main.length, j):
            continue
        sine = float(np.linalg.norm(np.cross(pipe.direction, main.direction)))
        if sine < math.sin(CROSSING):
            continue
        feet = common_perpendicular(pipe.middle, pipe.direction, main.middle, main.direction)[:2]
        if float(np.linalg.norm(feet[0] - feet[1])) > BESIDE * main.radius:
            continue
        inside = abs(float((feet[0] - pipe.middle) @ pipe.direction)) < 0.5 * pipe.length - 2.0 * main.radius / sine
        on = abs(float((feet[1] - main.middle) @ main.direction)) < 0.5 * main.length - 1.5 * pipe.radius
        if inside and on:
            return main, (feet[0], sine)
    return None
