"""The unrolled surface of a cylinder in cells: how far each is from the cylinder, and where it is dented."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray

POINTS_A_CELL = 25
"""A cell has about so many points …"""
LEAST_POINTS = 5
"""… and with fewer than this it is empty."""
MOST_CELLS = 20_000
FEWEST_AROUND = 16
MEDIAN_SPREAD = 1.2533
"""Standard deviation of a median over that of a mean, of normal errors."""
MAD_SPREAD = 1.4826
"""Standard deviation over the median of the absolute errors, of normal errors."""
CERTAIN = 5.0
"""A patch has a cell that is off by so many standard deviations of a cell …"""
EDGE = 0.5
"""… and goes on to those off by this share of it."""
LEAST_CELLS = 2
WINDOW = 1.0
"""Points within so many cells of the deepest cell tell how deep a patch is."""
LEAST_TO_SHARPEN = 20
WORST_CONDITION = 1e8
TINY = 1e-9
"""Nothing is off by less than this, in radii: coordinates have no more digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """The cells of a surface that have points.

    Parameters
    ----------
    columns, rows : int
        Cells around the axis and along it.
    cells : ndarray of shape (C,)
        Number of each: row times columns, plus column.
    angles, heights : ndarray of shape (C,)
        Means of its points: radians about the axis, and lengths from the middle.
    values : ndarray of shape (C,)
        Median of the residuals of its points, + is outside.
    sds : ndarray of shape (C,)
        Standard deviations of the values.
    noise : float
        Standard deviation of the points about their cell.
    width, length : float
        Size of a cell around the axis and along it.
    """

    columns: int
    rows: int
    cells: IndexArray
    angles: FloatArray
    heights: FloatArray
    values: FloatArray
    sds: FloatArray
    noise: float
    width: float
    length: float

    @property
    def coverage(self) -> float:
        """Angle about the axis of the columns that have a cell, radians."""
        return float(2.0 * np.pi * len(np.unique(self.cells % self.columns)) / self.columns)


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A part of a surface that is off the shape of the rest.

    Parameters
    ----------
    kind : {"dent", "bulge"}
        Inwards or outwards.
    depth : float
        Largest distance from the shape of the rest; scene units, > 0.
    depth_sd : float
        Its standard deviation.
    area, volume : float
        Of the cells that are off by half of what is certain, or more.
    around, along : float
        Size about the axis and along it, scene units.
    angle : float
        Middle, radians about the axis.
    height : float
        Middle, from the middle of the cylinder, scene units.
    deepest : (float, float)
        Angle and height of the deepest place.
    """

    kind: str
    depth: float
    depth_sd: float
    area: float
    volume: float
    around: float
    along: float
    angle: float
    height: float
    deepest: tuple[float, float]


def cells_of(
    heights: FloatArray, angles: FloatArray, residuals: FloatArray, radius: float, height: float, side: float | None
) -> Cells:
    """Sort points into roughly square cells of a surface.

    Parameters
    ----------
    heights, angles, residuals : ndarray of shape (n,)
        Of the points: lengths from the middle, radians about the axis, signed distances from the surface.
    radius, height : float
        Of the cylinder.
    side : float or None
        Side of the cells; None for what gives each about 25 points.
    """
    girth = 2.0 * np.pi * radius
    seen = max(len(np.unique(np.floor((angles / (2 * np.pi) + 0.5) * 72.0))) / 72.0, 1.0 / 72.0)
    if side is None:
        side = float(np.sqrt(girth * seen * height * POINTS_A_CELL / max(len(heights), 1)))
    side = max(side, float(np.sqrt(girth * height / MOST_CELLS)))
    columns = max(FEWEST_AROUND, int(np.ceil(girth / side)))
    rows = max(1, int(np.ceil(height / side)))
    column = np.clip(((angles / (2 * np.pi) + 0.5) * columns).astype(np.int64), 0, columns - 1)
    row = np.clip(((heights / height + 0.5) * rows).astype(np.int64), 0, rows - 1)
    cell = row * columns + column
    order = np.lexsort((residuals, cell))
    found, first, counts = np.unique(cell[order], return_index=True, return_counts=True)
    keep = counts >= LEAST_POINTS
    found, first, counts = found[keep], first[keep], counts[keep]
    sorted_residuals = residuals[order]
    values = 0.5 * (sorted_residuals[first + (counts - 1) // 2] + sorted_residuals[first + counts // 2])
    medians = np.full(columns * rows, np.nan)
    medians[found] = values
    away = residuals - medians[cell]
    away = away[np.isfinite(away)]
    noise = float(MAD_SPREAD * np.median(np.abs(away))) if len(away) else 0.0
    sums = [np.bincount(cell, weights, minlength=columns * rows)[found] for weights in (heights, angles)]
    return Cells(
        columns, rows, found, sums[1] / counts, sums[0] / counts, values,
        MEDIAN_SPREAD * noise / np.sqrt(counts), noise, girth / columns, height / rows,
    )  # fmt: skip


def patches_of(cells: Cells, off: FloatArray, radius: float, least: float) -> list[Patch]:
    """Return the patches of a surface, the deepest first.

    Parameters
    ----------
    cells : Cells
    off : ndarray of shape (C,)
        Distance of each cell from the shape of the rest, + is outside.
    radius : float
    least : float
        Patches less deep than this do not matter.
    """
    if not len(off):
        return []
    spread = MAD_SPREAD * float(np.median(np.abs(off - np.median(off))))
    certain = np.maximum(CERTAIN * np.maximum(cells.sds, spread), max(least, TINY * radius))
    out = []
    for kind, way in (("dent", -1.0), ("bulge", 1.0)):
        share = way * off / certain
        labels = _connected(cells, share >= EDGE)
        for label in range(int(labels.max(initial=-1)) + 1):
            own = np.flatnonzero(labels == label)
            if len(own) >= LEAST_CELLS and share[own].max() >= 1.0:
                out.append(_patch(kind, cells, own, np.abs(off), radius))
    return sorted(out, key=lambda patch: -patch.depth)


def _patch(kind: str, cells: Cells, own: IndexArray, off: FloatArray, radius: float) -> Patch:
    deepest = int(own[np.argmax(off[own])])
    weights = off[own]
    away = np.angle(np.exp(1j * (cells.angles[own] - cells.angles[deepest])))
    angle = float(cells.angles[deepest] + np.average(away, weights=weights))
    columns, rows = cells.cells[own] % cells.columns, cells.cells[own] // cells.columns
    one = cells.width * cells.length
    return Patch(
        kind,
        float(off[deepest]),
        float(cells.sds[deepest]),
        one * len(own),
        one * float(weights.sum()),
        cells.width * len(np.unique(columns)),
        cells.length * int(rows.max() - rows.min() + 1),
        float(np.angle(np.exp(1j * angle))),
        float(np.average(cells.heights[own], weights=weights)),
        (float(cells.angles[deepest]), float(cells.heights[deepest])),
    )


def sharpened(
    patch: Patch, cells: Cells, heights: FloatArray, angles: FloatArray, off: FloatArray, radius: float
) -> Patch:
    """Return a patch with the depth of its deepest place, from a quadric through the points about its deepest cell.

    The median of a cell is less deep than the deepest place: that is rarely its middle, and the cell is not small
    against the dent.

    Parameters
    ----------
    patch : Patch
    cells : Cells
    heights, angles, off : ndarray of shape (n,)
        Of the points of the surface: lengths from the middle, radians, distances from the shape of the rest.
    radius : float
    """
    u = radius * np.angle(np.exp(1j * (angles - patch.deepest[0]))) / cells.width
    v = (heights - patch.deepest[1]) / cells.length
    near = np.hypot(u, v) <= WINDOW
    u, v, away = u[near], v[near], off[near] * (-1.0 if patch.kind == "dent" else 1.0)
    middle = float(np.median(away)) if len(away) else 0.0
    good = np.abs(away - middle) <= max(np.ptp(away) if cells.noise == 0 else 6.0 * cells.noise + patch.depth, 0.0)
    u, v, away = u[good], v[good], away[good]
    if len(away) < LEAST_TO_SHARPEN:
        return patch

    def rows(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])

    design = rows(u, v)
    normal = design.T @ design
    if np.linalg.cond(normal) > WORST_CONDITION:
        return patch
    shape = np.linalg.solve(normal, design.T @ away)
    steps = np.linspace(-1.0, 1.0, 41)
    across, along = (one.ravel() for one in np.meshgrid(steps, steps))
    inside = np.hypot(across, along) <= 1.0
    tried = rows(across[inside], along[inside])
    best = tried[int(np.argmax(tried @ shape))]
    depth_sd = float(cells.noise * np.sqrt(best @ np.linalg.solve(normal, best)))
    angle = patch.deepest[0] + float(best[1]) * cells.width / radius
    deepest = (angle, patch.deepest[1] + float(best[2]) * cells.length)
    return replace(patch, depth=max(float(best @ shape), 0.0), depth_sd=depth_sd, deepest=deepest)


def _connected(cells: Cells, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Label the groups of chosen cells that touch, at corners and across the cut of the surface, too; -1 for none."""
    grid = np.full((cells.rows, cells.columns), -1, np.int64)
    grid.ravel()[cells.cells[chosen]] = np.flatnonzero(chosen)
    labels = np.full(len(chosen), -1, np.int64)
    group = 0
    for start in np.flatnonzero(chosen):
        if labels[start] >= 0:
            continue
        labels[start], todo = group, [int(start)]
        while todo:
            row, column = divmod(int(cells.cells[todo.pop()]), cells.columns)
            for r in range(max(row - 1, 0), min(row + 2, cells.rows)):
                for c in (column - 1, column, column + 1):
                    other = int(grid[r, c % cells.columns])
                    if other >= 0 and labels[other] < 0:
                        labels[other] = group
                        todo.append(other)
        group += 1
    return labels
