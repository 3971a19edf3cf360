"""What is about a pipe: the free points round its axis, and something that was found among them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import axis_basis
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings
from cylx.runs.wider import NARROWEST

SECTORS = 16
"""Parts of a turn about the axis of a pipe."""
ABOUT = 7.0
"""Points up to so many radii of the pipe are looked at: a wall goes on beyond what a flange could be."""


@dataclass(frozen=True, slots=True, eq=False)
class Collar:
    """Something about a pipe.

    Parameters
    ----------
    kind : {'flange', 'inline'}
    where : {'side', 'start', 'end'}
        Whether the pipe goes on at both sides of it, or ends at it.
    center : ndarray of shape (3,)
    radius, thickness : float
    pair : bool
    indices : ndarray of shape (n,)
    rms, coverage, confidence : float
    std : dict of str to float
    """

    kind: Literal["flange", "inline"]
    where: Literal["side", "start", "end"]
    center: FloatArray
    radius: float
    thickness: float
    pair: bool
    indices: IndexArray
    rms: float
    coverage: float
    confidence: float
    std: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """The free points about a pipe: indices, heights from its start, distances from its axis, sectors."""

    indices: IndexArray
    heights: FloatArray
    distances: FloatArray
    sectors: IndexArray

    def part(self, keep: MaskArray) -> Ring:
        """Return some of them."""
        return Ring(self.indices[keep], self.heights[keep], self.distances[keep], self.sectors[keep])


def ring_about(pipe: Pipe, near: Surroundings, rims: list[int], shut: tuple[bool, bool]) -> Ring:
    """Return the free points about a pipe, and those of its rims; beyond its ends unless these are shut."""
    low = 0.0 if shut[0] else -1.5 * pipe.radius
    high = pipe.length + (0.0 if shut[1] else 1.5 * pipe.radius)
    inner = NARROWEST * pipe.radius + ON_SURFACE * pipe.spread
    indices = near.about(pipe.start, pipe.direction, low, high, ABOUT * pipe.radius, inner)
    indices = indices[near.free(indices, rims)]
    away = near.points[indices] - pipe.start
    first, second = axis_basis(pipe.direction)
    x, y = away @ first, away @ second
    sectors = np.floor((np.arctan2(y, x) / (2 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
    return Ring(indices, away @ pipe.direction, np.hypot(x, y), sectors)
