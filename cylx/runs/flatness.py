"""Strips of a wall that were taken for a pipe: a tube that touches a wall has the points of it in common."""

from __future__ import annotations

import numpy as np

from cylx.geometry.cylinder import cylinder_coordinates
from cylx.runs.pipes import Pipe, Surroundings

PIECE = 2.0
"""Length of the pieces that are looked at, in radii: a strip may wind along the wall."""
LEAST_POINTS = 6


def is_flat(pipe: Pipe, near: Surroundings) -> bool:
    """Return whether planes explain the points on a pipe as well as it does itself.

    Parameters
    ----------
    pipe : Pipe
    near : Surroundings
    """
    points = near.points[near.on(pipe)]
    heights, distances, _ = cylinder_coordinates(points, pipe.middle, pipe.direction)
    rows = np.floor((heights + 0.5 * pipe.length) / (PIECE * pipe.radius)).astype(np.int64)
    of_plane = of_pipe = 0.0
    for row in np.unique(rows):
        own = rows == row
        if own.sum() >= LEAST_POINTS:
            away = points[own] - points[own].mean(axis=0)
            of_plane += float(np.linalg.eigvalsh(away.T @ away)[0]) / (own.sum() - 3) * own.sum()
            of_pipe += float(((distances[own] - pipe.radius) ** 2).sum())
    return 0.0 < of_plane < of_pipe
