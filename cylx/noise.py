"""Spacing and noise of a cloud, read off small pieces of its surfaces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.geometry.morton import BITS, cell_starts, gather_ball
from cylx.geometry.sorting import sort_in_place

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

SAMPLE = 3000
"""Neighbourhoods looked at; the mode of their noise then scatters by about 4 %."""
NEIGHBOURS = (48, 96, 192)
"""Sizes of a neighbourhood: the next is taken where the patch is not wide against its thickness."""
WIDE = 4.0
"""A patch is wide if its in-plane rms exceeds its thickness this many times."""
FLAT = 8.0
"""A patch says something of the noise of its place if it is wide this many times: what is thicker may be no surface."""
AGREED = 16
"""Patches that a cell needs to say something of its own noise."""
PIECES, PATCH = 600, 64
"""Larger pieces looked at, and the points of each."""
MAD_SHRINKAGE = 0.93
"""What the median absolute deviation of 48 quadric residuals shows of a Gaussian's standard deviation, as a share."""


class Patches(NamedTuple):
    """Small pieces of surface.

    Parameters
    ----------
    middles : ndarray of shape (m,)
        Index of the point each was taken about.
    deviations : ndarray of shape (m,)
        Standard deviations about their quadrics.
    """

    middles: IndexArray
    deviations: FloatArray


def measure_surface(
    points: FloatArray, codes: IndexArray, unit: float, rng: np.random.Generator
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

    Returns
    -------
    spacing, dense, noise : float
        Median spacing, spacing of the densest tenth, standard deviation about the surface.
    patches : Patches
        Where what was measured.
    """
    sample = np.sort(rng.choice(len(points), min(SAMPLE, len(points)), replace=False))
    level = 0
    while level < BITS and len(codes) < 24 * np.count_nonzero(np.diff(codes >> (3 * level))) + 24:
        level += 1
    cells, starts = cell_starts(codes, level)
    spread = np.full(len(sample), np.nan)
    deviation = np.full(len(sample), np.nan)
    spacing = np.full(len(sample), np.nan)
    flat = np.zeros(len(sample), np.bool_)
    for count in NEIGHBOURS:
        todo = np.flatnonzero(np.isnan(spread))
        size = min(count, len(points) - 1)
        if len(todo) == 0:
            break
        if size < 9:
            continue
        near, radius = _nearest(points, cells, starts, unit * 2.0**level, sample[todo], size)
        sd, width = quadric_spread(points[near])
        wide = width > WIDE * sd
        spread[todo[wide]] = sd[wide]
        flat[todo[wide]] = width[wide] > FLAT * sd[wide]
        third = np.flatnonzero(wide)[::3] if wide.any() else np.arange(0, len(todo), 3)
        deviation[todo[third]] = _core_spread(points[near[third]])
        fresh = np.isnan(spacing[todo])
        spacing[todo[fresh]] = (radius * math.sqrt(math.pi / size))[fresh]
    known = np.isfinite(spacing) & (spacing > 0)
    if not known.any():  # a handful of points: their extent is all there is to go by
        guess = float(np.linalg.norm(np.ptp(points, axis=0))) / math.sqrt(len(points))
        return guess, guess, 0.1 * guess, Patches(np.empty(0, np.int64), np.empty(0))
    typical, dense = np.quantile(spacing[known], [0.5, 0.1])
    good = np.isfinite(spread) & (spread > 1e-9 * typical)
    clear = good & flat
    cores = deviation[np.isfinite(deviation)]
    noise = 1e-3 * typical  # noise-free surfaces still have a scale below which nothing is told apart
    if good.any():
        plain, robust = half_sample_mode(spread[good]), half_sample_mode(cores + 1e-12 * typical)
        # heavy outliers blow up the plain estimate alone
        noise = max(noise, robust / MAD_SHRINKAGE if robust < 0.85 * MAD_SHRINKAGE * plain else plain)
    return float(typical), float(dense), float(noise), Patches(sample[clear], spread[clear])


def noise_by_place(places: FloatArray, ratios: FloatArray, extent: float) -> tuple[float, IndexArray, FloatArray]:
    """Measure where the noise exceeds the usual one: in cells that hold enough patches most of which agree.

    Parameters
    ----------
    places : ndarray of shape (m, 3)
        Of patches, from zero.
    ratios : ndarray of shape (m,)
        Standard deviations of the patches over the usual one.
    extent : float
        Side of the cube that holds the cloud.

    Returns
    -------
    side : float
        Of the cells.
    cells : ndarray of shape (C, 3), int64
        Those of which something is known; none if it is the same everywhere.
    factors : ndarray of shape (C,)
        How many times the usual noise there is.
    """
    none = np.empty((0, 3), np.int64), np.empty(0)
    side = 1.01 * extent
    while len(places) >= AGREED:
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
        # what is less may be the scatter of the estimate; and a quiet floor says nothing of what stands on it
        factors[c] = mode if known[c] and mode > 1.3 else 1.0
    if not (factors != 1.0).any():
        return side, *none
    return side, cells[known], factors[known]


def noise_by_size(
    points: FloatArray, codes: IndexArray, unit: float, spacing: float, noise: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Measure the noise over larger and larger flat pieces, as long as there are such and most of them agree.

    The residuals of curved pieces show their shape as soon as they are large; those of flat ones show noise at any
    size.
    """
    sizes, deviations = [4.0 * spacing], [noise]
    while len(sizes) < 5:
        size = 2.0 * sizes[-1]
        level = min(BITS, max(0, math.floor(math.log2(size / unit))))
        cells, starts = cell_starts(codes, level)
        sample = np.sort(rng.choice(len(points), min(PIECES, len(points)), replace=False))
        patches = np.empty((len(sample), PATCH, 3))
        full = np.zeros(len(sample), np.bool_)
        _fill_patches(points, cells, starts, unit * 2.0**level, sample, size, patches, full)
        if full.mean() < 0.5:
            break
        sd, width = quadric_spread(patches[full])
        value = np.maximum(np.minimum(sd, _core_spread(patches[full]) / MAD_SHRINKAGE), 1e-12 * spacing)
        covariance = np.einsum("mki,mkj->mij", *2 * (patches[full] - patches[full].mean(axis=1, keepdims=True),))
        thickness = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, 0], 0.0) / PATCH)
        flat = (value < width / 8.0) & (thickness < 2.0 * value)
        if flat.sum() < max(20, 0.15 * len(flat)):
            break
        mode = half_sample_mode(value[flat])
        if (np.abs(np.log(value[flat] / mode)) < 0.3).mean() < 0.4:
            break
        sizes.append(size)
        deviations.append(min(max(mode, deviations[-1]), 2.0 * deviations[-1]))
    # a tenth is the scatter of the estimate itself
    grown = np.where(np.array(deviations) > 1.15 * noise, deviations, noise)
    return np.array(sizes), np.maximum.accumulate(grown)


@njit(cache=True, nogil=True)
def _fill_patches(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    size: float,
    patches: FloatArray,
    full: NDArray[np.bool_],
) -> None:
    """Fill each patch with points evenly picked from the ball about a sample point, if it holds enough of them."""
    found = np.empty(40000, np.int64)
    count = patches.shape[1]
    for s in range(len(sample)):
        n = gather_ball(points, cells, starts, side, points[sample[s]], size, found)
        full[s] = n >= count
        if full[s]:
            for a in range(count):
                for d in range(3):
                    patches[s, a, d] = points[found[(a * n) // count], d]


def half_sample_mode(values: FloatArray) -> float:
    """Give the mode of positive values: the half-sample mode of their logarithms.

    Parameters
    ----------
    values : ndarray of shape (n,)
        Positive, n >= 1.

    References
    ----------
    D. R. Bickel and R. Fruehwirth, On a fast, robust estimator of the mode, CSDA 50 (2006).
    """
    logs = np.sort(np.log(values))
    while len(logs) > 3:
        half = len(logs) // 2 + 1
        start = int(np.argmin(logs[half - 1 :] - logs[: len(logs) - half + 1]))
        logs = logs[start : start + half]
    return float(np.exp(logs.mean()))


@njit(cache=True, nogil=True)
def _balls(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    sample: IndexArray,
    size: int,
    near: IndexArray,
    radius: FloatArray,
) -> None:
    room = np.empty(len(points) if len(points) < 20000 else 20000, np.int64)
    squares, ordered = np.empty(len(points)), np.empty(len(points))
    for s in range(len(sample)):
        center = points[sample[s]]
        reach, found = side, room
        n = gather_ball(points, cells, starts, side, center, reach, found)
        while n <= size:
            reach *= 1.5
            if reach > 12.0 * side:  # far from most others: there are more cells about it than points
                n, found = len(points), np.empty(len(points), np.int64)
                for i in range(n):
                    found[i] = i
            else:
                n = gather_ball(points, cells, starts, side, center, reach, found)
        for a in range(n):
            i = found[a]
            squares[a] = (
                (points[i, 0] - center[0]) ** 2 + (points[i, 1] - center[1]) ** 2 + (points[i, 2] - center[2]) ** 2
            )
            ordered[a] = squares[a]
        sort_in_place(ordered, n)
        k = 0
        for strictly in (True, False):  # of points equally far, those that come first
            for a in range(n):
                if k <= size and (squares[a] < ordered[size] if strictly else squares[a] == ordered[size]):
                    near[s, k] = found[a]
                    k += 1
        radius[s] = math.sqrt(ordered[size])


def _nearest(
    points: FloatArray, cells: IndexArray, starts: IndexArray, side: float, sample: IndexArray, size: int
) -> tuple[IndexArray, FloatArray]:
    """Give the `size` nearest neighbours of each sample point, itself among them, and the distance of the last."""
    near, radius = np.empty((len(sample), size + 1), np.int64), np.empty(len(sample))
    _balls(points, cells, starts, side, sample, size, near, radius)
    return near, radius


def quadric_spread(patches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit a quadric over the plane of each patch by least squares.

    Parameters
    ----------
    patches : ndarray of shape (m, k, 3)

    Returns
    -------
    deviations, widths : ndarray of shape (m,)
        Standard deviation of the residuals, k - 6 degrees of freedom; in-plane root mean square.
    """
    design, height, width = _over_own_plane(patches)
    residuals = _residuals(design, height, np.ones_like(height))
    count = patches.shape[1]
    return np.sqrt((residuals**2).mean(axis=1) * count / (count - 6)), width


def _core_spread(patches: FloatArray) -> FloatArray:
    """Give the scatter of the core of each patch about its quadric, by the median: outliers move it little."""
    design, height, _ = _over_own_plane(patches)
    weights = np.ones_like(height)
    residuals = height
    for _ in range(8):  # least absolute residuals first, then the core about them
        residuals = _residuals(design, height, weights)
        size = np.abs(residuals)
        weights = 1.0 / np.maximum(size, 0.1 * np.median(size, axis=1, keepdims=True) + 1e-300)
    core = np.ones_like(height, dtype=np.bool_)
    for _ in range(4):
        core = np.abs(residuals) <= 2.5 * 1.4826 * _masked_median(np.abs(residuals), core)
        residuals = _residuals(design, height, core.astype(np.float64))
    freedom = np.sqrt(core.sum(axis=1) / np.maximum(core.sum(axis=1) - 6, 1))
    return np.asarray(1.4826 * _masked_median(np.abs(residuals), core)[:, 0] * freedom)


def _over_own_plane(patches: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give design matrix (m, k, 6), heights (m, k) and in-plane rms (m,) of patches over their principal planes."""
    offsets = patches - patches.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", offsets, offsets))
    height, x, y = (np.einsum("mki,mi->mk", offsets, axes[:, :, a]) for a in (0, 1, 2))
    width = np.sqrt((x * x + y * y).mean(axis=1))
    scale = np.where(width > 0, width, 1.0)[:, None]
    x, y = x / scale, y / scale
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1), height, width


def _residuals(design: FloatArray, height: FloatArray, weights: FloatArray) -> FloatArray:
    """Give the residuals of one weighted least-squares fit a patch: design (m, k, 6), height and weights (m, k)."""
    weighted = design * weights[..., None]
    gram = np.einsum("mki,mkj->mij", weighted, design)
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    terms = np.linalg.solve(gram, np.einsum("mki,mk->mi", weighted, height)[..., None])[..., 0]
    return np.asarray(height - np.einsum("mki,mi->mk", design, terms), dtype=np.float64)


def _masked_median(values: FloatArray, mask: NDArray[np.bool_]) -> FloatArray:
    """Give the median of the masked values of each row, shape (m, 1); each row has some."""
    ordered = np.sort(np.where(mask, values, np.inf), axis=1)
    count = np.maximum(mask.sum(axis=1, keepdims=True), 1)
    low, high = (np.take_along_axis(ordered, half, axis=1) for half in ((count - 1) // 2, count // 2))
    return np.asarray(0.5 * (low + high), dtype=np.float64)
