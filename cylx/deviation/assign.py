"""Which points are those of which design cylinder: of those whose surface is near enough, the nearest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import Cylinder, cylinder_coordinates

WITHIN = 0.15
"""Points this near to the surface of a design cylinder may be its own, in radii."""


def assign(
    points: FloatArray, shapes: Sequence[Cylinder | None], within: Sequence[float]
) -> tuple[NDArray[np.int32], FloatArray]:
    """Assign points to cylinders.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    shapes : sequence of Cylinder or None
        A point is between the ends of its cylinder. None has no points.
    within : sequence of float
        How far from the surface of each its points may be, scene units.

    Returns
    -------
    labels : ndarray of shape (N,)
        Number of the cylinder; -1 for none.
    residuals : ndarray of shape (N,)
        Signed distance from its surface, + is outside; NaN for none.
    """
    labels = np.full(len(points), -1, np.int32)
    residuals = np.full(len(points), np.nan)
    nearest = np.full(len(points), np.inf)
    for number, (shape, width) in enumerate(zip(shapes, within, strict=True)):
        if shape is None:
            continue
        near = _in_box(points, shape, width)
        heights, distances, _ = cylinder_coordinates(points[near], shape.point, shape.direction)
        away = distances - shape.radius
        on = (np.abs(heights) <= 0.5 * shape.height) & (np.abs(away) <= width) & (np.abs(away) < nearest[near])
        own = near[on]
        labels[own], residuals[own], nearest[own] = number, away[on], np.abs(away[on])
    return labels, residuals


def _in_box(points: FloatArray, shape: Cylinder, width: float) -> IndexArray:
    """Return the points in the box along the coordinate axes that holds a cylinder."""
    across = (shape.radius + width) * np.sqrt(np.maximum(1.0 - shape.direction**2, 0.0))
    reach = across + 0.5 * shape.height * np.abs(shape.direction) + 1e-12 * np.abs(shape.point)
    inside = np.ones(len(points), bool)
    for axis in range(3):
        inside &= np.abs(points[:, axis] - shape.point[axis]) <= reach[axis]
    return np.flatnonzero(inside)
