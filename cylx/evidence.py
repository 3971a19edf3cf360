"""From measures to a confidence: the evidence weighed, not a heap of thresholds.

Each measure is turned into a term that grows with doubt or with trust and saturates, and a logistic regression says how
much each counts. The weights were fitted to about ten thousand fits, true and false, in 90 scenes with known cylinders:
rooms with boxes sharp and rounded, spheres, ellipsoids, cones, elbows, beams, wavy surfaces, walls and pipes close to
them, cylinders out of round, racks of pipes from four viewpoints, and scans of household objects. No term may speak
against its own meaning: the signs were fixed before the fit.
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


def _log(value: float, low: float, high: float) -> float:
    return math.log(min(max(value, low), high))


def _beyond(value: float, error: float, most: float) -> float:
    """Give how far a value is from zero beyond two standard errors, at most `most`."""
    return min(max(0.0, abs(value) - 2.0 * error), most)


BIAS = -10.605
TERMS = (
    # thickness of the surface against the noise of the scene, and what of it is form error, in hundredths of the radius
    Term("noise", -5.769, 0.09, lambda m: _log(m["noise_ratio"], 1.0, 20.0)),
    Term("lack of fit", -0.538, 0.6, lambda m: 100.0 * min(m["structure_radii"], 0.1)),
    # other points just outside the surface
    Term("outside", -0.756, 0.2, lambda m: _log(m["outside"] + 0.05, 0.05, 20.0) - math.log(0.05)),
    # how much of a cylinder is there at all
    Term("coverage", 1.282, 0.85, lambda m: min(m["coverage"], math.pi) / math.pi),
    Term("too few points", 1.037, 2.1, lambda m: _log(m["inliers"] / 60.0, 0.01, 2000.0 / 60.0)),
    Term("height", 1.240, 1.3, lambda m: _log(m["height_radii"], 0.1, 4.0)),
    Term("curvature", 0.269, 2.9, lambda m: _log(m["curvature"] / 10.0, 0.01, 100.0)),
    # what the candidates say
    Term("payoff", 1.286, 0.65, lambda m: m["payoff"]),
    Term("agreement", 10.833, 0.88, lambda m: m["agreement"]),
    # cones, spheres, elbows
    Term("slope", -24.58, 0.0, lambda m: _beyond(m["slope"], m["slope_error"], 0.3)),
    Term("bulge", -12.102, 0.0, lambda m: _beyond(m["bulge"], m["bulge_error"], 1.0)),
    Term("bulge unknown", -4.135, 0.01, lambda m: min(m["bulge_error"], 1.0)),
)


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
    >>> pipe = dict(noise_ratio=1.0, structure_radii=0.0, outside=0.0, coverage=6.0, inliers=2000.0, height_radii=9.0,
    ...             curvature=900.0, payoff=0.8, agreement=0.95, slope=0.0, slope_error=0.001, bulge=0.0,
    ...             bulge_error=0.01)
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
