"""Fittings and runs as a view shows them: short tubes along the centre lines, and the run of each cylinder."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.cylinder import Cylinder, cylinder_between
from cylx.records import Elbow, Flange, Piping, Reducer

if TYPE_CHECKING:
    from cylx.records import Extraction

CHORDS = 6
"""Pieces of a bend, and of a reducer."""


def labels_with_fittings(found: Extraction) -> NDArray[np.int32]:
    """Return the cylinder of each point; points of a fitting are shown with the first cylinder that it joins."""
    piping = found.piping
    if piping is None or not len(piping.labels) or not piping.fittings:
        return found.labels
    first = np.array([one.joins[0] for one in piping.fittings], np.int32)
    return np.where(piping.labels >= 0, first[piping.labels], found.labels).astype(np.int32)


def runs_of(piping: Piping, count: int) -> tuple[int, ...]:
    """Return the run of each of so many cylinders."""
    out = [0] * count
    for number, run in enumerate(piping.runs):
        for cylinder in run.cylinders:
            out[cylinder] = number
    return tuple(out)


def pieces_of(piping: Piping) -> Iterator[tuple[int, Cylinder]]:
    """Yield short tubes along elbows, reducers and flanges, each with the cylinder that it is shown with."""
    for one in piping.fittings:
        owner = one.joins[0]
        if isinstance(one, Elbow) and one.bend_radius > 0:
            turn = np.linspace(0.0, one.angle, CHORDS + 1)[:, None]
            radial = (one.start - one.center) / one.bend_radius
            line = one.center + one.bend_radius * (np.cos(turn) * radial + np.sin(turn) * np.cross(one.normal, radial))
            yield from ((owner, cylinder_between(a, b, one.radius)) for a, b in pairwise(line))
        elif isinstance(one, Reducer):
            share = np.linspace(0.0, 1.0, CHORDS + 1)
            line = one.start + share[:, None] * (one.end - one.start)
            radii = one.start_radius + (share[:-1] + 0.5 / CHORDS) * (one.end_radius - one.start_radius)
            for a, b, radius in zip(line[:-1], line[1:], radii, strict=True):
                yield owner, cylinder_between(a, b, float(radius))
        elif isinstance(one, Flange):
            half = 0.5 * one.thickness * one.axis
            yield owner, cylinder_between(one.center - half, one.center + half, one.radius)
