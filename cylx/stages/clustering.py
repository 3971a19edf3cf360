"""Candidates -> clusters: the clustering game (section 3.3).

Either the paper's payoff and dynamics over all candidates, or the same game at scale: a sparse payoff over pairs of
nearby candidates, and local populations, one neighbourhood after the other.
"""

from __future__ import annotations

import heapq
import math

import numpy as np

from cylx.config import ClusteringConfig
from cylx.game import SparsePayoff, evolve, local_payoff, screw_payoff
from cylx.game.agreement import Neighbourhood
from cylx.geometry.arrays import IndexArray
from cylx.records import Candidates, Cluster, Segment, StageReport

LEAST_SHARE_OF_MEMBER = 0.35
"""A candidate belongs to the cluster if its payoff against the equilibrium exceeds this share of the mean."""
MOST_CANDIDATES_OF_POPULATION = 400
"""Most candidates of a local population; the best connected ones are used."""


SURVIVING_SHARE = 1e-3
"""Where all play, a candidate with less than this part of an equal share is on its way out: the dynamics never end."""
LEAST_WEIGHT = 0.05
"""Members without a share of the population weigh this part of the largest share in the average."""
CLOSELY = 0.1, 4.0, 0.06
"""What says the same as a cylinder: offset in radii, angle in degrees, relative difference of radii."""
EXPLAINED = 0.25, 10.0, 0.2
"""What a cylinder accounts for: candidates of a few points that lie on it scatter so much about it."""
STALE = 1e-9
"""A degree in the heap is up to date but for rounding."""
STOP_SHARE = 0.5
"""The game ends where nobody has this part of the payoff that the smallest cluster accepted would give."""
RADIUS_STEP = 1.25
"""Ratio of the radii of neighbouring cells in which candidates say the same."""
SMALL_CLUSTERS_TO_END = 3
"""With the global population, this many small clusters in a row end the game. The paper says only "until all are
extracted"."""


class CandidateGame:
    """All candidates and their payoffs; returns one cluster after the other.

    Parameters
    ----------
    candidates : Candidates
    config : ClusteringConfig
    threads : int
        Does not change the result.

    Attributes
    ----------
    candidates : Candidates
    """

    def __init__(self, candidates: Candidates, config: ClusteringConfig, threads: int = 1) -> None:
        self._config = config
        self.candidates = candidates
        self._alive = np.ones(len(candidates), np.bool_)
        self._restored = np.zeros(len(candidates), np.bool_)
        self._places = Neighbourhood(candidates)
        self._dropped = {"too small": 0, "too little payoff": 0}
        self._clusters = 0
        self._patience = SMALL_CLUSTERS_TO_END
        if config.kernel == "screw":
            dense = screw_payoff(candidates.models, candidates.parents, config.screw_scale, config.min_radius_ratio)
            self._payoff = SparsePayoff.of(dense)
        else:
            self._payoff = local_payoff(
                candidates.models,
                candidates.parents,
                candidates.extents,
                math.radians(config.angle_deg),
                config.offset,
                config.radius,
                config.min_radius_ratio,
                threads,
            )
        self._degrees = self._payoff.degrees()
        self._heap = [(-degree, i) for i, degree in enumerate(self._degrees.tolist())]
        heapq.heapify(self._heap)

    def next_cluster(self) -> Cluster | None:
        """Play until a cluster emerges and remove its members from the game; return None when no candidate is left."""
        whole = self._config.population == "whole"
        while True:
            nodes = np.flatnonzero(self._alive) if whole else self._neighbourhood()
            if nodes is None or len(nodes) == 0:
                return None
            block = self._payoff.block(nodes)
            if whole or self._config.diagonal:
                np.fill_diagonal(block, self._config.diagonal)
            population = evolve(
                block,
                dynamics=self._config.dynamics,
                max_iterations=self._config.max_iterations,
                tolerance=self._config.tolerance,
            )
            fitness = block @ population
            mean = float(population @ fitness)
            # the paper's winners are the candidates with a share; here also those that do well against them
            members = population > (0.0 if not whole else 1.0 / len(nodes) * SURVIVING_SHARE)
            if not whole:
                members |= fitness > LEAST_SHARE_OF_MEMBER * mean
            self.withdraw(nodes[members])
            support = int(members.sum())
            if support < self._config.min_support:
                self._dropped["too small"] += 1
            elif mean < self._config.min_payoff:
                self._dropped["too little payoff"] += 1
            else:
                self._patience = SMALL_CLUSTERS_TO_END
                self._clusters += 1
                weights = population[members] + (0.0 if whole else LEAST_WEIGHT * population.max())
                return Cluster(nodes[members], weights / weights.sum(), mean)
            self._patience -= 1 if whole else 0
            if self._patience == 0:
                return None

    def withdraw(self, indices: IndexArray) -> None:
        """Remove candidates from the game by setting their rows and columns to zero (section 3.5)."""
        for i in indices[self._alive[indices]]:
            self._alive[i] = False
            columns, values = self._payoff.row(i)
            self._degrees[columns] -= values

    def restore(self, indices: IndexArray) -> None:
        """Put candidates back into the game, each once: a cluster had them that was not theirs."""
        for i in indices[~self._alive[indices] & ~self._restored[indices]]:
            self._alive[i] = self._restored[i] = True
            columns, values = self._payoff.row(i)
            self._degrees[columns] += values
            heapq.heappush(self._heap, (-float(self._degrees[i]), int(i)))

    def explained_by(self, segment: Segment, *, closely: bool = False) -> IndexArray:
        """Return the remaining candidates that a cylinder explains, or with `closely` those that nearly equal it."""
        return self._places.agreeing(segment, self._alive, *(CLOSELY if closely else EXPLAINED))

    def report(self) -> StageReport:
        """Return the counts of incoming candidates, clusters, and rejections."""
        dropped = {name: count for name, count in self._dropped.items() if count}
        return StageReport("clustering", len(self.candidates), self._clusters, dropped)

    def _neighbourhood(self) -> IndexArray | None:
        """Return the best connected remaining candidate, and its neighbours."""
        least = STOP_SHARE * self._config.min_payoff * (self._config.min_support - 1)
        while self._heap:
            degree, i = heapq.heappop(self._heap)
            if not self._alive[i]:
                continue
            if -degree > self._degrees[i] + STALE:
                heapq.heappush(self._heap, (-float(self._degrees[i]), i))
                continue
            if self._degrees[i] < least:
                return None
            self._alive[i] = False  # not tried again, whatever the outcome
            columns, values = self._payoff.row(i)
            present = self._alive[columns]
            columns, values = columns[present], values[present]
            if len(columns) >= MOST_CANDIDATES_OF_POPULATION:
                columns = columns[np.argsort(-values, kind="stable")[: MOST_CANDIDATES_OF_POPULATION - 1]]
            self._alive[i] = True
            self.withdraw(np.array([i]))
            return np.concatenate(([i], columns)).astype(np.int64)
        return None


def thin_candidates(candidates: Candidates, most: int = 8) -> Candidates:
    """Keep the best supported few of each group of nearly equal candidates.

    A large cylinder has thousands of equal candidates; the game needs only enough of them to tell it from chance.

    Parameters
    ----------
    candidates : Candidates
    most : int
        Candidates kept in each cell of place (half a radius), radius (a quarter) and direction (half a radian).

    Returns
    -------
    Candidates
    """
    if len(candidates) == 0:
        return candidates
    size_class = np.floor(np.log(candidates.radii) / math.log(RADIUS_STEP))
    side = 0.5 * RADIUS_STEP**size_class
    signs = np.where(
        candidates.directions[np.arange(len(candidates)), np.abs(candidates.directions).argmax(1)] < 0, -1, 1
    )
    key = np.column_stack(
        [
            size_class,
            np.floor(candidates.points / side[:, None]),
            np.round(2.0 * candidates.directions * signs[:, None]),
        ]
    ).astype(np.int64)
    order = np.lexsort((-candidates.inliers, *key.T))
    same = (key[order][1:] == key[order][:-1]).all(axis=1)
    starts = np.flatnonzero(np.concatenate(([True], ~same)))
    rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.concatenate((starts, [len(order)]))))
    return candidates.take(np.sort(order[rank < most]))
