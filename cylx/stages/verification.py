"""Cylinders -> accepted, with reasons: measured properties that tell a cylinder from what only looks like one.

Corners of boxes, strips of spheres, cones and pairs of planes give consistent false cylinders. No threshold decides
alone: the measures are weighed into one confidence, and all of them are reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.config import VerificationConfig
from cylx.evidence.measures import (
    TRUNCATED,
    Shell,
    deviations_of_form,
    edge_gain,
    facets,
    look_at,
    own_scatter,
    shape_of,
)
from cylx.evidence.places import distinct_places
from cylx.evidence.prisms import prism_share
from cylx.evidence.surroundings import ball_share, clear_of_ends, continuation, emptiness, flank
from cylx.evidence.weights import weigh, weigh_blend, weigh_profile, weigh_upright
from cylx.geometry.arrays import IndexArray
from cylx.geometry.coverage import covered_angle
from cylx.records import IndexedCloud, Segment

LEAST_POINTS_TO_MEASURE = 20
"""Points on the surface without which nothing can be measured."""
GOES_ON = 0.25
"""Density of points past an end of an arc, as a share of its own, from which it goes on tangentially."""
SURELY_GOES_ON = 0.5
"""The same, past one end alone, of what would pass for a cylinder."""
LEAST_OF_ARC = 0.5
"""Share of the arc between two planes that points have to cover: what is seen where the planes touch it alone, and not
between, is two planes that face each other, such as the flanges of a beam."""
CLOSED, DEVIATES = math.radians(300.0), 1.4
"""Angle and lack of fit from which a surface may be that of a prism."""
LEAST_SHARE = 1e-4
"""Deviation of form that is of no account, as a share of the radius."""
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
    blend : bool
        Whether it is accepted as an arc that goes on tangentially on both sides; `confidence` is that it is one, then.
    """

    reason: str
    confidence: float
    measures: dict[str, float]
    coverage: float
    points: IndexArray
    offset_error: float = math.inf
    tilt_error: float = math.inf
    blend: bool = False


def verify(
    segment: Segment,
    indexed: IndexedCloud,
    payoff: float,
    counts: tuple[int, int],
    config: VerificationConfig,
    *,
    arc: bool = False,
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
    arc : bool
        Judge it as an arc that goes on tangentially.

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
    measures, errors = _measures_of(segment, shell, indexed, coverage, counts)
    known = {**measures, "coverage": coverage, "inliers": float(len(points)), "payoff": payoff}
    probability, worst = weigh(known)
    if segment.upright:
        probability, worst = weigh_upright(known)
    confidence = round(probability, 3)  # further digits would order equals by chance
    reason = broken_limit(measures, len(points), coverage, config)
    if arc:
        confidence = round((weigh_blend if segment.wedge is None else weigh_profile)(known), 3)
    if not reason and confidence < config.min_confidence:
        reason = worst
    return Verdict(reason, confidence, measures, coverage, points, *errors, blend=arc)


def _measures_of(
    segment: Segment, shell: Shell, indexed: IndexedCloud, coverage: float, counts: tuple[int, int]
) -> tuple[dict[str, float], tuple[float, float]]:
    """Return all that is measured of a segment, and the standard deviations of its axis."""
    radius = segment.radius
    noise = indexed.noise_about(segment.model, segment.half)
    deviation = float(np.sqrt((shell.residuals[shell.on] ** 2).mean())) / TRUNCATED
    clear = clear_of_ends(shell, segment.half) if segment.upright else shell
    shape = shape_of(clear if clear.on.sum() >= LEAST_POINTS_TO_MEASURE else shell, segment, deviation)
    form = deviations_of_form(shell, deviation)
    structure = form["structure"]
    tangent, both = continuation(shell, radius)
    inside, outside = emptiness(shell, radius, segment.half)
    consistent, near = counts
    along = math.copysign(1.0, segment.direction[np.abs(segment.direction).argmax()])  # as the result has it
    scatter = own_scatter(shell, radius, segment.half, coverage)
    least = LEAST_SHARE * radius
    measures = {
        "scatter_radii": scatter / radius,
        "form_radii": math.sqrt(max(deviation**2 - scatter**2, 0.0)) / radius,
        "roughness": math.hypot(deviation, least) / math.hypot(scatter, least),
        "noise_ratio": deviation / noise,
        "lack_of_fit": form["lack_of_fit"],
        "structure": structure / noise,
        "structure_radii": structure / radius,
        "ovality": form["ovality"] / radius,
        "explained": form["explained"],
        "prism": _prism(shell, form, radius, scatter, coverage),
        "facets": facets(shell, indexed.flatness, radius, scatter),
        "deviation_radii": deviation / radius,
        "inside": inside,
        "outside": outside,
        "tangent": tangent,
        "tangent_both": both,
        "edge_gain": edge_gain(shell, segment, max(deviation, noise)),
        "arc": 0.0 if segment.wedge is None else 2.0 * math.acos(min(1.0, max(-1.0, float(segment.wedge[3])))),
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
        "ball": _ball(indexed, segment, deviation) if segment.upright else 0.0,
    }
    return measures, (shape["offset_error"], shape["tilt_error"])


def _ball(indexed: IndexedCloud, segment: Segment, deviation: float) -> float:
    """Return how much of a ball goes on beside a segment."""
    radius = segment.radius
    about = indexed.cells.near_cylinder(segment.model, -radius, radius, 0.0, 1.1 * radius)
    points = indexed.points[about[:: 1 + len(about) // ENOUGH_TO_MEASURE]]
    return ball_share(points, segment.model, segment.half, deviation)


def _prism(shell: Shell, form: dict[str, float], radius: float, scatter: float, coverage: float) -> float:
    """Return the share of the deviation of form that a prism explains; it is compared only where that is no noise.

    What is told as noise about a small thing may be its own corners; its points' own scatter has none of them.
    """
    if coverage < CLOSED or form["lack_of_fit"] < DEVIATES:
        return form["prism"]
    return max(form["prism"], prism_share(shell, radius, scatter))


def may_be_arc(verdict: Verdict, *, surely: bool = False) -> bool:
    """Return whether a segment goes on tangentially past an end of its arc, and its arc is seen.

    Parameters
    ----------
    verdict : Verdict
    surely : bool
        Whether it would pass for a cylinder otherwise: then it must go on at both ends, or as densely as the arc.
    """
    if verdict.coverage < LEAST_OF_ARC * verdict.measures.get("arc", 0.0):
        return False
    one, both = verdict.measures.get("tangent", 0.0), verdict.measures.get("tangent_both", 0.0)
    return (both >= GOES_ON or one >= SURELY_GOES_ON) if surely else one >= GOES_ON


def broken_limit(measures: dict[str, float], count: int, coverage: float, config: VerificationConfig) -> str:
    """Return the name of a limit the user has set that is not kept, or nothing."""
    limits = {
        "too few points": count < config.min_inliers,
        "coverage": coverage < math.radians(config.min_coverage_deg),
        "height": measures["height_radii"] < (config.min_height or 0.0),
        "slope": abs(measures["slope"]) - 3.0 * measures["slope_error"] > _limit(config.max_slope),
        "bulge": abs(measures["bulge"]) - 3.0 * measures["bulge_error"] > _limit(config.max_bulge),
    }
    return next((name for name, broken in limits.items() if broken), "")


def _limit(value: float | None) -> float:
    return math.inf if value is None else value
