"""What crosses the surface of a cylinder: lids, rims and tables, and how much of the height is free of it.

A plane across the axis meets the surface in a ring. Its points there lie inside and outside alike, in a slice as thick
as the noise. Where the noise is large, as before a depth camera, such a slice is a good part of a low wall, and pulls
the end of a fit inward or outward. Two things tell it: it holds more points than the other slices, and fewer of them
lie on the surface.
"""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray

SLICES, LEAST_IN_SLICE = 20, 12
"""Slices of the height at most, and the points that the usual one must hold."""
FEWEST_SLICES = 6
"""With fewer slices an end is not told from the middle."""
CROWDED = 1.5
"""A slice that holds so many times what the usual one does has points of something else."""
ASTRAY = 0.6
"""An end is crossed where less than this share of the points in the shell lies on the surface, of what is usual."""
MOST_CUT = 0.3
"""No more than this share of the height is taken off at either end."""


def between_crossings(
    heights: FloatArray, residuals: FloatArray, half: float, near: float, shell: float
) -> tuple[float, float]:
    """Return the heights between which nothing crosses the surface at its ends.

    Parameters
    ----------
    heights, residuals : ndarray of shape (n,)
        Heights of points from the middle of a cylinder, and their distances from its surface, outward; a length.
    half : float
        Half its height.
    near, shell : float
        Points within `near` of the surface are on it; those within `shell`, which is wider, lie about it.

    Returns
    -------
    low, high : float
        -half and half if nothing crosses it.
    """
    within = (np.abs(heights) < half) & (np.abs(residuals) < shell)
    count = _slices_for(int(within.sum()))
    if count < FEWEST_SLICES:
        return -half, half
    place = _slice_of(heights[within], half, count)
    around = np.bincount(place, minlength=count).astype(np.float64)
    on = np.bincount(place[np.abs(residuals[within]) < near], minlength=count).astype(np.float64)
    share = on / np.maximum(around, 1.0)
    middle = slice(count // 4, count - count // 4)
    crossed = around > CROWDED * np.median(around[middle])
    crossed &= share < ASTRAY * np.median(share[middle])
    most = int(MOST_CUT * count)
    first, last = _cut(crossed, most), count - _cut(crossed[::-1], most)
    width = 2.0 * half / count
    return -half + first * width, -half + last * width


def evened(heights: FloatArray, half: float) -> MaskArray:
    """Choose of points of a surface so many that no slice of the height is crowded.

    Parameters
    ----------
    heights : ndarray of shape (n,)
        Heights from the middle, a length.
    half : float
        Half the height; points beyond are all chosen.

    Returns
    -------
    ndarray of bool of shape (n,)
    """
    chosen = np.ones(len(heights), dtype=np.bool_)
    within = np.flatnonzero(np.abs(heights) < half)
    count = _slices_for(len(within))
    if count < FEWEST_SLICES:
        return chosen
    place = _slice_of(heights[within], half, count)
    around = np.bincount(place, minlength=count)
    usual = float(np.median(around[around > 0]))
    for crowded in np.flatnonzero(around > CROWDED * usual):
        own = within[place == crowded]
        chosen[own] = False
        chosen[own[(np.arange(round(usual)) * len(own)) // round(usual)]] = True
    return chosen


def _slices_for(points: int) -> int:
    return min(SLICES, points // LEAST_IN_SLICE)


def _slice_of(heights: FloatArray, half: float, count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.clip(((heights / half + 1.0) * 0.5 * count).astype(np.int64), 0, count - 1)


def _cut(crossed: MaskArray, most: int) -> int:
    """Return how many slices to take off at the start: up to the last crossed one of the first few."""
    where = np.flatnonzero(crossed[:most])
    return int(where[-1]) + 1 if len(where) else 0
