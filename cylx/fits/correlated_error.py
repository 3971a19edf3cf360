"""What errors that neighbouring points share do to the uncertainty of a cylinder.

A depth camera errs alike over many pixels, and a real object is no perfect cylinder. Such an error does not average out
over the points. Here the surface is divided into cells. The mean residuals of the cells are white noise and a Gaussian
process along the surface, with the covariance v exp(-d / l) at distance d. Variance v and length l are weighed by the
restricted likelihood (Patterson and Thompson, Biometrika 58, 1971), in which the five parameters of the cylinder and a
slope, which take up most of a long wave, are allowed for; all are averaged over, because a single surface tells little
of l. The fit
weighs all points alike, and so its covariance is A^-1 X^T V X A^-1, with the rows X of the parameters, A = X^T X, and V
the covariance of the points. An estimate that weighs them otherwise has its own variance, h^T V h, with what each point
counts in it, h.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit

COLUMNS, ROWS = 20, 5
"""Cells about the axis and along it."""
FEWEST_CELLS = 12
"""With fewer cells five parameters, a variance and a length are not told apart."""
UNSHARED = 1.4
"""Chi-square a cell up to which there is no sign of anything but white noise."""
LENGTHS = np.geomspace(0.25, 32.0, 8)
"""Lengths that are tried, in sides of a cell."""
VARIANCES = np.geomspace(1.0 / 16.0, 128.0, 9)
"""Variances that are tried, in mean squares of the cells' residuals, for a length of up to one side; little of a long
wave is left in the residuals, so that its variance is larger by its length."""


class Shared(NamedTuple):
    """The errors that neighbouring points share.

    Parameters
    ----------
    cell : ndarray of shape (n,)
        The cell of each point.
    weighted : ndarray of shape (k, 5)
        Rows of the parameters of the cylinder, times the number of points of the cell.
    inverse : ndarray of shape (5, 5)
        Inverse of the sum of the products of the points' rows.
    covariance : ndarray of shape (k, k)
        Of the shared errors of the cells.
    """

    cell: IndexArray
    weighted: FloatArray
    inverse: FloatArray
    covariance: FloatArray


def shared_covariance(
    heights: FloatArray, residuals: FloatArray, angles: FloatArray, radius: float
) -> FloatArray | None:
    """Return how much the errors that points share add to the covariance of a cylinder fitted to them.

    Parameters
    ----------
    heights, residuals, angles : ndarray of shape (n,)
        Cylinder coordinates of the points on the surface: lengths, and radians.
    radius : float
        Of the cylinder, a length.

    Returns
    -------
    ndarray of shape (5, 5) or None
        Of both offsets at height 0, both tilts and the radius; None if the points fill too few cells.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> turn, z = rng.uniform(0, 2, 4000), rng.uniform(-1, 1, 4000)
    >>> white = shared_covariance(z, 0.01 * rng.standard_normal(4000), turn, 1.0)
    >>> waves = shared_covariance(z, 0.01 * np.sin(9 * turn) * np.cos(5 * z), turn, 1.0)
    >>> bool(waves[4, 4] > 30 * white[4, 4])
    True
    """
    shared = _shared_errors(heights, residuals, angles, radius)
    if shared is None:
        return None
    spread = np.einsum("ia,ib->ab", shared.weighted, np.einsum("ij,jb->ib", shared.covariance, shared.weighted))
    covariance = shared.inverse @ spread @ shared.inverse
    return np.asarray(0.5 * (covariance + covariance.T), dtype=np.float64)


def shared_variance(
    heights: FloatArray, residuals: FloatArray, angles: FloatArray, radius: float, influence: FloatArray
) -> float | None:
    """Return how much the errors that points share add to the variance of an estimate that is linear in them.

    Parameters
    ----------
    heights, residuals, angles, radius
        As for `shared_covariance`.
    influence : ndarray of shape (n,)
        Change of the estimate by an error of each point.

    Returns
    -------
    float or None
        None if the points fill too few cells.
    """
    shared = _shared_errors(heights, residuals, angles, radius)
    if shared is None:
        return None
    on = np.bincount(shared.cell, influence, minlength=len(shared.covariance))
    return float(np.einsum("i,i->", on, np.einsum("ij,j->i", shared.covariance, on)))


def _shared_errors(heights: FloatArray, residuals: FloatArray, angles: FloatArray, radius: float) -> Shared | None:
    """Return the errors that neighbouring points share, None if the points fill too few cells."""
    low, high = float(heights.min(initial=0.0)), float(heights.max(initial=0.0))
    place = ((angles / (2.0 * np.pi) + 0.5) * COLUMNS).astype(np.int64) % COLUMNS * ROWS
    place += np.clip(((heights - low) / max(high - low, 1e-300) * ROWS).astype(np.int64), 0, ROWS - 1)
    _, cell, counts = np.unique(place, return_inverse=True, return_counts=True)
    cells = len(counts)
    if cells < FEWEST_CELLS or len(heights) <= 2 * cells:
        return None
    cosine, sine = np.cos(angles), np.sin(angles)
    terms = [cosine, sine, heights * cosine, heights * sine, np.ones(len(heights)), residuals, heights]
    means = np.column_stack([np.bincount(cell, term) / counts for term in terms])
    rows, values = np.ascontiguousarray(means[:, :5]), means[:, 5].copy()
    white = float(((residuals - values[cell]) ** 2).sum()) / (len(heights) - cells) / counts
    # a cone is no wave: its radius in the middle is as certain as that of a cylinder
    modelled = np.column_stack([rows, means[:, 6] - float((counts * means[:, 6]).sum()) / len(heights)])
    weighted = counts[:, None] * modelled  # summed in a fixed order, which BLAS does not
    gram = np.einsum("ia,ib->ab", weighted, modelled)
    found = np.einsum("ab,b->a", np.linalg.pinv(gram, hermitian=True), np.einsum("ia,i->a", weighted, values))
    values -= np.einsum("ia,a->i", modelled, found)
    turn = np.arctan2(means[:, 1], means[:, 0])
    apart = np.abs(turn[:, None] - turn)
    across = radius * np.minimum(apart, 2.0 * np.pi - apart)
    distances = np.hypot(across, means[:, 6, None] - means[:, 6])
    side = math.sqrt((high - low) / ROWS * 2.0 * math.pi * radius / COLUMNS)
    if not float((values**2 / np.maximum(white, 1e-300)).mean()) > UNSHARED:
        return Shared(cell, weighted[:, :5], np.zeros((5, 5)), np.zeros((cells, cells)))
    unit = float((values**2).mean())
    tried: list[tuple[float, float, FloatArray]] = []
    for length in LENGTHS:
        shape = np.exp(-distances / (length * side))
        for variance in max(length, 1.0) * unit * VARIANCES:
            likelihood = _restricted_likelihood(variance * shape + np.diag(white), modelled, values)
            tried.append((float(likelihood), float(variance), shape))
    best = max(likelihood for likelihood, _, _ in tried)
    if not math.isfinite(best):  # the points do not determine the parameters
        return None
    chosen, total = np.zeros((cells, cells)), 0.0
    for likelihood, variance, shape in tried:
        weight = math.exp(likelihood - best)
        chosen += weight * variance * shape
        total += weight
    chosen /= total
    inverse = np.linalg.pinv(gram[:5, :5], hermitian=True)
    return Shared(cell, weighted[:, :5], inverse, chosen)


@njit(cache=True, nogil=True)
def _restricted_likelihood(covariance: FloatArray, rows: FloatArray, values: FloatArray) -> float:
    """Return the restricted log-likelihood of values about a linear model, but for a constant; uses up `covariance`."""
    n, k = rows.shape
    right = np.empty((n, k + 1))
    for i in range(n):
        for a in range(k):
            right[i, a] = rows[i, a]
        right[i, k] = values[i]
    total = 0.0
    # Cholesky's decomposition by columns, and the forward substitution with it
    for j in range(n):
        if not covariance[j, j] > 0.0:
            return -math.inf
        root = math.sqrt(covariance[j, j])
        total -= math.log(root)
        for a in range(k + 1):
            right[j, a] /= root
        for i in range(j + 1, n):
            covariance[j, i] /= root
        for i in range(j + 1, n):
            factor = covariance[j, i]
            for a in range(k + 1):
                right[i, a] -= factor * right[j, a]
            for m in range(i, n):
                covariance[i, m] -= factor * covariance[j, m]
    gram = np.zeros((k + 1, k + 1))
    for i in range(n):
        for a in range(k + 1):
            for b in range(a, k + 1):
                gram[a, b] += right[i, a] * right[i, b]
    # the same of the parameters; what is left of the last one is the sum of squares that they do not explain
    for a in range(k):
        if not gram[a, a] > 0.0:
            return -math.inf
        total -= 0.5 * math.log(gram[a, a])
        for b in range(a + 1, k + 1):
            for c in range(b, k + 1):
                gram[b, c] -= gram[a, b] * gram[a, c] / gram[a, a]
    return float(total - 0.5 * gram[k, k])
