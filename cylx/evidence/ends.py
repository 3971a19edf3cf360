"""Whether two coaxial pieces are one cylinder that is hidden in between, or two with an end each."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import coordinates_of
from cylx.records import Finding, IndexedCloud

LEAST_COVERAGE = math.radians(300.0)
"""What hides the middle of a pipe hides it from one side. Of a piece seen all round nothing is hidden at its end."""
SECTORS = 12
"""Sectors of the turn of which each has an end."""
CLEAN_SHARE = 0.85
"""Share of the sectors that must end at one height for the end to be a cut across the axis."""
GAPS_OF_POINTS, ALLOWED_RADII = 4.5, 0.05
"""They do if within so many usual gaps between points and this share of the radius."""
RIM_RADII, BESIDE_RADII = 0.15, 0.3
"""What adjoins an end lies within so many radii of it, along and across the axis,"""
RIM_DEVIATIONS, RIM_SPACINGS, MOST_RADII = 3.0, 2.0, 0.8
"""or within so many deviations of the points and of their spacings, where that is more, but within so many radii:"""
OFF_DEVIATIONS, OFF_RADII = 4.0, 0.03
"""it lies off the surface by more than this,"""
ADJOINED_SHARE = 0.7
"""and in this share of the sectors. A pipe whose middle nobody saw ends in nothing."""
TELLING_SHARE = 0.6
"""If this is more than this share of the height, points are too few to tell."""


def are_distinct(one: Finding, other: Finding, indexed: IndexedCloud, gap: float) -> bool:
    """Return whether two pieces of one axis both end in a cut across it, on either side of a gap.

    Parameters
    ----------
    one, other : Finding
    indexed : IndexedCloud
    gap : float
        Between the two, along the axis; frame units.
    """
    across = other.segment.point - one.segment.point
    return all(
        ends_in_cut(piece, indexed, bool(sign * (across @ piece.segment.direction) > 0.0), 0.5 * gap)
        for piece, sign in ((one, 1.0), (other, -1.0))
    )


def ends_in_cut(finding: Finding, indexed: IndexedCloud, upper: bool, most: float = math.inf) -> bool:
    """Return whether a piece ends in a cut across its axis, all round, at something that adjoins it.

    Parameters
    ----------
    finding : Finding
    indexed : IndexedCloud
    upper : bool
        Whether to look at the end the direction points to, or at the other.
    most : float
        The end must be told within this length, frame units.
    """
    segment = finding.segment
    if finding.coverage < LEAST_COVERAGE:
        return False
    heights, _, angles = coordinates_of(indexed.points, finding.points, segment.model)
    heights = heights if upper else -heights
    sectors = _sectors_of(angles)
    counts = np.bincount(sectors, minlength=SECTORS)
    full = counts > 0
    allowed = GAPS_OF_POINTS * 2.0 * segment.half / float(np.median(counts[full])) + ALLOWED_RADII * segment.radius
    if allowed > min(TELLING_SHARE * 2.0 * segment.half, most):
        return False
    ends = np.full(SECTORS, -np.inf)
    np.maximum.at(ends, sectors, heights)
    if (ends[full] > segment.half - allowed).mean() < CLEAN_SHARE:
        return False
    return _adjoins(finding, indexed, upper, int(full.sum()))


def rim_height(finding: Finding) -> float:
    """Return how far along the axis, from an end, what adjoins it may lie; frame units."""
    return _within(RIM_RADII, RIM_DEVIATIONS, finding)


def _adjoins(finding: Finding, indexed: IndexedCloud, upper: bool, covered: int) -> bool:
    """Return whether something adjoins an end all round: a plate about the mouth of a bore, a cap of a pin."""
    segment = finding.segment
    radius, end = segment.radius, segment.half if upper else -segment.half
    along, across = rim_height(finding), _within(BESIDE_RADII, OFF_DEVIATIONS, finding)
    near = indexed.cells.near_cylinder(segment.model, end - along, end + along, radius - across, radius + across)
    _, residuals, angles = coordinates_of(indexed.points, near, segment.model)
    beside = np.abs(residuals) > max(OFF_DEVIATIONS * segment.spread, OFF_RADII * radius)
    return len(np.unique(_sectors_of(angles[beside]))) >= ADJOINED_SHARE * covered


def _within(radii: float, deviations: float, finding: Finding) -> float:
    """Return how far what adjoins an end may lie from it, frame units."""
    segment = finding.segment
    area = 2.0 * segment.half * segment.radius * finding.coverage
    spacing = math.sqrt(area / max(len(finding.points), 1))
    told = deviations * segment.spread + RIM_SPACINGS * spacing
    return min(max(radii * segment.radius, told), MOST_RADII * segment.radius)


def _sectors_of(angles: FloatArray) -> IndexArray:
    return np.asarray(((angles / (2.0 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS)
