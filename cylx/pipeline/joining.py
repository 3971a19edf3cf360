"""Findings of several parts of a cloud -> cylinders: what the rounds do at their end, for parts found apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cylx.game.agreement import Neighbourhood
from cylx.geometry.arrays import FloatArray
from cylx.pipeline.judging import Judge
from cylx.records import Candidates, Finding, IndexedCloud, Segment
from cylx.scene import Prepared
from cylx.stages.extending import extend
from cylx.stages.labelling import label_points, surface_points
from cylx.stages.merging import drop_claimed, merge_pieces
from cylx.stages.parting import parted


def join_findings(
    prepared: Prepared, indexed: IndexedCloud, windows: Candidates, findings: Sequence[Finding], doubtful: set[int]
) -> list[tuple[int | None, Finding]]:
    """Join findings of one cylinder, extend and part them, and drop what better ones have claimed.

    Blends are joined by themselves, and dropped where their points belong to a cylinder.

    Parameters
    ----------
    prepared : Prepared
        The points about the findings.
    indexed : IndexedCloud
        The same points, and what they lie on.
    windows : Candidates
        What a cylinder should agree with.
    findings : sequence of Finding
        In the frame of these points; which of them are theirs need not be known.
    doubtful : set of int
        Indices of the findings that have to pass on these points first, as they were found on fewer.

    Returns
    -------
    list of (int or None, Finding)
        The cylinders and then the blends: with the index of a finding that nothing was joined to, or else fitted to all
        their points.
    """
    judge, count = Judge(prepared, indexed, Neighbourhood(windows)), len(indexed.points)
    known = [replace(one, points=surface_points(one.segment, indexed)[0]) for one in findings]
    index = {id(one): i for i, one in enumerate(known)}
    there = [(i, one) for i, one in enumerate(known) if len(one.points)]
    sure = [judge.join(one.segment, one) if i in doubtful else one for i, one in there if not one.blend]
    pieces = merge_pieces([one for one in sure if one is not None], indexed, judge.join)
    longer = [extend(piece, indexed, judge.join) for piece in pieces]
    if any(one is not other for one, other in zip(longer, pieces, strict=True)):
        pieces = merge_pieces(longer, indexed, judge.join)
    apart = [part for piece in pieces for part in parted(piece, indexed, judge.join)]
    cylinders = drop_claimed(apart, count)
    arcs = drop_claimed([one for _, one in there if one.blend], count, cylinders)
    blends = drop_claimed(merge_pieces(arcs, indexed, judge.join_blend), count, cylinders)
    finished = [(index.get(id(one)), one if id(one) in index else judge.finish(one)) for one in (*cylinders, *blends)]
    return [(i, one) for i, one in finished if not judge.out_of_range(one.segment)]


def label_part(
    cylinders: list[Segment], blends: list[Segment], indexed: IndexedCloud
) -> tuple[tuple[NDArray[np.int32], FloatArray], tuple[NDArray[np.int32], FloatArray]]:
    """Assign the points of a part of a cloud to cylinders, and what is left of them to blends.

    Parameters
    ----------
    cylinders, blends : list of Segment
        In the frame of the part.
    indexed : IndexedCloud

    Returns
    -------
    cylinders, blends : pair of ndarray of shape (N,)
        The index of the segment of each point, -1 for none, and its signed distance from the surface.
    """
    labels, residuals = label_points(cylinders, indexed)
    owners, distances = label_points(blends, indexed)
    owners[labels >= 0] = -1
    return (labels, residuals), (owners, distances)
