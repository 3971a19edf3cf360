"""Decide by likelihood ratios whether a radius is one of a catalogue of nominal radii.

The measured radius is r with standard deviation s. If the object is of entry j, with nominal radius R_j and tolerance
t_j, then r ~ N(R_j, s^2 + t_j^2). If it is of no entry, only the scale of its radius is known: 1 / r has the same
probability in each octave, over the range of the catalogue and a factor of two on either side, so that r has the
density 1 / (r L) with L = ln(4 max R / min R). The same density is used outside of that range, so that a radius far
off is not assigned to an entry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

Decision = Literal["snapped", "ambiguous", "none"]

DECISIVE = 20.0
"""Least likelihood ratio of an entry to each of its rivals. Against one rival of equal prior probability, the entry is
then right in 20 cases of 21."""
NEAR_IN_DEVIATIONS = 3.0
"""Most standard deviations between a radius and the entry that it is assigned to."""
WIDER = 2.0
"""An object of no entry may be this many times smaller or larger than all entries."""
EXACT = 1e-12
"""No radius is known to better than this share of it, because numbers are rounded."""
MOST_RATIO = 1e9
"""Ratios are limited to this and its inverse; more extreme values carry no further information."""


class Catalogue(NamedTuple):
    """Nominal radii.

    Parameters
    ----------
    radii : tuple of float
        In any unit, > 0; not empty.
    tolerances : tuple of float
        Standard deviation of true radii about each of them, > 0, same unit.
    """

    radii: tuple[float, ...]
    tolerances: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """The most likely entry near a radius, and whether it is likely enough.

    Parameters
    ----------
    decision : {'snapped', 'ambiguous', 'none'}
        `snapped`: it is near, and decisively more likely than every rival. `none`: it is not near, or no more likely
        than no entry. `ambiguous`: anything between.
    entry : int
        Its index in the catalogue; the entry with the nearest radius if none is near.
    ratio : float
        Ratio of its likelihood to that of the stronger of its two rivals, the second entry and no entry; in
        [1 / `MOST_RATIO`, `MOST_RATIO`].
    radius, deviation : float
        The measured radius and its standard deviation, in the unit of the catalogue.
    """

    decision: Decision
    entry: int
    ratio: float
    radius: float
    deviation: float


def choose_entry(radius: float, deviation: float, catalogue: Catalogue) -> Choice:
    """Decide to which entry of a catalogue a measured radius belongs, if any.

    Parameters
    ----------
    radius : float
        In the unit of the catalogue, > 0.
    deviation : float
        Its standard deviation, >= 0.
    catalogue : Catalogue

    Returns
    -------
    Choice

    Examples
    --------
    >>> pipes = Catalogue((21.3, 26.9), (0.05, 0.05))
    >>> choose_entry(21.2, 0.1, pipes).decision
    'snapped'
    >>> choose_entry(24.0, 0.1, pipes).decision
    'none'
    """
    spreads = [math.hypot(deviation, tolerance, EXACT * radius) for tolerance in catalogue.tolerances]
    away = [abs(radius - nominal) / spread for nominal, spread in zip(catalogue.radii, spreads, strict=True)]
    # densities of ln r instead of r: the unit cancels before it could overflow
    logs = [
        -0.5 * z * z - math.log(math.sqrt(2.0 * math.pi) * (spread / radius))
        for z, spread in zip(away, spreads, strict=True)
    ]
    span = 2.0 * math.log(WIDER) + math.log(max(catalogue.radii)) - math.log(min(catalogue.radii))
    nothing = -math.log(span)
    near = [i for i, z in enumerate(away) if z <= NEAR_IN_DEVIATIONS]
    if near:
        best = max(near, key=logs.__getitem__)
    else:  # in the far tails the entry with the largest tolerance would be the most likely, which makes no sense
        best = min(range(len(logs)), key=lambda i: abs(math.log(radius) - math.log(catalogue.radii[i])))
    rival = max([nothing, *logs[:best], *logs[best + 1 :]])
    log_ratio = logs[best] - rival
    decision: Decision = "none"
    if near and logs[best] > nothing:
        decision = "snapped" if log_ratio >= math.log(DECISIVE) else "ambiguous"
    limit = math.log(MOST_RATIO)
    return Choice(decision, best, math.exp(min(max(log_ratio, -limit), limit)), radius, deviation)
