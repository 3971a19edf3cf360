"""Flanges about a pipe, and other things that sit about it, such as valves: what is round about its axis or is not."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

import numpy as np

from cylx.geometry.arrays import MaskArray
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings
from cylx.runs.rings import SECTORS, Collar, Ring, ring_about
from cylx.runs.wider import LONGEST_RIM, NARROWEST, WIDEST, coaxial

LEAST_SECTORS = 4
"""Sectors of a slice about the axis that must hold points of something that is short along it."""
ABOVE = 2.5
"""A sector of a slice holds something short if it has so many times the points that are usual along the pipe."""
LEAST_POINTS = 12
LONGEST_FLANGE = 1.25
"""Length of a flange or a pair along the axis, in its radius; what is longer is something else."""
THICKEST_PAIR, THICKEST_DISC = 0.9, 0.45
"""Thickness of a pair of flanges, and of one at the end of a pipe, in its radius: thicker discs are heads."""
LEAST_PIPE = 2.5
"""A pipe is at least so long for each of its flanges, in the radius of that."""
LEAST_ON_FACE = 6
"""Points of a face that tell where it is; else those of the rim do."""
LONGEST_INLINE = 6.0
"""Distance of the flanges at either side of something in line, in their radius."""
LEAST_SIDES = 5
"""Sectors about the axis in which the rim of a flange must be seen, and its faces."""
ALL_ROUND = 10
"""Sectors in which the rim must be seen if no face is."""
ROUND = 0.45
"""Share of the sectors that must have points at the rim."""
MOST_WITHIN = 0.45
"""Points in the middle of the disc, between its faces, for each point on its surface."""
MOST_BEYOND = 0.5
"""Points just beyond its rim, for each point on its surface."""


def collars_of(index: int, pipes: list[Pipe], near: Surroundings, shut: tuple[bool, bool]) -> list[Collar]:
    """Return the flanges on a pipe, and what is in line between two of them, along its axis.

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
    rims = [k for k in others if pipes[k].length < LONGEST_RIM * pipes[k].radius]
    covers = [pipes[k] for k in others if k not in rims]
    ring = ring_about(pipe, near, [pipes[k].label for k in rims], shut)
    if len(ring.indices) < LEAST_POINTS:
        return []
    flanges: list[Collar] = []
    for low, high in _short_things(ring, pipe, near):
        if any(abs(0.5 * (low + high) - _height(one, pipe)) < 0.6 * one.thickness for one in flanges):
            continue
        found = _flange(ring, (low, high), pipe, near, shut)
        if found is None or _is_of_cover(found, pipe, covers):
            continue
        if all(abs(_height(found, pipe) - _height(one, pipe)) > 0.5 * one.thickness for one in flanges):
            flanges.append(found)
    # what has more discs than there is room for on a pipe is a shaft with collars
    if pipe.length < LEAST_PIPE * sum(one.radius for one in flanges):
        return []
    flanges.sort(key=lambda one: _height(one, pipe))
    return _with_inlines(flanges, ring, pipe, near)


def _height(collar: Collar, pipe: Pipe) -> float:
    return float((collar.center - pipe.start) @ pipe.direction)


def _with_inlines(flanges: list[Collar], ring: Ring, pipe: Pipe, near: Surroundings) -> list[Collar]:
    """Return flanges, and what is between two of them where the pipe is not seen; what is about that is no flange."""
    inlines: list[Collar] = []
    k = 0
    while k < len(flanges):
        for m in range(len(flanges) - 1, k, -1):
            found = _inline(flanges[k], flanges[m], ring, pipe, near)
            if found is not None:
                inlines.append(found)
                del flanges[k + 1 : m]
                k += 1
                break
        k += 1
    return [*inlines, *flanges]


def _short_things(ring: Ring, pipe: Pipe, near: Surroundings) -> list[tuple[float, float]]:
    """Return where along the axis there is more about the pipe than usual, on several sides of it."""
    width = max(0.7 * near.spacing, 2.0 * pipe.spread, 0.08 * pipe.radius)
    low = float(ring.heights.min())
    rows = np.floor((ring.heights - low) / width).astype(np.int64)
    count = int(rows.max()) + 1
    grid = np.zeros((SECTORS, count))
    inner = ring.distances < WIDEST * pipe.radius
    np.add.at(grid, (ring.sectors[inner], rows[inner]), 1.0)
    reach = max(int(6.0 * pipe.radius / width), 8)
    active = np.zeros(count, np.bool_)
    for k in np.flatnonzero((grid > 0).sum(axis=0) >= LEAST_SECTORS):
        usual = np.median(grid[:, max(0, k - reach) : k + reach + 1], axis=1)
        active[k] = (grid[:, k] > ABOVE * usual).sum() >= LEAST_SECTORS
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


def _rim_of(own: Ring, pipe: Pipe) -> float:
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


def _flange(
    ring: Ring, seed: tuple[float, float], pipe: Pipe, near: Surroundings, shut: tuple[bool, bool]
) -> Collar | None:
    """Return the flange of which a short piece was seen; None if it is none."""
    margin = ON_SURFACE * pipe.spread
    own = ring.part((ring.heights > seed[0] - margin) & (ring.heights < seed[1] + margin))
    if len(own.indices) < LEAST_POINTS:
        return None
    radius = _rim_of(own, pipe)
    if not 1.2 * pipe.radius < radius < 0.97 * WIDEST * pipe.radius:
        return None
    # a rim goes on from face to face
    at_rim = np.sort(ring.heights[np.abs(ring.distances - radius) < margin])
    breaks = np.flatnonzero(np.diff(at_rim) > max(1.5 * near.spacing, 0.15 * radius))
    bounds = np.concatenate([[0], breaks + 1, [len(at_rim)]])
    middle = 0.5 * (seed[0] + seed[1])
    pieces = [at_rim[first:last] for first, last in pairwise(bounds) if last > first]
    if not pieces:
        return None
    rim_heights = min(pieces, key=lambda piece: max(piece[0] - middle, middle - piece[-1], 0.0))
    if rim_heights[0] - margin > seed[1] or rim_heights[-1] + margin < seed[0]:
        return None
    about = (ring.heights > rim_heights[0] - margin) & (ring.heights < rim_heights[-1] + margin)
    solid = ring.part(about & (ring.distances < radius + margin))
    low, high = _ends_of(solid, solid.distances < radius - margin, pipe.spread)
    if not 0 < high - low < LONGEST_FLANGE * radius or len(solid.indices) < LEAST_POINTS:
        return None
    return _judged(solid, ring, pipe, radius, (low, high), shut)


def _judged(
    solid: Ring, ring: Ring, pipe: Pipe, radius: float, ends: tuple[float, float], shut: tuple[bool, bool]
) -> Collar | None:
    """Return a flange with its evidence; None if the points do not show it."""
    margin, (low, high) = ON_SURFACE * pipe.spread, ends
    thickness, middle = high - low, 0.5 * (low + high)
    rim = np.abs(solid.distances - radius) < margin
    face = np.minimum(np.abs(solid.heights - low), np.abs(solid.heights - high)) < margin
    on = rim | face
    beyond = (ring.distances > radius + 1.5 * margin) & (ring.distances < 1.4 * radius + margin)
    beyond &= (ring.heights > low - margin) & (ring.heights < high + margin)
    within = ~on & (solid.heights > low) & (solid.heights < high)
    count, sides = int(on.sum()), len(np.unique(solid.sectors[rim]))
    # of faces that are wide enough to be seen there are points, on several sides
    wide = radius - margin - (NARROWEST * pipe.radius + margin) > 2.0 * pipe.spread
    faces = len(np.unique(solid.sectors[face & ~rim]))
    if (
        count < LEAST_POINTS
        or within.sum() > MOST_WITHIN * count
        or beyond.sum() > MOST_BEYOND * count
        or sides < max(LEAST_SIDES, ROUND * len(np.unique(solid.sectors)))
        or (wide and faces < LEAST_SIDES and sides < ALL_ROUND)
    ):
        return None
    where: Literal["side", "start", "end"] = "side"
    reach = max(0.6 * thickness, 0.6 * pipe.radius)
    if middle < reach and not shut[0]:
        where = "start"
    elif middle > pipe.length - reach and not shut[1]:
        where = "end"
    thickest = THICKEST_PAIR if where == "side" else THICKEST_DISC
    if thickness > thickest * radius or pipe.length < LEAST_PIPE * radius:
        return None
    errors = np.where(rim[on], solid.distances[on] - radius, 0.0)
    coverage = sides / SECTORS
    std = {
        "radius": pipe.spread / math.sqrt(max(int(rim.sum()), 1)),
        "thickness": 2.0 * pipe.spread / math.sqrt(max(int(face.sum()), 1)),
        "center": pipe.spread / math.sqrt(max(int(face.sum()), 1)),
    }
    wrong = float(within.sum() + beyond.sum()) / count
    sure = (1.0 - math.exp(-count / 15.0)) * (0.5 + 0.5 * min(1.0, 2.0 * coverage)) * (1.0 - 0.5 * wrong)
    return Collar(
        kind="flange",
        where=where,
        center=pipe.start + middle * pipe.direction,
        radius=radius,
        thickness=thickness,
        pair=where == "side",
        indices=solid.indices[on],
        rms=float(np.sqrt((errors**2).mean())),
        coverage=coverage,
        confidence=float(np.clip(sure, 0.0, 0.99)),
        std=std,
    )


def _ends_of(solid: Ring, of_face: MaskArray, spread: float) -> tuple[float, float]:
    """Return where a flange begins and ends along the axis: at its faces, where they are seen, or those of its rim."""
    heights, out = solid.heights, []
    for share in (0.03, 0.97):
        end = float(np.quantile(heights, share))
        for _ in range(4):
            near = np.abs(heights - end) < 2.0 * spread
            on_face = near & of_face
            chosen = on_face if on_face.sum() >= LEAST_ON_FACE else near
            end = float(np.median(heights[chosen])) if chosen.any() else end
        out.append(end)
    return out[0], out[1]


def _inline(first: Collar, second: Collar, ring: Ring, pipe: Pipe, near: Surroundings) -> Collar | None:
    """Return what is between two flanges, if it is about the pipe and hides it; None if there is only the pipe."""
    low, high = _height(first, pipe) + 0.5 * first.thickness, _height(second, pipe) - 0.5 * second.thickness
    radius = max(first.radius, second.radius)
    margin = ON_SURFACE * pipe.spread
    if not margin < high - low < LONGEST_INLINE * radius:
        return None
    body = ring.part((ring.heights > low) & (ring.heights < high) & (ring.distances < 1.2 * radius))
    own = near.about(
        pipe.start, pipe.direction, low + margin, high - margin, pipe.radius + margin, max(0.0, pipe.radius - margin)
    )
    sides = len(np.unique(body.sectors))
    seen = len(own) / max(high - low - 2.0 * margin, margin)
    usual = near.density(pipe) * 2.0 * math.pi * pipe.radius
    if len(body.indices) < LEAST_POINTS or sides < LEAST_SECTORS or seen > 0.4 * usual:
        return None
    start, end = _height(first, pipe) - 0.5 * first.thickness, _height(second, pipe) + 0.5 * second.thickness
    center = pipe.start + 0.5 * (start + end) * pipe.direction
    coverage = sides / SECTORS
    wrong = min(1.0, seen / max(usual, 1e-300))
    sure = 0.99 * (1.0 - math.exp(-len(body.indices) / 15.0)) * (0.5 + 0.5 * min(1.0, 2.0 * coverage)) * (1.0 - wrong)
    return Collar("inline", "side", center, radius, end - start, True, body.indices, 0.0, coverage, sure, {})


def _is_of_cover(collar: Collar, pipe: Pipe, covers: list[Pipe]) -> bool:
    """Return whether something is the end of a wider tube about the pipe, such as an insulation."""
    for cover in covers:
        along = abs(float((collar.center - cover.middle) @ pipe.direction))
        if along < 0.5 * cover.length + cover.radius and collar.radius < 1.15 * cover.radius:
            return True
    return False
