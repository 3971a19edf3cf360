"""Cylinders -> accepted, with reasons: measured properties that tell a cylinder from what only looks like one.

Corners of boxes, strips of spheres, cones and pairs of planes give consistent false cylinders. No threshold decides
alone: the measures are weighed into one confidence, and all of them are reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.config import VerificationConfig
from cylx.evidence.measures import TRUNCATED, distinct_places, lack_of_fit, look_at, shape_of
from cylx.evidence.surroundings import continuation, emptiness, flank
from cylx.evidence.weights import weigh
from cylx.geometry.arrays import IndexArray
from cylx.geometry.coverage import covered_angle
from cylx.records import IndexedCloud, Segment

LEAST_POINTS_TO_MEASURE = 20
"""Points on the surface without which nothing can be measured."""
ENOUGH_TO_MEASURE = 20000
"""Points on the surface that suffice for the measures."""


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What the verification measured of a segment, and made of it.

    Parameters
    ----------
    reason : str
        What speaks most against it; empty if it is accepted.
    confidence : float
        Probability that it is a cylinder.
    measures : dict of str to float
        Name to value.
    coverage : float
        Angle about the axis that is covered, radians.
    points : ndarray of shape (n,)
        Indices of the points within three deviations of the surface that may belong to it.
    offset_error, tilt_error : float
        Standard deviations of the axis, at its middle and in angle: frame units, radians.
    """

    reason: str
    confidence: float
    measures: dict[str, float]
    coverage: float
    points: IndexArray
    offset_error: float = math.inf
    tilt_error: float = math.inf


def verify(
    segment: Segment,
    indexed: IndexedCloud,
    payoff: float,
    counts: tuple[int, int],
    config: VerificationConfig,
) -> Verdict:
    """Measure a segment and judge it.

    Parameters
    ----------
    segment : Segment
        Fitted.
    indexed : IndexedCloud
        The cloud.
    payoff : float
        Mean payoff of its cluster.
    counts : tuple of int
        Candidates of windows along it that agree with it, and all of them.
    config : VerificationConfig

    Returns
    -------
    Verdict
    """
    whole = look_at(segment, indexed)
    points = whole.indices[whole.on]
    shell = whole.thinned(max(1, len(points) // ENOUGH_TO_MEASURE))
    if shell.on.sum() < LEAST_POINTS_TO_MEASURE:
        return Verdict("too few points", 0.0, {}, 0.0, points)
    coverage = covered_angle(shell.angles[shell.on])
    radius = segment.radius
    noise = indexed.noise_about(segment.model, segment.half)
    deviation = float(np.sqrt((shell.residuals[shell.on] ** 2).mean())) / TRUNCATED
    shape = shape_of(shell, segment, deviation)
    lack, structure = lack_of_fit(shell, deviation)
    inside, outside = emptiness(shell, radius)
    consistent, near = counts
    along = math.copysign(1.0, segment.direction[np.abs(segment.direction).argmax()])  # as the result has it
    measures = {
        "noise_ratio": deviation / noise,
        "lack_of_fit": lack,
        "structure": structure / noise,
        "structure_radii": structure / radius,
        "inside": inside,
        "outside": outside,
        "tangent": continuation(shell, radius),
        "flank": flank(shell, radius),
        "places": distinct_places(shell.angles[shell.on], radius, deviation),
        "curvature": shape["curvature"],
        "slope": shape["slope"] * along,
        "slope_error": shape["slope_error"],
        "bulge": shape["bulge"],
        "bulge_error": shape["bulge_error"],
        "bend": shape["bend"],
        "bend_error": shape["bend_error"],
        "radius_noises": radius / noise,
        "height_radii": 2.0 * segment.half / radius,
        "windows": float(near),
        "agreement": (consistent + 1.0) / (near + 2.0),
    }
    probability, worst = weigh({**measures, "coverage": coverage, "inliers": float(len(points)), "payoff": payoff})
    confidence = round(probability, 3)  # further digits would order equals by chance
    reason = broken_limit(measures, len(points), coverage, config) or (
        "" if confidence >= config.min_confidence else worst
    )
    return Verdict(reason, confidence, measures, coverage, points, shape["offset_error"], shape["tilt_error"])


def broken_limit(measures: dict[str, float], count: int, coverage: float, config: VerificationConfig) -> str:
    """Give the name of a limit the user has set that is not kept, or nothing."""
    limits = {
        "too few points": count < config.min_inliers,
        "coverage": coverage < math.radians(config.min_coverage_deg),
        "height": measures["height_radii"] < config.min_height,
        "slope": abs(measures["slope"]) > config.max_slope + 3.0 * measures["slope_error"],
        "bulge": abs(measures["bulge"]) > config.max_bulge + 3.0 * measures["bulge_error"],
    }
    return next((name for name, broken in limits.items() if broken), "")
