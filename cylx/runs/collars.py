"""Flanges about a pipe, and other things that sit about it, such as valves: what is round about its axis or is not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import axis_basis
from cylx.runs.pipes import ON_SURFACE, End, Pipe, Surroundings

SECTORS = 16
WIDEST, NARROWEST = 5.0, 1.12
"""Radii of a flange, in those of its pipe."""
LEAST_SECTORS = 4
"""Sectors of a slice about the axis that must hold points of something that is short along it."""
ABOVE = 2.5
"""A sector of a slice holds something short if it has so many times the points that are usual along the pipe."""
LEAST_POINTS = 12
LONGEST_FLANGE = 1.25
"""Length of a flange or a pair along the axis, in its radius; what is longer is something else."""
LONGEST_INLINE = 7.0
ROUND = 0.45
"""Share of the sectors that must have points at the rim."""
MOST_WITHIN = 0.45
"""Points in the middle of the disc, between its faces, for each point on its surface."""
MOST_BEYOND = 0.5
"""Points just beyond its rim, for each point on its surface."""


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
class _Ring:
    """The free points about a pipe: indices, heights from its start, distances from its axis, sectors."""

    indices: IndexArray
    heights: FloatArray
    distances: FloatArray
    sectors: IndexArray

    def part(self, keep: MaskArray) -> _Ring:
        return _Ring(self.indices[keep], self.heights[keep], self.distances[keep], self.sectors[keep])


def collars_of(index: int, pipes: list[Pipe], near: Surroundings, shut: tuple[bool, bool]) -> list[Collar]:
    """Return the flanges on a pipe, and other things about it, along its axis.

    Parameters
    ----------
    index : int
        Of the pipe.
    pipes : list of Pipe
    near : Surroundings
    shut : pair of bool
        Whether something joins its start and its end already, so that nothing else is there.
    """
    pipe = pipes[index]
    others = coaxial(index, pipes)
    rims = [k for k in others if pipes[k].length < LONGEST_FLANGE * pipes[k].radius]
    covers = [k for k in others if k not in rims]
    ring = _ring(pipe, near, [pipes[k].label for k in rims], shut)
    if len(ring.indices) < LEAST_POINTS:
        return []
    out = []
    for low, high in _short_things(ring, pipe, near):
        margin = ON_SURFACE * pipe.spread
        own = ring.part((ring.heights > low - margin) & (ring.heights < high + margin))
        found = _described(own, pipe, near, ring, shut)
        if found is not None and not _is_of_cover(found, pipe, [pipes[k] for k in covers]):
            out.append(found)
    return out


def coaxial(index: int, pipes: list[Pipe]) -> list[int]:
    """Return the wider pipes about the axis of a pipe."""
    pipe, out = pipes[index], []
    for k, other in enumerate(pipes):
        if k == index or not NARROWEST * pipe.radius < other.radius < WIDEST * pipe.radius:
            continue
        away = other.middle - pipe.middle
        along = float(away @ pipe.direction)
        offset = float(np.linalg.norm(away - along * pipe.direction))
        reach = 0.5 * (pipe.length + other.length) + other.radius
        parallel = abs(float(other.direction @ pipe.direction)) > math.cos(0.1)
        if parallel and offset < 0.2 * pipe.radius and abs(along) < reach:
            out.append(k)
    return out


def _ring(pipe: Pipe, near: Surroundings, rims: list[int], shut: tuple[bool, bool]) -> _Ring:
    low = 0.0 if shut[0] else -1.5 * pipe.radius
    high = pipe.length + (0.0 if shut[1] else 1.5 * pipe.radius)
    inner = NARROWEST * pipe.radius + ON_SURFACE * pipe.spread
    indices = near.about(pipe.start, pipe.direction, low, high, WIDEST * pipe.radius, inner)
    indices = indices[near.free(indices, rims)]
    away = near.points[indices] - pipe.start
    first, second = axis_basis(pipe.direction)
    x, y = away @ first, away @ second
    sectors = np.floor((np.arctan2(y, x) / (2 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
    return _Ring(indices, away @ pipe.direction, np.hypot(x, y), sectors)


def _short_things(ring: _Ring, pipe: Pipe, near: Surroundings) -> list[tuple[float, float]]:
    """Return where along the axis there is more about the pipe than usual, on several sides of it."""
    width = max(0.7 * near.spacing, 2.0 * pipe.spread, 0.08 * pipe.radius)
    low = float(ring.heights.min())
    rows = np.floor((ring.heights - low) / width).astype(np.int64)
    count = int(rows.max()) + 1
    grid = np.zeros((SECTORS, count))
    np.add.at(grid, (ring.sectors, rows), 1.0)
    reach = max(int(6.0 * pipe.radius / width), 8)
    usual = np.empty_like(grid)
    for k in range(count):
        usual[:, k] = np.median(grid[:, max(0, k - reach) : k + reach + 1], axis=1)
    active = (grid > ABOVE * usual).sum(axis=0) >= LEAST_SECTORS
    out: list[tuple[float, float]] = []
    bridge = max(2, int(0.35 * pipe.radius / width))
    last = -bridge - 2
    for k in np.flatnonzero(active).tolist():
        if k - last > bridge:
            out.append((low + k * width, low + (k + 1) * width))
        else:
            out[-1] = (out[-1][0], low + (k + 1) * width)
        last = k
    return out


def _rim_of(own: _Ring, pipe: Pipe) -> float:
    """Return the radius at which the points stop: most lie there, few beyond."""
    width = 2.5 * pipe.spread
    grid = np.arange(NARROWEST * pipe.radius + width, float(own.distances.max()) + pipe.spread, 0.5 * pipe.spread)
    if not len(grid):
        return 0.0
    ordered = np.sort(own.distances)
    upper, lower = np.searchsorted(ordered, grid + width), np.searchsorted(ordered, grid - width)
    beyond = np.searchsorted(ordered, 1.6 * grid) - upper
    best = float(grid[int(np.argmax(upper - lower - beyond))])
    at = own.distances[np.abs(own.distances - best) < width]
    return float(np.median(at)) if len(at) else best


def _described(own: _Ring, pipe: Pipe, near: Surroundings, ring: _Ring, shut: tuple[bool, bool]) -> Collar | None:
    if len(own.indices) < LEAST_POINTS:
        return None
    radius, margin = _rim_of(own, pipe), ON_SURFACE * pipe.spread
    if not 1.2 * pipe.radius < radius < 0.97 * WIDEST * pipe.radius:
        return None
    solid = own.part(own.distances < radius + margin)
    low, high = _faces(solid.heights, pipe.spread)
    thickness = high - low
    if thickness <= 0 or len(solid.indices) < LEAST_POINTS:
        return None
    middle = 0.5 * (low + high)
    center = pipe.start + middle * pipe.direction
    where: Literal["side", "start", "end"] = "side"
    if middle < max(0.6 * thickness, 0.6 * pipe.radius) and not shut[0]:
        where = "start"
    elif middle > pipe.length - max(0.6 * thickness, 0.6 * pipe.radius) and not shut[1]:
        where = "end"
    if thickness > LONGEST_FLANGE * radius:
        return _inline(own, pipe, center, radius, thickness) if where == "side" else None
    rim = np.abs(solid.distances - radius) < margin
    face = np.minimum(np.abs(solid.heights - low), np.abs(solid.heights - high)) < margin
    on = rim | face
    beyond = (ring.distances > radius + 1.5 * margin) & (ring.distances < 1.4 * radius + margin)
    beyond &= (ring.heights > low - margin) & (ring.heights < high + margin)
    within = ~on & (solid.heights > low) & (solid.heights < high)
    count = int(on.sum())
    # the rim, seen from where the pipe is seen
    sides = len(np.unique(solid.sectors[rim]))
    if (
        count < LEAST_POINTS
        or within.sum() > MOST_WITHIN * count
        or beyond.sum() > MOST_BEYOND * count
        or sides < ROUND * len(np.unique(own.sectors))
        or sides < LEAST_SECTORS
    ):
        return None
    errors = np.where(rim[on], solid.distances[on] - radius, 0.0)
    rms = float(np.sqrt((errors**2).mean()))
    coverage = sides / SECTORS
    std = {
        "radius": pipe.spread / math.sqrt(max(int(rim.sum()), 1)),
        "thickness": 2.0 * pipe.spread / math.sqrt(max(int(face.sum()), 1)),
        "center": pipe.spread / math.sqrt(max(int(face.sum()), 1)),
    }
    wrong = float(within.sum() + beyond.sum()) / count
    confidence = float(
        np.clip((1.0 - math.exp(-count / 15.0)) * (0.5 + 0.5 * min(1.0, 2.0 * coverage)) * (1.0 - 0.5 * wrong), 0, 0.99)
    )
    return Collar(
        "flange",
        where,
        center,
        radius,
        thickness,
        where == "side",
        solid.indices[on],
        rms,
        coverage,
        confidence,
        std,
    )


def _faces(heights: FloatArray, spread: float) -> tuple[float, float]:
    """Return where the points begin and end along the axis."""
    low, high = (float(value) for value in np.quantile(heights, [0.03, 0.97]))
    first, last = heights[heights < low + 1.5 * spread], heights[heights > high - 1.5 * spread]
    return float(np.median(first)), float(np.median(last))


def _inline(own: _Ring, pipe: Pipe, center: FloatArray, radius: float, thickness: float) -> Collar | None:
    """Describe something long about a pipe that is neither a flange nor a tube."""
    if thickness > LONGEST_INLINE * radius:
        return None
    spread = np.abs(own.distances - np.median(own.distances)) < ON_SURFACE * pipe.spread
    sides = len(np.unique(own.sectors))
    if spread.mean() > 0.7 or sides < LEAST_SECTORS:
        return None
    coverage = sides / SECTORS
    return Collar("inline", "side", center, radius, thickness, True, own.indices, 0.0, coverage, 0.7, {})


def _is_of_cover(collar: Collar, pipe: Pipe, covers: list[Pipe]) -> bool:
    """Return whether something is the end of a wider tube about the pipe, such as an insulation."""
    for cover in covers:
        along = abs(float((collar.center - cover.middle) @ pipe.direction))
        if along < 0.5 * cover.length + cover.radius and collar.radius < 1.15 * cover.radius:
            return True
    return False


def is_end(where: str) -> End | None:
    """Return the end of a pipe at which something is, None for none."""
    return "start" if where == "start" else "end" if where == "end" else None
