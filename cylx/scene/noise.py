"""Spacing and noise of a cloud, read off small pieces of its surfaces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.morton import BITS, cell_starts
from cylx.scene.neighbours import nearest_points
from cylx.scene.noise_patches import (
    MAD_SHRINKAGE,
    core_spread,
    finest_mode,
    half_sample_mode,
    quadric_spread,
)
from cylx.scene.scan_lines import spreads_of_rods

NEIGHBOURHOODS_SAMPLED = 3000
"""Neighbourhoods looked at; the mode of their noise then scatters by about 4 %."""
NEIGHBOURS = (48, 96, 192)
"""Sizes of a neighbourhood: the next is taken where the patch is not wide against its thickness."""
FINE = 16
"""Size of the smallest neighbourhood: larger ones cross the edges of small features."""
MOSTLY = 0.7
"""Share of the smallest neighbourhoods that must be wide for them to tell the noise."""
FINER = 0.8
"""The noise is that of the smallest neighbourhoods if it is less than this share of that of the others."""
PARTLY, MUCH_FINER = 0.4, 0.5
"""The same where fewer are wide, down to the first share: of a thick surface the thinnest patches are thinner than it,
but not by so much as those of a plate of which larger ones see both faces."""
THICK_NOISE = 0.3
"""Noise in spacings from which it may be the thickness of rods that are seen all round."""
FILAMENT = 0.3
"""A neighbourhood whose narrower direction is less than this share of its width is a curve, and no surface."""
LEAST_NOISE = 1e-3
"""Noise of a surface without any, in spacings: below it nothing is told apart."""
THICK = (384, 768, 1536, 3072, 6144)
"""Sizes that are tried of a cloud whose noise is so many spacings that few of the patches are wide."""
FEW_WIDE = 0.2
"""Share of the patches below which that is so. Larger ones are tried until half of them are wide."""
POINTS_PER_PATCH_POINT = 8
"""A patch of more than one point of so many is no longer a small piece."""
WIDE_PATCH = 4.0
"""A patch is wide if its in-plane rms exceeds its thickness this many times."""
WIDE_FOR_ITS_PLACE = 8.0
"""A patch says something of the noise of its place if it is wide this many times, and half as many across: what is
thicker may be no surface."""


LEAST_PARTLY = 0.1
"""Noise in spacings that leaves only some of the smallest neighbourhoods wide; with less, as with the steps of a depth
camera, others are not wide for another reason."""


class Patches(NamedTuple):
    """Small pieces of surface.

    Parameters
    ----------
    middles : ndarray of shape (m,)
        Index of the point each was taken about.
    deviations : ndarray of shape (m,)
        Standard deviations about their quadrics.
    radii : ndarray of shape (m,)
    """

    middles: IndexArray
    deviations: FloatArray
    radii: FloatArray


def measure_surface(
    points: FloatArray, codes: IndexArray, unit: float, rng: np.random.Generator, threads: int = 1
) -> tuple[float, float, float, Patches]:
    """Measure how far apart the points of a cloud lie and how far they scatter about their surfaces.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In Morton order, from zero.
    codes : ndarray of shape (N,)
    unit : float
        Side of the smallest cell.
    rng : numpy.random.Generator
    threads : int
        Do not change the result.

    Returns
    -------
    spacing, dense, noise : float
        Median spacing, spacing of the densest tenth, standard deviation about the surface.
    patches : Patches
        Where what was measured.
    """
    sample = np.sort(rng.choice(len(points), min(NEIGHBOURHOODS_SAMPLED, len(points)), replace=False))
    level = 0
    while level < BITS and len(codes) < 24 * np.count_nonzero(np.diff(codes >> (3 * level))) + 24:
        level += 1
    cells, starts = cell_starts(codes, level)
    spread = np.full(len(sample), np.nan)
    deviation = np.full(len(sample), np.nan)
    spacing = np.full(len(sample), np.nan)
    flat, size_of = np.zeros(len(sample), np.bool_), np.zeros(len(sample))
    thickness = 0.0
    enough = FEW_WIDE * len(sample)
    for count in NEIGHBOURS + THICK:
        todo = np.flatnonzero(np.isnan(spread))
        size = min(count, len(points) - 1)
        if len(todo) == 0 or (
            count in THICK and (len(sample) - len(todo) > enough or POINTS_PER_PATCH_POINT * count > len(points))
        ):
            break
        if count in THICK:  # larger ones are fewer: each costs as much more
            todo = np.arange(0, len(sample), 3 * count // THICK[0])
            enough = 0.5 * len(todo)
        if size < 9:
            continue
        near, radius = nearest_points(points, cells, starts, unit * 2.0**level, sample[todo], size, threads)
        sd, width, narrow = quadric_spread(points[near])
        wide = width > WIDE_PATCH * sd
        if count in THICK:
            thickness, spread[:] = float(np.median(sd)), np.nan  # of smaller patches only the thinnest are wide
        spread[todo[wide]] = sd[wide]
        flat[todo[wide]] = (width > WIDE_FOR_ITS_PLACE * sd)[wide] & (narrow > 0.5 * WIDE_FOR_ITS_PLACE * sd)[wide]
        size_of[todo[wide]] = radius[wide]
        third = np.flatnonzero(wide)[::3] if wide.any() else np.arange(0, len(todo), 3)
        deviation[todo[third]] = core_spread(points[near[third]])
        fresh = np.isnan(spacing[todo])
        spacing[todo[fresh]] = (radius * math.sqrt(math.pi / size))[fresh]
    known = np.isfinite(spacing) & (spacing > 0)
    if not known.any():  # a handful of points: their extent is all there is to go by
        guess = float(np.linalg.norm(np.ptp(points, axis=0))) / math.sqrt(len(points))
        return guess, guess, 0.1 * guess, Patches(np.empty(0, np.int64), np.empty(0), np.empty(0))
    typical, dense = np.quantile(spacing[known], [0.5, 0.1])
    good = np.isfinite(spread) & (spread > 1e-9 * typical)
    flawless = np.isfinite(spread).any()
    clear = good & flat
    cores = deviation[np.isfinite(deviation)]
    noise = LEAST_NOISE * typical  # noise-free surfaces still have a scale below which nothing is told apart
    if not good.any() and not flawless:
        noise = max(noise, thickness)  # of the largest patches, which do not look like surfaces; so it is at least that
    if good.any():
        plain, robust = finest_mode(spread[good], LEAST_NOISE * typical), half_sample_mode(cores + 1e-12 * typical)
        # heavy outliers blow up the plain estimate alone
        noise = max(noise, robust / MAD_SHRINKAGE if robust < 0.85 * MAD_SHRINKAGE * plain else plain)
    noise = _finer(noise, points, cells, starts, unit * 2.0**level, sample, typical, threads)
    if good.any():
        # the scatter of a patch has its outliers; what it says of its place is how it compares with that of others
        spread = spread * (noise / plain)
    return float(typical), float(dense), float(noise), Patches(sample[clear], spread[clear], size_of[clear])


def _finer(
    noise: float,
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    typical: float,
    threads: int,
) -> float:
    """Return the noise of the smallest neighbourhoods, or of rods, where it is clearly less than that of the others."""
    if noise > LEAST_NOISE * typical:
        fine, share = _noise_of_fine(points, cells, starts, side, sample, LEAST_NOISE * typical, threads)
        limit = float(np.interp(share, [PARTLY, MOSTLY], [MUCH_FINER, FINER]))
        told = share >= MOSTLY or fine > LEAST_PARTLY * typical
        noise = fine if told and fine < limit * noise else noise
    if noise > THICK_NOISE * typical:
        spreads = spreads_of_rods(points, cells, starts, side, sample[::4], threads)
        rods = finest_mode(spreads, LEAST_NOISE * typical) if len(spreads) else noise
        noise = rods if rods < FINER * noise else noise
    return noise


def _noise_of_fine(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    least: float,
    threads: int,
) -> tuple[float, float]:
    """Return the noise over the smallest neighbourhoods, and the share of these that are wide.

    The noise is infinite if few of them are pieces of a surface.
    """
    size = min(FINE, len(points) - 1)
    if size < 9:
        return math.inf, 0.0
    near, _ = nearest_points(points, cells, starts, side, sample, size, threads)
    sd, width, narrow = quadric_spread(points[near])
    surface = narrow > FILAMENT * width
    wide = surface & (width > WIDE_PATCH * sd)
    if wide.sum() < max(PARTLY * surface.sum(), FEW_WIDE * len(sample)):
        return math.inf, 0.0  # of thick patches only the thinnest are wide
    return finest_mode(sd[wide], least), float(wide.sum() / surface.sum())
