"""Arcs that go on tangentially: fitted with the planes that they go on into, or without the points of these."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cylx.fits.profile import fit_profile, tilt_of
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, coordinates_of
from cylx.geometry.numerics import fill_basis
from cylx.records import IndexedCloud, Segment

ARC_FLAT, ARC_STEPS = 0.2, 4
"""Points of flat windows of this share of what is too flat are not of an arc, and so many fits settle it."""
REACH = 3.3
"""The profile is fitted to what lies within so many radii of the axis."""
ENOUGH_OF_PROFILE = 6000
"""Points of it that suffice."""
LEAST_DEVIATION = 0.004
"""Deviation of the points, in radii, from which they hide where an arc ends; of less, their normals show it."""
LEAST_GAIN = 12.0
"""An arc is one if its squared residuals are smaller than those of the sharp edge by so many squared deviations."""
ENDS = 2.5
"""What lies within so many deviations of the ends may be of a lid."""
LEANS = 2
"""The profile is fitted so many times, and the axis after each."""
MOST_CHI_SQUARE = 3.0
"""Mean square, in squared deviations and clipped at nine, of the residuals of its points."""


def arcs_of(segment: Segment, indexed: IndexedCloud, refit: Callable[[Segment], Segment | str] | None) -> list[Segment]:
    """Fit a cylinder again as an arc between planes that touch it.

    An arc between two planes takes some of their points within the noise, and its radius comes out too large. Where
    both planes are seen, all three are fitted as one; else what lies in flat windows is left out.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    refit : callable or None
        Fits a segment to its points; why there is none if that fails. With None, it is only fitted with the planes.

    Returns
    -------
    list of Segment
        The arc with its planes and the arc without them, as far as they are there; the more certain one first.
    """
    if refit is None:
        own = _with_profile(segment, indexed)
        return [] if own is None else [own]
    narrowed: Segment | str = replace(segment, flat_share=ARC_FLAT)
    for _ in range(ARC_STEPS):
        if isinstance(narrowed, str):
            break
        narrowed = refit(narrowed)
    known = [one for one in (segment, narrowed) if not isinstance(one, str)]
    profiles = (_with_profile(one, indexed) for one in known)
    first = next((one for one in profiles if one is not None), None)
    return [*([] if first is None else [first]), *known[1:]]


def _with_profile(segment: Segment, indexed: IndexedCloud) -> Segment | None:
    """Fit an arc and the planes that touch it as one; None if these are not there."""
    half, radius = segment.half, segment.radius
    deviation = indexed.noise_about(segment.model, half)
    if deviation < LEAST_DEVIATION * radius:
        return None
    within = half - min(ENDS * deviation, 0.25 * half)  # without what closes the ends
    near = indexed.cells.near_cylinder(segment.model, -within, within, 0.0, REACH * radius)
    near = near[:: 1 + len(near) // ENOUGH_OF_PROFILE]
    if len(near) == 0:
        return None
    model, profile, wedge = segment.model, None, None
    basis = np.empty((2, 3))
    for _ in range(LEANS):
        fill_basis(model[DIRECTION], basis)
        heights, residuals, angles = coordinates_of(indexed.points, near, model)
        distances = residuals + model[RADIUS]
        flat = np.column_stack([distances * np.cos(angles), distances * np.sin(angles)])
        if wedge is not None:  # the basis may have turned with the axis
            middle = math.atan2(float(wedge[:3] @ basis[1]), float(wedge[:3] @ basis[0]))
        else:
            on = np.abs(residuals) < 3.0 * deviation
            if not on.any():
                return None
            middle = math.atan2(float(np.sin(angles[on]).mean()), float(np.cos(angles[on]).mean()))
        profile = fit_profile(flat, float(model[RADIUS]), middle, deviation)
        if profile is None or profile.edge_gain < LEAST_GAIN:
            return None
        lean = tilt_of(flat, heights, profile, deviation)
        wedge = _wedge(basis, profile.middle, profile.opening)
        model = model.copy()
        model[POINT] += profile.center @ basis
        model[RADIUS] = profile.radius
        model[DIRECTION] += lean @ basis
        model[DIRECTION] /= np.linalg.norm(model[DIRECTION])
    if profile is None or profile.chi_square > MOST_CHI_SQUARE:
        return None
    return replace(segment, model=model, spread=deviation, flat_share=1.0, wedge=wedge)


def _wedge(basis: FloatArray, middle: float, opening: float) -> FloatArray:
    return np.array([*(math.cos(middle) * basis[0] + math.sin(middle) * basis[1]), math.cos(opening)])
