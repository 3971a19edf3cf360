"""What the rounds make of a fitted segment: a cylinder, an arc that goes on tangentially, pieces of it, or nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.game.agreement import Neighbourhood, is_contradicted
from cylx.records import Finding, IndexedCloud, RejectedSegment, Segment
from cylx.scene import Prepared, out_of_range
from cylx.segments.finishing import finish, inflation
from cylx.segments.refitting import refit
from cylx.stages.arcs import arcs_of, rounded_edges_of
from cylx.stages.averaging import ENOUGH_TO_JUDGE
from cylx.stages.level_part import level_part_of
from cylx.stages.upright import HELD, leans, upright_of
from cylx.stages.verification import Verdict, may_be_arc, verify

SHORTEST_PIECE = 5.0
"""Pieces of a long segment have at least this height, in radii."""
UNEVEN, MOST_UNEVEN = 0.02, 0.1
"""Structure in the residuals, in radii, from which a long segment is looked at in pieces, as a trunk bends and tapers;
and deviation, in radii, up to which a piece of what is no cylinder as a whole may be one."""
MOST_ARC = math.radians(270.0)
"""Angle of the surface from which a refused segment is no arc between two planes."""
MUCH_LIKELIER = 0.2
"""What passes as a cylinder is none but an arc unless it is likelier by this much."""
SAME_EDGE = math.cos(math.radians(25.0))
"""The middles of two arcs of one edge enclose a smaller angle, seen from the axis."""
FLAT_SIDES = 0.3
"""Share of a flank from which what was found may be two rounded edges of a bar or a plate."""
MOST_LOOSENED, LEAST_KEPT = 1.05, 0.85
"""A short cylinder is upright if its points scatter no more by this factor when it is held so, or do not say that it
leans; and if it keeps this share of them."""
OF_FORM = frozenset(
    {"form", "agreement", "other shape", "cone, barrel or elbow", "lack of fit", "bend", "bulge", "slope", "facets"}
)
"""Reasons that a piece may not have."""


class Judge:
    """Judges segments by the points and the candidates about them.

    Parameters
    ----------
    prepared : Prepared
    indexed : IndexedCloud
    windows : Neighbourhood
        What a cylinder should agree with.
    """

    def __init__(self, prepared: Prepared, indexed: IndexedCloud, windows: Neighbourhood) -> None:
        self._prepared = prepared
        self._limits = prepared.config.verification
        self._indexed = indexed
        self._windows = windows

    def is_contradicted(self, segment: Segment) -> bool:
        """Return whether so many windows disagree that a fit would be pointless."""
        return is_contradicted(self._windows.agreement(segment))

    def out_of_range(self, segment: Segment) -> str:
        """Return which of the limits given for what is looked for a segment does not keep, or nothing."""
        return out_of_range(segment, self._prepared.radii, self._prepared.config.scene)

    def in_pieces(self, segment: Segment, support: int, payoff: float) -> list[Finding | RejectedSegment]:
        """Verify a segment; where a long one has not the form of a cylinder, give the pieces of it that have.

        It is halved until its pieces pass, so that they are as long as may be.
        """
        whole = self.judge(segment, support, payoff)
        if whole.measures and whole.measures["flank"] > FLAT_SIDES and not whole.segment.upright:
            edges = self._judge_edges(whole)
            if edges:
                return edges
        if not _may_have_pieces(whole):
            return [whole]
        pieces: list[Finding | RejectedSegment] = []
        left = _halves(segment)
        while left:
            piece = left.pop(0)
            fitted = self._refit(piece)
            found = fitted if isinstance(fitted, str) else self.judge(fitted, support, payoff)
            if isinstance(found, Finding) and found.measures["deviation_radii"] <= MOST_UNEVEN:
                pieces.append(found)
            elif isinstance(found, RejectedSegment) and _may_have_pieces(found):
                left += _halves(piece)
        return pieces or [whole]

    def judge(self, segment: Segment, support: int, payoff: float) -> Finding | RejectedSegment:
        """Verify a segment; what speaks most against it if it does not pass.

        Parameters
        ----------
        segment : Segment
            Fitted.
        support : int
            Candidates of its cluster.
        payoff : float
            Mean payoff of its cluster.

        Returns
        -------
        Finding or RejectedSegment
        """
        if reason := self.out_of_range(segment):
            return RejectedSegment(segment, reason, support, payoff)
        limits = self._limits
        verdict = verify(segment, self._indexed, payoff, self._windows.agreement(segment), limits)
        reason = verdict.reason
        if verdict.measures and not limits.enabled:
            reason = "coverage" if verdict.coverage < math.radians(limits.min_coverage_deg) else ""
        if limits.enabled and limits.blends and verdict.measures:
            goes_on = may_be_arc(verdict, surely=not reason)
            if goes_on or (reason and verdict.coverage < MOST_ARC):
                arc = self._judge_arc(segment, support, payoff, goes_on=goes_on)
                if arc is not None and (reason or arc.confidence > verdict.confidence - MUCH_LIKELIER):
                    return arc
        if limits.enabled and verdict.measures and not segment.upright:
            standing = self._judge_upright(segment, support, payoff)
            if standing is not None and (reason or self._is_as_close(standing, segment, verdict)):
                return standing
        if reason:
            confidence = verdict.confidence if verdict.measures else None
            return RejectedSegment(segment, reason, support, payoff, confidence, verdict.coverage, verdict.measures)
        return _finding(segment, verdict, support, payoff)

    def arcs_between_planes(self, rejected: RejectedSegment) -> list[Finding | RejectedSegment]:
        """Verify arcs, with the planes they go on into, where no cylinder could be fitted; else give that back."""
        if not (self._limits.enabled and self._limits.blends):
            return [rejected]
        arc = self._judge_arc(rejected.segment, rejected.support, rejected.payoff, goes_on=False)
        return [rejected] if arc is None else self._judge_edges(arc) or [arc]

    def join(self, segment: Segment, best: Finding) -> Finding | None:
        """Refit and judge a joined segment in the light of the better of its parts; None if it is no cylinder."""
        found = self._judge_joined(segment, best)
        return found if found is not None and not found.blend else None

    def join_blend(self, segment: Segment, best: Finding) -> Finding | None:
        """Refit and judge a joined blend in the light of the better of its parts; None if it is none."""
        if best.segment.wedge is not None:  # it was fitted with the planes that touch it, and so is the whole
            whole = self._judge_arc(segment, best.support, best.payoff, goes_on=False)
            return whole if whole is not None and _is_same_edge(whole.segment, best.segment) else None
        found = self._judge_joined(segment, best)
        return found if found is not None and found.blend else None

    def finish(self, finding: Finding) -> Finding:
        """Fit a finding to all its points; up to here a sample of them was enough."""
        inflated = inflation(finding.measures)
        known, catalogue = self._prepared.known, self._prepared.catalogue
        fitted = finish(finding.segment, self._indexed, known, catalogue, inflated=inflated)
        if isinstance(fitted, str):
            return finding
        if finding.segment.wedge is not None:  # it was fitted with what it touches
            fitted = replace(finding.segment, covariance=fitted.covariance)
        return replace(finding, segment=fitted)

    def _judge_joined(self, segment: Segment, best: Finding) -> Finding | None:
        fitted = refit(segment, self._indexed)
        found = fitted if isinstance(fitted, str) else self.judge(fitted, best.support, best.payoff)
        return found if isinstance(found, Finding) else None

    def _judge_arc(self, segment: Segment, support: int, payoff: float, *, goes_on: bool) -> Finding | None:
        """Verify a segment as an arc that goes on tangentially, as far as is seen of it; None if it is none."""
        refit = self._refit if goes_on else None
        # the few rows of one that is held upright do not tell its axis
        for arc in [segment] if segment.upright else arcs_of(segment, self._indexed, refit):
            if self.out_of_range(arc):
                continue
            verdict = verify(arc, self._indexed, payoff, self._windows.agreement(arc), self._limits, arc=True)
            if not verdict.reason and may_be_arc(verdict):
                return _finding(arc, verdict, support, payoff)
        return None

    def _judge_edges(self, whole: Finding | RejectedSegment) -> list[Finding | RejectedSegment]:
        """Verify two rounded edges where they explain the points better than one circle; nothing if they do not."""
        edges = rounded_edges_of(whole.segment, self._indexed)
        found: list[Finding | RejectedSegment] = []
        for edge in edges:
            agreement = self._windows.agreement(edge)
            verdict = verify(edge, self._indexed, whole.payoff, agreement, self._limits, arc=True)
            if not verdict.reason and may_be_arc(verdict) and not self.out_of_range(edge):
                found.append(_finding(edge, verdict, whole.support, whole.payoff))
        if edges and not found and isinstance(whole, Finding):
            what = whole.segment, "other shape", whole.support, whole.payoff
            found.append(RejectedSegment(*what, whole.confidence, whole.coverage, whole.measures))
        return found

    def _judge_upright(self, segment: Segment, support: int, payoff: float) -> Finding | None:
        """Verify a short segment as one that stands on a plane; None if it is none."""
        held = upright_of(segment, self._indexed)
        if held is None or self.out_of_range(held):
            return None
        verdict = verify(held, self._indexed, payoff, self._windows.agreement(held), self._limits)
        if verdict.reason in OF_FORM or verdict.reason == "noise":
            level = level_part_of(held, self._indexed, HELD)
            if level is not None:
                held = level
                verdict = verify(held, self._indexed, payoff, self._windows.agreement(held), self._limits)
        return None if verdict.reason else _finding(held, verdict, support, payoff)

    def _is_as_close(self, standing: Finding, free: Segment, verdict: Verdict) -> bool:
        """Return whether a cylinder held upright explains its points about as well as one that was fitted freely."""
        if len(standing.points) < LEAST_KEPT * len(verdict.points):
            return False
        if standing.measures["deviation_radii"] <= MOST_LOOSENED * verdict.measures["deviation_radii"]:
            return True
        points = self._indexed.points[np.union1d(standing.points, verdict.points)]
        return not leans(points, free, standing.segment)

    def _refit(self, segment: Segment) -> Segment | str:
        return refit(segment, self._indexed, most=ENOUGH_TO_JUDGE)


def _is_same_edge(whole: Segment, part: Segment) -> bool:
    """Return whether an arc lies between the same planes as a part of it: both edges of a bar are no one half round."""
    if whole.wedge is None or part.wedge is None:
        return True
    return float(whole.wedge[:3] @ part.wedge[:3]) > SAME_EDGE


def _may_have_pieces(one: Finding | RejectedSegment) -> bool:
    """Return whether a segment is long, and refused because of its form."""
    if isinstance(one, Finding) or not one.measures or one.reason not in OF_FORM:
        return False
    return one.measures["height_radii"] >= 2.0 * SHORTEST_PIECE and one.measures["structure_radii"] > UNEVEN


def _halves(segment: Segment) -> list[Segment]:
    """Cut a segment across its axis in the middle."""
    parts = []
    for side in (-0.5, 0.5):
        model = segment.model.copy()
        model[:3] += side * segment.half * segment.direction
        parts.append(replace(segment, model=model, half=0.5 * segment.half))
    return parts


def _finding(segment: Segment, verdict: Verdict, support: int, payoff: float) -> Finding:
    return Finding(
        segment,
        verdict.points,
        support,
        payoff,
        verdict.confidence,
        verdict.coverage,
        verdict.offset_error,
        verdict.tilt_error,
        verdict.measures,
        verdict.blend,
    )
