"""Which points of a cloud lie as on surfaces: neither copies of others nor lines that are far denser than wide.

The nearest points of a point on a scan line, of a ring or of a profile lie on that line. They are a curve, or a piece
of the scan plane, and tell nothing of the surface: its noise would be that of the instrument's angles, its spacing that
along the line. One point of each voxel is left of such a cloud, of voxels so large that lines become surfaces.
"""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.morton import BITS, cell_starts, pick_one
from cylx.scene.neighbours import nearest_points
from cylx.scene.noise_patches import rod_spread

SAMPLED = 400
"""Neighbourhoods looked at, evenly over the cloud."""
SMALL, LARGE = 16, 96
"""Points of a neighbourhood, and of the larger one it is held against."""
NARROW = 0.3
"""A neighbourhood whose narrower direction is less than this share of its width is a curve."""
THIN = 0.25
"""A neighbourhood whose thickness is less than this share of its narrower direction is a plane."""
TURNED = 0.7
"""Cosine between the planes of a small and of a large neighbourhood, below which the small one is no piece of it."""
LINES, SURFACES = 0.42, 0.15
"""Share of the neighbourhoods that are lines in a cloud of scan lines, and in one that has been thinned enough."""
FEWEST = 150
"""A cloud is not thinned to fewer points."""


ROD, ROD_LENGTH = 48, 192
"""Points of a piece of a rod whose cross-section is looked at, and of the piece that tells its direction."""
RODS = 0.5
"""Share of the neighbourhoods that are pieces of rods in a cloud of rods."""


def points_on_surfaces(points: FloatArray, codes: IndexArray, unit: float, threads: int = 1) -> IndexArray:
    """Return the points of a cloud on which surfaces can be measured.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order, from zero.
    codes : ndarray of shape (N,)
    unit : float
        Side of the smallest cell.
    threads : int
        Do not change the result.

    Returns
    -------
    ndarray of int64
        Ascending indices: all points but copies of others; of a cloud of scan lines, one of each voxel.
    """
    single = np.flatnonzero(np.concatenate([[True], (points[1:] != points[:-1]).any(axis=1)]))
    if len(single) < FEWEST or share_of_lines(points[single], codes[single], unit, threads) < LINES:
        return single
    occupied, best, least = len(single), single, 1.0
    for level in range(1, BITS):
        kept = single[pick_one(*cell_starts(codes[single], level))]
        if len(kept) < FEWEST:
            break
        if len(kept) > 0.7 * occupied:  # the cells are still smaller than the gaps along the lines
            continue
        occupied = len(kept)
        share = share_of_lines(points[kept], codes[kept], unit, threads)
        if share < least - 0.05:
            best, least = kept, share
        if share < SURFACES:
            break
    return best


def share_of_lines(points: FloatArray, codes: IndexArray, unit: float, threads: int = 1) -> float:
    """Return the share of small neighbourhoods that are no piece of the surface about them, in [0, 1]."""
    sample = np.unique(np.linspace(0, len(points) - 1, SAMPLED).astype(np.int64))
    level = 0
    while level < BITS and len(codes) < 24 * np.count_nonzero(np.diff(codes >> (3 * level))) + 24:
        level += 1
    cells, starts = cell_starts(codes, level)
    side = unit * 2.0**level
    if len(spreads_of_rods(points, cells, starts, side, sample, threads)):
        return 0.0  # the thinnest rods are seen all round, and are no lines
    near, _ = nearest_points(points, cells, starts, side, sample, min(LARGE, len(points) - 1), threads)
    squares = ((points[near] - points[sample][:, None]) ** 2).sum(axis=2)
    closest = np.argsort(squares, axis=1, kind="stable")[:, : SMALL + 1]
    _, widths, axes = _planes(points[np.take_along_axis(near, closest, axis=1)])
    _, _, wider = _planes(points[near])
    curve = widths[:, 1] < NARROW**2 * widths[:, 2]
    # where noise is as large as the neighbourhood, no plane can be told
    sheet = widths[:, 0] < THIN**2 * widths[:, 1]
    turned = sheet & (np.abs((axes[:, :, 0] * wider[:, :, 0]).sum(axis=1)) < TURNED)
    return float((curve | turned).mean())


def spreads_of_rods(
    points: FloatArray, cells: IndexArray, starts: IndexArray, side: float, sample: IndexArray, threads: int
) -> FloatArray:
    """Return the scatter of rods thinner than any neighbourhood about circles across them; empty if there are few."""
    if len(points) <= 2 * ROD_LENGTH:
        return np.empty(0)
    long, _ = nearest_points(points, cells, starts, side, sample, ROD_LENGTH, threads)
    near, _ = nearest_points(points, cells, starts, side, sample, ROD, threads)
    spread, is_rod = rod_spread(points[long], points[near])
    return spread[is_rod] if is_rod.mean() > RODS else np.empty(0)


def _planes(patches: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return middles, ascending variances and principal directions (columns) of patches (m, k, 3)."""
    middles = patches.mean(axis=1)
    offsets = patches - middles[:, None]
    variances, axes = np.linalg.eigh(offsets.transpose(0, 2, 1) @ offsets)
    return middles, variances, axes
