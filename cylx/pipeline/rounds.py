"""Clustering, averaging and verification in turns: one accepted cylinder after the other, removing what it explains."""

from __future__ import annotations

import math
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from cylx.config import Config
from cylx.fits.likelihood import Prior
from cylx.fits.nominal_radius import Catalogue
from cylx.game.agreement import Neighbourhood, is_contradicted
from cylx.pipeline.stage_log import StageLog
from cylx.records import Candidates, Cluster, Finding, IndexedCloud, RejectedSegment, Segment
from cylx.scene import out_of_range
from cylx.stages.averaging import average_cluster, finish, inflation, measure_extent, refine, refit
from cylx.stages.clustering import CandidateGame
from cylx.stages.extending import extend
from cylx.stages.merging import as_rows, drop_claimed, is_part_of, merge_pieces
from cylx.stages.verification import verify

FloatArray = NDArray[np.float64]

FOUND_BEFORE = "found before"
"""The reason of a segment that is one of those accepted already; it is no other cylinder."""


ROUND = 16
"""Clusters fitted at the same time; the number does not depend on that of the threads, and so the result does not."""


class Rounds:
    """The loop over clusters.

    Parameters
    ----------
    game : CandidateGame
    candidates : Candidates
        Those in the game.
    all_windows : Candidates
        What a cylinder should agree with: all curved windows, which are drawn evenly over the surface.
    indexed : IndexedCloud
        The cloud.
    radii : tuple of float
        Least and greatest radius, frame units; they hold for the fitted cylinders, too.
    known : Prior or None
        What is known of each cylinder.
    catalogue : Catalogue or None
        Nominal radii, frame units.
    config : Config
        Resolved.
    threads : int
        Does not change the result.

    Attributes
    ----------
    refused : list of RejectedSegment
        What was not accepted so far, but for what had been found before.
    """

    def __init__(
        self,
        game: CandidateGame,
        candidates: Candidates,
        all_windows: Candidates,
        indexed: IndexedCloud,
        radii: tuple[float, float],
        known: Prior | None,
        catalogue: Catalogue | None,
        config: Config,
        threads: int,
    ) -> None:
        self._game = game
        self._candidates = candidates
        self._all_windows = Neighbourhood(all_windows)
        self._indexed = indexed
        self._radii = radii
        self._known = known
        self._catalogue = catalogue
        self._config = config
        self._threads = threads
        self.refused: list[RejectedSegment] = []
        # the paper takes no more than the winners out of the game (section 3.5)
        self._removes = config.clustering.population == "local"

    def play(self, log: StageLog) -> list[Finding]:
        """Take cluster after cluster until none is left, or until as many cylinders as asked for are found."""
        findings: list[Finding] = []
        rejected: Counter[str] = Counter()
        with ThreadPoolExecutor(self._threads) as pool:
            while clusters := self._next_clusters():
                known = as_rows([finding.segment for finding in findings])
                for outcome in list(pool.map(self._try, clusters, repeat(known))):
                    found = self._new_or_known(outcome, findings)
                    if isinstance(found, Finding):
                        findings.append(found)
                    else:
                        rejected[found.reason] += 1
                        self.refused += [found] if found.reason != FOUND_BEFORE else []
                    if self._removes:
                        # what the like of a refused segment would lead to is known, too
                        closely = not isinstance(found, Finding)
                        self._game.withdraw(self._game.explained_by(found.segment, closely=closely))
                    log.advance()
                if self._enough(findings):
                    break
        log.reports.append(self._game.report())
        log.report("verification", len(findings) + rejected.total(), len(findings), rejected)
        return findings

    def _next_clusters(self) -> list[tuple[Cluster, Segment]]:
        """Take the next few clusters out of the game, each with its average; the paper takes one at a time."""
        clusters: list[tuple[Cluster, Segment]] = []
        while len(clusters) < (ROUND if self._removes else 1):
            cluster = self._game.next_cluster()
            if cluster is None:
                break
            average = average_cluster(self._candidates, cluster, self._config.averaging)
            clusters.append((cluster, average))
            if self._removes:
                self._game.withdraw(self._game.explained_by(average, closely=True))
        return clusters

    def _try(self, candidate: tuple[Cluster, Segment], known: FloatArray) -> Finding | RejectedSegment:
        """Fit an average and judge it: the finding, or why it is none."""
        cluster, average = candidate
        support, payoff = len(cluster.members), cluster.payoff
        if self._config.verification.enabled and is_contradicted(self._all_windows.agreement(average)):
            return RejectedSegment(average, "agreement", support, payoff)
        fitted = self._fit(average)
        if isinstance(fitted, str):
            return RejectedSegment(average, fitted, support, payoff)
        if self._removes and is_part_of(fitted, known):
            return RejectedSegment(fitted, FOUND_BEFORE, support, payoff)
        return self._judge(fitted, support, payoff)

    def _new_or_known(self, found: Finding | RejectedSegment, findings: list[Finding]) -> Finding | RejectedSegment:
        """Refuse a finding that another cluster of the same round has led to before."""
        if not (self._removes and isinstance(found, Finding)):
            return found
        known = as_rows([finding.segment for finding in findings[-ROUND:]])
        return RejectedSegment.of(found, FOUND_BEFORE) if is_part_of(found.segment, known) else found

    def merge(self, findings: list[Finding], log: StageLog) -> list[Finding]:
        """Join the pieces of one pipe, drop what better cylinders have claimed, and keep as many as asked for."""
        kept = findings
        joined = claimed = 0
        strayed: list[RejectedSegment] = []
        if self._config.averaging.merge:
            distinct = drop_claimed(findings, len(self._indexed.points))
            pieces = merge_pieces(distinct, self._indexed, self._join)
            with ThreadPoolExecutor(self._threads) as pool:
                longer = list(pool.map(lambda piece: extend(piece, self._indexed, self._join), pieces))
            if any(one is not other for one, other in zip(longer, pieces, strict=True)):
                pieces = merge_pieces(longer, self._indexed, self._join)
            kept = drop_claimed(pieces, len(self._indexed.points))
            for before, after in ((findings, distinct), (pieces, kept)):
                there = {id(finding) for finding in after}
                self.refused += [
                    RejectedSegment.of(one, "claimed by a better one") for one in before if id(one) not in there
                ]
            joined = len(distinct) - len(pieces)
            claimed = len(findings) - joined - len(kept)
        if self._config.averaging.refine:
            with ThreadPoolExecutor(self._threads) as pool:
                finished = list(pool.map(self._finish, kept))
            strayed = [
                RejectedSegment.of(one, reason) for one in finished if (reason := self._out_of_range(one.segment))
            ]
            kept = [finding for finding in finished if not self._out_of_range(finding.segment)]
            self.refused += strayed
        kept = sorted(kept, key=lambda finding: (-finding.confidence, -len(finding.points)))
        beyond = kept[self._config.max_cylinders :] if self._config.max_cylinders else []
        kept = kept[: len(kept) - len(beyond)]
        self.refused += [RejectedSegment.of(finding, "beyond max_cylinders") for finding in beyond]
        rejected = {"joined": joined, "claimed by a better one": claimed, "beyond max_cylinders": len(beyond)}
        rejected |= Counter(rejected_segment.reason for rejected_segment in strayed)
        log.report("merging", len(findings), len(kept), rejected)
        return kept

    def _finish(self, finding: Finding) -> Finding:
        """Fit a finding to all its points; up to here a sample of them was enough."""
        inflated = inflation(finding.measures)
        fitted = finish(finding.segment, self._indexed, self._known, self._catalogue, inflated=inflated)
        return finding if isinstance(fitted, str) else replace(finding, segment=fitted)

    def _enough(self, findings: list[Finding]) -> bool:
        """Tell whether to stop early: the paper's order is that of the clusters, ours that of the cylinders."""
        most = self._config.max_cylinders
        return most is not None and not self._config.averaging.merge and len(findings) >= most

    def _fit(self, segment: Segment) -> Segment | str:
        return (refine if self._config.averaging.refine else measure_extent)(segment, self._indexed)

    def _join(self, segment: Segment, best: Finding) -> Finding | None:
        """Refit and judge a joined segment in the light of the better of its parts."""
        fitted = refit(segment, self._indexed)
        found = fitted if isinstance(fitted, str) else self._judge(fitted, best.support, best.payoff)
        return found if isinstance(found, Finding) else None

    def _judge(self, segment: Segment, support: int, payoff: float) -> Finding | RejectedSegment:
        """Verify a segment; what speaks most against it if it does not pass."""
        if reason := self._out_of_range(segment):
            return RejectedSegment(segment, reason, support, payoff)
        counts = self._all_windows.agreement(segment)
        verdict = verify(segment, self._indexed, payoff, counts, self._config.verification)
        reason, limits = verdict.reason, self._config.verification
        if verdict.measures and not limits.enabled:
            reason = "coverage" if verdict.coverage < math.radians(limits.min_coverage_deg) else ""
        if reason:
            confidence = verdict.confidence if verdict.measures else None
            return RejectedSegment(segment, reason, support, payoff, confidence, verdict.coverage, verdict.measures)
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
        )

    def _out_of_range(self, segment: Segment) -> str:
        return out_of_range(segment, self._radii, self._config.scene)
