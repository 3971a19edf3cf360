"""Whether two coaxial pieces are one cylinder that is hidden in between, or two with an end each."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.coverage import SECTORS, sector_of
from cylx.geometry.cylinder import coordinates_of
from cylx.records import Finding, IndexedCloud

LEAST_COVERAGE = math.radians(300.0)
"""What hides the middle of a pipe hides it from one side. Of a piece seen all round nothing is hidden at its end."""
CLEAN_SHARE = 0.85
"""Share of the sectors that must end at one height for the end to be a cut across the axis."""
GAPS_OF_POINTS, ALLOWED_RADII = 3.0, 0.05
"""They do if within so many usual gaps between points and this share of the radius."""
TELLING_SHARE = 0.6
"""If this is more than this share of the height, points are too few to tell."""


def ends_before(finding: Finding, other: Finding, indexed: IndexedCloud, gap: float) -> bool:
    """Return whether a piece ends in a cut across its axis, all round, on the side of another piece of its axis.

    Parameters
    ----------
    finding, other : Finding
    indexed : IndexedCloud
    gap : float
        Between the two, along the axis; frame units.
    """
    segment = finding.segment
    if finding.coverage < LEAST_COVERAGE or gap <= 0.0:
        return False
    heights, _, angles = coordinates_of(indexed.points, finding.points, segment.model)
    if (other.segment.point - segment.point) @ segment.direction < 0.0:
        heights = -heights
    sectors = sector_of(angles)
    counts = np.bincount(sectors, minlength=SECTORS)
    full = counts > 0
    allowed = GAPS_OF_POINTS * 2.0 * segment.half / float(np.median(counts[full])) + ALLOWED_RADII * segment.radius
    if allowed > TELLING_SHARE * 2.0 * segment.half or gap < 2.0 * allowed:
        return False
    ends = np.full(SECTORS, -np.inf)
    np.maximum.at(ends, sectors, heights)
    return bool((ends[full] > segment.half - allowed).mean() >= CLEAN_SHARE)
