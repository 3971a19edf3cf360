"""From measures to a confidence: what a cylinder explains better than anything else, weighed.

Each measure is turned into a term that grows with doubt or with trust and saturates, and a logistic regression says how
much each counts. No term asks how large the noise of the cloud is: what points scatter is compared with what their
neighbours on the same surface scatter, with the radius, and with what other shapes would explain.

The weights were fitted to some 24 200 fits, one in sixteen of them true, in 355 scenes. Made ones: rooms with boxes
sharp and rounded, spheres, ellipsoids, cones, elbows, beams and wavy surfaces; the same with little of each cylinder to
be seen, or with noise that neighbours share; racks of pipes as four scanners see them; steelwork; household things
before a depth camera; solids that are nearly cylinders; rooms full of pipes and noise; single things that are no
cylinders. Scans of others: CAD parts of Fit4CAD without noise and with one of 0.2 spacings, depth-camera scenes of the
Object Segmentation Database, stems and columns. Each kind weighs the same but racks and single things (twice), depth
cameras and stems (three times); false fits weigh 1.2 times as much as true ones. `tests/training` collects the fits and
fits the weights. That of the slope was raised from 2 to 10 by hand, because a slope that counts more where it is steep
was not among the terms then. No term may speak against its own meaning: the signs are fixed before the fit. Fits near
a true cylinder that were neither clearly it nor clearly another were left out, and so were arcs that go on
tangentially: these have weights of their own, from the same CAD parts. Those that were fitted with the planes that
touch them have others, from 1 760 verdicts on such arcs, one in eleven of them true, in 101 of these clouds: of two
thirds of the parts, with noise of 0.2 spacings, some with less. Short cylinders that were held upright on a plane have
their own, from 3 965 verdicts, one in 36 of them true, in all of these parts with noise of 0.2 spacings; their slope,
bulge and what other shapes explain weigh as those of others, as hardly any of these rows was of a cone, a ball or a
prism.

The agreement was then measured at all sizes of windows that seemed large enough; since it is that of the size at which
most agree, and a prism counts where noise hides its faces, the same weights were held against 25 000 fits anew: fitted
again they would find no more by cross-validation.

What is not fitted are the terms themselves and the limits in them; some forty variants were compared by
cross-validation, no scene being judged by weights that had seen it.
"""

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


def _log(value: float, low: float, high: float) -> float:
    return math.log(min(max(value, low), high))


def _thickness(measures: Mapping[str, float]) -> float:
    """Return the thickness of the surface over the scatter of its points, without the form that is excused."""
    scatter = max(measures["scatter_radii"], LEAST_SCATTER)
    excused = min(measures["form_radii"], FORM, FORM_SCATTER * scatter) / scatter
    return math.sqrt(max(measures["roughness"] ** 2 - excused**2, 1.0))


def _misfit(measures: Mapping[str, float]) -> float:
    """Return the lack of fit, up to three, the less the more points there are: many show the form of any object."""
    return _log(measures["lack_of_fit"], 1.0, 3.0) * min(1.0, TELLING / max(measures["inliers"], 1.0))


def _explained(measures: Mapping[str, float]) -> float:
    """Return the share of the deviation of form that another shape explains, beyond what chance brings."""
    share = measures["explained"]
    if measures["facets"] > 0.5 or measures["prism"] > PRISM:
        share = max(share, measures["prism"])
    return max(0.0, share - 0.3) * min(1.0, measures["structure_radii"] / 0.01)


def _facets(measures: Mapping[str, float]) -> float:
    """Return how far a surface is made of flat pieces that deviate from a cylinder."""
    return max(0.0, measures["facets"] - 0.5) * min(2.0, max(0.0, measures["roughness"] - 1.3))


def _payoff(measures: Mapping[str, float]) -> float:
    """Return the payoff: candidates of a cylinder that scatters much for its radius agree less well."""
    return min(measures["payoff"] + 1.5 * min(measures["scatter_radii"], 0.2), 1.0)


def _slope(measures: Mapping[str, float]) -> float:
    """Return the slope beyond two standard errors, or beyond what moves the ends by `FORM`; a steep one counts more."""
    excused = max(2.0 * measures["slope_error"], FORM / _height(measures))
    slope = max(0.0, abs(measures["slope"]) - excused)
    return min(slope + slope**2 / STEEP, 0.5)


def _flank(measures: Mapping[str, float]) -> float:
    """Return the flank, at most 0.3, of what may be an edge: thin, and seen from little more than one side.

    A camera smears the outline of anything, tangentially; the end of the arc of a thick cylinder can be seen, and what
    goes on past it is in `tangent`. An edge covers half a turn, and as much more on either side as its flanks stay
    within three deviations of the surface; an edge has nothing behind its flanks.
    """
    radius = 1.0 / max(measures["scatter_radii"], LEAST_SCATTER)
    most = math.pi + 2.0 * math.acos(radius / (radius + 3.0))
    behind = min(max(0.0, (measures["coverage"] - most) / BEHIND), 1.0)
    return min(measures["flank"], 0.3) * min(1.0, (THIN / radius) ** 2) * (1.0 - behind)


def _bulge(measures: Mapping[str, float]) -> float:
    """Return the bulge, at most 0.3, less one so small, for its height, that a real object's form may have it.

    A waist may be as large as a bend: few things have one, but rims and lids seen with a wall pull its ends out.
    """
    excused = (2.0 if measures["bulge"] > 0.0 else 8.0) * FORM / _height(measures) ** 2
    return min(max(0.0, abs(measures["bulge"]) - excused), 0.3)


def _barrel(measures: Mapping[str, float]) -> float:
    """Return the bulge of what stands on a plane, up to one, beyond two standard errors or what form may have.

    The band of a ball about its equator is as round as a disc; its bulge is one.
    """
    excused = max(2.0 * measures["bulge_error"], 2.0 * FORM / _height(measures) ** 2)
    return min(max(0.0, measures["bulge"] - excused), 1.0)


def _bend(measures: Mapping[str, float]) -> float:
    """Return the bend beyond two standard errors, or beyond what moves the ends by `FORM`; at most 0.2."""
    excused = max(2.0 * measures["bend_error"], 8.0 * FORM / _height(measures) ** 2)
    return min(max(0.0, measures["bend"] - excused), 0.2)


def _one_shape(measures: Mapping[str, float]) -> float:
    """Return the share of the scatter that one bend, slope or bulge explains, beyond a quarter.

    The scatter of real things has many causes; where one of these makes most of it, the thing is an elbow, a cone or a
    barrel, however little of it is seen. What moves the surface by less than `SEEN` does not count in full.
    """
    height, best = _height(measures), 0.0
    for name, moves in (("bend", height**2 / 8.0), ("slope", height / 2.0), ("bulge", height**2 / 8.0)):
        square = (measures[name] / max(measures[name + "_error"], 1e-12)) ** 2
        share = square / (square + measures["inliers"])
        best = max(best, share * min(1.0, abs(measures[name]) * moves / SEEN))
    return max(0.0, best - 0.25)


def _height(measures: Mapping[str, float]) -> float:
    return max(measures["height_radii"], 0.05)


BIAS = -3.551
TERMS = (
    # what its form is like
    Term("form", -1.708, 0.10, lambda m: _log(m["structure_radii"] / 0.02, 1.0, 10.0)),
    Term("other shape", -6.630, 0.01, _explained),
    Term("lack of fit", -1.067, 0.17, _misfit),
    Term("facets", -2.326, 0.02, _facets),
    # other points inside and just outside, and going on past an end of the arc or off to one side
    Term("inside", -1.476, 0.03, lambda m: _log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("outside", -1.071, 0.21, lambda m: _log(m["outside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("tangent", -1.602, 0.03, lambda m: min(m["tangent"], 1.5)),
    Term("flank", -14.648, 0.00, _flank),
    # how much of a cylinder is there at all
    Term("few points", 3.203, -0.02, lambda m: _log(m["inliers"] / 100.0, 0.2, 1.0)),
    Term("few lines", 1.007, -0.00, lambda m: _log(m["places"] / 12.0, 1.0 / 12.0, 1.0)),
    Term("curvature", 1.412, 1.56, lambda m: _log(m["curvature"] / 20.0, 0.2, 5.0)),
    # what the candidates say
    Term("payoff", 3.734, 0.82, _payoff),
    Term("agreement", 4.160, 0.40, lambda m: _log(m["agreement"] / 0.5, 0.3, 1.6)),
    # cones, barrels, elbows
    Term("slope", -10.0, 0.01, _slope),
    Term("bulge", -8.147, 0.01, _bulge),
    Term("bend", -5.977, 0.00, _bend),
    Term("cone, barrel or elbow", -58.443, 0.00, _one_shape),
)

BLEND_BIAS = -13.731
BLEND_TERMS = (
    Term("noise", -11.701, 0.00, lambda m: _log(_thickness(m), 1.0, 20.0)),
    Term("form", -3.958, 0.00, lambda m: _log(m["structure_radii"] / 0.02, 1.0, 10.0)),
    Term("oval", -24.556, 0.00, lambda m: min(m["ovality"], 0.1)),
    Term("lack of fit", -2.014, 0.31, _misfit),
    Term("few lines", 4.919, 0.00, lambda m: _log(m["places"] / 12.0, 1.0 / 12.0, 1.0)),
    Term("curvature", 4.900, 1.61, lambda m: _log(m["curvature"] / 20.0, 0.2, 5.0)),
    Term("payoff", 8.413, 0.87, lambda m: m["payoff"]),
    Term("agreement", 7.805, 0.38, lambda m: _log(m["agreement"] / 0.5, 0.1, 1.5)),
    Term("inside", -1.231, 0.53, lambda m: _log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
)

PROFILE_BIAS = -0.484
PROFILE_TERMS = (
    Term("noise", -21.204, 0.03, lambda m: _log(m["noise_ratio"], 1.0, 2.0)),
    Term("form", -0.626, 0.10, lambda m: min(m["structure"], 1.5)),
    Term("oval", -47.833, 0.00, lambda m: min(m["ovality"], 0.05)),
    Term("lack of fit", -1.753, 0.33, lambda m: _log(m["lack_of_fit"], 1.0, 8.0)),
    Term("edge", 0.441, 1.39, lambda m: _log(m["edge_gain"] / max(m["inliers"], 20.0), 0.02, 5.0)),
    Term("tangent", 1.939, 0.94, lambda m: min(m["tangent_both"], 1.0)),
    Term("few points", 3.399, 0.68, lambda m: _log(m["inliers"] / 100.0, 0.2, 3.0)),
    Term("roughness", -4.613, 0.03, lambda m: _log(m["roughness"], 1.0, 1.5)),
)


UPRIGHT_BIAS = 5.725
UPRIGHT_TERMS = (
    Term("noise", -12.596, 0.06, lambda m: _log(m["noise_ratio"], 1.0, 2.0)),
    Term("form", -1.192, 0.00, lambda m: _log(m["structure_radii"] / 0.02, 1.0, 10.0)),
    Term("oval", -55.839, 0.00, lambda m: min(m["ovality"], 0.05)),
    Term("lack of fit", -2.394, 0.21, _misfit),
    Term("facets", -6.420, 0.00, _facets),
    Term("other shape", -6.630, 0.01, _explained),
    Term("inside", -0.491, 0.40, lambda m: _log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("outside", -1.805, 0.07, lambda m: _log(m["outside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("few points", 5.279, -0.22, lambda m: _log(m["inliers"] / 100.0, 0.2, 1.0)),
    Term("agreement", 2.155, -0.18, lambda m: _log(m["agreement"] / 0.5, 0.3, 1.6)),
    Term("slope", -10.0, 0.01, _slope),
    Term("bulge", -8.147, 0.01, _barrel),
)


def weigh_profile(measures: Mapping[str, float]) -> float:
    """Return the probability that an arc which was fitted with the two planes that touch it is a piece of a cylinder.

    Candidates of windows that see the planes, too, are too large; so it is neither asked whether they agree, nor how
    well those of its cluster do.

    Parameters
    ----------
    measures : mapping of str to float
        As for `weigh`.
    """
    odds = PROFILE_BIAS + sum(term.weight * term.value(measures) for term in PROFILE_TERMS)
    return 1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0)))


def weigh_blend(measures: Mapping[str, float]) -> float:
    """Return the probability that an arc which goes on tangentially on both sides is a piece of a cylinder.

    Parameters
    ----------
    measures : mapping of str to float
        As for `weigh`.
    """
    odds = BLEND_BIAS + sum(term.weight * term.value(measures) for term in BLEND_TERMS)
    return 1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0)))


def weigh_upright(measures: Mapping[str, float]) -> tuple[float, str]:
    """Return the probability that what was fitted with its axis held to the normal of a plane is a cylinder.

    Windows that see what it stands on, too, agree with it less; its few points scatter about it as about any surface.

    Parameters
    ----------
    measures : mapping of str to float
        As for `weigh`.

    Returns
    -------
    confidence : float
    worst : str
        As from `weigh`.
    """
    return _weighed(UPRIGHT_TERMS, UPRIGHT_BIAS, measures)


def weigh(measures: Mapping[str, float]) -> tuple[float, str]:
    """Weigh the measures of a segment.

    Parameters
    ----------
    measures : mapping of str to float
        From `cylx.stages.verification`, with `coverage` (radians), `inliers` and `payoff` of the segment beside them.

    Returns
    -------
    confidence : float
        Probability that it is a cylinder, in (0, 1).
    worst : str
        Name of what speaks most against it.

    Examples
    --------
    >>> pipe = dict(lack_of_fit=1.0, structure_radii=0.0, explained=0.0, inside=0.0, outside=0.0, tangent=0.0,
    ...             flank=0.0, coverage=6.0, facets=0.0, prism=0.0, roughness=1.0, inliers=2000.0, curvature=500.0,
    ...             height_radii=9.0, payoff=0.8, agreement=0.95, scatter_radii=0.01, slope=0.0, slope_error=0.001,
    ...             bulge=0.0, bulge_error=0.01, bend=0.0, bend_error=0.001, places=12.0)
    >>> weigh(pipe)[0] > 0.95
    True
    >>> confidence, worst = weigh({**pipe, "agreement": 0.1, "payoff": 0.3})
    >>> confidence < 0.5, worst
    (True, 'agreement')
    """
    return _weighed(TERMS, BIAS, measures)


def _weighed(terms: tuple[Term, ...], bias: float, measures: Mapping[str, float]) -> tuple[float, str]:
    """Return the probability by a law, and the name of what speaks most against it."""
    odds, worst, least = bias, "", 0.0
    for term in terms:
        value = term.value(measures)
        odds += term.weight * value
        loss = term.weight * (value - term.usual)
        if loss < least:
            worst, least = term.reason, loss
    return 1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0))), worst
