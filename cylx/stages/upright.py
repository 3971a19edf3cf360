"""Short cylinders that stand on a plane, or end at one: fitted with the axis held to its normal.

The tilt of a disc, of a pin or of a bore in a plate is hardly seen in a few rows of points, and what crosses its ends
bends it: an axis that leans by some degrees takes points of a lid on one side, and of a floor on the other. Nearly all
of them stand on a plane, whose normal is known far better.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.fits.likelihood import Prior, fit_mixture
from cylx.geometry.arrays import FloatArray
from cylx.geometry.coverage import likely_angle
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, distances_to, points_on
from cylx.geometry.extent import visible_extent
from cylx.records import IndexedCloud, Segment
from cylx.segments.finishing import LEANING, NEARLY_UPRIGHT, SHORT
from cylx.segments.refitting import LEAST_POINTS_OF_AVERAGE, own_points

SURELY_UPRIGHT = math.cos(math.radians(2.0))
"""Cosine of the angle to the normal of a plane up to which it is held what could not be fitted freely, or is
contradicted: it was laid about that normal."""
HELD = math.radians(0.1)
"""Standard deviation of the tilt of an axis that is held."""
FITS = 3
"""Fits, each followed by a look at where the surface ends."""
SHELL_NOISES, SHELL_RADII = 6.0, 0.12
"""Half width of the shell of the first fit, whichever is more; of the later ones it is that of the noise."""
WITHIN = 2.0
"""What lies within so many deviations of the ends may be of a lid or a floor,"""
MOST_END = 0.3
"""but no more than this share of half the height is left out."""
CLEAR = 5.0
"""The arc that is covered is told from what is so many deviations off the ends that were found, within that share."""
REACH_SPACINGS, REACH_RADII = 3.0, 0.3
"""The ends are looked for so much further than they were."""
SHORTEST = 0.5
"""Half the height is at least so many spacings."""
ENOUGH = 6000
"""Points that suffice."""
LEAST_COVERAGE = math.radians(200.0)
"""Of less than this the axis is not told, however its tilt is: it is an arc, if anything."""
LEAST_NOISE = 1e-6
"""Points may lie on the surface exactly; in radii."""
MOST_MOVED = 0.5
"""A fit whose radius changes by this share has left where it started."""


def normals_about(direction: FloatArray, planes: FloatArray, nearly: float) -> FloatArray:
    """Return the normals of planes that a direction may stand on, turned as the direction, shape (k, 3)."""
    cosines = planes @ direction
    near = np.abs(cosines) > nearly
    return np.asarray(planes[near] * np.sign(cosines[near])[:, None], dtype=np.float64)


def upright_of(segment: Segment, indexed: IndexedCloud, nearly: float = NEARLY_UPRIGHT) -> Segment | None:
    """Fit a short cylinder again with its axis held to the normal of the plane it stands on.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    nearly : float
        Cosine of the angle to that normal up to which it is tried.

    Returns
    -------
    Segment or None
        None if it is not short, there is no such plane, or no surface.
    """
    if segment.half > SHORT * segment.radius or segment.wedge is not None:
        return None
    found = [_held(segment, normal, indexed) for normal in normals_about(segment.direction, indexed.planes, nearly)]
    return max((one for one in found if one is not None), key=lambda one: one[0], default=(0, None))[1]


def held_as_is(segment: Segment, indexed: IndexedCloud) -> Segment | None:
    """Fit a short cylinder about the direction it has; None if there is no such surface.

    Parameters
    ----------
    segment : Segment
        About an axis that is known.
    indexed : IndexedCloud
    """
    found = _held(segment, segment.direction, indexed)
    return None if found is None else found[1]


def leans(points: FloatArray, free: Segment, held: Segment) -> bool:
    """Return whether points say that a short cylinder leans: its middle, as what is at its ends may be of a lid.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Of either, frame units.
    free, held : Segment
        The cylinder as it was fitted, and with its axis held to the normal of a plane.

    Returns
    -------
    bool
        False where the few points in the middle do not tell.
    """
    distances, clear = [], np.ones(len(points), np.bool_)
    for one in (free, held):
        above, off = distances_to(points, one.model)
        distances.append(off)
        clear &= np.abs(above) <= one.half - min(CLEAR * free.spread, MOST_END * one.half)
    scale = max(free.spread, LEAST_NOISE * free.radius)
    squares = [(np.minimum(off[clear] / scale, 3.0) ** 2).sum() for off in distances]
    return bool(squares[1] - squares[0] > LEANING**2)


def _held(segment: Segment, normal: FloatArray, indexed: IndexedCloud) -> tuple[int, Segment] | None:
    """Fit a short cylinder about a direction; give the number of points on it, too."""
    model, half = segment.model.copy(), segment.half
    model[DIRECTION] = normal
    noise = max(indexed.noise_about(model, half), LEAST_NOISE * segment.radius)
    prior = Prior(direction=normal, direction_deviation=HELD)
    spread, count = noise, 0
    for step in range(FITS):
        width = max(SHELL_NOISES * noise, 0.0 if step else SHELL_RADII * float(model[RADIUS]))
        beyond = half + max(REACH_SPACINGS, REACH_RADII * half)
        points = own_points(indexed, model, beyond, 2.0 * width, ENOUGH)
        end = half - min(WITHIN * noise, MOST_END * half)
        if len(points) == 0:
            return None
        above, off = distances_to(points, model)
        if (((np.abs(above) <= end) & (off < width)).sum()) < LEAST_POINTS_OF_AVERAGE:
            return None
        fit = fit_mixture(points, model, low=-end, high=end, width=width, deviation=noise, prior=prior)
        if fit is None or abs(fit.model[RADIUS] / segment.radius - 1.0) > MOST_MOVED:
            return None
        model = fit.model.copy()
        model[DIRECTION] = normal
        spread = fit.law.deviation
        heights, angles = points_on(points, model, 3.0 * max(noise, min(spread, 2.0 * noise)))
        ends = visible_extent(heights, angles, half, float(model[RADIUS]))
        if ends is None:
            return None
        low, high = ends
        on = (heights > low) & (heights < high)
        count = int(on.sum())
        half = 0.5 * (high - low)
        model[POINT] += 0.5 * (low + high) * normal
        if half < SHORTEST or half > SHORT * model[RADIUS]:
            return None
        clear = np.abs(heights - 0.5 * (low + high)) < half - min(CLEAR * noise, MOST_END * half)
        if not clear.any() or likely_angle(angles[clear]) < LEAST_COVERAGE:
            return None
    held = replace(segment, model=model, half=half, spread=spread, covariance=None, choice=None, upright=True)
    return count, held
