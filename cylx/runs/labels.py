"""The cylinder of each point of a cloud, from the cylinders alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.records import CylinderFit
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings


def nearest_cylinders(
    fits: Sequence[CylinderFit], points: FloatArray, spacing: float, noise: float
) -> NDArray[np.int32]:
    """Return the cylinder with the nearest surface for each point, -1 for none within three standard deviations.

    Parameters
    ----------
    fits : sequence of CylinderFit
    points : ndarray of shape (N, 3)
        Scene units.
    spacing, noise : float
        Of the cloud, scene units.

    Returns
    -------
    ndarray of shape (N,), int32
    """
    near = Surroundings(points, np.full(len(points), -1, np.int32), spacing, noise)
    least = np.full(len(points), np.inf)
    for index, fit in enumerate(fits):
        pipe = Pipe.of(index, fit, near.origin, noise)
        reach, half = ON_SURFACE * pipe.spread, 0.5 * pipe.length
        inner = max(0.0, pipe.radius - reach)
        found = near.about(pipe.middle, pipe.direction, -half, half, pipe.radius + reach, inner)
        away = near.points[found] - pipe.middle
        square = np.einsum("ij,ij->i", away, away) - (away @ pipe.direction) ** 2
        distances = np.abs(np.sqrt(np.maximum(square, 0.0)) - pipe.radius)
        closer = distances < least[found]
        near.labels[found[closer]], least[found[closer]] = index, distances[closer]
    labels = np.empty(len(points), np.int32)
    labels[near.order] = near.labels
    return labels
