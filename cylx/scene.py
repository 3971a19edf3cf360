"""What a cloud says about itself: its spacing, its noise, its own frame, and so the meaning of every `null`.

The frame has the spacing as its unit, the corner of the cloud as its zero and the Morton curve as the order of the
points. All stages work in it, which is why unit, origin and order of the points do not change a result.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.config import Config
from cylx.errors import InputError
from cylx.geometry.morton import BITS, cell_starts, gather_ball, morton_codes
from cylx.records import Frame, Noise, Scene

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

SAMPLE = 3000
"""Neighbourhoods looked at; the mode of their noise then scatters by about 4 %."""
NEIGHBOURS = (48, 96, 192)
"""Sizes of a neighbourhood: the next is taken where the patch is not wide against its thickness."""
WIDE = 4.0
"""A patch is wide if its in-plane rms exceeds its thickness this many times."""
PIECES, PATCH = 600, 64
"""Larger pieces looked at, and the points of each."""
MAD_SHRINKAGE = 0.93
"""What the median absolute deviation of 48 quadric residuals shows of a Gaussian's standard deviation, as a share."""


def check_usable(points: FloatArray, place: str) -> None:
    """Refuse a cloud in which no cylinder could be told from anything else.

    Raises
    ------
    InputError
        If there are fewer than 5 points, or all are equal, on a line or on a plane.
    """
    remedy = "a cylinder needs at least 5 points that do not lie on one plane"
    if len(points) < 5:
        raise InputError(place, f"only {len(points)} usable point{'s' if len(points) != 1 else ''}", remedy)
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    if extent == 0:
        raise InputError(place, "all points are equal", remedy)
    offsets = (points - low) / extent
    offsets -= offsets.mean(axis=0)
    widths = np.sqrt(np.maximum(np.linalg.eigvalsh(offsets.T @ offsets / len(points)), 0.0))
    # the covariance of exactly flat points keeps rounding of its own size, and coordinates far away keep theirs
    rounding = 1e-7 + 4.0 * float(np.spacing(np.abs([low, high]).max())) / extent
    if widths[1] < rounding:
        raise InputError(place, "all points lie on one line", remedy)
    if widths[0] < rounding:
        raise InputError(place, "all points lie on one plane", remedy)


def canonical_order(points: FloatArray) -> tuple[FloatArray, IndexArray, IndexArray, float]:
    """Sort points along the Morton curve of their own bounding cube: an order that does not depend on the given one.

    Returns
    -------
    points : ndarray of shape (N, 3)
        Sorted, from zero.
    order : ndarray of shape (N,)
        Where each sorted point stood.
    codes : ndarray of shape (N,)
        Sorted codes.
    unit : float
        Side of the smallest cell.
    """
    offsets = points - points.min(axis=0)
    unit = float(offsets.max()) / (2**BITS - 2)
    codes = morton_codes(offsets, unit)
    order = np.argsort(codes)
    return offsets[order], order, codes[order], unit


def measure_scene(points: FloatArray, seed: int = 0) -> Scene:
    """Read spacing and noise off a cloud.

    Quadrics are fitted to small neighbourhoods: the residuals show the noise, the density shows the spacing. The noise
    is the mode over the neighbourhoods, because edges and contacts of surfaces are thicker than a surface and only the
    surfaces agree.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        N >= 5, scene units.
    seed : int
        Seed of the choice of neighbourhoods.

    Returns
    -------
    Scene
    """
    ordered, _, codes, unit = canonical_order(points)
    spacing, _, noise = _measure(ordered, codes, unit, np.random.default_rng([seed, 1]))
    return Scene(spacing, noise, float(np.linalg.norm(np.ptp(points, axis=0))))


def make_frame(points: FloatArray, config: Config) -> tuple[Frame, Scene]:
    """Measure a cloud and put it into its own frame.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units, usable (see `check_usable`).
    config : Config
        Spacing and noise given here are taken as known.

    Returns
    -------
    frame : Frame
        The points in units of the spacing, in Morton order.
    scene : Scene
        What was measured or given, scene units.
    """
    ordered, order, codes, unit = canonical_order(points)
    rng = np.random.default_rng([config.seed, 1])
    spacing, dense, measured = _measure(ordered, codes, unit, rng)
    noise = config.scene.noise or measured
    sizes, deviations = _noise_by_size(ordered, codes, unit, spacing, measured, rng)
    dense *= (config.scene.spacing or spacing) / spacing
    spacing = config.scene.spacing or spacing
    scene = Scene(spacing, noise, float(np.linalg.norm(np.ptp(points, axis=0))))
    window = max(config.candidates.window_spacings * dense, config.candidates.window_noises * noise) / spacing
    ordered /= spacing
    # cells are powers of two of a voxel that puts about 6 x 6 points of a plane into the radius of the smallest window
    voxel = window / 6.0
    level = max(0, min(BITS - 1, math.floor(math.log2(2.0**BITS * voxel / (float(ordered.max()) + voxel)))))
    unit = voxel / 2.0**level
    codes = morton_codes(ordered, unit)
    again = np.argsort(codes, kind="stable")
    frame = Frame(
        points=np.ascontiguousarray(ordered[again]),
        order=order[again],
        codes=codes[again],
        unit=unit,
        voxel_level=level,
        window=window,
        noise=Noise(sizes / spacing, deviations * (noise / measured) / spacing),
        origin=points.min(axis=0),
        spacing=spacing,
    )
    return frame, scene


def resolve(config: Config, scene: Scene) -> Config:
    """Replace every `null` that means "from the cloud" by its value, in scene units.

    Parameters
    ----------
    config : Config
    scene : Scene

    Returns
    -------
    Config
    """
    least, greatest = config.scene.radius_min, config.scene.radius_max
    thickness = config.slicing.thickness or 2.0 * max(scene.spacing, 2.0 * scene.noise)
    known = {
        "scene": {
            "spacing": scene.spacing,
            "noise": scene.noise,
            "radius_min": least or min(max(3.0 * scene.noise, 0.25 * scene.spacing), greatest or math.inf),
            "radius_max": greatest or max(0.5 * scene.extent, least or 0.0),
        },
        "slicing": {"thickness": thickness},
        "ellipses": {"tolerance": config.ellipses.tolerance or 4.0 * scene.noise + 0.06 * thickness},
    }
    return config.model_copy(
        update={name: getattr(config, name).model_copy(update=values) for name, values in known.items()}
    )


def radius_range(config: Config, frame: Frame) -> tuple[float, float]:
    """Give the least and the greatest radius looked for in frame units, from a resolved configuration."""
    low, high = config.scene.radius_min, config.scene.radius_max
    return (low or 0.0) / frame.spacing, (high or math.inf) / frame.spacing


def _measure(
    points: FloatArray, codes: IndexArray, unit: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Give median spacing, spacing of the densest tenth, and noise."""
    sample = np.sort(rng.choice(len(points), min(SAMPLE, len(points)), replace=False))
    level = 0
    while level < BITS and len(codes) < 24 * np.count_nonzero(np.diff(codes >> (3 * level))) + 24:
        level += 1
    cells, starts = cell_starts(codes, level)
    spread = np.full(len(sample), np.nan)
    deviation = np.full(len(sample), np.nan)
    spacing = np.full(len(sample), np.nan)
    for count in NEIGHBOURS:
        todo = np.flatnonzero(np.isnan(spread))
        size = min(count, len(points) - 1)
        if len(todo) == 0:
            break
        if size < 9:
            continue
        near, radius = _nearest(points, cells, starts, unit * 2.0**level, sample[todo], size)
        sd, mad, width = _quadric_residuals(points[near])
        wide = width > WIDE * sd
        spread[todo[wide]], deviation[todo[wide]] = sd[wide], mad[wide]
        fresh = np.isnan(spacing[todo])
        spacing[todo[fresh]] = (radius * math.sqrt(math.pi / size))[fresh]
    known = np.isfinite(spacing) & (spacing > 0)
    if not known.any():  # a handful of points: their extent is all there is to go by
        guess = float(np.linalg.norm(np.ptp(points, axis=0))) / math.sqrt(len(points))
        return guess, guess, 0.1 * guess
    typical, dense = np.quantile(spacing[known], [0.5, 0.1])
    good = np.isfinite(spread) & (spread > 1e-9 * typical)
    noise = 1e-3 * typical  # noise-free surfaces still have a scale below which nothing is told apart
    if good.any():
        plain, robust = half_sample_mode(spread[good]), half_sample_mode(deviation[good] + 1e-12 * typical)
        # heavy outliers blow up the plain estimate alone
        noise = max(noise, robust / MAD_SHRINKAGE if robust < 0.85 * MAD_SHRINKAGE * plain else plain)
    return float(typical), float(dense), float(noise)


def _noise_by_size(
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
        sd, robust, width = _quadric_residuals(patches[full])
        value = np.maximum(np.minimum(sd, robust / MAD_SHRINKAGE), 1e-12 * spacing)
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
    found = np.empty(len(points) if len(points) < 20000 else 20000, np.int64)
    for s in range(len(sample)):
        center = points[sample[s]]
        reach = side
        n = gather_ball(points, cells, starts, side, center, reach, found)
        while n <= size:
            reach *= 1.5
            n = gather_ball(points, cells, starts, side, center, reach, found)
        squares = np.empty(n)
        for a in range(n):
            i = found[a]
            squares[a] = (
                (points[i, 0] - center[0]) ** 2 + (points[i, 1] - center[1]) ** 2 + (points[i, 2] - center[2]) ** 2
            )
        nearest = np.argsort(squares)
        for a in range(size + 1):
            near[s, a] = found[nearest[a]]
        radius[s] = math.sqrt(squares[nearest[size]])


def _nearest(
    points: FloatArray, cells: IndexArray, starts: IndexArray, side: float, sample: IndexArray, size: int
) -> tuple[IndexArray, FloatArray]:
    """Give the `size` nearest neighbours of each sample point (itself first), and the distance of the last."""
    near, radius = np.empty((len(sample), size + 1), np.int64), np.empty(len(sample))
    _balls(points, cells, starts, side, sample, size, near, radius)
    return near, radius


def _quadric_residuals(patches: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a quadric to each patch (m, k, 3); give sd and scaled MAD of the residuals, and the patch's in-plane rms."""
    count = patches.shape[1]
    offsets = patches - patches.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", offsets, offsets))
    height, x, y = (np.einsum("mki,mi->mk", offsets, axes[:, :, a]) for a in (0, 1, 2))
    width = np.sqrt((x * x + y * y).mean(axis=1))
    scale = np.where(width > 0, width, 1.0)[:, None]
    x, y = x / scale, y / scale
    design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    residuals = _residuals(design, height, np.ones_like(height))
    sd = np.sqrt((residuals**2).mean(axis=1) * count / (count - 6))
    weights = np.ones_like(height)
    for _ in range(8):  # least absolute residuals first, which outliers move little, then the core about them
        residuals = _residuals(design, height, weights)
        weights = 1.0 / np.maximum(
            np.abs(residuals), 0.1 * np.median(np.abs(residuals), axis=1, keepdims=True) + 1e-300
        )
    for _ in range(4):
        core = np.abs(residuals) <= 2.5 * 1.4826 * _masked_median(np.abs(residuals), weights > 0)
        weights = core.astype(np.float64)
        residuals = _residuals(design, height, weights)
    freedom = np.sqrt(core.sum(axis=1) / np.maximum(core.sum(axis=1) - 6, 1))
    return sd, 1.4826 * _masked_median(np.abs(residuals), core)[:, 0] * freedom, width


def _residuals(design: FloatArray, height: FloatArray, weights: FloatArray) -> FloatArray:
    """Give the residuals of one weighted least-squares fit a patch: design (m, k, 6), height and weights (m, k)."""
    weighted = design * weights[..., None]
    gram = np.einsum("mki,mkj->mij", weighted, design)
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    terms = np.linalg.solve(gram, np.einsum("mki,mk->mi", weighted, height)[..., None])[..., 0]
    return np.asarray(height - np.einsum("mki,mi->mk", design, terms), dtype=np.float64)


def _masked_median(values: FloatArray, mask: NDArray[np.bool_]) -> FloatArray:
    """Give the median of the masked values of each row, shape (m, 1)."""
    return np.asarray(np.nanmedian(np.where(mask, values, np.nan), axis=1, keepdims=True), dtype=np.float64)
