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
    pipe = pipes[index]
    radii, lengths = np.array([one.radius for one in pipes]), np.array([one.length for one in pipes])
    away = np.array([one.middle for one in pipes]).reshape(-1, 3) - pipe.middle
    turns = np.abs(np.array([one.direction for one in pipes]).reshape(-1, 3) @ pipe.direction)
    along = away @ pipe.direction
    offsets = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - along**2, 0.0))
    short = lengths < LONGEST_RIM * radii
    wide = (radii > NARROWEST * pipe.radius) & (radii < WIDEST * pipe.radius)
    parallel = turns > np.where(short, math.cos(0.3), math.cos(0.1))
    beside = offsets < np.where(short, 0.5, 0.25) * pipe.radius
    reach = np.abs(along) < 0.5 * (pipe.length + lengths) + radii
    found = wide & parallel & beside & reach
    found[index] = False
    return [int(k) for k in np.flatnonzero(found)]


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
