"""Cylinders about a narrower pipe: rims of flanges, and covers such as insulation. They are no pipes themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cylx.runs.pipes import Pipe

WIDEST, NARROWEST = 5.0, 1.12
"""Radii of a rim, in those of its pipe."""
LONGEST_RIM = 1.25
"""Length of the rim of a flange, in its radius; what is longer is a cover."""
COVERED = 0.5
"""A cover has a pipe in so much of its length."""


def coaxial(index: int, pipes: Sequence[Pipe]) -> list[int]:
    """Return the wider pipes about the axis of a pipe."""
    pipe, out = pipes[index], []
    for k, other in enumerate(pipes):
        if k == index or not NARROWEST * pipe.radius < other.radius < WIDEST * pipe.radius:
            continue
        away = other.middle - pipe.middle
        along = float(away @ pipe.direction)
        offset = float(np.linalg.norm(away - along * pipe.direction))
        reach = 0.5 * (pipe.length + other.length) + other.radius
        short = other.length < LONGEST_RIM * other.radius
        parallel = abs(float(other.direction @ pipe.direction)) > math.cos(0.3 if short else 0.1)
        if parallel and offset < (0.5 if short else 0.25) * pipe.radius and abs(along) < reach:
            out.append(k)
    return out


def wider_ones(pipes: Sequence[Pipe]) -> set[int]:
    """Return the cylinders that are rims or covers of a pipe that is within them."""
    out: set[int] = set()
    for index, pipe in enumerate(pipes):
        for k in coaxial(index, pipes):
            other = pipes[k]
            along = float((other.middle - pipe.middle) @ pipe.direction)
            low, high = along - 0.5 * other.length, along + 0.5 * other.length
            within = min(high, 0.5 * pipe.length) - max(low, -0.5 * pipe.length)
            if other.length < LONGEST_RIM * other.radius:
                at = abs(along) < 0.5 * (pipe.length + other.length) and other.radius > 1.2 * pipe.radius
            else:
                at = within > COVERED * other.length
            if at:
                out.add(k)
    return out
