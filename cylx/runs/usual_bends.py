"""Bend radii that points hardly tell, with what is usual: as other elbows of the size in the cloud, or as made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cylx.records import Elbow
from cylx.runs.bend_fit import bend_of
from cylx.runs.bending import NEARBY
from cylx.runs.tracing import Trace

MADE = ((1.0, 0.25), (1.5, 0.45), (2.0, 0.05), (3.0, 0.15), (5.0, 0.1))
"""Bend radii that elbows and bends are made with, in nominal diameters, and how usual each is."""
DIAMETER, DIAMETER_SD = 1.75, 0.05
"""A nominal diameter in radii of the pipe (EN 10220: 1.66 to 1.85 from DN 40 to DN 300), and how far sizes differ."""
GRID = np.linspace(1.0 - 3.0 * DIAMETER_SD, 1.0 + 3.0 * DIAMETER_SD, 61) * DIAMETER
"""Nominal diameters of a size, in radii of its pipe, of which its elbows tell how likely each is."""
SURE, SAME_SD = 0.025, 0.01
"""Elbows whose radius is known so well, in itself, tell those of others of their size; how far these differ."""
SAME_SIZE = 0.04
"""Radii of the tubes of one size differ by less."""
OF_CLOUD, AS_MADE, ANY = 0.4, 0.35, 0.25
"""Prior weights: as another elbow of the size, as made, and any radius."""
SHARPEST, WIDEST = 1.0, 14.0
"""Range of any radius, in that of the pipe: uniform in its logarithm."""


@dataclass(frozen=True, slots=True)
class Usual:
    """A usual bend radius: its value, its standard deviation, and its weight."""

    radius: float
    std: float
    weight: float


def settle_radii(trace: Trace) -> None:
    """Move the bend radii of elbows towards usual ones, as far as their points leave that open.

    A soft prior: what the points tell well stays as it is, and so does what contradicts all usual radii.

    Parameters
    ----------
    trace : Trace
        Its elbows and the ends of their pipes change.
    """
    elbows = {k: one for k, one in enumerate(trace.fittings) if isinstance(one, Elbow) and _is_open(one)}
    known = [one for one in elbows.values() if one.std["bend_radius"] < SURE * one.bend_radius]
    for k, one in elbows.items():
        alike = [other for other in elbows.values() if other is not one and _is_alike(one, other)]
        usual = _usual(one, [other for other in known if other in alike], nominal_of(alike))
        radius, std = posterior(one.bend_radius, one.std["bend_radius"], one.radius, usual)
        first, second = (trace.pipes[i] for i in one.joins)
        ends = one.ends
        assert ends[0] != "side"
        assert ends[1] != "side"
        bend, _ = bend_of(first, second, (ends[0], ends[1]), np.zeros(8), radius)
        before = (first.at(ends[0]), second.at(ends[1]))
        moves = [float(np.linalg.norm(new - old)) for new, old in zip((bend.start, bend.end), before, strict=True)]
        if max(moves) > NEARBY * one.radius or any(
            move > 0.9 * pipe.length for move, pipe in zip(moves, (first, second), strict=True)
        ):
            continue
        for index, end, place in zip(one.joins, (ends[0], ends[1]), (bend.start, bend.end), strict=True):
            trace.pipes[index] = trace.pipes[index].with_end(end, place)
        trace.fittings[k] = replace(
            one,
            bend_radius=radius,
            center=bend.center,
            normal=bend.normal,
            angle=bend.angle,
            start=bend.start,
            end=bend.end,
            std={**one.std, "bend_radius": std},
        )


def _is_open(one: Elbow) -> bool:
    """Return whether points tell an elbow, of which more or less is known: also one that has hardly any radius."""
    return one.inliers > 0 and one.std.get("bend_radius", 0.0) > 0


def _is_alike(one: Elbow, other: Elbow) -> bool:
    """Return whether two elbows are of pipes of one size."""
    return abs(other.radius - one.radius) < SAME_SIZE * one.radius


def nominal_of(elbows: Sequence[Elbow]) -> tuple[float, float]:
    """Return the nominal diameter of a size, in radii of its pipe, and its standard deviation.

    All elbows of a size have bend radii that are usual multiples of one diameter: those that are known well tell it.

    Parameters
    ----------
    elbows : sequence of Elbow
        Of one size; none leave what is known of all sizes.
    """
    logs = -0.5 * ((GRID / DIAMETER - 1.0) / DIAMETER_SD) ** 2
    for one in elbows:
        measured, std = one.bend_radius / one.radius, one.std["bend_radius"] / one.radius
        likely = np.full(len(GRID), ANY * _any(measured, std, 1.0)[2])
        for times, share in MADE:
            spread = np.hypot(std, SAME_SD * times * GRID)
            likely += (
                AS_MADE
                * share
                * np.exp(-0.5 * ((measured - times * GRID) / spread) ** 2)
                / (math.sqrt(2.0 * math.pi) * spread)
            )
        logs += np.log(likely)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    mean = float(weights @ GRID)
    return mean, math.sqrt(float(weights @ (GRID - mean) ** 2) + (SAME_SD * mean) ** 2)


def _usual(one: Elbow, known: Sequence[Elbow], nominal: tuple[float, float]) -> list[Usual]:
    """Return the usual radii for an elbow, of which some of its size and the nominal diameter of that are known."""
    diameter, std = nominal
    out = [Usual(times * diameter * one.radius, times * std * one.radius, AS_MADE * share) for times, share in MADE]
    for other in known:
        sd = math.hypot(other.std["bend_radius"], SAME_SD * other.bend_radius)
        out.append(Usual(other.bend_radius, sd, OF_CLOUD / len(known)))
    return out


def _any(measured: float, std: float, tube: float) -> tuple[float, float, float]:
    """Return mean, standard deviation and density of a measured bend radius, if any radius is as usual as another."""
    span = math.log(WIDEST / SHARPEST)
    low, high = max(SHARPEST * tube, measured - 6.0 * std), min(WIDEST * tube, measured + 6.0 * std)
    if high <= low:  # a mitre, or a pipe that was bent
        return measured, std, 1.0 / (span * min(max(measured, SHARPEST * tube), WIDEST * tube))
    grid = np.geomspace(low, high, 65)
    likely = np.exp(-0.5 * ((measured - grid) / std) ** 2)
    mean = float((likely * grid).sum() / likely.sum())
    sd = math.sqrt(float((likely * (grid - mean) ** 2).sum() / likely.sum()))
    density = float(likely.mean()) * math.log(high / low) / (span * std * math.sqrt(2.0 * math.pi))
    return mean, sd, density


def posterior(measured: float, std: float, tube: float, usual: Sequence[Usual]) -> tuple[float, float]:
    """Return a bend radius and its standard deviation after a measurement, given usual radii, or any.

    Parameters
    ----------
    measured, std : float
        As the points have it, > 0.
    tube : float
        Radius of the tube, > 0.
    usual : sequence of Usual
        The prior; what is left of the weights is that of any radius.

    Returns
    -------
    radius, std : float
        Those of the most probable kind of radius; the deviation is about it, of all kinds together.
    """
    mean, sd, density = _any(measured, std, tube)
    kinds = [(mean, sd, ANY * density)]
    for one in usual:
        spread = math.hypot(std, one.std)
        density = math.exp(-0.5 * ((measured - one.radius) / spread) ** 2) / (math.sqrt(2.0 * math.pi) * spread)
        weight = 1.0 / (1.0 / std**2 + 1.0 / one.std**2)
        mean = weight * (measured / std**2 + one.radius / one.std**2)
        kinds.append((mean, math.sqrt(weight), one.weight * density))
    means, sds, weights = np.array(kinds).T
    weights = weights / weights.sum()
    # kinds that agree are one: the best is that with the most weight about it
    near = np.abs(means[:, None] - means) < np.hypot(sds[:, None], sds)
    about = near * weights
    best = int(np.argmax(about.sum(axis=1)))
    radius = float((about[best] * means).sum() / about[best].sum())
    variance = float((weights * (sds**2 + (means - radius) ** 2)).sum())
    return radius, math.sqrt(variance)
