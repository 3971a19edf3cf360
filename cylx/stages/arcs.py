"""Arcs that go on tangentially: fitted with the planes that they go on into, or without the points of these."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cylx.fits.profile import fit_profile, tilt_of
from cylx.fits.rounded_end import fit_rounded_end
from cylx.geometry.arrays import FloatArray, IndexArray
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
LEAST_END_GAIN, LEAST_END_SHARE, LEAST_FLAT = 40.0, 0.5, 0.04
"""Two edges are no half round if their squared residuals are smaller by so many squared deviations, by this share of
what the half round leaves unexplained, and what is flat between them is this much of their radius."""


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
    deviation = indexed.noise_about(segment.model, segment.half)
    if deviation < LEAST_DEVIATION * segment.radius:
        return None
    near = _about(segment, indexed, deviation)
    if len(near) == 0:
        return None
    model, profile, wedge = segment.model, None, None
    basis = np.empty((2, 3))
    for _ in range(LEANS):
        fill_basis(model[DIRECTION], basis)
        heights, flat, middle = _across(indexed.points, near, model, deviation)
        if wedge is not None:  # the basis may have turned with the axis
            middle = math.atan2(float(wedge[:3] @ basis[1]), float(wedge[:3] @ basis[0]))
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


def rounded_edges_of(segment: Segment, indexed: IndexedCloud) -> list[Segment]:
    """Fit two rounded edges of a bar or a plate, with something narrow and flat between them, to what passed for round.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud

    Returns
    -------
    list of Segment
        Both edges; none if one circle explains the points as well.
    """
    deviation = max(indexed.noise_about(segment.model, segment.half), LEAST_DEVIATION * segment.radius)
    near = _about(segment, indexed, deviation)
    if len(near) == 0:
        return []
    _, flat, middle = _across(indexed.points, near, segment.model, deviation)
    end = fit_rounded_end(flat, segment.radius, middle, deviation)
    if end is None or end.gain < LEAST_END_GAIN or end.share < LEAST_END_SHARE or end.flat < LEAST_FLAT * end.radius:
        return []
    basis = np.empty((2, 3))
    fill_basis(segment.direction, basis)
    edges = []
    for center, turn in zip(end.centers, end.middles, strict=True):
        model = segment.model.copy()
        model[POINT] += center @ basis
        model[RADIUS] = end.radius
        wedge = _wedge(basis, float(turn), 0.25 * math.pi)
        edges.append(replace(segment, model=model, spread=deviation, flat_share=1.0, wedge=wedge))
    return edges


def _about(segment: Segment, indexed: IndexedCloud, deviation: float) -> IndexArray:
    """Return points about a segment that suffice for its profile, without what closes the ends."""
    within = segment.half - min(ENDS * deviation, 0.25 * segment.half)
    near = indexed.cells.near_cylinder(segment.model, -within, within, 0.0, REACH * segment.radius)
    return near[:: 1 + len(near) // ENOUGH_OF_PROFILE]


def _across(
    points: FloatArray, near: IndexArray, model: FloatArray, deviation: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return heights, places across the axis and the angle of the middle of what is on the surface."""
    heights, residuals, angles = coordinates_of(points, near, model)
    distances = residuals + model[RADIUS]
    on = np.abs(residuals) < 3.0 * deviation
    middle = math.atan2(float(np.sin(angles[on]).sum()), float(np.cos(angles[on]).sum()))
    return heights, np.column_stack([distances * np.cos(angles), distances * np.sin(angles)]), middle


def _wedge(basis: FloatArray, middle: float, opening: float) -> FloatArray:
    return np.array([*(math.cos(middle) * basis[0] + math.sin(middle) * basis[1]), math.cos(opening)])
