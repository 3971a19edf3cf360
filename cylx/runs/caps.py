"""Caps: closed ends of pipes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.runs.pipes import End, Pipe, Surroundings, sectors_of

FURTHEST = 1.3
"""A cap reaches so many radii beyond the end at most."""
WITHIN = 0.85
"""Points nearer to the axis than so many radii are of the cap, not of the mantle."""
LEAST_POINTS = 10
CELLS = 12
LEAST_COVERAGE = 0.4
MOST_BEHIND = 0.5
"""Points inside the pipe behind the cap, or about it beyond, for each point of it."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedCap:
    """A cap: its outermost place on the axis, its points, and how much of it they cover."""

    center: FloatArray
    indices: IndexArray
    rms: float
    coverage: float
    std: float


def fit_cap(pipe: Pipe, end: End, near: Surroundings) -> FittedCap | None:
    """Fit a cap, a disc that may bulge, to the points at an end; None if there is none.

    Parameters
    ----------
    pipe : Pipe
    end : {'start', 'end'}
    near : Surroundings
    """
    radius, place, axis = pipe.radius, pipe.at(end), pipe.outward(end)
    indices = near.about(place, axis, -radius, FURTHEST * radius, radius)
    indices = indices[near.free(indices, (pipe.label,))]
    points = near.points[indices]
    heights = (points - place) @ axis
    square = np.einsum("ij,ij->i", points - place, points - place) - heights**2
    distances = np.sqrt(np.maximum(square, 0.0)) / radius
    within = distances < WITHIN
    if within.sum() < LEAST_POINTS:
        return None
    indices, heights, distances = indices[within], heights[within], distances[within]
    # a bulge of any depth, from flat to half a ball
    slope = 1.0 - distances**2
    matrix = np.column_stack([np.ones(len(slope)), slope])
    weights = np.ones(len(slope))
    width = max(3.0 * pipe.spread, 0.05 * radius)
    solution = np.array([float(np.median(heights)), 0.0])
    for _ in range(10):
        scaled = matrix * weights[:, None]
        solution = np.linalg.lstsq(scaled.T @ matrix + 1e-9 * np.eye(2), scaled.T @ heights, rcond=None)[0]
        errors = heights - matrix @ solution
        weights = 1.0 / (1.0 + (errors / width) ** 2)
    own = np.abs(errors) < width
    depth = float(solution[1])
    if own.sum() < LEAST_POINTS or not -0.2 * radius < depth < 1.1 * radius:
        return None
    if (~own).sum() > MOST_BEHIND * own.sum():
        return None
    sectors = sectors_of(near.points[indices[own]], place, axis, CELLS // 2)
    rings = (distances[own] > WITHIN / math.sqrt(2.0)).astype(np.int64)
    coverage = len(np.unique(2 * sectors + rings)) / CELLS
    beyond = near.about(place, axis, solution[0] + max(depth, 0.0) + width, 2.0 * FURTHEST * radius, 1.5 * radius)
    if coverage < LEAST_COVERAGE or len(beyond) > own.sum():
        return None
    rms = float(np.sqrt((errors[own] ** 2).mean()))
    top = float(solution[0] + max(depth, 0.0))
    return FittedCap(place + top * axis, indices[own], rms, coverage, rms / math.sqrt(int(own.sum())))
