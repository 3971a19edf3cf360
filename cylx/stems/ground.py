"""The ground of a plot: a grid of heights, from points that are known to be ground or from the lowest points there are.

The lowest points of small cells are ground, or whatever hides it. Those that stand higher above others than a slope of
50 degrees are left out. A local plane is then fitted about each cell, by weights that fall off with the height above
the plane, whose limit is lowered and whose range narrowed from step to step: shrubs and stems lose their say. All is
local, so that a part of a plot has the ground that it has in the whole. That surface lies under the lowest points; the
ground is above it, where most points are (`cylx.stems.level`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.optional.extras import is_found
from cylx.records.stems import Ground
from cylx.stems.level import levels_over

if TYPE_CHECKING:
    from numpy.typing import NDArray

GroundBy = Literal["classes", "cloth", "lowest"]

CELL = 0.5
"""Side of a cell of the grid, metres."""
GROUND_CLASS = 2
"""Class of ground points in LAS."""
STEEPEST = math.tan(math.radians(50.0))
STEPS = ((3.0, 1.0), (3.0, 0.5), (2.0, 0.35), (1.5, 0.25), (1.0, 0.2), (1.0, 0.15), (0.75, 0.12))
"""Standard deviation of the weights over the plane, and height at which a point above it loses its say; metres."""
BELOW = 0.4
"""Lowest points that are by this much lower than all about them were never there, metres."""


def choose_ground(classes: NDArray[Any] | None) -> GroundBy:
    """Return how the ground is to be found: by class 2 if points have it, else by a cloth if the library is there."""
    if classes is not None and bool((np.asarray(classes) == GROUND_CLASS).any()):
        return "classes"
    return "cloth" if is_found("CSF") else "lowest"


def find_ground(points: FloatArray, classes: NDArray[Any] | None, by: GroundBy) -> Ground:
    """Return the ground under a cloud.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Metres; z points upwards.
    classes : ndarray of shape (N,) or None
        Classes as LAS has them.
    by : {"classes", "cloth", "lowest"}
        From points of class 2, by a cloth that is laid over the cloud from below (the library
        `cloth-simulation-filter`), or from the lowest points.

    Returns
    -------
    Ground
        A grid that spans the cloud; found by the lowest points where no point is on the cloth, as of a single tree.
    """
    corner = np.floor(points[:, :2].min(axis=0) / CELL) * CELL
    shape = tuple(int(n) for n in np.floor((points[:, :2].max(axis=0) - corner) / CELL).astype(np.int64) + 1)
    if by == "classes":
        points = points[np.asarray(classes) == GROUND_CLASS]
    lowest = _lowest(points, corner, shape)
    if by == "cloth":
        from cylx.stems.cloth import on_cloth  # noqa: PLC0415  needs a library that may be missing

        z, u, v = lowest
        on = on_cloth(z, u, v, CELL)
        if on.any():
            lowest = np.where(on, z, math.nan), u, v
        else:  # a tree alone: the cloth finds no ground at all
            by = "lowest"
    under = Ground(corner, CELL, _surface(*lowest), by)
    return replace(under, heights=under.heights + levels_over(points, under))


def _lowest(
    points: FloatArray, corner: FloatArray, shape: tuple[int, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the height of the lowest point of each cell, NaN if there is none, and its place within the cell."""
    cells = np.floor((points[:, :2] - corner) / CELL).astype(np.int64)
    np.clip(cells, 0, np.array(shape) - 1, out=cells)
    flat = cells[:, 0] * shape[1] + cells[:, 1]
    chosen = np.full(shape[0] * shape[1], -1, np.int64)
    _pick_lowest(points, flat, chosen)
    there = chosen >= 0
    out = np.full((3, len(chosen)), math.nan)
    place = (points[chosen[there], :2] - corner) / CELL
    out[0, there], out[1, there], out[2, there] = points[chosen[there], 2], place[:, 0], place[:, 1]
    z, u, v = out.reshape(3, *shape)
    return _without_strays(z), u, v


@njit(cache=True, nogil=True)
def _pick_lowest(points: FloatArray, cells: IndexArray, chosen: IndexArray) -> None:
    for i in range(len(cells)):
        best = chosen[cells[i]]
        if best < 0 or points[i, 2] < points[best, 2]:
            chosen[cells[i]] = i


def _without_strays(z: FloatArray) -> FloatArray:
    """Return the lowest heights without those that lie far below the plane of all about them."""
    near = _neighbours(z, 2)
    many = np.isfinite(near).sum(axis=0)
    with np.errstate(all="ignore"):
        least = np.sort(np.where(np.isfinite(near), near, math.inf), axis=0)[1]  # one stray may have another beside it
    steep = STEEPEST * 3.0 * CELL
    return np.where((many >= 5) & (z < least - steep - BELOW), math.nan, z)


def _neighbours(z: FloatArray, reach: int) -> FloatArray:
    """Return the values of all cells about each, without its own; NaN beyond the edge."""
    wide = np.pad(z, reach, constant_values=math.nan)
    span = range(2 * reach + 1)
    views = [wide[i : i + z.shape[0], j : j + z.shape[1]] for i in span for j in span if (i, j) != (reach, reach)]
    return np.stack(views)


def _surface(z: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return the surface under the lowest points, shape of `z`: heights at the middles of the cells."""
    envelope = np.where(np.isfinite(z), z, math.inf)
    _lower(envelope, STEEPEST * CELL)
    known: MaskArray = np.isfinite(z) & (z <= envelope + 1e-9)
    surface = _filled(np.where(known, z, math.nan))
    for sigma, limit in STEPS:
        above = np.where(known, z - _at(surface, u, v), 0.0)
        weight = np.where(known, np.where(above > 0.0, np.exp(-((above / limit) ** 2)), 1.0), 0.0)
        surface = _planes(z, u, v, weight, sigma / CELL, surface)
    return surface


@njit(cache=True, nogil=True)
def _lower(z: FloatArray, step: float) -> None:
    """Lower heights to what a slope of `step` a cell allows above every other cell: two sweeps, twice."""
    rows, columns = z.shape
    slant = step * math.sqrt(2.0)
    for _ in range(2):
        for i in range(rows):
            for j in range(columns):
                best = z[i, j]
                if i > 0:
                    best = min(best, z[i - 1, j] + step)
                    if j > 0:
                        best = min(best, z[i - 1, j - 1] + slant)
                    if j < columns - 1:
                        best = min(best, z[i - 1, j + 1] + slant)
                if j > 0:
                    best = min(best, z[i, j - 1] + step)
                z[i, j] = best
        for i in range(rows - 1, -1, -1):
            for j in range(columns - 1, -1, -1):
                best = z[i, j]
                if i < rows - 1:
                    best = min(best, z[i + 1, j] + step)
                    if j > 0:
                        best = min(best, z[i + 1, j - 1] + slant)
                    if j < columns - 1:
                        best = min(best, z[i + 1, j + 1] + slant)
                if j < columns - 1:
                    best = min(best, z[i, j + 1] + step)
                z[i, j] = best


def _filled(z: FloatArray) -> FloatArray:
    """Return heights with each missing one replaced by the nearest that is known."""
    from scipy.ndimage import distance_transform_edt  # noqa: PLC0415  slow to import

    if not np.isfinite(z).any():
        return np.zeros_like(z)
    nearest = distance_transform_edt(~np.isfinite(z), return_distances=False, return_indices=True)
    return np.asarray(z[tuple(nearest)])


def _at(surface: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return a surface at places in cells, between the middles of the cells; NaN counts as the corner."""
    from scipy.ndimage import map_coordinates  # noqa: PLC0415  slow to import

    places = np.stack([np.nan_to_num(u) - 0.5, np.nan_to_num(v) - 0.5])
    return np.asarray(map_coordinates(surface, places, order=1, mode="nearest"))


def _planes(
    z: FloatArray, u: FloatArray, v: FloatArray, weight: FloatArray, sigma: float, surface: FloatArray
) -> FloatArray:
    """Return the height of a weighted plane about each cell, about more cells where little is known, or as it was."""
    from scipy.ndimage import gaussian_filter  # noqa: PLC0415  slow to import

    i, j = np.meshgrid(np.arange(z.shape[0]) + 0.5, np.arange(z.shape[1]) + 0.5, indexing="ij")
    base = float(np.median(surface))
    x, y, h = (np.where(weight > 0.0, value, 0.0) for value in (u, v, z - base))
    out = np.full(z.shape, math.nan)
    for widened in (1.0, 3.0, 10.0):

        def smooth(values: FloatArray, wide: float = sigma * widened) -> FloatArray:
            return np.asarray(gaussian_filter(weight * values, wide, mode="constant", truncate=3.0))

        w = smooth(np.ones_like(z))
        # moments about each cell itself
        wx, wy = smooth(x) - w * i, smooth(y) - w * j
        sx, sy = smooth(x), smooth(y)
        xx = smooth(x * x) - 2.0 * i * sx + w * i * i
        yy = smooth(y * y) - 2.0 * j * sy + w * j * j
        xy = smooth(x * y) - i * sy - j * sx + w * i * j
        wh, xh, yh = smooth(h), smooth(x * h), smooth(y * h)
        xh, yh = xh - i * wh, yh - j * wh
        ridge = 0.02 * w * (sigma * widened) ** 2  # where the points are in a line, the plane is level across it
        matrix = np.stack([w, wx, wy, wx, xx + ridge, xy, wy, xy, yy + ridge], axis=-1).reshape(*z.shape, 3, 3)
        enough = w > 0.02
        take = enough & ~np.isfinite(out)
        right = np.stack([wh, xh, yh], axis=-1)
        out[take] = np.linalg.solve(matrix[take], right[take][..., None])[..., 0, 0] + base
    return np.where(np.isfinite(out), out, surface)
