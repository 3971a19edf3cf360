"""The terms of the evidence: functions of measures that grow with doubt or with trust, and saturate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Term(NamedTuple):
    """One line of the sum.

    Parameters
    ----------
    reason : str
        What is wrong if it is the worst of all.
    weight : float
        Change of the log-odds by one unit of the term.
    usual : float
        Its mean over true cylinders: what a term is compared with to find the worst.
    value : callable
        The term as a function of the measures.
    """

    reason: str
    weight: float
    usual: float
    value: Callable[[Mapping[str, float]], float]


FORM = 0.012
"""Real objects deviate from a cylinder by about this share of their radius: cans have seams, pipes are out of round."""
STEEP = 0.08
"""A slope beyond what is excused of this much counts twice."""
SEEN = 0.005
"""Move of the ends, in radii, that counts in full."""
FORM_SCATTER = 1.2
"""No deviation of form beyond this many times the scatter is excused: that of a large radius could hide anything."""
TELLING = 600.0
"""Points up to which a lack of fit is more than the form error of a real object could show."""
THIN = 20.0
"""Radius over scatter up to which a flank counts in full."""
BEHIND = 0.7
"""Angle (radians) that must be covered behind a flank for it not to count at all."""
PRISM = 0.6
"""Share of the deviation of form that makes a prism of a cylinder, whether or not the noise hides its faces: no real
cylinder among those of the rows has so much of it."""
LEAST_SCATTER = 1e-4
"""Scatter in radii below which nothing is told apart."""


def log(value: float, low: float, high: float) -> float:
    """Return the natural logarithm of a value that is held within two bounds."""
    return math.log(min(max(value, low), high))


def thickness(measures: Mapping[str, float]) -> float:
    """Return the thickness of the surface over the scatter of its points, without the form that is excused."""
    scatter = max(measures["scatter_radii"], LEAST_SCATTER)
    excused = min(measures["form_radii"], FORM, FORM_SCATTER * scatter) / scatter
    return math.sqrt(max(measures["roughness"] ** 2 - excused**2, 1.0))


def size(measures: Mapping[str, float]) -> float:
    """Return the logarithm of the radius over the scatter of its points, twenty being zero; that of forty at most."""
    return log(1.0 / (20.0 * max(measures["scatter_radii"], LEAST_SCATTER)), 0.2, 2.0)


def misfit(measures: Mapping[str, float]) -> float:
    """Return the lack of fit, up to three, the less the more points there are: many show the form of any object."""
    return log(measures["lack_of_fit"], 1.0, 3.0) * min(1.0, TELLING / max(measures["inliers"], 1.0))


def explained(measures: Mapping[str, float]) -> float:
    """Return the share of the deviation of form that another shape explains, beyond what chance brings.

    Of what stands on a plane it is also asked whether it is the band of a ball.
    """
    share = measures["explained"]
    if measures["facets"] > 0.5 or measures["prism"] > PRISM:
        share = max(share, measures["prism"])
    return max(max(0.0, share - 0.3) * min(1.0, measures["structure_radii"] / 0.01), measures.get("ball", 0.0))


def facets(measures: Mapping[str, float]) -> float:
    """Return how far a surface is made of flat pieces that deviate from a cylinder."""
    return max(0.0, measures["facets"] - 0.5) * min(2.0, max(0.0, measures["roughness"] - 1.3))


def payoff(measures: Mapping[str, float]) -> float:
    """Return the payoff: candidates of a cylinder that scatters much for its radius agree less well."""
    return min(measures["payoff"] + 1.5 * min(measures["scatter_radii"], 0.2), 1.0)


def slope(measures: Mapping[str, float]) -> float:
    """Return the slope beyond two standard errors, or beyond what moves the ends by `FORM`; a steep one counts more."""
    excused = max(2.0 * measures["slope_error"], FORM / height_radii(measures))
    slope = max(0.0, abs(measures["slope"]) - excused)
    return min(slope + slope**2 / STEEP, 0.5)


def flank(measures: Mapping[str, float]) -> float:
    """Return the flank, at most 0.3, of what may be an edge: thin, and seen from little more than one side.

    A camera smears the outline of anything, tangentially; the end of the arc of a thick cylinder can be seen, and what
    goes on past it is in `tangent`. An edge covers half a turn, and as much more on either side as its flanks stay
    within three deviations of the surface; an edge has nothing behind its flanks.
    """
    radius = 1.0 / max(measures["scatter_radii"], LEAST_SCATTER)
    most = math.pi + 2.0 * math.acos(radius / (radius + 3.0))
    behind = min(max(0.0, (measures["coverage"] - most) / BEHIND), 1.0)
    return min(measures["flank"], 0.3) * min(1.0, (THIN / radius) ** 2) * (1.0 - behind)


def bulge(measures: Mapping[str, float]) -> float:
    """Return the bulge, at most 0.3, less one so small, for its height, that a real object's form may have it.

    A waist may be as large as a bend: few things have one, but rims and lids seen with a wall pull its ends out.
    """
    excused = (2.0 if measures["bulge"] > 0.0 else 8.0) * FORM / height_radii(measures) ** 2
    return min(max(0.0, abs(measures["bulge"]) - excused), 0.3)


def barrel(measures: Mapping[str, float]) -> float:
    """Return the bulge of what stands on a plane, up to one, beyond two standard errors or what form may have.

    The band of a ball about its equator is as round as a disc; its bulge is one.
    """
    excused = max(2.0 * measures["bulge_error"], 2.0 * FORM / height_radii(measures) ** 2)
    return min(max(0.0, measures["bulge"] - excused), 1.0)


def bend(measures: Mapping[str, float]) -> float:
    """Return the bend beyond two standard errors, or beyond what moves the ends by `FORM`; at most 0.2."""
    excused = max(2.0 * measures["bend_error"], 8.0 * FORM / height_radii(measures) ** 2)
    return min(max(0.0, measures["bend"] - excused), 0.2)


def one_shape(measures: Mapping[str, float]) -> float:
    """Return the share of the scatter that one bend, slope or bulge explains, beyond a quarter.

    The scatter of real things has many causes; where one of these makes most of it, the thing is an elbow, a cone or a
    barrel, however little of it is seen. What moves the surface by less than `SEEN` does not count in full.
    """
    height, best = height_radii(measures), 0.0
    for name, moves in (("bend", height**2 / 8.0), ("slope", height / 2.0), ("bulge", height**2 / 8.0)):
        square = (measures[name] / max(measures[name + "_error"], 1e-12)) ** 2
        share = square / (square + measures["inliers"])
        best = max(best, share * min(1.0, abs(measures[name]) * moves / SEEN))
    return max(0.0, best - 0.25)


def height_radii(measures: Mapping[str, float]) -> float:
    """Return the height over the radius, which is not so low that what is excused knows no bound."""
    return max(measures["height_radii"], 0.05)
