"""What points say of a branch on its main: they follow both surfaces about the saddle, and there are none inside it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.runs.junctions import Branching
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings, sectors_of

ABOUT = 1.6
"""The saddle and its surroundings: so many radii of the branch about its axis, and along it from the main's surface."""
FOOT = 0.7
"""Within so many radii of the axis of a branch, its main has a hole."""
SECTORS = 12


class Saddle(NamedTuple):
    """Points on main and branch about the saddle, their residual, how much of it they go round, and how filled it is.

    `filled` is the density of the main's points within the foot of the branch over that on the main, 0 to 1.
    """

    inliers: int
    rms: float
    coverage: float
    filled: float


def saddle_of(one: Branching, pipes: list[Pipe], near: Surroundings) -> Saddle | None:
    """Measure the surroundings of the end of a branch; None if there are no points.

    Parameters
    ----------
    one : Branching
    pipes : list of Pipe
    near : Surroundings
    """
    main, branch = pipes[one.main], pipes[one.branch]
    if near.cells is None:
        return None
    out = -branch.outward(one.end)
    reach = ABOUT * branch.radius
    found = near.about(one.surface, out, -reach, reach, reach)
    points = near.points[found[near.free(found, (main.label, branch.label))]]
    of_main, of_branch = _distances(points, main), _distances(points, branch)
    heights = (points - one.root) @ out
    on_main = np.abs(of_main - main.radius) < ON_SURFACE * main.spread
    on_branch = (np.abs(of_branch - branch.radius) < ON_SURFACE * branch.spread) & (of_main > main.radius)
    on_branch &= heights > 0.0
    # the main is seen from the side of the branch, but for what the branch hides
    under = on_main & (heights > 0.0) & (of_branch < FOOT * branch.radius)
    outside = on_main & (of_branch > branch.radius)
    own = on_branch | outside
    if not own.any():
        return Saddle(0, 0.0, 0.0, 0.0)
    errors = np.where(on_branch, of_branch - branch.radius, of_main - main.radius)[own]
    around = sectors_of(points[own], one.root, out, SECTORS)
    foot, ring = FOOT**2, ABOUT**2 - 1.0
    usual = outside.sum() / ring * foot
    filled = min(1.0, float(under.sum()) / max(usual, 1.0))
    return Saddle(int(own.sum()), math.sqrt(float((errors**2).mean())), len(np.unique(around)) / SECTORS, filled)


def _distances(points: FloatArray, pipe: Pipe) -> FloatArray:
    away = points - pipe.middle
    along = away @ pipe.direction
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - along**2, 0.0)))
