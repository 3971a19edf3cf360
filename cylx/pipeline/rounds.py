"""Clustering, averaging and verification in rounds: what an accepted cylinder explains leaves the game."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from cylx.game.agreement import Neighbourhood
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import are_on
from cylx.pipeline.judging import Judge
from cylx.pipeline.stage_log import StageLog
from cylx.records import Candidates, Cluster, Finding, IndexedCloud, RejectedSegment, Segment
from cylx.scene import Prepared
from cylx.segments.finishing import SHORT
from cylx.stages.averaging import average_cluster, refine
from cylx.stages.clustering import CandidateGame
from cylx.stages.coaxial import walls_about
from cylx.stages.consensus import of_one_place, of_one_surface
from cylx.stages.extending import extend
from cylx.stages.measuring import measure_extent
from cylx.stages.merging import as_rows, drop_claimed, is_part_of, merge_pieces
from cylx.stages.parting import parted
from cylx.stages.upright import SURELY_UPRIGHT, held_as_is, upright_of

Item = TypeVar("Item")
Outcome = TypeVar("Outcome")

FOUND_BEFORE = "found before"
"""The reason of a segment that is one of those accepted already; it is no other cylinder."""


OTHER_WALL = 0.03
"""A window further off a surface than this share of its radius, and than five deviations, was laid on another wall."""
AXES_OF_AXES = 3
"""Walls are looked for about the axes of cylinders, and of walls found so, so many times in all."""
ROUND = 16
"""Clusters fitted at the same time; the number does not depend on that of the threads, and so the result does not."""


class Fitted(NamedTuple):
    """A segment fitted to its points, and what its cluster says of it.

    Parameters
    ----------
    segment : Segment
    support : int
        Candidates of its cluster.
    payoff : float
        Mean payoff of its cluster.
    members : ndarray of int
        The candidates.
    """

    segment: Segment
    support: int
    payoff: float
    members: IndexArray = np.empty(0, np.int64)


class Rounds:
    """The loop over clusters: a few at a time are averaged and verified.

    Parameters
    ----------
    prepared : Prepared
    indexed : IndexedCloud
        The cloud.
    game : CandidateGame
    all_windows : Candidates
        What a cylinder should agree with: all curved windows, which are drawn evenly over the surface.

    Attributes
    ----------
    findings : list of Finding
        What was accepted so far.
    rejected : list of RejectedSegment
        What was not accepted so far, but for what had been found before.
    """

    def __init__(self, prepared: Prepared, indexed: IndexedCloud, game: CandidateGame, all_windows: Candidates) -> None:
        self._prepared = prepared
        self._config = prepared.config
        self._indexed = indexed
        self._game = game
        self._judge = Judge(prepared, indexed, Neighbourhood(all_windows))
        self._counts: Counter[str] = Counter()
        self.findings: list[Finding] = []
        self.rejected: list[RejectedSegment] = []
        # the paper takes no more than the winners out of the game (section 3.5)
        self._removes = prepared.config.clustering.population == "local"

    def clusters(self, log: StageLog) -> Iterator[list[tuple[Cluster, Segment]]]:
        """Take a few clusters at a time out of the game, until none is left or enough cylinders are found.

        Each comes with the average of its candidates. The paper takes one cluster at a time.
        """
        while not self._enough():
            with log.stage("clustering"):
                clusters = self._next_clusters()
            if not clusters:
                return
            yield clusters

    def _next_clusters(self) -> list[tuple[Cluster, Segment]]:
        clusters: list[tuple[Cluster, Segment]] = []
        while len(clusters) < (ROUND if self._removes else 1):
            cluster = self._game.next_cluster()
            if cluster is None:
                break
            average = average_cluster(self._game.candidates, cluster, self._config.averaging)
            if self._removes:
                cluster, average = self._of_one_surface(cluster, average)
                self._withdraw(average, closely=True)
            clusters.append((cluster, average))
        return clusters

    def _of_one_surface(self, cluster: Cluster, average: Segment) -> tuple[Cluster, Segment]:
        """Take one wall and one place of a cluster of several, and put the other members back into the game."""
        candidates, config = self._game.candidates, self._config.averaging
        parts = of_one_surface(candidates, cluster, average, self._indexed)
        if parts is not None:
            cluster, others = parts
            self._game.restore(others)
            average = average_cluster(candidates, cluster, config)
        parts = of_one_place(candidates, cluster, average)
        if parts is not None:
            cluster, others = parts
            self._game.restore(others)
            average = average_cluster(candidates, cluster, config)
        return cluster, average

    def _withdraw(self, segment: Segment, *, closely: bool) -> None:
        """Take the candidates that a segment explains out of the game, but for those of another wall about its axis."""
        explained = self._game.explained_by(segment, closely=closely)
        places = self._game.candidates.places[explained]
        noise = self._indexed.noise_about(segment.model, segment.half)
        width = max(5.0 * max(noise, segment.spread), OTHER_WALL * segment.radius)
        self._game.withdraw(explained[np.isnan(places[:, 0]) | are_on(places, segment.model, width)])

    def fit(self, clusters: list[tuple[Cluster, Segment]]) -> list[Fitted | RejectedSegment]:
        """Fit the averages of clusters to the cloud, over threads."""
        known = as_rows([finding.segment for finding in self.findings])
        return self._over_threads(lambda cluster: self._fit_average(*cluster, known), clusters)

    def _fit_average(self, cluster: Cluster, average: Segment, known: FloatArray) -> Fitted | RejectedSegment:
        support, payoff = len(cluster.members), cluster.payoff
        verified = self._config.verification.enabled
        if verified and self._judge.is_contradicted(average):
            fitted: Segment | str = "agreement"
        else:
            fitted = (refine if self._config.averaging.refine else measure_extent)(average, self._indexed)
        if isinstance(fitted, str):
            held = upright_of(average, self._indexed, SURELY_UPRIGHT) if verified else None
            if held is None:
                return RejectedSegment(average, fitted, support, payoff)
            fitted = held
        if self._removes and is_part_of(fitted, known):
            return RejectedSegment(fitted, FOUND_BEFORE, support, payoff)
        return Fitted(fitted, support, payoff, cluster.members)

    def verify(self, segments: list[Fitted | RejectedSegment], log: StageLog) -> None:
        """Judge the fitted segments, over threads; take what the accepted ones explain out of the game."""
        judged = self._over_threads(self._outcomes_of, segments)
        self._restore_beyond([one for one in segments if isinstance(one, Fitted)])
        for outcome in (one for outcomes in judged for one in outcomes):
            found = self._new_or_known(outcome)
            if isinstance(found, Finding):
                self.findings.append(found)
            else:
                self._counts[found.reason] += 1
                self.rejected += [found] if found.reason != FOUND_BEFORE else []
            if self._removes:
                # what the like of a rejected segment would lead to is known, too
                closely = not isinstance(found, Finding)
                self._withdraw(found.segment, closely=closely)
            log.advance()

    def _outcomes_of(self, one: Fitted | RejectedSegment) -> list[Finding | RejectedSegment]:
        """Judge a segment: it, or the pieces of it that are cylinders, or arcs where no cylinder could be fitted."""
        if isinstance(one, Fitted):
            return self._judge.in_pieces(one.segment, one.support, one.payoff)
        return [one] if one.reason == FOUND_BEFORE else self._judge.arcs_between_planes(one)

    def _restore_beyond(self, fitted: list[Fitted]) -> None:
        """Put the members of clusters back into the game that were laid beyond the ends of what these led to."""
        for one in fitted if self._removes else []:
            places = self._game.candidates.places[one.members]
            heights = (places - one.segment.point) @ one.segment.direction
            self._game.restore(one.members[np.abs(heights) > one.segment.half + one.segment.radius])

    def _new_or_known(self, found: Finding | RejectedSegment) -> Finding | RejectedSegment:
        """Reject a finding that another cluster of the same round, or a piece of another whole, has led to before."""
        if not (self._removes and isinstance(found, Finding)):
            return found
        known = as_rows([finding.segment for finding in self.findings])
        return RejectedSegment.of(found, FOUND_BEFORE) if is_part_of(found.segment, known) else found

    def look_about_axes(self, log: StageLog) -> None:
        """Look for further walls about the axes of the cylinders found so far, and of those found so."""
        if not (self._removes and self._config.verification.enabled):
            return
        fresh = [finding for finding in self.findings if not finding.blend]
        for _ in range(AXES_OF_AXES):
            free = np.ones(len(self._indexed.points), np.bool_)
            for finding in self.findings:
                free[finding.points] = False
            start = len(self.findings)
            walls = self._over_threads(partial(walls_about, indexed=self._indexed, free=free), fresh)
            fitted = [(wall, one) for one, found in zip(fresh, walls, strict=True) for wall in found]
            self.verify(self._over_threads(lambda pair: self._fit_wall(*pair), fitted), log)
            fresh = [finding for finding in self.findings[start:] if not finding.blend]
            if not fresh:
                break

    def _fit_wall(self, wall: Segment, known: Finding) -> Fitted | RejectedSegment:
        """Fit a wall about a known axis; a short one does not tell its axis better."""
        short = wall.half <= SHORT * wall.radius
        fitted = (held_as_is if short else refine)(wall, self._indexed)
        if fitted is None or isinstance(fitted, str):
            return RejectedSegment(wall, fitted or "no fit", known.support, known.payoff)
        if is_part_of(fitted, as_rows([finding.segment for finding in self.findings])):
            return RejectedSegment(fitted, FOUND_BEFORE, known.support, known.payoff)
        return Fitted(fitted, known.support, known.payoff)

    def report(self, log: StageLog) -> None:
        """Note what the game and the verification considered, kept and rejected."""
        log.reports.append(self._game.report())
        log.report("verification", len(self.findings) + self._counts.total(), len(self.findings), self._counts)

    def merge(self, log: StageLog) -> list[Finding]:
        """Join the pieces of one pipe, drop what better cylinders have claimed, and keep as many as asked for."""
        findings = kept = [finding for finding in self.findings if not finding.blend]
        joined = claimed = 0
        strayed: list[RejectedSegment] = []
        if self._config.averaging.merge:
            distinct = drop_claimed(findings, len(self._indexed.points))
            pieces = merge_pieces(distinct, self._indexed, self._judge.join)
            longer = self._over_threads(lambda piece: extend(piece, self._indexed, self._judge.join), pieces)
            if any(one is not other for one, other in zip(longer, pieces, strict=True)):
                pieces = merge_pieces(longer, self._indexed, self._judge.join)
            apart = self._over_threads(lambda piece: parted(piece, self._indexed, self._judge.join), pieces)
            joined = len(distinct) - len(pieces)
            pieces = [piece for whole in apart for piece in whole]
            kept = drop_claimed(pieces, len(self._indexed.points))
            for before, after in ((findings, distinct), (pieces, kept)):
                there = {id(finding) for finding in after}
                lost = [one for one in before if id(one) not in there]
                self.rejected += [RejectedSegment.of(one, "claimed by a better one") for one in lost]
            claimed = len(findings) - len(distinct) + len(pieces) - len(kept)
        if self._config.averaging.refine:
            finished = self._over_threads(self._judge.finish, kept)
            reasons = [self._judge.out_of_range(one.segment) for one in finished]
            both = list(zip(finished, reasons, strict=True))
            strayed = [RejectedSegment.of(one, reason) for one, reason in both if reason]
            kept = [one for one, reason in both if not reason]
            self.rejected += strayed
        kept = sorted(kept, key=lambda finding: (-finding.confidence, -len(finding.points)))
        beyond = kept[self._config.max_cylinders :] if self._config.max_cylinders else []
        kept = kept[: len(kept) - len(beyond)]
        self.rejected += [RejectedSegment.of(finding, "beyond max_cylinders") for finding in beyond]
        counts = {"joined": joined, "claimed by a better one": claimed, "beyond max_cylinders": len(beyond)}
        counts |= Counter(one.reason for one in strayed)
        log.report("merging", len(findings), len(kept), counts)
        return kept

    def merge_blends(self, cylinders: list[Finding], log: StageLog) -> list[Finding]:
        """Join the pieces of one blend, and drop those whose points belong to a cylinder or to a better blend.

        Parameters
        ----------
        cylinders : list of Finding
            The merged cylinders.
        log : StageLog
        """
        blends, count = [finding for finding in self.findings if finding.blend], len(self._indexed.points)
        if not blends:
            return []
        distinct = drop_claimed(blends, count, cylinders)
        pieces = merge_pieces(distinct, self._indexed, self._judge.join_blend)
        kept = self._over_threads(self._judge.finish, drop_claimed(pieces, count, cylinders))
        kept = [one for one in kept if not self._judge.out_of_range(one.segment)]
        joined = len(distinct) - len(pieces)
        counts = {"joined": joined, "claimed by a better one": len(blends) - joined - len(kept)}
        log.report("blends", len(blends), len(kept), {reason: n for reason, n in counts.items() if n})
        return sorted(kept, key=lambda finding: (-finding.confidence, -len(finding.points)))

    def _enough(self) -> bool:
        """Return whether to stop early: the paper's order is that of the clusters, ours that of the cylinders."""
        most = self._config.max_cylinders
        return most is not None and not self._config.averaging.merge and len(self.findings) >= most

    def _over_threads(self, work: Callable[[Item], Outcome], items: list[Item]) -> list[Outcome]:
        with ThreadPoolExecutor(self._prepared.threads) as pool:
            return list(pool.map(work, items))
