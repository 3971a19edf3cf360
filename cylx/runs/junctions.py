"""Tees and crosses: ends of pipes on the surface of another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.lines import common_perpendicular
from cylx.runs.pipes import ENDS, ON_SURFACE, End, Pipe, Surroundings

LEAST_ANGLE = math.radians(25.0)
"""Between the axes of a branch and its main."""
WIDEST_BRANCH = 1.08
"""Radius of a branch, in that of the main."""
BESIDE = 0.3
"""The axis of a branch passes that of its main within so many radii of it."""
BEFORE = 2.5
"""The end of a branch may have been found so many of its radii before the surface."""
AFTER = 1.1
"""Or behind the axis of the main, by so many times where it leaves the main at the other side."""
SEEN = 4
"""Points on the branch just before the surface that show that it gets there."""


@dataclass(frozen=True, slots=True, eq=False)
class Branching:
    """An end of a pipe on the surface of another.

    Parameters
    ----------
    main, branch : int
    end : {'start', 'end'}
        Of the branch.
    center : ndarray of shape (3,)
        Where the axes meet, on that of the main.
    root : ndarray of shape (3,)
        On the axis of the branch, where it meets that of the main.
    angle : float
        Between the axes, radians.
    gap : float
        From the end to the surface of the main, along the branch.
    surface : ndarray of shape (3,)
        On the axis of the branch, at the surface of the main.
    """

    main: int
    branch: int
    end: End
    center: FloatArray
    root: FloatArray
    angle: float
    gap: float
    surface: FloatArray
    std: dict[str, float]


def branchings(
    pipes: list[Pipe], taken: set[tuple[int, End]], aside: set[int], near: Surroundings
) -> Iterator[Branching]:
    """Yield the free ends that end on the surface of another pipe, nearest first for each end."""
    middles = np.array([pipe.middle for pipe in pipes]).reshape(-1, 3)
    halves = np.array([0.5 * pipe.length for pipe in pipes])
    radii = np.array([pipe.radius for pipe in pipes])
    for i, pipe in enumerate(pipes):
        for end in ENDS:
            if (i, end) in taken:
                continue
            reach = halves + 2.0 * radii + BEFORE * pipe.radius
            close = np.linalg.norm(middles - pipe.at(end), axis=1) < reach + 2.0 * pipe.radius
            close &= pipe.radius < WIDEST_BRANCH * radii
            found = [_branching(pipes, i, end, int(j)) for j in np.flatnonzero(close) if j != i and j not in aside]
            kept = [one for one in found if one is not None and _arrives(one, pipes, near)]
            if kept:
                yield min(kept, key=lambda one: abs(one.gap))


def _branching(pipes: list[Pipe], i: int, end: End, j: int) -> Branching | None:
    branch, main = pipes[i], pipes[j]
    outward = branch.outward(end)
    cosine = abs(float(outward @ main.direction))
    angle = math.acos(min(cosine, 1.0))
    if angle < LEAST_ANGLE:
        return None
    feet = common_perpendicular(branch.at(end), outward, main.middle, main.direction)[:2]
    root, center = feet[0], feet[1]
    uncertain = ON_SURFACE * math.hypot(branch.axis_deviation(root), main.axis_deviation(center))
    if float(np.linalg.norm(root - center)) > BESIDE * main.radius + uncertain:
        return None
    if abs(float((center - main.middle) @ main.direction)) > 0.5 * main.length - 0.3 * branch.radius:
        return None
    sine = math.sin(angle)
    ahead = float((root - branch.at(end)) @ outward)
    gap = ahead - main.radius / sine
    if gap > BEFORE * branch.radius + 0.3 * main.radius or -ahead > AFTER * (main.radius + branch.radius) / sine:
        return None
    tilts = branch.covariance[2:4, 2:4] + main.covariance[2:4, 2:4]
    std = {
        "angle_deg": math.degrees(math.sqrt(max(0.5 * float(np.trace(tilts)), 0.0))),
        "center": uncertain / ON_SURFACE,
    }
    surface = root - main.radius / sine * outward
    return Branching(j, i, end, center, root, angle, gap, surface, std)


def _arrives(found: Branching, pipes: list[Pipe], near: Surroundings) -> bool:
    """Return whether the branch has points up to the surface of the main."""
    branch = pipes[found.branch]
    if near.cells is None or found.gap < 0.5 * branch.radius + 2.0 * near.spacing:
        return True
    reach = ON_SURFACE * branch.spread
    inner = max(0.0, branch.radius - reach)
    place, outward = branch.at(found.end), branch.outward(found.end)
    first = near.about(place, outward, 0.0, 0.5 * found.gap, branch.radius + reach, inner)
    last = near.about(place, outward, 0.5 * found.gap, found.gap, branch.radius + reach, inner)
    return min(int(near.free(one, (branch.label,)).sum()) for one in (first, last)) >= SEEN
