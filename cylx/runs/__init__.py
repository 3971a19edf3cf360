"""Runs: cylinders joined by their fittings, which are proposed by the axes and fitted to the points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cylx.fits.nominal_radius import Catalogue
from cylx.geometry.arrays import FloatArray
from cylx.records import CylinderFit
from cylx.runs.adding import add_caps, add_collars, add_gaps, add_junctions, add_reducers
from cylx.runs.answer import Traced, answer_of, in_order
from cylx.runs.assumed import add_assumed
from cylx.runs.bend_evidence import DOUBTED_TURN
from cylx.runs.chains import settle_chains
from cylx.runs.crossings import split_crossings
from cylx.runs.elbows import add_bends, trim
from cylx.runs.graph import find_runs
from cylx.runs.jogs import split_jogs
from cylx.runs.onward import follow_ends
from cylx.runs.parts import drop_parts, drop_turned, drop_twins
from cylx.runs.pieces import settled
from cylx.runs.pipes import Pipe, Surroundings
from cylx.runs.roughness import rough_ones
from cylx.runs.tracing import Trace
from cylx.runs.usual_bends import settle_radii

__all__ = ["Traced", "trace_runs"]

ROUNDS = 3
"""Times that fittings are looked for anew, with the pipes as they are between those found before."""


def trace_runs(
    fits: Sequence[CylinderFit],
    points: FloatArray,
    labels: NDArray[np.int32],
    *,
    spacing: float,
    noise: float,
    catalogue: Catalogue | None = None,
    names: Sequence[str | None] = (),
) -> Traced:
    """Join the cylinders of a cloud to runs, and find and fit what joins them.

    Parameters
    ----------
    fits : sequence of CylinderFit
        The cylinders.
    points : ndarray of shape (N, 3)
        The cloud, scene units; without points the fittings are those that the axes tell.
    labels : ndarray of shape (N,)
        Cylinder of each point, -1 for none.
    spacing, noise : float
        Of the cloud, scene units.
    catalogue : Catalogue, optional
        Nominal radii, scene units: decided for all pipes of a size of a run together.
    names : sequence of str or None
        Names of its entries.

    Returns
    -------
    Traced
    """
    near = Surroundings(points, labels, spacing, noise)
    pipes = [Pipe.of(i, fit, near.origin, noise) for i, fit in enumerate(fits)]
    pipes = split_jogs(split_crossings(settled(pipes, near), near), near)
    others = rough_ones(pipes, near) | {k for k, pipe in enumerate(pipes) if pipe.is_other}
    trace = Trace(pipes, near, others=others)
    add_bends(trace, near, furthest=DOUBTED_TURN)
    add_reducers(trace, near)
    for _ in range(ROUNDS):
        # straights that were found too long have bent with their fittings; those found along the runs are new
        trace = drop_twins(trace)
        trace = Trace(trim(trace, near), near, others=trace.others, followed=trace.followed)
        add_bends(trace, near, furthest=DOUBTED_TURN)
        add_reducers(trace, near)
        add_junctions(trace, near)
        if not follow_ends(trace, near):
            break
        while follow_ends(trace, near):
            pass
    else:
        add_junctions(trace, near)
    # what may be two elbows, but was not found as two
    add_bends(trace, near)
    add_collars(trace, near)
    add_gaps(trace, near)
    add_caps(trace, near)
    trace = drop_parts(trace)
    # a bend that was taken for two has both its pipes again
    add_bends(trace, near)
    add_reducers(trace, near)
    trace = drop_turned(trace)
    add_assumed(trace, near)
    settle_chains(trace, near)
    settle_radii(trace)
    trace = in_order(trace)
    runs = find_runs(trace.pipes, trace.fittings, near, catalogue, names)
    return answer_of(trace, runs, fits, near)
