"""Maximum-likelihood fit of a cylinder to points with outliers, which have a larger scatter.

The residuals are modelled by a mixture of two Gaussians (`cylx.fits.residual_law`), whose shares and widths are
estimated together with the cylinder. Gauss-Newton steps solve the normal equations, with weights of the points from
the mixture. The fit reaches the Cramer-Rao bound. Its covariance is that of an M-estimator (Huber, 1967), which holds
even if the residuals are not such a mixture.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.fits.residual_law import BINS, Law, estimate_law
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, UX, UY, UZ
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import fill_basis

MIXTURE_ROUNDS, STEPS_A_ROUND = 3, 5
CLOSE = 1e-4
"""The iteration ends when a step is shorter than this share of the standard deviation."""
LEAST_POINTS_OF_MIXTURE = 12
CONTRADICTION = 5.0
"""A prior contradicts the points if they differ by more standard deviations than this."""
_LOWER = np.tril_indices(5, -1)
ONE_SIDED = 25.0
"""Above this chi-square (five degrees of freedom) the outliers lie on one side and say nothing about the surface."""


class MixtureFit(NamedTuple):
    """A cylinder with its uncertainty.

    Parameters
    ----------
    model : ndarray of shape (7,)
        A point of the axis, its unit direction, and the radius, corrected for its bias.
    covariance : ndarray of shape (5, 5)
        Of two offsets of the axis at its point, its two tilts (radians), and the radius. The first offset and tilt are
        along the first of the two directions of `fill_basis`, the others along the second.
    law : Law
    """

    model: FloatArray
    covariance: FloatArray
    law: Law


class Prior(NamedTuple):
    """Prior knowledge of a cylinder, as Gaussians.

    Parameters
    ----------
    radius : float or None
        None if unknown.
    radius_deviation : float
    direction : ndarray of shape (3,) or None
        Unit direction of the axis, up to sign; None if unknown.
    direction_deviation : float
        Standard deviation of each of the two tilts, radians.
    """

    radius: float | None = None
    radius_deviation: float = math.inf
    direction: FloatArray | None = None
    direction_deviation: float = math.inf

    def as_far_as_borne_out(self, fit: MixtureFit, most: float = CONTRADICTION) -> Prior | None:
        """Drop the parts that differ from a fit without the prior by more than `most` deviations; None if all do."""
        covariance, kept = fit.covariance, self
        if self.radius is not None:
            away = fit.model[RADIUS] - self.radius
            if away**2 > most**2 * (covariance[4, 4] + self.radius_deviation**2):
                kept = kept._replace(radius=None)
        if self.direction is not None:
            basis = np.empty((2, 3))
            fill_basis(fit.model[DIRECTION], basis)
            tilts = basis @ self.direction * np.sign(self.direction @ fit.model[DIRECTION])
            spread = covariance[2:4, 2:4] + self.direction_deviation**2 * np.eye(2)
            if tilts @ np.linalg.solve(spread, tilts) > most**2:
                kept = kept._replace(direction=None)
        return None if kept.radius is None and kept.direction is None else kept


def fit_mixture(
    points: FloatArray,
    model: FloatArray,
    *,
    low: float,
    high: float,
    width: float,
    deviation: float,
    prior: Prior | None = None,
) -> MixtureFit | None:
    """Fit a cylinder by maximum likelihood, starting from a robust fit.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    model : ndarray of shape (7,)
        Start: a point of the axis, its unit direction, the radius. Not changed.
    low, high : float
        Only points are used whose height from the model's point lies between these.
    width : float
        Only points this near to the surface are used: a few standard deviations of the surface.
    deviation : float
        Initial standard deviation of the surface.
    prior : Prior, optional
        Prior; the fit is then the mode of the posterior.

    Returns
    -------
    MixtureFit or None
        None if there are fewer than a dozen points, or the fit fails or moves from its start by more than `width`.
    """
    fitted = np.array(model, dtype=np.float64)
    points = np.ascontiguousarray(points)
    law, symmetric = Law(min(deviation, 0.3 * width), min(3.0 * deviation, 0.6 * width), 0.1), True
    for _ in range(MIXTURE_ROUNDS):
        counts = np.zeros(BINS)
        _count_residuals(points, fitted, low, high, width, counts)
        law = estimate_law(counts, width, law)
        if not law.deviation > 0.0:  # all of them are outliers
            return None
        weights = law.weights(width, outliers=symmetric)
        for _ in range(STEPS_A_ROUND):
            sums = _Sums.of(points, fitted, low, high, width, weights)
            if prior is not None:
                sums.know(prior, fitted)
            size = _advance(fitted, sums) if sums.count >= LEAST_POINTS_OF_MIXTURE else math.inf
            if not size < math.inf:
                return None
            if size < CLOSE * law.deviation:
                break
        if symmetric and law.share > 0.0:
            full = _Sums.of(points, fitted, low, high, width, weights, full=True)
            symmetric = full.one_sidedness() < ONE_SIDED
    sums = _Sums.of(points, fitted, low, high, width, law.weights(width, outliers=symmetric), full=True)
    if prior is not None:
        sums.know(prior, fitted)
    covariance = sums.covariance()
    aside = np.linalg.norm(np.cross(fitted[POINT] - model[POINT], model[DIRECTION]))
    if covariance is None or not abs(fitted[RADIUS] - model[RADIUS]) + aside < width:
        return None
    fitted[RADIUS] -= sums.count / sums.weight / (2.0 * fitted[RADIUS])
    return MixtureFit(fitted, covariance, law)


class _Sums:
    """Sums over the points of one pass.

    Attributes
    ----------
    normal, right : ndarray of shape (5, 5), (5,)
        The weighted normal equations.
    slopes, scores, outer_scores : ndarray of shape (5, 5)
        Sums of the derivative of the score, of the squares of the score, and of the squares of the outliers' score.
    outer_right : ndarray of shape (5,)
        Score of the outliers.
    count, weight, reach : float
    """

    def __init__(self, reach: float) -> None:
        self.normal, self.slopes, self.scores, self.outer_scores = np.zeros((4, 5, 5))
        self.right, self.outer_right = np.zeros((2, 5))
        self.basis = np.empty((2, 3))
        self.reach = reach
        self.count = self.weight = 0.0

    @classmethod
    def of(
        cls,
        points: FloatArray,
        model: FloatArray,
        low: float,
        high: float,
        width: float,
        weights: FloatArray,
        *,
        full: bool = False,
    ) -> _Sums:
        """Sum over the points; with `full`, include the sums for the covariance."""
        self = cls(max(abs(low), abs(high)))
        matrices = np.zeros((4, 5, 5))
        vectors = np.zeros((3, 5))
        fill_basis(model[DIRECTION], self.basis)
        _fill_sums(points, model, self.basis, low, high, width, self.reach, weights, full, matrices, vectors)
        for matrix in matrices:
            matrix[_LOWER[1], _LOWER[0]] = matrix[_LOWER]
        self.normal, self.slopes, self.scores, self.outer_scores = matrices
        self.right, self.outer_right = vectors[:2]
        self.count, self.weight = float(vectors[2, 0]), float(vectors[2, 1])
        return self

    def know(self, prior: Prior, model: FloatArray) -> None:
        """Add a prior to the normal equations: a pseudo-observation of the radius and one of each tilt."""
        values, precisions = np.zeros(5), np.zeros(5)
        if prior.radius is not None:
            biased = prior.radius + self.count / self.weight / (2.0 * model[RADIUS])  # the bias of a fit to noise
            values[4], precisions[4] = biased - model[RADIUS], prior.radius_deviation**-2
        if prior.direction is not None:
            direction = prior.direction * np.sign(prior.direction @ model[DIRECTION])
            values[2:4] = self.reach * (self.basis @ direction)
            precisions[2:4] = (self.reach * prior.direction_deviation) ** -2
        self.right += precisions * values
        for matrix in (self.normal, self.slopes, self.scores):
            matrix[np.diag_indices(5)] += precisions

    def one_sidedness(self) -> float:
        """Return chi-square, with five degrees of freedom, of the outliers about the surface."""
        scores = self.outer_scores + 1e-9 * np.trace(self.outer_scores) * np.eye(5)
        return float(self.outer_right @ np.linalg.lstsq(scores, self.outer_right, rcond=None)[0])

    def covariance(self) -> FloatArray | None:
        """Return the covariance of an M-estimator, for heights in units of length; None if it is not determined."""
        try:
            inverse = np.linalg.inv(self.slopes)
        except np.linalg.LinAlgError:
            return None
        few = self.count / max(self.count - 5.0, 1.0)  # five parameters were fitted to these residuals
        scale = np.array([1.0, 1.0, 1.0 / self.reach, 1.0 / self.reach, 1.0])
        covariance = few * inverse @ self.scores @ inverse.T * np.outer(scale, scale)
        good = np.isfinite(covariance).all() and (np.diag(covariance) >= 0.0).all()
        return np.asarray(0.5 * (covariance + covariance.T)) if good else None


def _advance(model: FloatArray, sums: _Sums) -> float:
    """Move a model by a step, and return the displacement at its ends; infinity if there is no step."""
    try:
        step = np.linalg.solve(sums.normal, sums.right)
    except np.linalg.LinAlgError:
        return math.inf
    size = float(np.abs(step).max())
    if not size < 0.5 * model[RADIUS]:
        return math.inf
    model[POINT] += step[:2] @ sums.basis
    model[DIRECTION] += step[2:4] @ sums.basis / sums.reach
    model[DIRECTION] /= np.linalg.norm(model[DIRECTION])
    model[RADIUS] += step[4]
    return size if model[RADIUS] > 0.0 else math.inf


@njit(cache=True, nogil=True)
def _count_residuals(
    points: FloatArray, model: FloatArray, low: float, high: float, width: float, counts: FloatArray
) -> None:
    """Count absolute residuals in equal steps up to `width`; the entries are at the middles of the steps."""
    for i in range(len(points)):
        z, square = 0.0, 0.0
        for d in range(3):
            offset = points[i, d] - model[d]
            z += offset * model[UX + d]
            square += offset * offset
        residual = abs(math.sqrt(max(square - z * z, 0.0)) - model[RADIUS])
        if low <= z <= high and residual < width:
            # split between the two nearest steps, so that rounding makes no difference
            place = max(0.0, residual / width * len(counts) - 0.5)
            k = int(place)
            counts[k] += 1.0 - (place - k)
            counts[min(k + 1, len(counts) - 1)] += place - k


@njit(cache=True, nogil=True)
def _fill_sums(
    points: FloatArray,
    model: FloatArray,
    basis: FloatArray,
    low: float,
    high: float,
    width: float,
    reach: float,
    weights: FloatArray,
    full: bool,
    matrices: FloatArray,
    vectors: FloatArray,
) -> None:
    """Fill the sums of `_Sums`; heights are in units of the reach."""
    row = np.empty(5)
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - model[0], points[i, 1] - model[1], points[i, 2] - model[2]
        z = dx * model[UX] + dy * model[UY] + dz * model[UZ]
        if z < low or z > high:
            continue
        x = dx * basis[0, 0] + dy * basis[0, 1] + dz * basis[0, 2]
        y = dx * basis[1, 0] + dy * basis[1, 1] + dz * basis[1, 2]
        distance = math.sqrt(x * x + y * y) + 1e-300
        residual = distance - model[RADIUS]
        if abs(residual) >= width:
            continue
        place = abs(residual) / width * (len(weights) - 1)
        k = int(place)
        part = place - k
        weight = (1.0 - part) * weights[k, 0] + part * weights[k + 1, 0]
        row[0], row[1] = x / distance, y / distance
        row[2], row[3], row[4] = z / reach * row[0], z / reach * row[1], 1.0
        vectors[2, 0] += 1.0
        vectors[2, 1] += weight
        score = weight * residual
        for a in range(5):
            vectors[0, a] += score * row[a]
            for b in range(a + 1):
                matrices[0, a, b] += weight * row[a] * row[b]
        if full:
            slope = (1.0 - part) * weights[k, 1] + part * weights[k + 1, 1]
            outer = ((1.0 - part) * weights[k, 2] + part * weights[k + 1, 2]) * residual
            for a in range(5):
                vectors[1, a] += outer * row[a]
                for b in range(a + 1):
                    matrices[1, a, b] += slope * row[a] * row[b]
                    matrices[2, a, b] += score * score * row[a] * row[b]
                    matrices[3, a, b] += outer * outer * row[a] * row[b]
