"""The last fit of a cylinder, to all its points, and how uncertain it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cylx.fits.conditioning import given_radius
from cylx.fits.correlated_error import shared_covariance
from cylx.fits.likelihood import MixtureFit, Prior, fit_mixture
from cylx.fits.nominal_radius import Catalogue, choose_entry
from cylx.fits.robust import FIT_BEYOND_ENDS
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, RADIUS, coordinates_of
from cylx.records import IndexedCloud, Segment
from cylx.segments.refitting import REFIT_STEPS, ROUGH_TOLERANCE, refit, robust_fit, shell_of

STRUCTURED_LACK_OF_FIT = 1.4
"""A lack of fit (chi-square per cell) beyond this is none by chance."""
SHORT = 1.0
"""A cylinder whose half height is less than so many radii is short."""
NEARLY_UPRIGHT = math.cos(math.radians(12.0))
"""Cosine of the angle to the normal of a plane up to which an axis may stand on it."""
LEANING = 3.5
"""It leans if its points say so by more than this many deviations."""
UPRIGHT_DEVIATION = math.radians(0.5)
"""Standard deviation of the tilt against that normal of what stands on a plane."""
WIDEST_IN_LAST_FIT = 8.0
"""Deviations from the surface up to which points have a say in the last fit; outliers are hardly further away."""
ON_SURFACE = 3.0
"""Points within so many deviations are on the surface."""


def inflation(measures: Mapping[str, float]) -> float:
    """Return how many times larger a covariance is than noise makes it, as far as one number tells.

    Where the residuals are structured beyond noise, because the object is no perfect cylinder or its noise is shared by
    neighbours, the parameters are less certain at least as much as the mean residuals over its surface scatter more.
    """
    lack = measures.get("lack_of_fit", 1.0)
    return lack if lack > STRUCTURED_LACK_OF_FIT else 1.0


def finish(
    segment: Segment,
    indexed: IndexedCloud,
    known: Prior | None = None,
    catalogue: Catalogue | None = None,
    *,
    inflated: float = 1.0,
) -> Segment | str:
    """Fit a cylinder to all its points by maximum likelihood, and say how uncertain it is.

    What is known draws the fit to it, as far as the points do not contradict it: a prior that is wrong by many
    standard deviations would spoil the fit. A nominal radius draws the fit only where the points bear it out.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    known : Prior, optional
    catalogue : Catalogue, optional
        Nominal radii, in the unit of the cloud's frame.
    inflated : float
        `inflation` of the measures. If it is above 1, the object is no perfect cylinder, and its residuals are no
        noise. The likelihood would be that of its most cylindrical part; the robust fit is drawn by all of it, and
        stays.

    Returns
    -------
    Segment or str
        With its covariance; that of `refit` without one if the points are too few for it; or why there
        is none.
    """
    points, width = shell_of(segment, indexed, None)
    fit = robust_fit(points, width, segment, indexed, steps=REFIT_STEPS, tolerance=ROUGH_TOLERANCE)
    if fit is None:
        return "no fit"
    model, spread = fit
    _turn_as_given(model)
    end = FIT_BEYOND_ENDS * segment.half
    deviation = max(spread, 1e-9 * model[RADIUS])  # points may lie on the surface exactly
    limits = {
        "low": -end,
        "high": end,
        "width": min(WIDEST_IN_LAST_FIT * deviation, 2.0 * width),
        "deviation": deviation,
    }
    likely = fit_mixture(points, model, **limits)
    if likely is None:
        return refit(segment, indexed)
    prior = None if known is None else known.as_far_as_borne_out(likely)
    if inflated == 1.0 or segment.upright:
        prior = _upright(segment, indexed.planes, likely, prior)
    robust = inflated > 1.0 and prior is None
    if robust:
        fitted = refit(segment, indexed)
        if isinstance(fitted, str):
            return fitted
        _turn_as_given(fitted.model)
        covariance = _with_shared_error(likely.covariance, points, fitted, inflated)
        free = replace(fitted, covariance=covariance)
    else:
        if prior is not None:
            likely = fit_mixture(points, model, **limits, prior=prior) or likely
        covariance = inflated * likely.covariance
        free = replace(segment, model=likely.model, spread=spread, covariance=covariance, choice=None)
    if catalogue is None:
        return free
    choice = choose_entry(free.radius, math.sqrt(covariance[4, 4]), catalogue)
    if choice.decision != "snapped":
        return replace(free, choice=choice)
    nominal, tolerance = catalogue.radii[choice.entry], catalogue.tolerances[choice.entry]
    # inflated with the rest, it is the tolerance again, and the points weigh as little as they should
    deviation = tolerance / math.sqrt(inflated)
    snapping = (prior or Prior())._replace(radius=nominal, radius_deviation=deviation)
    snapped = None if robust else fit_mixture(points, model, **limits, prior=snapping)
    if snapped is not None:
        covariance = inflated * snapped.covariance
        return replace(free, model=snapped.model, spread=spread, covariance=covariance, choice=choice)
    start = free.model.copy()
    _turn_as_given(start)
    moved, covariance = given_radius(start, covariance, nominal, tolerance)
    return replace(free, model=moved, covariance=covariance, choice=choice)


def _upright(segment: Segment, planes: FloatArray, fit: MixtureFit, known: Prior | None) -> Prior | None:
    """Add to what is known of a short cylinder that its axis is the normal of a plane, unless the points say otherwise.

    The tilt of a disc, of a bore in a plate or of a pin is hardly seen in its few points, and what crosses its ends
    bends it. Nearly all of them stand on a plane or end at one.
    """
    told = known is not None and known.direction is not None
    if told or segment.half > SHORT * segment.radius or segment.wedge is not None or len(planes) == 0:
        return known
    cosines = planes @ segment.direction
    best = int(np.abs(cosines).argmax())
    if abs(cosines[best]) < NEARLY_UPRIGHT:
        return known
    upright = Prior(direction=planes[best], direction_deviation=UPRIGHT_DEVIATION)
    if not segment.upright and upright.as_far_as_borne_out(fit, LEANING) is None:
        return known
    return (known or Prior())._replace(direction=planes[best], direction_deviation=UPRIGHT_DEVIATION)


def _with_shared_error(covariance: FloatArray, points: FloatArray, fitted: Segment, inflated: float) -> FloatArray:
    """Add what the errors that points share do to a covariance; multiply it where too little is seen to tell."""
    heights, residuals, angles = coordinates_of(points, np.arange(len(points)), fitted.model)
    on = (np.abs(residuals) < ON_SURFACE * fitted.spread) & (np.abs(heights) <= FIT_BEYOND_ENDS * fitted.half)
    shared = shared_covariance(heights[on], residuals[on], angles[on], fitted.radius)
    return np.asarray(inflated * covariance if shared is None else covariance + shared, dtype=np.float64)


def _turn_as_given(model: FloatArray) -> None:
    """Turn the direction of a model as the result has it, which the covariance goes by: its largest part positive."""
    direction = model[DIRECTION]
    direction *= np.sign(direction[np.abs(direction).argmax()])
