"""How many places about an axis have points: a circle goes through any three."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray

PLACES = 12.0
"""More places than these about an axis tell no more."""
GAP_BEYOND_CHANCE = 4.0
"""A gap this much wider than is to be expected by chance is none by chance."""
SPARSE = 0.2
"""Where there is less than this share of the usual density, points lie between lines."""
LINE_SHARE = 0.1
"""Fewer points than this share are not a line but strays."""


def distinct_places(angles: FloatArray, radius: float, deviation: float) -> float:
    """Count the places about the axis where there are points, as far as the noise tells them apart.

    A circle goes through any three lines of points that are parallel to its axis, as a scanner that turns about the
    upright sees upright edges. Points without gaps, as far as can be told from their number, count as many.

    Parameters
    ----------
    angles : ndarray of shape (n,)
        Angles of the points about the axis, radians.
    radius, deviation : float
        Of the surface, in one unit.

    Returns
    -------
    places : float
        At most `PLACES`.
    """
    count = len(angles)
    if count < 2:
        return float(count)
    ordered = np.sort(angles)
    gaps = np.diff(np.append(ordered, ordered[0] + 2.0 * math.pi))
    first = int(np.argmax(gaps)) + 1
    ordered = np.concatenate([ordered[first:], ordered[:first] + 2.0 * math.pi])
    ordered = ordered[_dense(ordered, 1.5 * deviation / radius)]
    # the widest gap to be expected of so many points at random is log(n) / n of the arc
    count = len(ordered)
    widest = GAP_BEYOND_CHANCE * (ordered[-1] - ordered[0]) * math.log(count) / count
    cuts = np.flatnonzero(np.diff(ordered) > max(widest, 3.0 * deviation / radius)) + 1
    lines = [line for line in np.split(ordered, cuts) if len(line) >= LINE_SHARE * count]
    if len(lines) < 2:
        return PLACES
    places = 0.0
    for line in lines:
        width = (line[-1 - len(line) // 20] - line[len(line) // 20]) * radius
        places += 1.0 + min(PLACES, width / max(6.0 * deviation, 1e-300))
    return min(places, PLACES)


def _dense(ordered: FloatArray, reach: float) -> MaskArray:
    """Return which of sorted angles have so many others within reach that they do not lie between lines."""
    near = np.searchsorted(ordered, ordered + reach, "right") - np.searchsorted(ordered, ordered - reach)
    usual = 2.0 * reach * len(ordered) / max(float(ordered[-1] - ordered[0]), 2.0 * reach, 1e-300)
    return np.asarray(near >= SPARSE * usual, dtype=np.bool_)
