"""How far the surface of a pipe deviates from a cylinder, beyond noise: stems of trees are no pipes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cylx.geometry.cylinder import cylinder_coordinates
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings

MOST = 0.015
"""Pipes deviate from cylinders by less, in radii: standard deviation of pieces of surface half a radius wide."""
SECTORS = 12
KEPT = 0.8
"""Share of the pieces, those that deviate least."""
LEAST_IN_CELL, LEAST_CELLS = 5, 8
"""Points of a piece of the surface that tell where it lies, and pieces that tell how far they deviate."""


def is_rough(pipe: Pipe, near: Surroundings) -> bool:
    """Return whether the surface of a pipe clearly deviates from a cylinder by more than pipes do."""
    found = deviation_of(pipe, near)
    return found is not None and found[0] - 2.0 * found[1] > MOST**2


def rough_ones(pipes: Sequence[Pipe], near: Surroundings) -> frozenset[int]:
    """Return which cylinders are too rough for pipes.

    Where they are so together, such as in a forest, all are that are not clearly smooth: those whose points do not tell
    are of the same kind as the others.
    """
    found = [deviation_of(pipe, near) for pipe in pipes]
    rough = {k for k, one in enumerate(found) if one is not None and one[0] - 2.0 * one[1] > MOST**2}
    smooth = {k for k, one in enumerate(found) if one is not None and one[0] + 2.0 * one[1] < MOST**2}
    known = np.array([one for one in found if one is not None]).reshape(-1, 2)
    weights = 1.0 / np.maximum(known[:, 1], 1e-12) ** 2
    together = len(known) > 0 and float(weights @ known[:, 0]) - math.sqrt(weights.sum()) > MOST**2 * weights.sum()
    return frozenset(range(len(pipes))) - smooth if together else frozenset(rough)


def deviation_of(pipe: Pipe, near: Surroundings) -> tuple[float, float] | None:
    """Return the mean square deviation of pieces of a surface from a cylinder, and its standard deviation.

    Both are in squares of the radius; None if too few pieces have points. It is below 0 where noise hides all.
    """
    if near.cells is None:
        return None
    reach = max(ON_SURFACE * 2.0 * pipe.spread, 0.15 * pipe.radius)
    half = 0.5 * pipe.length
    found = near.about(pipe.middle, pipe.direction, -half, half, pipe.radius + reach, max(0.0, pipe.radius - reach))
    found = found[near.free(found, (pipe.label,))]
    heights, distances, angles = cylinder_coordinates(near.points[found], pipe.middle, pipe.direction)
    errors = distances - pipe.radius
    sector = np.floor((angles / (2.0 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
    row = np.floor((heights + half) / (0.5 * pipe.radius)).astype(np.int64)
    _, cell = np.unique(row * SECTORS + sector, return_inverse=True)
    counts = np.bincount(cell)
    means = np.bincount(cell, errors) / counts
    squares = np.bincount(cell, errors**2) / counts - means**2
    used = counts >= LEAST_IN_CELL
    if used.sum() < LEAST_CELLS:
        return None
    # what is left of the scatter of the means when that of the points within the pieces is taken off
    noise = squares[used] / (counts[used] - 1)
    deviations = (means[used] - float(np.median(means[used]))) ** 2
    # branches and rims deviate more, in a few places
    kept = np.argsort(deviations, kind="stable")[: max(LEAST_CELLS // 2, int(KEPT * len(deviations)))]
    form = float((deviations - noise)[kept].mean())
    uncertain = math.sqrt(2.0 / len(kept)) * float(deviations[kept].mean())
    return form / pipe.radius**2, uncertain / pipe.radius**2
