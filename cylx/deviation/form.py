"""The form of a surface: cylindricity, ovality and taper, of its cells.

Cylindricity is that of ISO 1101 and ISO 12180-1: the least distance of two coaxial cylinders that hold the surface
between them (minimum zone), or that of two about the axis of least squares. The surface is that of the medians of the
cells, which is what ISO 12180-2 calls a filtered one: of single points, cylindricity would be that of the noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.deviation.surface import MAD_SPREAD, Cells
from cylx.geometry.arrays import FloatArray

STEPS = 20
LEAST_CELLS = 12
"""Cells that tell a form."""
HALF_ROUND = np.radians(200.0)
"""Less than this about the axis does not tell whether a section is oval."""
TUKEY = 4.685
FIRST_EXCHANGE = 100
"""Extreme cells that the search for the minimum zone begins with."""


@dataclass(frozen=True, slots=True, eq=False)
class Smooth:
    """A cylinder that may be oval and tapered, and heeds no dents.

    Parameters
    ----------
    shape : ndarray of shape (6,) or (8,)
        Two offsets of the axis, its two tilts, the radius, its change along the axis and, if enough of the section was
        seen, the second harmonic about it.
    covariance : ndarray of the same shape, squared
    off : ndarray of shape (C,)
        Distance of each cell from it, + is outside.
    of_cylinder : ndarray of shape (5, 5)
        Covariance of two offsets of the axis, its two tilts and the radius of a true cylinder, from how the cells
        scatter about that.
    """

    shape: FloatArray
    covariance: FloatArray
    off: FloatArray
    of_cylinder: FloatArray

    @property
    def oval(self) -> bool:
        """Whether it may be oval."""
        return len(self.shape) > 6

    def at(self, angles: FloatArray, heights: FloatArray) -> FloatArray:
        """Return its distance from the cylinder that the cells count from, at places; + is outside."""
        return np.asarray(_rows(angles, heights, self.oval) @ self.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """The form of a surface.

    Parameters
    ----------
    minimum_zone, least_squares : float
        Cylindricity, scene units.
    noise : float
        What the noise alone makes of it, about: the range of as many cells of a perfect cylinder.
    ovality, ovality_sd : float or None
        Largest diameter minus smallest of the second harmonic, scene units, and its standard deviation; None if too
        little of the section was seen.
    taper, taper_sd : float
        Change of the diameter per length along the axis, and its standard deviation.
    """

    minimum_zone: float
    least_squares: float
    noise: float
    ovality: float | None
    ovality_sd: float | None
    taper: float
    taper_sd: float


def smooth_of(cells: Cells) -> Smooth | None:
    """Fit the shape of a surface without its dents; None if it has too few cells.

    Parameters
    ----------
    cells : Cells
    """
    if len(cells.cells) < LEAST_CELLS:
        return None
    oval = cells.coverage >= HALF_ROUND
    rows = _rows(cells.angles, cells.heights, oval)
    shape, covariance, off = _robustly(rows, cells.values)
    _, own, _ = _robustly(_ways(cells.angles, cells.heights), cells.values)
    return Smooth(shape, covariance, off, own)


def form_of(cells: Cells, radius: float, smooth: Smooth, peaks: FloatArray | None = None) -> Form | None:
    """Measure the form of a surface; None if its cells do not determine a cylinder.

    Parameters
    ----------
    cells : Cells
    radius : float
        Of the cylinder that its values count from.
    smooth : Smooth
        Its shape without its dents.
    peaks : ndarray of shape (k, 3), optional
        Angle, height and value of the deepest places of its dents, which may be between the middles of cells.
    """
    angles, heights, values = cells.angles, cells.heights, cells.values
    places = (radius + values)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    axis = _least_squares(places, heights)
    if axis is None:
        return None
    if peaks is not None and len(peaks):
        more = (radius + peaks[:, 2])[:, None] * np.column_stack([np.cos(peaks[:, 0]), np.sin(peaks[:, 0])])
        places, heights = np.vstack([places, more]), np.concatenate([heights, peaks[:, 1]])
    shape, covariance = smooth.shape, smooth.covariance
    noise = 2.0 * float(np.median(cells.sds)) * math.sqrt(2.0 * math.log(len(cells.cells)))
    ovality = ovality_sd = None
    if smooth.oval:
        size = float(np.hypot(shape[6], shape[7]))
        ovality = 4.0 * size
        way = shape[6:8] / size if size > 0 else np.array([1.0, 0.0])
        ovality_sd = 4.0 * math.sqrt(max(float(way @ covariance[6:8, 6:8] @ way), 0.0))
    return Form(
        minimum_zone=_minimum_zone(axis, places, heights),
        least_squares=float(np.ptp(_distances(axis, places, heights))),
        noise=noise,
        ovality=ovality,
        ovality_sd=ovality_sd,
        taper=2.0 * float(shape[5]),
        taper_sd=2.0 * math.sqrt(max(float(covariance[5, 5]), 0.0)),
    )


def _rows(angles: FloatArray, heights: FloatArray, oval: bool) -> FloatArray:
    """Return how distances from an axis change with a cylinder that may be tapered and oval, shape (n, 6 or 8)."""
    harmonics = [np.cos(2 * angles), np.sin(2 * angles)] if oval else []
    return np.column_stack([_ways(angles, heights), heights, *harmonics])


def _ways(angles: FloatArray, heights: FloatArray) -> FloatArray:
    """Return how distances from an axis change with the axis and the radius of a cylinder, shape (n, 5)."""
    cosines, sines = np.cos(angles), np.sin(angles)
    return np.column_stack([cosines, sines, heights * cosines, heights * sines, np.ones(len(cosines))])


def _distances(axis: FloatArray, places: FloatArray, heights: FloatArray) -> FloatArray:
    """Return the distances of places in sections from an axis: two offsets and two tilts, which are small."""
    dx = places[:, 0] - axis[0] - axis[2] * heights
    dy = places[:, 1] - axis[1] - axis[3] * heights
    return np.asarray(np.hypot(dx, dy))


def _slopes(axis: FloatArray, places: FloatArray, heights: FloatArray) -> FloatArray:
    """Return how these distances change with the axis, shape (C, 4)."""
    dx = places[:, 0] - axis[0] - axis[2] * heights
    dy = places[:, 1] - axis[1] - axis[3] * heights
    distances = np.hypot(dx, dy)
    cosines, sines = dx / distances, dy / distances
    return -np.column_stack([cosines, sines, heights * cosines, heights * sines])


def _least_squares(places: FloatArray, heights: FloatArray) -> FloatArray | None:
    """Return the axis of least squares; None if the places determine none."""
    axis = np.zeros(4)
    for _ in range(STEPS):
        distances = _distances(axis, places, heights)
        rows = np.column_stack([_slopes(axis, places, heights), -np.ones(len(heights))])
        sizes = np.linalg.norm(rows, axis=0)
        if not np.isfinite(sizes).all() or not sizes.all():
            return None
        step, _, rank, _ = np.linalg.lstsq(rows / sizes, distances.mean() - distances, rcond=1e-10)
        if rank < 5:
            return None
        axis = axis + (step / sizes)[:4]
        if np.abs(step).max() < 1e-12 * np.abs(distances).max():
            break
    return axis


def _minimum_zone(axis: FloatArray, places: FloatArray, heights: FloatArray) -> float:
    """Return the least width of two coaxial cylinders between which all places lie, from an axis that is near.

    A linear program in the axis, the middle radius and half the width, repeated about each axis found. Only the extreme
    places matter: those that a solution leaves outside are added until there is none.
    """
    from scipy.optimize import linprog  # noqa: PLC0415  half a second

    scale = float(np.abs(heights).max()) or 1.0
    best = float(np.ptp(_distances(axis, places, heights)))
    for _ in range(STEPS):
        distances, slopes = _distances(axis, places, heights), _slopes(axis, places, heights)
        slopes[:, 2:] /= scale
        order = np.argsort(distances)
        active = np.unique(np.concatenate([order[:FIRST_EXCHANGE], order[-FIRST_EXCHANGE:]]))
        step = np.zeros(4)
        middle = float(distances.mean())
        for _ in range(STEPS):
            rows, ones = slopes[active], np.ones((len(active), 1))
            above = np.hstack([rows, -ones, -ones])
            below = np.hstack([-rows, ones, -ones])
            off = distances[active] - middle
            found = linprog(
                [0, 0, 0, 0, 0, 1], np.vstack([above, below]), np.concatenate([-off, off]), bounds=(None, None)
            )
            if found.x is None:
                return best
            step = np.asarray(found.x[:4])
            away = np.abs(distances - middle + slopes @ step - found.x[4])
            out = np.flatnonzero(away > found.x[5] + 1e-9 * best)
            fresh = np.setdiff1d(out, active)
            if not len(fresh):
                break
            active = np.union1d(active, fresh[np.argsort(-away[fresh])[:FIRST_EXCHANGE]])
        step[2:] /= scale
        width = float(np.ptp(_distances(axis + step, places, heights)))
        if not width < best * (1.0 - 1e-9):
            break
        axis, best = np.asarray(axis + step), width
    return best


def _robustly(rows: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit linear parameters by Tukey's weights; return them, their covariance, and what is left of the values."""
    sizes = np.linalg.norm(rows, axis=0)
    sizes = np.where(sizes > 0, sizes, 1.0)
    scaled = rows / sizes
    weights: FloatArray = np.ones(len(values))
    shape: FloatArray = np.zeros(rows.shape[1])
    left: FloatArray = values
    spread = 0.0
    for _ in range(STEPS):
        root = np.sqrt(weights)
        solved = np.linalg.lstsq(scaled * root[:, None], values * root, rcond=1e-10)[0]
        shape = solved.astype(np.float64)
        left = values - scaled @ shape
        spread = MAD_SPREAD * float(np.median(np.abs(left)))
        if spread == 0.0:
            break
        weights = np.maximum(1.0 - (left / (TUKEY * spread)) ** 2, 0.0) ** 2
    normal = (scaled * weights[:, None]).T @ scaled
    covariance = spread**2 * np.linalg.pinv(normal, rcond=1e-12)
    return shape / sizes, covariance / np.outer(sizes, sizes), left
