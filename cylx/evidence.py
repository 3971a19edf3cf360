"""From measures to a confidence: the evidence weighed, not a heap of thresholds.

Each measure is turned into a term that grows with doubt or with trust and saturates, and a logistic regression says how
much each counts. The weights were fitted to 6 700 fits, a fifth of them true, in 148 scenes of six kinds that weigh
the same: rooms with boxes sharp and rounded, spheres, ellipsoids, cones, elbows, beams and wavy surfaces; the same with
little of each cylinder to be seen, or with noise that neighbours share; racks of pipes as four scanners see them, half
of them in scan lines, half of them out of round and dented; household things before a depth camera, dented cans and
fruit among them; and rooms full of pipes and noise.
`tests/benchmarks/evidence` makes the scenes and fits the weights. No term may speak against its own meaning: the signs
are fixed before the fit.

What is not fitted are the terms themselves: `FORM`, `FORM_NOISES`, `TELLING`, the limits in the terms, and that height
counts as far as candidates disagree. About forty variants were compared, by cross-validation and with the scenes of
`docs/benchmarks.md` in view. Fits near a true cylinder that were neither clearly it nor clearly another were left out.
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


def _stubbiness(measures: Mapping[str, float]) -> float:
    """Give how much shorter than four radii it is, as a negative logarithm, as far as candidates disagree.

    A strip of a sphere or of an elbow is short, too, but its candidates do not agree with it as those of a tin do.
    """
    return math.log(min(max(measures["height_radii"], 0.1), 4.0) / 4.0) * (1.0 - measures["agreement"])


BIAS = -4.467
TERMS = (
    Term("noise", -5.338, 0.06, lambda m: _log(_thickness(m), 1.0, 20.0)),
    Term("lack of fit", -1.875, 0.14, _misfit),
    # other points inside, just outside, and going on past an end of the arc
    Term("inside", -0.492, 0.11, lambda m: _log(m["inside"] / 0.1 + 1.0, 1.0, 51.0)),
    Term("outside", -0.293, 0.46, lambda m: _log(m["outside"] / 0.05 + 1.0, 1.0, 400.0)),
    Term("tangent", -4.310, 0.01, lambda m: min(m["tangent"], 1.5)),
    # how much of a cylinder is there at all
    Term("coverage", 1.161, 0.95, lambda m: min(m["coverage"], math.pi) / math.pi),
    Term("height", 3.851, -0.01, _stubbiness),
    Term("few lines", 3.231, 0.00, lambda m: _log(m["places"] / 12.0, 1.0 / 12.0, 1.0)),
    # what the candidates say
    Term("payoff", 5.373, 0.81, lambda m: m["payoff"]),
    Term("agreement", 5.692, 0.85, lambda m: m["agreement"]),
    # cones; and whatever is too short to be told from a sphere
    Term("slope", -32.365, 0.00, _slope),
    Term("bulge unknown", -36.962, 0.00, lambda m: min(m["bulge_error"], 1.0)),
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
    >>> pipe = dict(noise_ratio=1.0, lack_of_fit=1.0, structure=0.0, structure_radii=0.0, inside=0.0, outside=0.0,
    ...             tangent=0.0, coverage=6.0, inliers=2000.0, places=12.0, height_radii=9.0, payoff=0.8,
    ...             agreement=0.95, slope=0.0, slope_error=0.001, bulge_error=0.01)
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
