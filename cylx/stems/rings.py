"""Rings: the section across a stem, fitted to points seen along its axis, each side of it with the same weight.

A scanner nearby sees a hundred times as many points of one side as another one of the other side. A stem is not round,
so the sides are given equal weights: the mean radius is what the girth of the stem tells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.fits.correlated_error import shared_variance
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import solve_in_place

SECTORS = 36
TUKEY = 4.685
SPREAD = 1.25
"""Deviation of the points over that of residuals weighed by the biweight at this tuning."""
EFFICIENCY = 1.0 / 0.95
"""Variance of an estimate by the biweight at this tuning over that of least squares, for Gaussian errors."""
STEPS = 25
ON = 3.0
"""Points within so many deviations are on the ring."""
LEAST_POINTS = 12
SETTLED = 1e-4
FORM = tuple(0.01 * (2.0 / n) ** 2 for n in range(2, 7))
"""Usual waves of two, three ... periods about a stem, standard deviations of their cosine and sine, in radii: an oval
whose diameters differ by some percent. Noise hides them, and they count where not all sides are seen."""
EVEN = 0.2
"""A sector with less than this share of the usual points does not weigh as much as the others."""
OVAL_ARC = 1.5 * math.pi
"""Angle that must be seen to tell an oval from a circle."""


class Ring(NamedTuple):
    """A ring.

    Parameters
    ----------
    x, y, radius : float
        Centre and mean radius, lengths.
    deviation : float
        Of the points about it.
    radius_sd : float
        Standard deviation of the radius, with the errors that neighbouring points share.
    arc : float
        Angle covered, radians.
    roundness : float
        Least over greatest diameter of its second harmonic; NaN if less than three quarters are seen.
    on : int
        Number of points on it.
    contrast : float
        Share of the points on the ring among those on it, within it, and in as wide a ring about it, over the arc.
    """

    x: float
    y: float
    radius: float
    deviation: float
    radius_sd: float
    arc: float
    roundness: float
    on: int
    contrast: float


def fit_ring(
    xy: FloatArray, heights: FloatArray, start: tuple[float, float, float], *, drift: float = 0.5, shared: bool = False
) -> Ring | None:
    """Fit a ring to points seen along an axis, from a start.

    Parameters
    ----------
    xy : ndarray of shape (n, 2)
        Across the axis.
    heights : ndarray of shape (n,)
        Along the axis.
    start : (float, float, float)
        Centre and radius.
    drift : float
        Share of the radius by which centre and radius may move from the start.
    shared : bool
        Whether the standard deviation allows for errors that neighbouring points share, which takes a while.

    Returns
    -------
    Ring or None
        None if the fit fails, moves too far, or has too few points.
    """
    if len(xy) < LEAST_POINTS:
        return None
    x, y, r = start
    circle = np.array([x, y, r])
    deviation = _fit(np.ascontiguousarray(xy.T), circle, 0.6 * r, 0.004)
    moved = math.hypot(circle[0] - x, circle[1] - y)
    if not (deviation > 0.0 and moved <= drift * r and abs(circle[2] - r) <= drift * r):
        return None
    offsets = xy - circle[:2]
    distances, angles = np.hypot(*offsets.T), np.arctan2(offsets[:, 1], offsets[:, 0])
    residuals = distances - circle[2]
    on = np.abs(residuals) < ON * deviation
    if on.sum() < LEAST_POINTS:
        return None
    return _measured(circle, deviation, heights, residuals, angles, on, shared=shared)


def _measured(
    circle: FloatArray,
    deviation: float,
    heights: FloatArray,
    residuals: FloatArray,
    angles: FloatArray,
    on: MaskArray,
    *,
    shared: bool,
) -> Ring | None:
    place = ((angles / (2.0 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
    counts = np.bincount(place[on], minlength=SECTORS)
    seen = counts > max(0.5, 0.1 * float(np.median(counts[counts > 0])))
    arc = float(seen.mean()) * 2.0 * math.pi
    radius, roundness = float(circle[2]), math.nan
    influence = _influence_on_circle(angles[on], place[on], counts)
    if arc >= OVAL_ARC:
        means = np.bincount(place[on], residuals[on], minlength=SECTORS)[seen] / counts[seen]
        turn = ((np.arange(SECTORS) + 0.5) / SECTORS - 0.5)[seen] * 2.0 * math.pi
        rows = np.stack([np.ones_like(turn), *(f(k * turn) for k in (1, 2) for f in (np.cos, np.sin))], axis=1)
        solution = np.linalg.pinv(rows)
        found = np.einsum("as,s->a", solution, means)
        share = np.zeros(SECTORS)
        share[seen] = solution[0] / counts[seen]
        influence = share[place[on]]
        swing = math.hypot(found[3], found[4])
        radius += float(found[0])
        roundness = (radius - swing) / (radius + swing)
    about = seen[place]
    inside = int((about & (residuals <= -ON * deviation)).sum())
    outside = int((about & (residuals >= ON * deviation) & (residuals < 2.0 * ON * deviation + 0.3 * radius)).sum())
    count = int((on & about).sum())
    contrast = count / max(1, count + inside + outside)
    white = EFFICIENCY * deviation**2 * float((influence**2).sum())
    common = shared_variance(heights[on], residuals[on], angles[on], radius, influence) if shared else None
    form = _variance_by_form(angles[on], influence, radius)
    variance = white + max(form, 0.0 if common is None else common)
    scatter = _scatter(residuals[on], heights[on], place[on])
    radius -= min(scatter**2 / (2.0 * radius), 0.3 * radius)
    if not (radius > 0.0 and math.isfinite(variance)):
        return None
    return Ring(
        float(circle[0]), float(circle[1]), radius, deviation, math.sqrt(variance), arc, roundness, count, contrast
    )


def _influence_on_circle(angles: FloatArray, place: IndexArray, counts: IndexArray) -> FloatArray:
    """Return the change of the circle's radius by an error of each point, (n,): sectors weigh alike, as in the fit."""
    least = EVEN * float(counts[counts > 0].mean())
    weights = 1.0 / np.maximum(counts[place], least)
    rows = np.stack([np.cos(angles), np.sin(angles), np.ones_like(angles)], axis=1)
    inverse = np.linalg.pinv(np.einsum("ia,ib,i->ab", rows, rows, weights), hermitian=True)
    return np.asarray(np.einsum("a,ia->i", inverse[2], rows) * weights)


def _variance_by_form(angles: FloatArray, influence: FloatArray, radius: float) -> float:
    """Return the variance of the radius that the usual form of stems gives: none if all sides are seen."""
    waves = np.arange(2, 2 + len(FORM))
    sums = np.exp(1j * np.outer(waves, angles)) @ influence
    return float((radius**2 * np.array(FORM) ** 2 * np.abs(sums) ** 2).sum())


def _scatter(residuals: FloatArray, heights: FloatArray, place: IndexArray) -> float:
    """Return the deviation of points about those beside them: noise, without the form of the bark."""
    cell = place * 64 + np.clip(((heights - heights.min()) / 0.1).astype(np.int64), 0, 63)
    _, inverse, counts = np.unique(cell, return_inverse=True, return_counts=True)
    means = np.bincount(inverse, residuals) / counts
    free = len(residuals) - len(counts)
    if free < 10:
        return float(residuals.std())
    return math.sqrt(float(((residuals - means[inverse]) ** 2).sum()) / free)


@njit(cache=True, nogil=True)
def _fit(xy: FloatArray, circle: FloatArray, width: float, floor: float) -> float:
    """Move a circle to the robust least squares with equal weights of the sectors; return the deviation, 0 if none."""
    n = xy.shape[1]
    matrix, right = np.empty((3, 3)), np.empty(3)
    counts, places = np.zeros(SECTORS), np.zeros(n, np.int64)
    deviation = 0.0
    for step in range(STEPS):
        counts.fill(0.0)
        for i in range(n):
            dx, dy = xy[0, i] - circle[0], xy[1, i] - circle[1]
            if abs(math.sqrt(dx * dx + dy * dy) - circle[2]) < width:
                places[i] = int((math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * SECTORS) % SECTORS
                counts[places[i]] += 1.0
        filled, total = 0, 0.0
        for s in range(SECTORS):
            if counts[s] > 0.0:
                filled += 1
                total += counts[s]
        if filled < 3:
            return 0.0
        least = EVEN * total / filled
        for a in range(3):
            right[a] = 0.0
            for b in range(3):
                matrix[a, b] = 0.0
        weights, squares = 0.0, 0.0
        for i in range(n):
            dx, dy = xy[0, i] - circle[0], xy[1, i] - circle[1]
            d = math.sqrt(dx * dx + dy * dy) + 1e-300
            e = d - circle[2]
            rest = 1.0 - (e / width) ** 2
            if rest <= 0.0:
                continue
            weight = rest * rest / max(counts[places[i]], least)
            u, v = dx / d, dy / d
            matrix[0, 0] += weight * u * u
            matrix[0, 1] += weight * u * v
            matrix[1, 1] += weight * v * v
            matrix[0, 2] += weight * u
            matrix[1, 2] += weight * v
            matrix[2, 2] += weight
            right[0] += weight * e * u
            right[1] += weight * e * v
            right[2] += weight * e
            weights += weight
            squares += weight * e * e
        matrix[1, 0], matrix[2, 0], matrix[2, 1] = matrix[0, 1], matrix[0, 2], matrix[1, 2]
        if weights <= 0.0 or not solve_in_place(matrix, right):
            return 0.0
        size = 0.0
        for d_ in range(3):
            move = min(max(right[d_], -0.3 * circle[2]), 0.3 * circle[2])
            circle[d_] += move
            size = max(size, abs(move))
        if circle[2] <= 0.0:
            return 0.0
        deviation = SPREAD * math.sqrt(squares / weights)
        width = max(floor, min(0.9 * width, TUKEY * deviation)) if step < 10 else max(floor, TUKEY * deviation)
        if size < SETTLED * circle[2] and step > 8:
            break
    return deviation
