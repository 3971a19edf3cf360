"""The side from which a surface is seen: that of a pin, that of a bore, or neither can be told.

Points say nothing of the side they were seen from, but what adjoins a surface does. Caps close a pin, and a plate lies
about the two mouths of a bore. A plate at one end and a cap at the other are a pin on a plate as well as a blind hole,
so they tell nothing.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from cylx.evidence.measures import scatter_of
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.coverage import SECTORS, sector_of
from cylx.geometry.cylinder import coordinates_of
from cylx.records import IndexedCloud, Segment

Side = Literal["convex", "concave", "unknown"]

RIM, RIM_RADII, WIDTH_RADII = 3.0, 0.25, 0.1
"""Points of a cap or a plate lie this near to the rim: spacings, or radii along and across the axis if that is more."""
ONLY_THERE = 0.5
"""Beside the surface away from the rim, there are fewer than this share of as many points per height."""
MOST_SECTORS, FILLED = 0.6, 0.2
"""A cap or a plate fills this share of the covered sectors, each to this share of the density on the surface."""
MIDDLE = 0.8
"""Share of the height in which other things are looked for, away from caps and plates."""
MANY, FEW = 0.02, 0.005
"""Things are there from the first share of the points on the surface on, and nothing is there up to the second."""
LEAST_POINTS = 10
"""Fewer points are no thing, and no surface."""
MORE_THAN_HALF_DEG = 200.0
"""Covered angle from which things inside and outside count: arcs of half a turn go on outside on either side."""
SLENDER = 6.0
"""Plates at both ends of a cylinder longer than this, in radii, may be floor and ceiling, and it a column."""
WALL, WALL_SHARE = 0.05, 0.5
"""A wall about the same axis is so thick at most, in radii, and holds this share of the points on its side."""
ENOUGH = 200_000
"""Points about a cylinder that suffice."""


class _Around(NamedTuple):
    """The points in and about a segment, and where there is surface."""

    heights: FloatArray
    residuals: FloatArray
    sectors: IndexArray
    on: MaskArray
    covered: MaskArray
    half: float
    radius: float
    gap: float
    density: float


def side_of(segment: Segment, indexed: IndexedCloud, coverage: float) -> Side:
    """Return from which side the surface of a segment is seen, from what lies about it.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    coverage : float
        Angle about the axis that is covered, radians.

    Returns
    -------
    {'convex', 'concave', 'unknown'}
    """
    around = _look_around(segment, indexed)
    if around is None:
        return "unknown"
    caps, plates = ([_adjoins(around, end, way) for end in (-1, 1)] for way in (-1, 1))
    inside, outside = _share(around, -1), _share(around, 1)
    if all(caps) and not any(plates):
        return "unknown" if inside >= MANY or _goes_on(around, -1) else "convex"
    if all(plates) and not any(caps):
        short = 2.0 * around.half <= SLENDER * around.radius
        return "concave" if short and inside < MANY and not _goes_on(around, 1) else "unknown"
    if any(plates) and (any(caps) or 2.0 * around.half <= SLENDER * around.radius):
        return "unknown"
    if coverage < math.radians(MORE_THAN_HALF_DEG) or _has_wall(around, -1) or _has_wall(around, 1):
        return "unknown"
    if outside >= MANY and inside <= FEW:
        return "convex"
    return "concave" if inside >= MANY and outside <= FEW and not any(caps) else "unknown"


def _look_around(segment: Segment, indexed: IndexedCloud) -> _Around | None:
    """Collect the points up to a radius about a segment; None if there are too few on it."""
    radius, half = segment.radius, segment.half
    deviation = scatter_of(segment, indexed.noise_about(segment.model, half))
    reach = half + radius + RIM
    near = indexed.cells.near_cylinder(segment.model, -reach, reach, 0.0, 2.0 * radius + RIM)
    near = near[:: max(1, len(near) // ENOUGH)]
    heights, residuals, angles = coordinates_of(indexed.points, near, segment.model)
    on = (np.abs(residuals) < 3.0 * deviation) & (np.abs(heights) <= half)
    sectors = sector_of(angles)
    counts = np.bincount(sectors[on], minlength=SECTORS)
    if on.sum() < LEAST_POINTS or half <= 0.0:
        return None
    covered = counts >= 0.3 * np.median(counts[counts > 0])
    area = 2.0 * half * radius * 2.0 * math.pi * covered.sum() / SECTORS
    gap = max(4.0 * deviation, min(0.5, 0.1 * radius))
    density = float(counts[covered].sum()) / area
    return _Around(heights, residuals, sectors, on, covered, half, radius, gap, density)


def _adjoins(around: _Around, end: int, way: int) -> bool:
    """Return whether a surface across the axis adjoins an end (-1, 1), inwards (-1) or outwards (1)."""
    unit = 1.0 / math.sqrt(around.density)  # the spacing on this surface, of the points that are looked at
    thick = max(around.gap, RIM * unit)
    past = end * around.heights - around.half
    thick = min(thick, around.half)
    band = (past > -thick) & (past < max(RIM * unit, thick, RIM_RADII * around.radius))
    width = max(RIM * unit, WIDTH_RADII * around.radius)
    if not _fills(around, band, way, width):
        return False
    # a wall beside the surface is there at all heights
    room = min(around.half - thick, 2.0 * thick)
    off = way * around.residuals
    ring = (off > around.gap) & (off < around.gap + width)
    beside = float((ring & (past < -thick) & (past > -thick - room)).sum())
    at_rim = float((ring & (np.abs(past) < thick)).sum())
    return room < 0.5 * thick or beside / room < ONLY_THERE * max(at_rim, 1.0) / (2.0 * thick)


def _goes_on(around: _Around, way: int) -> bool:
    """Return whether there is a further surface beyond an end, nearer to the axis (-1) or farther from it (1)."""
    past = np.abs(around.heights) - around.half
    unit = 1.0 / math.sqrt(around.density)
    first = max(around.gap, RIM * unit, RIM_RADII * around.radius)
    for end in (-1, 1):
        beyond = (end * around.heights > 0) & (past > first) & (past < first + max(RIM * unit, 0.5 * around.radius))
        if _fills(around, beyond, way, around.radius, FILLED * (RIM_RADII if way > 0 else 1.0)):
            return True
    return False


def _fills(around: _Around, band: MaskArray, way: int, width: float, least: float = FILLED) -> bool:
    """Return whether points of a band lie inside (-1) or outside (1) the surface in most of the covered sectors."""
    off = way * around.residuals
    ring = band & (off > around.gap) & (off < around.gap + width)
    first = around.radius + way * around.gap
    last = max(0.0, first + way * width)
    expected = around.density * abs(last**2 - first**2) * math.pi / SECTORS
    counts = np.bincount(around.sectors[ring], minlength=SECTORS)[around.covered]
    enough = counts.sum() >= max(LEAST_POINTS // 2, least * expected * len(counts))
    return bool(enough and (counts >= max(1.0, least * expected)).mean() >= MOST_SECTORS)


def _share(around: _Around, way: int) -> float:
    """Return the points inside (-1) or outside (1), away from the ends, as a share of those on the surface.

    Walls about the same axis are no things.
    """
    things = _things(around, way)
    count = float(things.sum())
    if _has_wall(around, way) or count < LEAST_POINTS:
        return 0.0
    return count / max(float((around.on & (np.abs(around.heights) <= MIDDLE * around.half)).sum()), 1.0)


def _things(around: _Around, way: int) -> MaskArray:
    off = way * around.residuals
    least = max(1.5 * around.gap, 0.1 * around.radius)
    return np.asarray((np.abs(around.heights) <= MIDDLE * around.half) & (off > least), dtype=np.bool_)


def _has_wall(around: _Around, way: int) -> bool:
    """Return whether a wall about the same axis holds most of what is inside (-1) or outside (1)."""
    off = way * around.residuals
    middle = (np.abs(around.heights) <= MIDDLE * around.half) & (off > around.gap)
    depths = np.sort(off[middle])
    if len(depths) < LEAST_POINTS:
        return False
    thick = max(2.0 * around.gap, WALL * around.radius)
    held = np.searchsorted(depths, depths + thick, "right") - np.arange(len(depths))
    first = int(held.argmax())
    wall = middle & (off >= depths[first]) & (off <= depths[first] + thick)
    about = np.bincount(around.sectors[wall], minlength=SECTORS)[around.covered] > 0
    return bool(wall.sum() >= WALL_SHARE * len(depths) and about.mean() >= MOST_SECTORS)
