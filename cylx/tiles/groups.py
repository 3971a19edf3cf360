"""Which parts of different tiles may be one cylinder, or claim the same points."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS
from cylx.tiles.parts import Part

LEAST_COSINE = math.cos(math.radians(8.0))
LEAST_RADIUS_RATIO = 0.75
MOST_OFFSET, ERRORS_OF_OFFSET = 0.3, 4.0
"""Two parts that differ less in direction, radius and offset may be one cylinder: what `merge_pieces` asks for."""
SHARED = 0.2
"""Share of a part's points that lie on another one, from which they claim the same points."""
WIDTH_SPREADS, WIDTH_RADII = 4.0, 0.03
"""A point lies on a part within so many spreads, or this share of its radius."""


def groups_of(parts: Sequence[Part], tiles: Sequence[int]) -> list[list[int]]:
    """Group parts, each with those of other tiles that it may be one with, and those with theirs.

    Parameters
    ----------
    parts : sequence of Part
    tiles : sequence of int
        Where each was found. Parts of one tile have been compared there.

    Returns
    -------
    list of list of int
        Indices of the parts, ascending; the groups by their first part.
    """
    roots = list(range(len(parts)))

    def root(i: int) -> int:
        while roots[i] != i:
            roots[i] = roots[roots[i]]
            i = roots[i]
        return i

    for i, j in _pairs(parts, np.array(tiles, np.int64)):
        low, high = sorted((root(i), root(j)))
        roots[high] = low
    groups: dict[int, list[int]] = {}
    for i in range(len(parts)):
        groups.setdefault(root(i), []).append(i)
    return [groups[first] for first in sorted(groups)]


def _pairs(parts: Sequence[Part], tiles: IndexArray) -> list[tuple[int, int]]:
    """Return the pairs of parts of different tiles that belong together."""
    if not parts:
        return []
    models = np.array([part.finding.segment.model for part in parts])
    halves = np.array([part.finding.segment.half for part in parts])
    spreads = np.array([part.finding.segment.spread for part in parts])
    offsets = np.array([part.finding.offset_error for part in parts])
    blends = np.array([part.finding.blend for part in parts])
    boxes = _boxes(models, halves)
    found = []
    for i, part in enumerate(parts):
        one = models[i]
        others = np.flatnonzero((tiles != tiles[i]) & (np.arange(len(parts)) > i))
        if not len(others):
            continue
        alike = _alike(one, models[others], part, offsets[others]) & (blends[others] == blends[i])
        near = ((boxes[others, 0] <= boxes[i, 1]) & (boxes[others, 1] >= boxes[i, 0])).all(axis=1)
        for k in others[near & ~alike]:
            width = np.maximum(WIDTH_SPREADS * spreads[[i, k]], WIDTH_RADII * models[[i, k], RADIUS])
            there = _share_on(parts[k].sample, one, halves[i], float(width[0]))
            here = _share_on(part.sample, models[k], halves[k], float(width[1]))
            if max(there, here) >= SHARED:
                found.append((i, int(k)))
        found += [(i, int(k)) for k in others[alike]]
    return found


def _alike(one: FloatArray, others: FloatArray, part: Part, offsets: FloatArray) -> MaskArray:
    """Return which cylinders may go on where one ends, within the errors of its axis."""
    ratios = others[:, RADIUS] / one[RADIUS]
    alike = np.abs(others[:, DIRECTION] @ one[DIRECTION]) >= LEAST_COSINE
    alike &= (ratios >= LEAST_RADIUS_RATIO) & (ratios * LEAST_RADIUS_RATIO <= 1.0)
    across = others[:, POINT] - one[POINT]
    heights = across @ one[DIRECTION]
    apart = np.linalg.norm(across - heights[:, None] * one[DIRECTION], axis=1)
    errors = np.sqrt(part.finding.offset_error**2 + offsets**2 + (part.finding.tilt_error * heights) ** 2)
    return np.asarray(alike & (apart <= MOST_OFFSET * one[RADIUS] + ERRORS_OF_OFFSET * errors))


def _boxes(models: FloatArray, halves: FloatArray) -> FloatArray:
    """Return the bounding boxes of cylinders, shape (n, 2, 3)."""
    along = halves[:, None] * np.abs(models[:, DIRECTION])
    across = models[:, RADIUS, None] * np.sqrt(np.maximum(1.0 - models[:, DIRECTION] ** 2, 0.0))
    reach = 1.1 * (along + across)
    return np.stack([models[:, POINT] - reach, models[:, POINT] + reach], axis=1)


def _share_on(points: FloatArray, model: FloatArray, half: float, width: float) -> float:
    """Return the share of points on the surface of a cylinder."""
    if not len(points):
        return 0.0
    offsets = points - model[POINT]
    heights = offsets @ model[DIRECTION]
    distances = np.sqrt(np.maximum((offsets**2).sum(axis=1) - heights**2, 0.0))
    on = (np.abs(distances - model[RADIUS]) < width) & (np.abs(heights) <= half)
    return float(on.mean())


def is_whole(parts: Sequence[Part]) -> int | None:
    """Return the part of a group that is seen whole and holds all others, if there is one.

    Parameters
    ----------
    parts : sequence of Part
        Of one group.
    """
    best = max(range(len(parts)), key=lambda i: (not parts[i].clipped, parts[i].inside, parts[i].inliers))
    if parts[best].clipped:
        return None
    segment = parts[best].finding.segment
    width = max(WIDTH_SPREADS * segment.spread, WIDTH_RADII * segment.radius)
    half = segment.half + 0.25 * segment.radius
    held = [_share_on(part.sample, segment.model, half, width) > 1.0 - SHARED for part in parts]
    return best if all(held) else None
