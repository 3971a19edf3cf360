"""Variation of the noise over the cloud and with the size of a piece."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.morton import BITS, cell_starts, gather_ball
from cylx.scene.noise_patches import MAD_SHRINKAGE, core_spread, half_sample_mode, quadric_spread

MOST_NOISE_FACTOR = 8.0
"""Upper limit of the noise of a place relative to the usual noise: larger scatter is not a surface."""
AGREED = 16
"""Patches that a cell needs for a noise of its own."""
LARGE_PIECES, POINTS_OF_PIECE = 600, 64
"""Number of larger pieces, and points of each."""


def noise_by_place(places: FloatArray, ratios: FloatArray, extent: float) -> tuple[float, IndexArray, FloatArray]:
    """Measure where the noise exceeds the usual noise: in cells with enough patches, most of which agree.

    Parameters
    ----------
    places : ndarray of shape (m, 3)
        Positions of the patches, from zero.
    ratios : ndarray of shape (m,)
        Standard deviations of the patches relative to the usual noise.
    extent : float
        Side of the cube that holds the cloud.

    Returns
    -------
    side : float
        Side of the cells.
    cells : ndarray of shape (C, 3), int64
        Cells with a noise of their own; empty if the noise is the same everywhere.
    factors : ndarray of shape (C,)
        Noise in these cells relative to the usual noise.
    """
    none = np.empty((0, 3), np.int64), np.empty(0)
    side = 1.01 * extent
    for _ in range(20):
        corner = np.floor(places / (0.5 * side)).astype(np.int64)
        cells, owner = np.unique(corner, axis=0, return_inverse=True)
        if len(places) < 2 * AGREED * len(cells):
            break
        side *= 0.5
    corner = np.floor(places / side).astype(np.int64)
    cells, owner = np.unique(corner, axis=0, return_inverse=True)
    factors, known = np.ones(len(cells)), np.zeros(len(cells), np.bool_)
    for c in range(len(cells)):
        own = ratios[owner.ravel() == c]
        if len(own) < AGREED:
            continue
        mode = half_sample_mode(own)
        known[c] = (np.abs(np.log(own / mode)) < 0.3).mean() >= 0.6
        # a smaller value may be scatter of the estimate; and a quiet floor says nothing about the objects on it
        factors[c] = min(mode, MOST_NOISE_FACTOR) if known[c] and mode > 1.3 else 1.0
    if not (factors != 1.0).any():
        return side, *none
    return side, cells[known], factors[known]


def noise_by_size(
    points: FloatArray,
    codes: IndexArray,
    unit: float,
    spacing: float,
    noise: float,
    rng: np.random.Generator,
    threads: int = 1,
) -> tuple[FloatArray, FloatArray]:
    """Measure the noise over larger and larger flat pieces, as long as there are enough and most of them agree.

    The residuals of large curved pieces show their shape; those of flat pieces show the noise at any size.
    """
    larger = [8.0 * spacing, 16.0 * spacing, 32.0 * spacing, 64.0 * spacing]
    samples = [np.sort(rng.choice(len(points), min(LARGE_PIECES, len(points)), replace=False)) for _ in larger]

    def work(size: float, sample: IndexArray) -> float | None:
        return _noise_of_flat(points, codes, unit, size, sample, 1e-12 * spacing)

    with ThreadPoolExecutor(threads) as pool:
        modes = list(pool.map(work, larger, samples))
    sizes, deviations = [4.0 * spacing], [noise]
    for size, mode in zip(larger, modes, strict=True):
        if mode is None:
            break
        sizes.append(size)
        deviations.append(min(max(mode, deviations[-1]), 2.0 * deviations[-1]))
    # a tenth is the scatter of the estimate itself
    grown = np.where(np.array(deviations) > 1.15 * noise, deviations, noise)
    return np.array(sizes), np.maximum.accumulate(grown)


def _noise_of_flat(
    points: FloatArray, codes: IndexArray, unit: float, size: float, sample: IndexArray, least: float
) -> float | None:
    """Return the noise over the flat pieces of one size; None if there are few, or they do not agree."""
    level = min(BITS, max(0, math.floor(math.log2(size / unit))))
    cells, starts = cell_starts(codes, level)
    patches = np.empty((len(sample), POINTS_OF_PIECE, 3))
    full = np.zeros(len(sample), np.bool_)
    _fill_patches(points, cells, starts, unit * 2.0**level, sample, size, patches, full)
    if full.mean() < 0.5:
        return None
    patches = patches[full]
    sd, width, _ = quadric_spread(patches)
    value = np.maximum(np.minimum(sd, core_spread(patches) / MAD_SHRINKAGE), least)
    offsets = patches - patches.mean(axis=1, keepdims=True)
    thickness = np.sqrt(
        np.maximum(np.linalg.eigvalsh(offsets.transpose(0, 2, 1) @ offsets)[:, 0], 0.0) / POINTS_OF_PIECE
    )
    flat = (value < width / 8.0) & (thickness < 2.0 * value)
    if flat.sum() < max(20, 0.15 * len(flat)):
        return None
    mode = half_sample_mode(value[flat])
    return mode if (np.abs(np.log(value[flat] / mode)) < 0.3).mean() >= 0.4 else None


@njit(cache=True, nogil=True)
def _fill_patches(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    size: float,
    patches: FloatArray,
    full: MaskArray,
) -> None:
    """Fill each patch with points picked evenly from the ball about a sample point, if it holds enough points."""
    found = np.empty(40000, np.int64)
    count = patches.shape[1]
    for s in range(len(sample)):
        n = gather_ball(points, cells, starts, side, points[sample[s]], size, found)
        full[s] = n >= count
        if full[s]:
            for a in range(count):
                for d in range(3):
                    patches[s, a, d] = points[found[(a * n) // count], d]
