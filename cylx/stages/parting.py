"""A whole -> its pieces: two bores in line, or two collars of a shaft, that were followed across their gap.

A surface is followed across gaps, as most pipes are hidden in places. Where both sides of a gap are seen all round, and
end there in a cut with something that adjoins it, nothing is hidden: there are two cylinders.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cylx.evidence.ends import are_distinct
from cylx.geometry.arrays import FloatArray
from cylx.geometry.coverage import covered_angle
from cylx.geometry.cylinder import coordinates_of
from cylx.records import Finding, IndexedCloud, Segment

PER_PIECE = 12.0
"""Points that a piece of the height should hold on the average."""
MOST_PIECES = 400
SPARSE = 0.15
"""Pieces that hold less than this share of the median are empty: something crosses."""
LEAST_GAP = 0.15
"""Gaps of so many radii are looked at."""
LEAST_POINTS = 40
"""Points without which a piece is none."""

Judge = Callable[[Segment, Finding], Finding | None]


def parted(finding: Finding, indexed: IndexedCloud, judge: Judge) -> list[Finding]:
    """Part a cylinder at the gaps on both sides of which it ends.

    Parameters
    ----------
    finding : Finding
        Accepted.
    indexed : IndexedCloud
        The cloud.
    judge : callable
        Refits and verifies a segment, given the finding it came from; None if it is rejected.

    Returns
    -------
    list of Finding
        The pieces, if all of them are cylinders; else the finding alone.
    """
    heights, _, angles = coordinates_of(indexed.points, finding.points, finding.segment.model)
    gaps = _gaps(heights, finding.segment)
    pieces: list[Finding] = []
    low = -np.inf
    for first, last in gaps:
        one = _piece(finding, heights, angles, low, first)
        other = _piece(finding, heights, angles, last, np.inf)
        if one is not None and other is not None and are_distinct(one, other, indexed, last - first):
            pieces.append(one)
            low = last
    if not pieces:
        return [finding]
    rest = _piece(finding, heights, angles, low, np.inf)
    judged = [None if one is None else judge(one.segment, finding) for one in [*pieces, rest]]
    kept = [one for one in judged if one is not None]
    return kept if len(kept) == len(judged) else [finding]


def _gaps(heights: FloatArray, segment: Segment) -> list[tuple[float, float]]:
    """Return where gaps begin and end along the axis, ascending."""
    count = int(np.clip(len(heights) / PER_PIECE, 4, MOST_PIECES))
    edges = np.linspace(-segment.half, segment.half, count + 1)
    filled, _ = np.histogram(heights, edges)
    empty = filled < SPARSE * float(np.median(filled[filled > 0])) if filled.any() else filled < 0
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], empty, [False]]).astype(np.int8)))
    found = []
    for first, last in bounds.reshape(-1, 2):
        before, after = heights[heights < edges[first]], heights[heights > edges[last]]
        if len(before) and len(after) and edges[last] - edges[first] > LEAST_GAP * segment.radius:
            found.append((float(before.max()), float(after.min())))
    return found


def _piece(finding: Finding, heights: FloatArray, angles: FloatArray, low: float, high: float) -> Finding | None:
    """Return what of a finding lies between two heights; None if that is next to nothing."""
    within = (heights >= low) & (heights <= high)
    if within.sum() < LEAST_POINTS:
        return None
    segment, ends = finding.segment, (float(heights[within].min()), float(heights[within].max()))
    model = segment.model.copy()
    model[:3] += 0.5 * (ends[0] + ends[1]) * segment.direction
    piece = replace(segment, model=model, half=0.5 * (ends[1] - ends[0]), covariance=None)
    return replace(finding, segment=piece, points=finding.points[within], coverage=covered_angle(angles[within]))
