"""The angle about an axis that points cover."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray

SECTORS = 36
LIKELY_STEPS = 8


def covered_angle(angles: FloatArray) -> float:
    """Return the angle that points cover about an axis, radians.

    A sector counts if it holds at least 15 % of the points in a typical filled sector. With more points, the sectors
    are finer.
    """
    if len(angles) == 0:
        return 0.0
    fine = int(np.clip(len(angles) // 20, SECTORS, 360))
    return float(filled_sectors(angles, fine).mean()) * 2.0 * math.pi


def likely_angle(angles: FloatArray) -> float:
    """Return the angle that a surface covers if its points lie at random: a few leave sectors of it empty by chance.

    Of k points in each of the sectors that it covers, on average, a share of exp(-k) stays empty.
    """
    share = covered_angle(angles) / (2.0 * math.pi)
    likely = share
    for _ in range(LIKELY_STEPS if share > 0.0 else 0):
        likely = min(1.0, share / -math.expm1(-len(angles) / (SECTORS * likely)))
    return likely * 2.0 * math.pi


def filled_sectors(angles: FloatArray, sectors: int, share: float = 0.15) -> MaskArray:
    """Return which sectors hold more than a share of the points in a typical filled sector."""
    index = ((angles / (2.0 * np.pi) + 0.5) * sectors).astype(np.int64) % sectors
    counts = np.bincount(index, minlength=sectors)
    return np.asarray(counts > max(0.5, share * float(np.median(counts[counts > 0]))), dtype=np.bool_)


def sector_of(angles: FloatArray) -> IndexArray:
    """Return the index of the sector, of `SECTORS`, for each angle (radians)."""
    return np.floor((angles / (2.0 * np.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
