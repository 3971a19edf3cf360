"""Short cylinders with rounded ends: the part of the height over which the wall is level.

The wall of a lid, a tyre or a washer goes on into the round of its rim without an edge. What lies within the noise of
the wall there draws the fit, and makes a barrel of the whole.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cylx.fits.likelihood import Prior, fit_mixture
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, coordinates_of
from cylx.records import IndexedCloud, Segment
from cylx.segments.refitting import LEAST_POINTS_OF_AVERAGE

MOST_SLICES, LEAST_SLICES = 40, 3
"""Slices that the height is cut into at most; and at least, each of which is a spacing or more."""
LEAST_IN_SLICE = 5
"""Points without which a slice says nothing of the level."""
SHELL = 4.0
"""Points within so many deviations are looked at."""
MOST_CHI_SQUARE = 2.0
"""Mean squared deviation of the slices of a level part, in squared standard errors."""
CERTAIN, LEAST_DEVIATION = 0.1, 1e-6
"""Share of the deviation by which the mean of any slice may be off, and the least deviation in radii."""
LONGEST = 0.9
"""A level part that is more than this share of the height is all of it."""


def level_part_of(segment: Segment, indexed: IndexedCloud, tilt_deviation: float) -> Segment | None:
    """Return the longest part of a short cylinder's height over which its wall is level, fitted by itself.

    Parameters
    ----------
    segment : Segment
        Held upright.
    indexed : IndexedCloud
    tilt_deviation : float
        Standard deviation of its tilt, radians.

    Returns
    -------
    Segment or None
        None if all of it is level, or no part is.
    """
    deviation = max(indexed.noise_about(segment.model, segment.half), LEAST_DEVIATION * segment.radius)
    reach = SHELL * deviation
    near = indexed.cells.near_cylinder(
        segment.model, -segment.half, segment.half, max(0.0, segment.radius - reach), segment.radius + reach
    )
    near = near[indexed.may_be_on(near, segment.model)]
    heights, residuals, _ = coordinates_of(indexed.points, near, segment.model)
    found = level_run(heights, residuals, segment.half, deviation)
    if found is None:
        return None
    low, high = found
    inside = (heights > low) & (heights < high)
    if inside.sum() < LEAST_POINTS_OF_AVERAGE:
        return None
    model = segment.model.copy()
    model[POINT] += 0.5 * (low + high) * segment.direction
    half = 0.5 * (high - low)
    prior = Prior(direction=segment.direction, direction_deviation=tilt_deviation)
    points = indexed.points[near[inside]]
    fit = fit_mixture(points, model, low=-half, high=half, width=reach, deviation=deviation, prior=prior)
    if fit is None:
        return None
    model = fit.model.copy()
    model[DIRECTION] = segment.direction
    return replace(segment, model=model, half=half, spread=fit.law.deviation)


def level_run(heights: FloatArray, residuals: FloatArray, half: float, deviation: float) -> tuple[float, float] | None:
    """Return the ends of the longest run of slices whose mean residuals are equal but for their standard errors.

    Parameters
    ----------
    heights, residuals : ndarray of shape (n,)
        Of the points, frame units.
    half : float
        Half the height.
    deviation : float
        Standard deviation of a point.

    Returns
    -------
    low, high : float
        None if there is no such run, it is nearly all, or all is one barrel, as the band of a ball.
    """
    count = int(min(2.0 * half, MOST_SLICES))
    if count <= LEAST_SLICES:
        return None
    which = np.clip(((heights / half + 1.0) * 0.5 * count).astype(np.int64), 0, count - 1)
    numbers = np.bincount(which, minlength=count)
    means = np.bincount(which, residuals, minlength=count) / np.maximum(numbers, 1)
    weights = np.where(
        numbers < LEAST_IN_SLICE, 0.0, 1.0 / (deviation**2 * (1.0 / np.maximum(numbers, 1) + CERTAIN**2))
    )
    if _is_barrel(means, weights):
        return None
    best, longest = None, 0
    for first in range(count):
        for last in range(first + max(LEAST_SLICES, longest + 1), count + 1):
            own = weights[first:last]
            if own.sum() == 0.0:
                break
            off = means[first:last] - np.average(means[first:last], weights=own)
            seen = int((own > 0.0).sum())
            if seen >= LEAST_SLICES and float((own * off**2).sum()) <= MOST_CHI_SQUARE * (seen - 1):
                best, longest = (first, last), last - first
    if best is None or longest > LONGEST * count:
        return None
    return (2.0 * best[0] / count - 1.0) * half, (2.0 * best[1] / count - 1.0) * half


def _is_barrel(means: FloatArray, weights: FloatArray) -> bool:
    """Return whether one parabola explains the means of all slices."""
    known = np.flatnonzero(weights > 0.0)
    roots = np.sqrt(weights[known])
    design = np.vander(known / len(means), 3) * roots[:, None]
    fitted, *_ = np.linalg.lstsq(design, means[known] * roots, rcond=None)
    left = float(((means[known] * roots - design @ fitted) ** 2).sum())
    return left <= MOST_CHI_SQUARE * max(len(known) - 3, 1)
