"""The unrolled surface of a cylinder: the residuals of its points by angle and height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis, cylinder_coordinates

MOST_COLUMNS, MOST_ROWS = 72, 48
MOST_CELLS = MOST_COLUMNS * MOST_ROWS
POINTS_A_CELL = 6
EMPTY = -128


@dataclass(frozen=True, slots=True, eq=False)
class ResidualMap:
    """The mean residual in the cells of an unrolled surface.

    Parameters
    ----------
    means : ndarray of shape (rows, columns), int8
        Multiples of a 127th of `reach`, -128 without points. Rows go from the start of the axis to its end, columns
        around it from -180 to 180 degrees.
    reach : float
        Largest of them, scene units.
    limit : float
        The residual at the end of the colour scale, scene units: that of all but the most extreme cells with more than
        two points, and at least twice the noise, so that mere noise is pale.
    zero : str
        The coordinate axis towards which the angle is 0.
    """

    means: NDArray[np.int8]
    reach: float
    limit: float
    zero: str


def unroll(
    points: FloatArray, residuals: FloatArray, cylinder: Cylinder, noise: float, most_cells: int = MOST_CELLS
) -> ResidualMap:
    """Average the residuals of a cylinder's points in roughly square cells of its surface.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Its points, scene units.
    residuals : ndarray of shape (n,)
        Their signed distances to its surface, + is outside, scene units.
    cylinder : Cylinder
        Points beyond its ends are left out.
    noise : float
        Scene units.
    most_cells : int
        At least 8.

    Returns
    -------
    ResidualMap
    """
    heights, _, angles = cylinder_coordinates(points, cylinder.point, cylinder.direction)
    zero, turn = _zero(cylinder)
    inside = np.abs(heights) <= 0.5 * cylinder.height * (1 + 1e-9) if cylinder.height else np.ones(len(points), bool)
    columns, rows = _cells(cylinder, int(inside.sum()), most_cells)
    column = ((angles[inside] - turn) / (2 * np.pi) + 0.5) % 1.0 * columns
    row = (heights[inside] / (cylinder.height or 1.0) + 0.5) * rows
    cell = np.clip(row.astype(int), 0, rows - 1) * columns + np.clip(column.astype(int), 0, columns - 1)
    counts = np.bincount(cell, minlength=rows * columns)
    sums = np.bincount(cell, residuals[inside], minlength=rows * columns)
    means = np.divide(sums, counts, out=np.zeros(len(sums)), where=counts > 0)
    sizes = np.abs(means[counts > 0])
    reach = float(sizes.max(initial=0.0)) or 1.0
    sure = sizes[counts[counts > 0] > 2]
    limit = max(float(np.quantile(sure, 0.98)) if len(sure) else 0.0, 2.0 * noise) or reach
    packed = np.where(counts > 0, np.rint(means / reach * 127), EMPTY).astype(np.int8)
    return ResidualMap(packed.reshape(rows, columns), reach, limit, zero)


def _cells(cylinder: Cylinder, count: int, most: int) -> tuple[int, int]:
    """Return the columns and rows of a map: roughly square cells, with some points in each."""
    cells = float(np.clip(count / POINTS_A_CELL, 8, most))
    shape = 2 * np.pi * cylinder.radius / max(cylinder.height, 1e-9 * cylinder.radius)
    columns = int(np.clip(np.rint(np.sqrt(cells * shape)), 8, MOST_COLUMNS))
    return columns, int(np.clip(np.rint(cells / columns), 1, MOST_ROWS))


def _zero(cylinder: Cylinder) -> tuple[str, float]:
    """Choose the direction of angle 0: up, or x for an upright cylinder; return its name and its angle in the frame."""
    name, axis = ("z", 2) if abs(cylinder.direction[2]) < 0.9 else ("x", 0)
    across, along = axis_basis(cylinder.direction)
    return name, float(np.arctan2(along[axis], across[axis]))
