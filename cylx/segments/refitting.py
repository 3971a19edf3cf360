"""Fits of a segment to its points: which points these are, and the robust fit to them."""

from __future__ import annotations

from dataclasses import replace

from cylx.fits.robust import FIT_BEYOND_ENDS, TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder, unbiased_radius
from cylx.geometry.arrays import FloatArray
from cylx.geometry.crossings import evened
from cylx.geometry.cylinder import RADIUS
from cylx.records import IndexedCloud, Segment

LEAST_WIDTH = 3.0
"""The width of the weights does not fall below this many noises: a Gaussian ends there."""
LEAST_POINTS_OF_AVERAGE = 20
"""Without so many points five parameters are not fitted robustly."""
SHELL_OF_FIT, LEAST_SHELL_OF_FIT = 4.0, 0.02
"""Half width of the shell of the last fits: in noises, and at least in radii, as real surfaces are no cylinders."""
ROUGH_TOLERANCE = 0.02
"""Where a better fit follows, one may end at steps of this share of the spread."""
REFIT_STEPS, MOST_REFIT_STEPS = 15, 60
"""Gauss-Newton steps of a fit to a sample of the points, and of one to all of them, which goes to its fixed point."""


def refit(segment: Segment, indexed: IndexedCloud, most: int | None = None, *, even: bool = False) -> Segment | str:
    """Fit a cylinder to its points between its ends, to the fixed point of the robust estimate.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    most : int, optional
        Points that suffice; all by default.
    even : bool
        Thin slices of the height that are crowded.

    Returns
    -------
    Segment or str
        With the bias of the radius taken off; or why there is none.
    """
    points, width = shell_of(segment, indexed, most)
    if even:
        points = points[evened((points - segment.point) @ segment.direction, segment.half)]
    fit = robust_fit(points, width, segment, indexed, steps=REFIT_STEPS if most else MOST_REFIT_STEPS)
    if fit is None:
        return "no fit"
    model, spread = fit
    model[RADIUS] = unbiased_radius(model[RADIUS], min(spread, 0.5 * model[RADIUS]))
    return replace(segment, model=model, spread=spread, covariance=None, choice=None, upright=False)


def shell_of(segment: Segment, indexed: IndexedCloud, most: int | None) -> tuple[FloatArray, float]:
    """Return the points about the surface of a segment, and how near to it those lie that have a say at first."""
    width = max(SHELL_OF_FIT * indexed.noise_about(segment.model, segment.half), LEAST_SHELL_OF_FIT * segment.radius)
    end = FIT_BEYOND_ENDS * segment.half
    return own_points(indexed, segment.model, end, 2.0 * width, most, segment.flat_share), width


def robust_fit(
    points: FloatArray, width: float, segment: Segment, indexed: IndexedCloud, *, steps: int, tolerance: float = 1e-9
) -> tuple[FloatArray, float] | None:
    """Fit a cylinder to the points of a segment; give it and the standard deviation about it."""
    noise, end = indexed.noise_about(segment.model, segment.half), FIT_BEYOND_ENDS * segment.half
    schedule = WeightSchedule(width, LEAST_WIDTH * noise, 1.0, TUKEY * TUKEY_SPREAD, tolerance)
    if len(points) < LEAST_POINTS_OF_AVERAGE:
        return None
    fit = fit_cylinder(points, segment.model, low=-end, high=end, schedule=schedule, steps=steps)
    return None if fit is None else (fit[0], fit[1] * TUKEY_SPREAD)


def own_points(
    indexed: IndexedCloud, model: FloatArray, half: float, width: float, most: int | None, strict: float = 1.0
) -> FloatArray:
    """Return points near a cylinder's surface not of something flatter, about `most` of them."""
    limit = strict * indexed.too_flat(model[RADIUS])
    if indexed.normals is None:
        return indexed.cells.surface_points(model, half, width, most, indexed.flatness, limit)
    radius = float(model[RADIUS])
    near = indexed.cells.near_cylinder(model, -half, half, max(0.0, radius - width), radius + width)
    near = near[indexed.may_be_on(near, model) & (indexed.flatness[near] < limit)]
    return indexed.points[near[:: max(1, len(near) // most) if most else 1]]
