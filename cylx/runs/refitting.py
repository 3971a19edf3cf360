"""A pipe fitted again to points between its ends, and whether they bear it out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.fits.likelihood import Prior, fit_mixture
from cylx.fits.robust import TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, canonical_direction
from cylx.runs.pipes import LEAST_SPREAD, ON_SURFACE, Pipe, turned
from cylx.runs.stretches import SHELL

LEAST_POINTS = 30
"""Of a piece of a pipe."""
OWN_SHARE = 0.6
"""Share of the points about a piece that must be on it."""
SHORT, KNOWN_TILT = 5.0, 0.02
"""The axis of a piece shorter than so many radii is known from before, with this deviation in radians."""
OTHER_RADIUS, OTHER_AXIS = 0.03, 0.06
"""Pieces that differ by less, in radii, beside their uncertainty, are one pipe."""


def refit(pipe: Pipe, points: FloatArray, width: float | None = None) -> Pipe | None:
    """Fit a pipe to the points between its ends; None if that fails.

    Parameters
    ----------
    pipe : Pipe
    points : ndarray of shape (N, 3)
    width : float, optional
        How near to its surface points have a say at first.
    """
    half = 0.5 * pipe.length
    width = width or max(4.0 * pipe.spread, 0.03 * pipe.radius)
    floor = ON_SURFACE * pipe.spread
    schedule = WeightSchedule(width, min(floor, width), 1.0, TUKEY * TUKEY_SPREAD, 1e-6)
    fit = fit_cylinder(np.ascontiguousarray(points), pipe.model(), low=-half, high=half, schedule=schedule, steps=30)
    if fit is None:
        return None
    model = fit[0]
    deviation = max(fit[1] * TUKEY_SPREAD, 1e-9 * float(model[RADIUS]))
    model[DIRECTION] = canonical_direction(model[DIRECTION])
    prior = None
    if pipe.length < SHORT * pipe.radius:  # points at the ends that are of something else would turn its axis
        model[DIRECTION] = pipe.direction
        prior = Prior(direction=pipe.direction, direction_deviation=KNOWN_TILT)
    likely = fit_mixture(points, model, low=-half, high=half, width=8.0 * deviation, deviation=deviation, prior=prior)
    if likely is None:
        return None
    model = likely.model
    middle, direction, radius = model[POINT], model[DIRECTION], float(model[RADIUS])
    spread = max(deviation, LEAST_SPREAD * radius)
    covariance = np.asarray(likely.covariance, dtype=np.float64)
    if not (np.isfinite(covariance).all() and np.isfinite(model).all() and radius > 0):
        return None
    found = replace(
        pipe,
        start=middle - half * direction,
        end=middle + half * direction,
        radius=radius,
        spread=min(spread, 2.0 * pipe.spread),
        covariance=covariance,
    )
    return found.with_ends(*turned(pipe.start, pipe.end))


def is_borne_out(pipe: Pipe, points: FloatArray, least: int = LEAST_POINTS) -> bool:
    """Return whether most of the points about a pipe are on it."""
    away = points - pipe.middle
    heights = away @ pipe.direction
    errors = np.abs(np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - heights**2, 0.0)) - pipe.radius)
    about = (np.abs(heights) <= 0.5 * pipe.length) & (errors < SHELL * pipe.radius)
    own = about & (errors < ON_SURFACE * pipe.spread)
    return bool(own.sum() >= max(least, OWN_SHARE * about.sum()))


def differs(one: Pipe, two: Pipe) -> bool:
    """Return whether two pieces of about one axis are different pipes."""
    sd = math.sqrt(max(float(one.covariance[4, 4] + two.covariance[4, 4]), 0.0))
    radius = min(one.radius, two.radius)
    if abs(one.radius - two.radius) > OTHER_RADIUS * radius + ON_SURFACE * sd:
        return True
    place = 0.5 * (one.middle + two.middle)
    feet = [pipe.middle + float((place - pipe.middle) @ pipe.direction) * pipe.direction for pipe in (one, two)]
    uncertain = ON_SURFACE * math.hypot(one.axis_deviation(place), two.axis_deviation(place))
    return float(np.linalg.norm(feet[0] - feet[1])) > OTHER_AXIS * radius + uncertain
