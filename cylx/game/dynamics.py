"""Evolutionary games on a payoff matrix: from payoffs to a stable population. Independent of cylinders.

A population x on the simplex evolves towards a larger mean payoff x' A x. With a zero diagonal the supports of its
stable states are dominant sets, the clusters of the pairwise similarity A (Pavan and Pelillo). With a unit diagonal
every stable state is a single strategy, so the answer depends on when the iteration stops.
"""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit

EXTINCT = 1e-9
"""A share of the final population below this counts as zero: replicators reach zero only in infinite time."""
GONE = 1e-200
"""A share below this cannot recover before the dynamics end."""


@njit(cache=True, nogil=True)
def _replicator(payoff: FloatArray, population: FloatArray, steps: int, tolerance: float) -> int:
    n = len(population)
    fitness = np.empty(n)
    for step in range(steps):
        mean = 0.0
        for i in range(n):
            fitness[i] = 0.0
            if population[i] > 0.0:
                for j in range(n):
                    fitness[i] += payoff[i, j] * population[j]
                mean += fitness[i] * population[i]
        if mean <= 1e-300:
            return step
        change = 0.0
        for i in range(n):
            share = population[i] * fitness[i] / mean  # eq. 7
            if share < GONE:
                share = 0.0
            change += abs(share - population[i])
            population[i] = share
        if change < tolerance:
            return step + 1
    return steps


@njit(cache=True, nogil=True)
def _infection_immunization(payoff: FloatArray, population: FloatArray, steps: int, tolerance: float) -> int:
    n = len(population)
    fitness = np.zeros(n)
    for i in range(n):
        for j in range(n):
            fitness[i] += payoff[i, j] * population[j]
    for step in range(steps):
        mean = 0.0
        for i in range(n):
            mean += population[i] * fitness[i]
        best, worst = 0, -1
        regret = 0.0
        for i in range(n):
            if fitness[i] > fitness[best]:
                best = i
            if population[i] > 0.0 and (worst < 0 or fitness[i] < fitness[worst]):
                worst = i
            miss = min(population[i], mean - fitness[i])
            regret += miss * miss
        if regret < tolerance * tolerance:
            return step
        # infect with the strategy that does best against the population, or immunise against the one that does worst
        chosen = best if fitness[best] - mean >= mean - fitness[worst] else worst
        gain = fitness[chosen] - mean
        bend = payoff[chosen, chosen] - fitness[chosen] - gain
        if gain >= 0.0:
            move = min(1.0, -gain / bend) if bend < 0.0 else 1.0
        else:
            move = population[chosen] / (population[chosen] - 1.0) if population[chosen] < 1.0 else 0.0
            if bend < 0.0:
                move = max(move, -gain / bend)
        for i in range(n):
            population[i] *= 1.0 - move
            fitness[i] += move * (payoff[i, chosen] - fitness[i])
        population[chosen] += move
        if population[chosen] < EXTINCT:
            population[chosen] = 0.0
    return steps


def evolve(
    payoff: FloatArray,
    *,
    dynamics: str = "infection-immunization",
    max_iterations: int = 1000,
    tolerance: float = 1e-6,
    start: FloatArray | None = None,
) -> FloatArray:
    """Let a population evolve on a symmetric, non-negative payoff matrix.

    Parameters
    ----------
    payoff : ndarray of shape (M, M)
    dynamics : {"replicator", "infection-immunization"}
        Discrete replicator dynamics (eq. 7), or Rota Bulo and Bomze's faster way to the same equilibria.
    max_iterations : int
        Maximum number of steps.
    tolerance : float
        Stop when a step changes the population by less than this (replicator, sum of absolute changes), or no strategy
        could gain more than this (infection-immunization).
    start : ndarray of shape (M,), optional
        First population; uniform by default.

    Returns
    -------
    ndarray of shape (M,)
        Shares of the strategies, non-negative, of sum 1.

    Examples
    --------
    Three strategies that agree, and one that agrees with none:

    >>> payoff = np.ones((4, 4)) - np.eye(4)
    >>> payoff[3, :] = payoff[:, 3] = 0.0
    >>> evolve(payoff).round(3)
    array([0.333, 0.333, 0.333, 0.   ])

    References
    ----------
    The paper, eq. 7. S. Rota Bulo and I. M. Bomze, Games and Economic Behavior 71 (2011) 193-211.
    """
    count = len(payoff)
    if count == 0:
        return np.zeros(0)
    population = np.full(count, 1.0 / count) if start is None else np.array(start, dtype=np.float64)
    step = _replicator if dynamics == "replicator" else _infection_immunization
    step(np.ascontiguousarray(payoff, dtype=np.float64), population, max_iterations, tolerance)
    population[population < EXTINCT] = 0.0
    return np.asarray(population / population.sum(), dtype=np.float64)


@njit(cache=True, nogil=True)
def _fill_block(
    pointers: IndexArray,
    indices: IndexArray,
    values: FloatArray,
    nodes: IndexArray,
    place: IndexArray,
    block: FloatArray,
) -> None:
    for a in range(len(nodes)):
        place[nodes[a]] = a
    for a in range(len(nodes)):
        for k in range(pointers[nodes[a]], pointers[nodes[a] + 1]):
            b = place[indices[k]]
            if b >= 0:
                block[a, b] = values[k]
    for a in range(len(nodes)):
        place[nodes[a]] = -1


class SparsePayoff:
    """A symmetric payoff matrix that stores only the positive entries, row by row.

    Parameters
    ----------
    pointers : ndarray of shape (M + 1,)
        Row i has the entries `pointers[i]:pointers[i + 1]`.
    indices : ndarray of int64
        Columns.
    values : ndarray of float64
        Payoffs.
    """

    def __init__(self, pointers: IndexArray, indices: IndexArray, values: FloatArray) -> None:
        self.pointers = pointers
        self.indices = indices
        self.values = values
        self._place = np.full(len(pointers) - 1, -1, np.int64)

    @classmethod
    def of(cls, payoff: FloatArray) -> SparsePayoff:
        """Keep the positive entries of a dense matrix of shape (M, M)."""
        rows, columns = np.nonzero(payoff)
        pointers = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=len(payoff))))).astype(np.int64)
        return cls(pointers, columns.astype(np.int64), payoff[rows, columns])

    def row(self, i: int) -> tuple[IndexArray, FloatArray]:
        """Return the columns and payoffs of row i."""
        part = slice(self.pointers[i], self.pointers[i + 1])
        return self.indices[part], self.values[part]

    def degrees(self) -> FloatArray:
        """Return the sum of each row, shape (M,)."""
        rows = np.repeat(np.arange(len(self._place)), np.diff(self.pointers))
        return np.asarray(np.bincount(rows, self.values, minlength=len(self._place)), dtype=np.float64)

    def block(self, nodes: IndexArray) -> FloatArray:
        """Return the payoffs among a few strategies, shape (m, m)."""
        out = np.zeros((len(nodes), len(nodes)))
        _fill_block(self.pointers, self.indices, self.values, nodes, self._place, out)
        return out
