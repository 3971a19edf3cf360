"""From measures to a confidence: the evidence weighed, not a heap of thresholds.

Each measure is turned into a term that grows with doubt or with trust and saturates, and a logistic regression says how
much each counts. The weights were fitted to 9 400 fits, a sixth of them true, in 195 scenes of eight kinds that weigh
the same: rooms with boxes sharp and rounded, spheres, ellipsoids, cones, elbows, beams and wavy surfaces; the same with
little of each cylinder to be seen, or with noise that neighbours share; racks of pipes as four scanners see them, half
of them in scan lines, half of them out of round and dented; steelwork with a few pipes, seen likewise; household things
before a depth camera, dented cans and fruit among them; solids that are nearly cylinders; and rooms full of pipes and
noise. False fits weigh double. `tests/training` makes the scenes and fits the weights. No term may speak
against its own meaning: the signs are fixed before the fit.

What is not fitted are the terms themselves: `FORM`, `FORM_NOISES`, `TELLING`, `THIN`, `BEHIND`, and the limits in the
terms. Some hundred variants were compared, by cross-validation and with the scenes of `docs/benchmarks.md` in view.
Fits near a true cylinder that were neither clearly it nor clearly another were left out.
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
FORM_NOISES = 1.2
"""No deviation of form beyond this many noises is excused: that of a large radius could hide anything."""

TELLING = 600.0
"""Points up to which a lack of fit is more than the form error of a real object could show."""


THIN = 20.0
"""Radius in noises up to which a flank counts in full."""
BEHIND = 0.7
"""Angle (radians) that must be covered behind a flank for it not to count at all."""


def _log(value: float, low: float, high: float) -> float:
    return math.log(min(max(value, low), high))


def _thickness(measures: Mapping[str, float]) -> float:
    """Give the thickness of the surface in noises, without the form error that real objects are excused."""
    structure, share = measures["structure"], measures["structure_radii"]
    excused = min(structure, FORM_NOISES, FORM * structure / share) if share > 0.0 else 0.0
    return math.sqrt(max(measures["noise_ratio"] ** 2 - excused**2, 1.0))


def _misfit(measures: Mapping[str, float]) -> float:
    """Give the lack of fit, up to three, the less the more points there are: in many, the form of any object shows."""
    return _log(measures["lack_of_fit"], 1.0, 3.0) * min(1.0, TELLING / max(measures["inliers"], 1.0))


def _slope(measures: Mapping[str, float]) -> float:
    """Give the slope beyond two standard errors, at most 0.3."""
    return min(max(0.0, abs(measures["slope"]) - 2.0 * measures["slope_error"]), 0.3)


def _flank(measures: Mapping[str, float]) -> float:
    """Give the flank, at most 0.3, of what may be an edge: thin, and seen from little more than one side.

    A camera smears the outline of anything, tangentially; the end of the arc of a thick cylinder can be seen, and what
    goes on past it is in `tangent`. An edge covers half a turn, and as much more on either side as its flanks stay
    within three noises of the surface; what goes on behind them is none.
    """
    radius = measures["radius_noises"]
    most = math.pi + 2.0 * math.acos(radius / (radius + 3.0))
    behind = min(max(0.0, (measures["coverage"] - most) / BEHIND), 1.0)
    return min(measures["flank"], 0.3) * min(1.0, (THIN / radius) ** 2) * (1.0 - behind)


def _bulge(measures: Mapping[str, float]) -> float:
    """Give the bulge, at most 0.15, less one so small, for its height, that a real object's form may have it."""
    return min(max(0.0, abs(measures["bulge"]) - FORM / measures["height_radii"] ** 2), 0.15)


def _bend(measures: Mapping[str, float]) -> float:
    """Give the bend beyond two standard errors, or beyond what moves the ends by `FORM`; at most 0.2."""
    excused = max(2.0 * measures["bend_error"], 8.0 * FORM / measures["height_radii"] ** 2)
    return min(max(0.0, measures["bend"] - excused), 0.2)


BIAS = -3.193
TERMS = (
    Term("noise", -5.770, 0.06, lambda m: _log(_thickness(m), 1.0, 20.0)),
    Term("lack of fit", -1.667, 0.14, _misfit),
    # other points inside, and going on past an end of the arc or off to one side
    Term("inside", -1.184, 0.10, lambda m: _log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("tangent", -4.530, 0.01, lambda m: min(m["tangent"], 1.5)),
    Term("flank", -18.249, 0.00, _flank),
    # how much of a cylinder is there at all
    Term("coverage", 1.773, 0.95, lambda m: min(m["coverage"], math.pi) / math.pi),
    Term("few lines", 3.221, -0.00, lambda m: _log(m["places"] / 12.0, 1.0 / 12.0, 1.0)),
    # what the candidates say
    Term("payoff", 2.265, 0.81, lambda m: m["payoff"]),
    Term("agreement", 4.899, 0.86, lambda m: m["agreement"]),
    # cones, barrels, elbows
    Term("slope", -50.926, 0.00, _slope),
    Term("bulge", -24.300, 0.00, _bulge),
    Term("bend", -30.710, 0.00, _bend),
)


BLEND_BIAS = -3.518
BLEND_TERMS = (
    Term("oval", -500.0, 0.00, lambda m: min(m["ovality"], 0.1)),
    Term("facets", -4.152, 0.03, lambda m: m["facets"]),
    Term("lack of fit", -1.035, 0.35, _misfit),
    Term("curvature", 1.854, 1.61, lambda m: _log(m["curvature"] / 20.0, 0.2, 5.0)),
    Term("agreement", 5.415, 0.96, lambda m: m["agreement"]),
    Term("bulge", -112.0, 0.00, _bulge),
    Term("bend", -136.0, 0.00, _bend),
)


def weigh_blend(measures: Mapping[str, float]) -> float:
    """Return the probability that an arc which goes on tangentially on both sides is a piece of a cylinder.

    Parameters
    ----------
    measures : mapping of str to float
        As for `weigh`.
    """
    odds = BLEND_BIAS + sum(term.weight * term.value(measures) for term in BLEND_TERMS)
    return 1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0)))


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
    >>> pipe = dict(noise_ratio=1.0, lack_of_fit=1.0, structure=0.0, structure_radii=0.0, inside=0.0, outside=0.0,
    ...             tangent=0.0, flank=0.0, coverage=6.0, inliers=2000.0, places=12.0, height_radii=9.0, payoff=0.8,
    ...             agreement=0.95, radius_noises=50.0, slope=0.0, slope_error=0.001, bulge=0.0, bend=0.0,
    ...             bend_error=0.001)
    >>> weigh(pipe)[0] > 0.99
    True
    >>> confidence, worst = weigh({**pipe, "agreement": 0.1, "payoff": 0.3})
    >>> confidence < 0.5, worst
    (True, 'agreement')
    """
    odds, worst, least = BIAS, "", 0.0
    for term in TERMS:
        value = term.value(measures)
        odds += term.weight * value
        loss = term.weight * (value - term.usual)
        if loss < least:
            worst, least = term.reason, loss
    return 1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0))), worst
