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
touch them have others. Both laws of arcs come from verdicts on all parts, without noise and with one of 0.2 spacings,
and on 45 boxes with sharp edges, in noise of 0.01 to 0.8 spacings: 33 100 on those without the planes, one in a hundred
of them true, and 5 090 on those with them, one in eight true; false ones weigh 1.5 times as much. Short cylinders that
were held upright on a plane have their own, from 3 965 verdicts, one in 36 of them true, in all of these parts with
noise of 0.2 spacings; their slope, bulge and what other shapes explain weigh as those of others, as hardly any of these
rows was of a cone, a ball or a prism.

The agreement was then measured at all sizes of windows that seemed large enough; since it is that of the size at which
most agree, and a prism counts where noise hides its faces, the same weights were held against 25 000 fits anew: fitted
again they would find no more by cross-validation.

What is not fitted are the terms themselves and the limits in them; some forty variants were compared by
cross-validation, no scene being judged by weights that had seen it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from cylx.evidence.terms import (
    Term,
    barrel,
    bend,
    bulge,
    explained,
    facets,
    flank,
    log,
    misfit,
    one_shape,
    payoff,
    size,
    slope,
    thickness,
)

BIAS = -3.551
TERMS = (
    # what its form is like
    Term("form", -1.708, 0.10, lambda m: log(m["structure_radii"] / 0.02, 1.0, 10.0)),
    Term("other shape", -6.630, 0.01, explained),
    Term("lack of fit", -1.067, 0.17, misfit),
    Term("facets", -2.326, 0.02, facets),
    # other points inside and just outside, and going on past an end of the arc or off to one side
    Term("inside", -1.476, 0.03, lambda m: log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("outside", -1.071, 0.21, lambda m: log(m["outside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("tangent", -1.602, 0.03, lambda m: min(m["tangent"], 1.5)),
    Term("flank", -14.648, 0.00, flank),
    # how much of a cylinder is there at all
    Term("few points", 3.203, -0.02, lambda m: log(m["inliers"] / 100.0, 0.2, 1.0)),
    Term("few lines", 1.007, -0.00, lambda m: log(m["places"] / 12.0, 1.0 / 12.0, 1.0)),
    Term("curvature", 1.412, 1.56, lambda m: log(m["curvature"] / 20.0, 0.2, 5.0)),
    # what the candidates say
    Term("payoff", 3.734, 0.82, payoff),
    Term("agreement", 4.160, 0.40, lambda m: log(m["agreement"] / 0.5, 0.3, 1.6)),
    # cones, barrels, elbows
    Term("slope", -10.0, 0.01, slope),
    Term("bulge", -8.147, 0.01, bulge),
    Term("bend", -5.977, 0.00, bend),
    Term("cone, barrel or elbow", -58.443, 0.00, one_shape),
)

BLEND_BIAS = -5.392
BLEND_TERMS = (
    Term("noise", -3.883, 0.01, lambda m: log(thickness(m), 1.0, 20.0)),
    Term("form", -1.009, 0.00, lambda m: log(m["structure_radii"] / 0.02, 1.0, 10.0)),
    Term("oval", -11.900, 0.00, lambda m: min(m["ovality"], 0.1)),
    Term("lack of fit", -1.422, 0.30, misfit),
    Term("few lines", 0.631, 0.00, lambda m: log(m["places"] / 12.0, 1.0 / 12.0, 1.0)),
    Term("few points", 1.130, 0.91, lambda m: log(m["inliers"] / 100.0, 0.2, 3.0)),
    Term("size", 1.523, 0.68, size),
    Term("curvature", 0.681, 1.61, lambda m: log(m["curvature"] / 20.0, 0.2, 5.0)),
    Term("payoff", 5.495, 0.81, lambda m: m["payoff"]),
    Term("agreement", 1.474, 0.38, lambda m: log(m["agreement"] / 0.5, 0.1, 1.5)),
    Term("inside", -0.435, 0.62, lambda m: log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("outside", -0.580, 1.20, lambda m: log(m["outside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("tangent", -0.575, 0.08, lambda m: min(max(m["tangent"] - 1.5, 0.0), 3.0)),
    Term("bulge", -1.059, 0.01, lambda m: min(max(abs(m["bulge"]) - 2.0 * m["bulge_error"], 0.0), 0.3)),
)

PROFILE_BIAS = 0.809
PROFILE_TERMS = (
    Term("noise", -9.607, 0.03, lambda m: log(m["noise_ratio"], 1.0, 2.0)),
    Term("form", -1.418, 0.09, lambda m: min(m["structure"], 1.5)),
    Term("oval", -25.687, 0.00, lambda m: min(m["ovality"], 0.05)),
    Term("lack of fit", -0.770, 0.28, lambda m: log(m["lack_of_fit"], 1.0, 8.0)),
    Term("edge", 0.309, 1.33, lambda m: log(m["edge_gain"] / max(m["inliers"], 20.0), 0.02, 5.0)),
    Term("tangent", 0.222, 0.91, lambda m: min(m["tangent_both"], 1.0)),
    Term("few points", 1.503, 0.78, lambda m: log(m["inliers"] / 100.0, 0.2, 3.0)),
    Term("size", 1.252, 0.35, size),
    Term("roughness", -6.729, 0.03, lambda m: log(m["roughness"], 1.0, 1.5)),
)


UPRIGHT_BIAS = 5.725
UPRIGHT_TERMS = (
    Term("noise", -12.596, 0.06, lambda m: log(m["noise_ratio"], 1.0, 2.0)),
    Term("form", -1.192, 0.00, lambda m: log(m["structure_radii"] / 0.02, 1.0, 10.0)),
    Term("oval", -55.839, 0.00, lambda m: min(m["ovality"], 0.05)),
    Term("lack of fit", -2.394, 0.21, misfit),
    Term("facets", -6.420, 0.00, facets),
    Term("other shape", -6.630, 0.01, explained),
    Term("inside", -0.491, 0.40, lambda m: log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("outside", -1.805, 0.07, lambda m: log(m["outside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("few points", 5.279, -0.22, lambda m: log(m["inliers"] / 100.0, 0.2, 1.0)),
    Term("agreement", 2.155, -0.18, lambda m: log(m["agreement"] / 0.5, 0.3, 1.6)),
    Term("slope", -10.0, 0.01, slope),
    Term("bulge", -8.147, 0.01, barrel),
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
