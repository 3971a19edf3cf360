"""The distribution of residuals: a mixture of two Gaussians, one of a surface and a broader one of outliers.

The mixture is estimated by expectation maximisation (Dempster, Laird and Rubin, JRSS B 39, 1977) from a histogram, so
that its cost does not grow with the points.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit

BINS = 240
"""Steps of the residual in which the distribution and the weights are tabulated."""
EM_STEPS = 40
SETTLED = 1e-4
"""The estimate ends when a variance changes by less than this share."""
LEAST_RATIO = 1.3
"""The outliers must be this many times broader; otherwise the two parts cannot be separated."""


class Law(NamedTuple):
    """The distribution of residuals.

    Parameters
    ----------
    deviation, broad : float
        Standard deviations of the surface and of the outliers.
    share : float
        Share of outliers among the points, in [0, 1).
    """

    deviation: float
    broad: float
    share: float

    def weights(self, width: float, *, outliers: bool) -> FloatArray:
        """Tabulate the weight of a residual, shape (BINS + 1, 3), at equal steps of its absolute value up to `width`.

        The columns are the weight, the derivative of the score (weight times residual), and the outliers' part of the
        weight. Without `outliers`, the outliers' part is left out of the first two columns.
        """
        squares = (width * np.arange(BINS + 1) / BINS) ** 2
        narrow, broad = self.deviation**2, self.broad**2
        outer = _posterior(squares, narrow, broad, self.share)
        gain = 1.0 / broad if outliers else 0.0
        weight = (1.0 - outer) / narrow + outer * gain
        slope = weight - outer * (1.0 - outer) * squares * (1.0 / narrow - gain) * (1.0 / narrow - 1.0 / broad)
        return np.column_stack([weight, slope, outer / broad])


def estimate_law(counts: FloatArray, width: float, start: Law) -> Law:
    """Estimate the distribution of residuals by expectation maximisation.

    Parameters
    ----------
    counts : ndarray of shape (BINS,)
        Number of residuals by absolute value, in equal steps up to `width`; need not be integers.
    width : float
    start : Law

    Returns
    -------
    Law
        Without outliers if the second part is less than `LEAST_RATIO` times as broad.
    """
    squares = (width * (np.arange(BINS) + 0.5) / BINS) ** 2
    total = float(counts.sum())
    if total == 0.0:
        return start
    narrow, broad, share = _maximise(squares, counts, total, start.deviation**2, start.broad**2, max(start.share, 0.02))
    if share < 1e-3 or broad < LEAST_RATIO**2 * narrow:
        everything = math.sqrt(float(counts @ squares) / total)
        return Law(everything, everything, 0.0)
    return Law(math.sqrt(narrow), math.sqrt(broad), share)


@njit(cache=True, nogil=True)
def _maximise(
    squares: FloatArray, counts: FloatArray, total: float, narrow: float, broad: float, share: float
) -> tuple[float, float, float]:
    """Improve these variances and this share of outliers until the likelihood of the counts is largest."""
    for _ in range(EM_STEPS):
        # the odds that a residual of this square is not an outlier
        ratio, rate = (1.0 - share) / share * math.sqrt(broad / narrow), 0.5 * (1.0 / narrow - 1.0 / broad)
        mass, outside, inside = 0.0, 0.0, 0.0
        for i in range(len(counts)):
            outer = counts[i] / (1.0 + ratio * math.exp(-rate * squares[i]))
            mass += outer
            outside += outer * squares[i]
            inside += (counts[i] - outer) * squares[i]
        share, last = mass / total, narrow
        if share < 1e-3:
            break
        broad, narrow = outside / mass, inside / max(total - mass, 1e-9 * total)
        if abs(narrow - last) < SETTLED * narrow or not narrow > 0.0:
            break
    return narrow, broad, share


def _posterior(squares: FloatArray, narrow: float, broad: float, share: float) -> FloatArray:
    """Return the probability that residuals of these squares are outliers, from the two variances."""
    if share <= 0.0:
        return np.zeros_like(squares)
    ratio = (1.0 - share) / share * math.sqrt(broad / narrow)
    return np.asarray(1.0 / (1.0 + ratio * np.exp(-0.5 * squares * (1.0 / narrow - 1.0 / broad))))
