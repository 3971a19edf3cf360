"""Whether a radius is one of a catalogue of nominal radii, told by likelihood ratios.

Measured is a radius r with standard deviation s. If the object is of entry j, with nominal radius R_j and tolerance
t_j, then r ~ N(R_j, s^2 + t_j^2). If it is of none, nothing is known of its radius but the scale: 1 / r is as likely on
each octave, over the range of the catalogue and a factor of two on either side, so that r has the density 1 / (r L)
with L = ln(4 max R / min R). Outside of that range the density goes on, so that what is far off finds no refuge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

Decision = Literal["snapped", "ambiguous", "none"]

DECISIVE = 20.0
"""Least likelihood ratio of an entry to each of its rivals; against one that was as likely beforehand, the entry is
right in 20 cases of 21."""
NEAR_IN_DEVIATIONS = 3.0
"""Most standard deviations between a radius and the entry that it is taken for."""
WIDER = 2.0
"""What is of no entry may be so many times smaller or larger than all of them."""
EXACT = 1e-12
"""No radius is known better than to this share of it: numbers are rounded."""
MOST_RATIO = 1e9
"""Ratios are given up to this, and down to its inverse; beyond, they say nothing that they did not say before."""


class Catalogue(NamedTuple):
    """Nominal radii.

    Parameters
    ----------
    radii : tuple of float
        > 0, any unit; not empty.
    tolerances : tuple of float
        Standard deviation of true radii about each of them, > 0, same unit.
    """

    radii: tuple[float, ...]
    tolerances: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """What the most likely entry near a radius is, and whether it is likely enough.

    Parameters
    ----------
    decision : {'snapped', 'ambiguous', 'none'}
        `snapped`: it is decisively more likely than every rival, and near. `none`: it is not near, or no more likely
        than no entry at all. `ambiguous`: anything between.
    entry : int
        Its position in the catalogue; of the entry with the nearest radius if none is near.
    ratio : float
        Of its likelihood to the greater one of its two rivals: the second entry, and no entry at all; in
        [1 / `MOST_RATIO`, `MOST_RATIO`].
    radius, deviation : float
        What was decided upon, in the unit of the catalogue.
    """

    decision: Decision
    entry: int
    ratio: float
    radius: float
    deviation: float


def choose_entry(radius: float, deviation: float, catalogue: Catalogue) -> Choice:
    """Decide which entry of a catalogue a measured radius is of, if any.

    Parameters
    ----------
    radius : float
        > 0, the unit of the catalogue.
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
    else:  # the likeliest one in the far tails is that of the largest tolerance, which nobody would look for
        best = min(range(len(logs)), key=lambda i: abs(math.log(radius) - math.log(catalogue.radii[i])))
    rival = max([nothing, *logs[:best], *logs[best + 1 :]])
    log_ratio = logs[best] - rival
    decision: Decision = "none"
    if near and logs[best] > nothing:
        decision = "snapped" if log_ratio >= math.log(DECISIVE) else "ambiguous"
    limit = math.log(MOST_RATIO)
    return Choice(decision, best, math.exp(min(max(log_ratio, -limit), limit)), radius, deviation)
