"""A whole -> its pieces: two bores in line, or two collars of a shaft, that were followed across their gap.

A surface is followed across gaps, as most pipes are hidden in places. Where both sides of a gap are seen all round,
and end there in a cut with something that adjoins it, nothing is hidden: there are two cylinders. There are two as
well where the gap is longer than either side, and each side by itself has another radius: what touches the surface
between pipes that lie in line by chance, such as the beams that they lie on, leads from one to the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from cylx.evidence.ends import are_distinct
from cylx.evidence.sizes import is_another_size
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
STRIP = 0.5
"""What lies between two gaps, shorter than either, and covers less than this share of the arc, may cross."""
LEAST_POINTS = 40
"""Points without which a piece is none."""

Judge = Callable[[Segment, Finding], Finding | None]


def parted(finding: Finding, indexed: IndexedCloud, judge: Judge) -> list[Finding]:
    """Part a cylinder at the gaps on both sides of which it ends, or has another size.

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
    cut = partial(_piece, finding, heights, angles)
    groups = _groups_of(_gaps(heights, finding.segment), heights, angles, STRIP * finding.coverage)
    pieces: list[Finding] = []
    low = -np.inf
    for number, gaps in enumerate(groups):
        first, last = gaps[0][0], gaps[-1][1]
        end = groups[number + 1][0][0] if number + 1 < len(groups) else np.inf
        differ = _have_other_sizes(cut(low, first), cut(last, end), last - first, judge)
        for gap in [(first, last)] if differ else gaps:
            one, rest = cut(low, gap[0]), cut(gap[1], np.inf)
            if one is None or rest is None:
                continue
            if differ or are_distinct(one, rest, indexed, gap[1] - gap[0]):
                pieces.append(one)
                low = gap[1]
    if not pieces:
        return [finding]
    judged = [None if one is None else judge(one.segment, finding) for one in [*pieces, cut(low, np.inf)]]
    kept = [one for one in judged if one is not None]
    return kept if len(kept) == len(judged) else [finding]


def _have_other_sizes(one: Finding | None, other: Finding | None, gap: float, judge: Judge) -> bool:
    """Return whether both sides of a gap longer than either are cylinders, of different radii."""
    if one is None or other is None or gap <= 2.0 * max(one.segment.half, other.segment.half):
        return False
    fitted = judge(one.segment, one), judge(other.segment, other)
    return fitted[0] is not None and fitted[1] is not None and is_another_size(fitted[0], fitted[1], gap)


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


def _groups_of(
    gaps: list[tuple[float, float]], heights: FloatArray, angles: FloatArray, most: float
) -> list[list[tuple[float, float]]]:
    """Group gaps: with the next one if what lies between is shorter than either and covers less than some angle.

    Such is what crosses in a long gap and touches the surface.
    """
    groups: list[list[tuple[float, float]]] = []
    for gap in gaps:
        before = groups[-1][-1] if groups else gap
        between = (heights >= before[1]) & (heights <= gap[0])
        short = gap[0] - before[1] < max(gap[1] - gap[0], before[1] - before[0])
        if groups and short and covered_angle(angles[between]) < most:
            groups[-1].append(gap)
        else:
            groups.append([gap])
    return groups


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
