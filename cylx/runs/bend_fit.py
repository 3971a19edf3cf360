"""The fit of a bend to points: bend radius, radius of the tube and both axes, with what is known of the pipes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.runs.bend import Bend
from cylx.runs.bend_normal import fill_bend_normal
from cylx.runs.pipes import ON_SURFACE, End, Pipe, tilted

CLOSE = 10.0
"""The fit ends at steps shorter than so many of the small ones that derivatives are taken by."""
SKEWED = 0.02
"""Axes of one bend pass each other by about so many radii."""
LESSER = 0.25
"""Say of points just beside the arc."""


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """A bend after its fit: with the radius of its tube, what moved the pipes, and the covariance of all of it."""

    bend: Bend
    radius: float
    change: FloatArray
    covariance: FloatArray


def bend_of(
    one: Pipe, two: Pipe, ends: tuple[End, End], change: FloatArray, bend_radius: float
) -> tuple[Bend, FloatArray]:
    """Return the bend between two axes after small changes, and by how much they pass each other."""
    middle, direction = tilted(one, change[:4])
    other, onward = tilted(two, change[4:8])
    first = direction if ends[0] == "end" else -direction
    second = onward if ends[1] == "start" else -onward
    away = other - middle
    cosine, along, onto = float(direction @ onward), float(away @ direction), float(away @ onward)
    sine = 1.0 - cosine * cosine
    foot = middle + (along - cosine * onto) / sine * direction
    skew = foot - (other + (cosine * along - onto) / sine * onward)
    return Bend(foot - 0.5 * skew, first, second, bend_radius), skew


def axes_of(one: Pipe, two: Pipe) -> FloatArray:
    """Return middle, direction and basis of two pipes, as the normal equations take them; shape (2, 4, 3)."""
    return np.array([[pipe.middle, pipe.direction, *pipe.basis] for pipe in (one, two)])


def signs_of(ends: tuple[End, End]) -> FloatArray:
    """Return 1 for each of two pipes whose direction is that of the bend between these ends, else -1; shape (2,)."""
    return np.array([1.0 if ends[0] == "end" else -1.0, 1.0 if ends[1] == "start" else -1.0])


def refined(
    bend: Bend,
    one: Pipe,
    two: Pipe,
    radius: float,
    points: FloatArray,
    spread: float,
    steps: int = 8,
    says: tuple[float, float] = (0.0, 0.0),
) -> Solved:
    """Fit bend radius, tube radius and both axes to the points of the bend, with what is known of the pipes as priors.

    Parameters
    ----------
    bend : Bend
        Start of the fit.
    one, two : Pipe
        The pipes; their ends are told by the directions of the bend.
    radius : float
        Start of the radius of the tube.
    points : ndarray of shape (N, 3)
    spread : float
        Standard deviation of points about a surface.
    steps : int
        Gauss-Newton steps.
    says : pair of float
        Up to how far from the arc points of either pipe have a full say: of one whose axis is hardly known.
    """
    ends: tuple[End, End] = (
        "end" if float(bend.first @ one.direction) > 0 else "start",
        "start" if float(bend.second @ two.direction) > 0 else "end",
    )
    information = np.zeros((10, 10))
    for place, pipe in ((0, one), (4, two)):
        known = pipe.covariance[:4, :4] + np.diag([*[(0.002 * radius) ** 2] * 2, *[1e-6] * 2])
        information[place : place + 4, place : place + 4] = np.linalg.inv(known)
    tube = 1.0 / max(one.covariance[4, 4], 1e-300) + 1.0 / max(two.covariance[4, 4], 1e-300)
    information[8, 8] = 1.0 / (1.0 / tube + (0.01 * radius) ** 2)
    base = np.zeros(10)
    base[8], base[9] = radius, bend.bend_radius
    state = base.copy()
    small = np.array([*[1e-4 * radius] * 2, *[1e-5] * 2, *[1e-4 * radius] * 2, *[1e-5] * 2, *[1e-4 * radius] * 2])
    places, signs = (
        axes_of(one, two),
        np.array([1.0 if ends[0] == "end" else -1.0, 1.0 if ends[1] == "start" else -1.0]),
    )
    # points of the straights are in their priors already
    reach = np.array([spread, ON_SURFACE * 1.5 * spread, *says, 2.0 * radius, LESSER, SKEWED * radius])
    points = np.ascontiguousarray(points)
    normal, gradient = np.empty((10, 10)), np.empty(10)
    covariance = np.linalg.inv(information + np.diag([*[0.0] * 9, 1e-12 / radius**2]))
    for _ in range(steps):
        fill_bend_normal(points, places, signs, state, small, reach, normal, gradient)
        normal += information
        normal[9, 9] += 1e-9 / radius**2
        gradient += information @ (state - base)
        covariance = np.linalg.inv(normal)
        step = covariance @ gradient
        state = state - step
        state[9] = max(state[9], 0.0)
        if float(np.abs(step / small).max()) < CLOSE:
            break
    shape, _ = bend_of(one, two, ends, state, float(state[9]))
    change = np.asarray(state[:8] - base[:8], dtype=np.float64)
    return Solved(shape, float(state[8]), change, np.asarray(covariance, dtype=np.float64))
