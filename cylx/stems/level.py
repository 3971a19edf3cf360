"""The level of the ground over the surface under its lowest points: where the points about each place are densest.

The lowest of many points lies below the ground by some deviations of their noise: two to three, which are centimetres
for a mobile scanner. Above the ground are herbs, so the middle of all points lies above it. The points of the ground
themselves make the densest layer. A histogram of heights about each cell has its peak there, and is symmetric but for
the herbs; the deviation is told by its lower side, and the peak by the points within some deviations of it.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.records.stems import Ground

LOW, HIGH, BIN = -0.2, 0.4, 0.005
"""Heights over the surface of the lowest points that count, and the steps between them, metres."""
ABOUT = (0.75, 2.25)
"""Standard deviation of the weights of the cells about each; the wider one where there are few points; metres."""
FEW = 10.0
"""Points of a cell with half the weight that a cell with many has."""
ENOUGH = 40.0
"""Points about a cell that tell its level."""
COARSE = 0.015
"""Standard deviation of the weights by which the peak is looked for at first, metres."""
WITHIN = 1.5
"""Standard deviation of the weights about the peak, in those of the points below it."""
FINEST = 0.01
"""And at least this, metres: two steps."""
SECOND = 0.5
"""The ground is the lowest peak that has this share of the highest one."""
TURNS = 8
LEAST_TIMES, SURE_TIMES = 2.0, 3.0
"""A layer so many times as dense as above it is surely the ground: a stem alone is as dense all the way up."""
MOST = 0.15
"""The lowest points of a noise that stems can be measured in are not deeper than this, metres."""


def levels_over(points: FloatArray, ground: Ground) -> FloatArray:
    """Return the height of the ground over a surface under its lowest points.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Metres.
    ground : Ground
        The surface under the lowest points.

    Returns
    -------
    ndarray
        A height for each cell of the ground, metres; zero where too few points tell it.
    """
    counts = _counts(points, ground)
    total = counts.sum(axis=2, keepdims=True)
    weighted = counts / (total + FEW)  # a cell near the scanner has a hundred times as many points as another
    out = np.full(counts.shape[:2], math.nan)
    for about in ABOUT:
        missing = ~np.isfinite(out)
        if missing.any():
            wide = about / ground.cell
            enough = _smooth(total[..., 0], wide) * 2.0 * math.pi * wide**2 >= ENOUGH
            found = _peaks(_smooth(weighted, wide))
            out = np.where(missing & enough, found, out)
    return np.asarray(np.nan_to_num(out), np.float64)


def _counts(points: FloatArray, ground: Ground) -> FloatArray:
    """Count the points of each cell by their heights over the surface, shape (rows, columns, steps)."""
    over = points[:, 2] - ground.at(points[:, :2])
    near = (over >= LOW) & (over < HIGH)
    rows, columns = ground.heights.shape
    steps = round((HIGH - LOW) / BIN)
    cells = np.floor((points[near, :2] - ground.corner) / ground.cell).astype(np.int64)
    cells = np.clip(cells, 0, [rows - 1, columns - 1])
    step = np.minimum(((over[near] - LOW) / BIN).astype(np.int64), steps - 1)
    flat = (cells[:, 0] * columns + cells[:, 1]) * steps + step
    return np.bincount(flat, minlength=rows * columns * steps).reshape(rows, columns, steps).astype(np.float64)


def _smooth(values: FloatArray, wide: float) -> FloatArray:
    """Return the weighted means over the cells about each."""
    from scipy.ndimage import gaussian_filter  # noqa: PLC0415  slow to import

    wides = (wide, wide, *(0.0 for _ in values.shape[2:]))
    return np.asarray(gaussian_filter(values, wides, mode="constant", truncate=3.0))


def _peaks(counts: FloatArray) -> FloatArray:
    """Return the height of the peak of each histogram, along the last axis; less of it where it is hardly one."""
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415  slow to import

    heights = LOW + BIN * (np.arange(counts.shape[-1]) + 0.5)
    coarse = np.where(heights <= MOST, gaussian_filter1d(counts, COARSE / BIN, axis=-1, mode="constant"), -1.0)
    high = (coarse[..., 1:] <= coarse[..., :-1]) & (coarse[..., :-1] >= SECOND * coarse.max(axis=-1, keepdims=True))
    peak = heights[np.argmax(high, axis=-1)]  # the first one: herbs are above it
    for turn in range(TURNS + 1):
        off = heights - peak[..., None]
        below = np.where(off < 0.0, counts, 0.0)
        spread = np.sqrt((below * off**2).sum(axis=-1) / np.maximum(below.sum(axis=-1), 1e-300))
        if turn < TURNS:
            weights = counts * np.exp(-0.5 * (off / np.maximum(WITHIN * spread, FINEST)[..., None]) ** 2)
            peak = peak + (weights * off).sum(axis=-1) / np.maximum(weights.sum(axis=-1), 1e-300)
    wide = np.maximum(spread, FINEST)[..., None]
    above = (off > 3.0 * wide) & (off < 5.0 * wide)
    times = _mean_where(counts, np.abs(off) < wide) / np.maximum(_mean_where(counts, above), 1e-300)
    times = np.where(above.any(axis=-1), times, 0.0)
    sure = np.clip((times - LEAST_TIMES) / (SURE_TIMES - LEAST_TIMES), 0.0, 1.0)
    return np.asarray(sure * np.clip(peak, LOW, MOST))


def _mean_where(counts: FloatArray, chosen: MaskArray) -> FloatArray:
    """Return the mean of the chosen counts along the last axis."""
    return np.asarray((counts * chosen).sum(axis=-1) / np.maximum(chosen.sum(axis=-1), 1))
