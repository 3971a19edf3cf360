"""Frame -> candidates: slices through windows of every scale, where local curvature has found nothing.

In a large scene the paper's slices through the whole cloud rarely cut a given pipe. Slices through windows do. Two
kinds help where points are few: planes in all directions, and a plane across the longest direction of the points in the
window, as thick as the window. In that one a thin pipe is a circle, however sparse its points are.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.config import SlicingConfig
from cylx.fits.polish import move_to_foot, polish
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.circle import search_circle
from cylx.geometry.cylinder import RADIUS, UX
from cylx.geometry.ellipse import conic_shape, search_conic
from cylx.geometry.kernels import njit
from cylx.geometry.lines import fit_line, off_line
from cylx.geometry.morton import gather_ball
from cylx.geometry.numerics import fill_basis
from cylx.records import Candidates, Explained, Frame, Scale

WINDOW_CAPACITY = 2048
"""Maximum number of points of a window."""
SAMPLES = 48
"""Samples of five points per slice."""
HALF_THICKNESS = 0.15
"""Half thickness of a slice, in radii of its window."""
SLIM = 0.4
"""A window's points are elongated if their scatter about their line is less than this share of their length."""
LEAST_POINTS_OF_SLICE = 15
"""Minimum number of points in a window to search it."""
COUNTS = ("slices", "too few points", "no ellipse", "does not fit")


def slice_windows(
    frame: Frame,
    explained: Explained,
    radius_range: tuple[float, float],
    config: SlicingConfig,
    scale_ratio: float,
    supported: tuple[int, float],
    seed: int,
    threads: int,
) -> tuple[Candidates, dict[str, int]]:
    """Propose a cylinder for each window that holds unexplained points.

    Parameters
    ----------
    frame : Frame
    explained : Explained
        Points in flat windows or on candidates of local curvature; they get no windows.
    radius_range : tuple of float
        Least and greatest radius, frame units.
    config : SlicingConfig
    scale_ratio : float
        Ratio of successive window radii.
    supported : (int, float)
        Minimum number of points of a candidate, and minimum share of the points in its window.
    seed : int
    threads : int
        Does not change the result.

    Returns
    -------
    candidates : Candidates
    counts : dict of str to int
        Number of slices, and the reasons of those without a candidate.
    """
    parts: list[Candidates] = []
    totals = np.zeros(len(COUNTS), np.int64)
    for radius in reversed(frame.window_radii(scale_ratio)):
        scale = Scale.of(frame, radius, explained.flatness == 0)
        if len(scale.points) < LEAST_POINTS_OF_SLICE:
            continue
        open_points = ~explained.curved[scale.indices]
        seeds = scale.seeds(config.windows // 2, open_points)
        stride = max(1, math.ceil(len(seeds) / config.windows))
        rows, counts = _look(frame, scale, seeds[::stride], radius_range, config.local_planes, supported, seed, threads)
        totals += counts
        good = rows[:, 7] > 0
        parts.append(Candidates.of_windows(rows[good], radius, scale.points[seeds[::stride][good]]))
    return Candidates.joined(parts), dict(zip(COUNTS, totals.tolist(), strict=True))


def _look(
    frame: Frame,
    scale: Scale,
    seeds: IndexArray,
    radius_range: tuple[float, float],
    planes: int,
    supported: tuple[int, float],
    seed: int,
    threads: int,
) -> tuple[FloatArray, IndexArray]:
    """Search the windows about all seeds, in chunks over threads; the random draws of a window depend on its place."""
    seeds = np.ascontiguousarray(seeds)  # or the kernel would be compiled for each layout
    rows = np.zeros((len(seeds), 9))
    chunks = np.array_split(np.arange(len(seeds)), max(1, min(8 * threads, len(seeds) // 16)))
    noises = frame.noise.about(scale.points[seeds], 2.0 * scale.radius)
    draws = scale.codes[seeds] ^ np.int64(0x2545F491 * (seed + 1))

    def work(chunk: IndexArray) -> IndexArray:
        counts = np.zeros(len(COUNTS), np.int64)
        if len(chunk):
            part = slice(int(chunk[0]), int(chunk[-1]) + 1)
            _slice_windows(
                scale.points,
                scale.cells,
                scale.starts,
                scale.side,
                seeds[part],
                2.0 * scale.radius,
                noises[part],
                draws[part],
                planes,
                radius_range,
                supported,
                rows[part],
                counts,
            )
        return counts

    with ThreadPoolExecutor(threads) as pool:
        totals = np.sum(list(pool.map(work, chunks)), axis=0)
    return rows, np.asarray(totals, dtype=np.int64)


@njit(cache=True, nogil=True)
def _draw(state: int) -> int:
    """Return the next state of a xorshift generator; its upper bits can be used as random numbers."""
    state ^= (state << 13) & 0x7FFFFFFFFFFFFFFF
    state ^= state >> 7
    state ^= (state << 17) & 0x7FFFFFFFFFFFFFFF
    return state


@njit(cache=True, nogil=True)
def _slice_windows(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    seeds: IndexArray,
    reach: float,
    noises: FloatArray,
    draws: IndexArray,
    planes: int,
    radius_range: tuple[float, float],
    supported: tuple[int, float],
    rows: FloatArray,
    counts: IndexArray,
) -> None:
    found, samples = np.empty(WINDOW_CAPACITY, np.int64), np.empty((SAMPLES, 5), np.int64)
    around, alone, flat = np.empty((3, WINDOW_CAPACITY)), np.empty((3, WINDOW_CAPACITY)), np.empty((2, WINDOW_CAPACITY))
    model, normal, basis, shape, quality = np.empty(7), np.empty(3), np.empty((2, 3)), np.empty(5), np.empty(3)
    for s in range(len(seeds)):
        seed, noise, state = points[seeds[s]], noises[s], (draws[s] & 0x7FFFFFFFFFFFFFFF) | 1
        for _ in range(4):
            state = _draw(state)
        n = gather_ball(points, cells, starts, side, seed, reach, found)
        if n < LEAST_POINTS_OF_SLICE:
            continue
        _copy_about(points, found, n, seed, around)
        least, greatest = max(radius_range[0], 4.0 * noise), min(radius_range[1], 0.75 * reach)
        rows[s, 7] = 0.0
        for p in range(planes + 1):
            counts[0] += 1
            # the first one across the longest direction, as thick as the window; the others in all directions
            thick, offset, size = HALF_THICKNESS * reach, 0.0, n
            if p == 0:
                thick, size = math.inf, _pick_slim(around, n, reach, normal, alone)
            else:
                state = _draw(_fill_normal(state, normal))
                k = (state >> 20) % n
                offset = around[0, k] * normal[0] + around[1, k] * normal[1] + around[2, k] * normal[2]
            fill_basis(normal, basis)
            own = alone if p == 0 else around
            m = _project(own, size, normal, offset, thick, basis, flat)
            if m < LEAST_POINTS_OF_SLICE:
                counts[1] += 1
                continue
            state = _fill_samples(state, m, samples)
            if not _find_shape(flat, m, samples, noise, reach, p == 0, least, greatest, shape):
                counts[2] += 1
                continue
            fits = False
            for turn in range(1 if p == 0 else 2):
                _set_model(normal, offset, basis, shape, 1.0 if turn == 0 else -1.0, model)
                low, high = max(radius_range[0], 0.5 * model[RADIUS]), min(radius_range[1], 2.0 * model[RADIUS])
                fit = polish(own, size, model, noise, low, high, supported[0], supported[1], 0.5 * low, quality)
                fits = fits or fit == 2
                if fit == 2 and quality[0] > rows[s, 7]:
                    move_to_foot(model, seed)
                    for d in range(7):  # a slice assignment takes seconds to compile, for its error message on shapes
                        rows[s, d] = model[d]
                    rows[s, 7], rows[s, 8] = quality[0], quality[1]
            counts[3] += 0 if fits else 1


@njit(cache=True, nogil=True)
def _copy_about(points: FloatArray, found: IndexArray, n: int, seed: FloatArray, around: FloatArray) -> None:
    """Copy the points of a window, with its seed at zero."""
    for a in range(n):
        for d in range(3):
            around[d, a] = points[found[a], d] - seed[d]


@njit(cache=True, nogil=True)
def _pick_slim(xyz: FloatArray, n: int, reach: float, direction: FloatArray, out: FloatArray) -> int:
    """Fill in the points along the longest direction of the points about zero, if they are slim; return their number.

    Among several pipes side by side, a smaller part of the window shows the one at its centre.
    """
    place = np.zeros(3)
    for part in (1.0, 0.6, 0.36):
        for d in range(3):
            place[d] = 0.0
        across, along = fit_line(xyz, n, part * reach, place, direction)
        if across < SLIM * along:
            m = 0
            for i in range(n):
                if off_line(xyz, i, place, direction) < 3.0 * across:
                    for d in range(3):
                        out[d, m] = xyz[d, i]
                    m += 1
            return m
    return 0


@njit(cache=True, nogil=True)
def _fill_samples(state: int, count: int, samples: IndexArray) -> int:
    """Draw samples of five out of `count` points; return the next state."""
    for k in range(len(samples)):
        for d in range(5):
            state = _draw(state)
            samples[k, d] = (state >> 20) % count
    return state


@njit(cache=True, nogil=True)
def _find_shape(
    flat: FloatArray,
    n: int,
    samples: IndexArray,
    noise: float,
    reach: float,
    across: bool,
    least: float,
    greatest: float,
    shape: FloatArray,
) -> bool:
    """Fill in the ellipse of a slice, a circle if it lies across a cylinder; return False if few points support it."""
    if across:
        support = search_circle(flat, n, samples, 3.0 * noise + 0.02 * reach, least, greatest, shape)
    else:
        conic = np.empty(6)
        tolerance = 3.0 * noise + 0.06 * HALF_THICKNESS * reach
        support = search_conic(flat, n, samples, tolerance, least, greatest, 3.0, conic)
        if support > 0.0 and not conic_shape(conic, shape):
            return False
    return support >= 0.5 * LEAST_POINTS_OF_SLICE and support >= 0.25 * n


@njit(cache=True, nogil=True)
def _fill_normal(state: int, normal: FloatArray) -> int:
    """Draw a direction evenly from the sphere; return the next state."""
    state = _draw(state)
    z = 2.0 * ((state >> 20) % 1048576) / 1048576.0 - 1.0
    state = _draw(state)
    turn = 2.0 * math.pi * ((state >> 20) % 1048576) / 1048576.0
    across = math.sqrt(max(0.0, 1.0 - z * z))
    normal[0], normal[1], normal[2] = across * math.cos(turn), across * math.sin(turn), z
    return state


@njit(cache=True, nogil=True)
def _project(
    xyz: FloatArray, n: int, normal: FloatArray, offset: float, thick: float, basis: FloatArray, flat: FloatArray
) -> int:
    """Fill in the plane coordinates of the points close to a plane; return their number."""
    m = 0
    for i in range(n):
        x, y, z = xyz[0, i], xyz[1, i], xyz[2, i]
        if abs(x * normal[0] + y * normal[1] + z * normal[2] - offset) < thick:
            flat[0, m] = x * basis[0, 0] + y * basis[0, 1] + z * basis[0, 2]
            flat[1, m] = x * basis[1, 0] + y * basis[1, 1] + z * basis[1, 2]
            m += 1
    return m


@njit(cache=True, nogil=True)
def _set_model(
    normal: FloatArray, offset: float, basis: FloatArray, shape: FloatArray, sign: float, model: FloatArray
) -> None:
    """Set one of the two cylinders that intersect a plane in an ellipse: eq. 3 and 4 of the paper."""
    cosine = shape[3] / shape[2]
    sine = sign * math.sqrt(max(0.0, 1.0 - cosine * cosine))
    along, across = math.cos(shape[4]), math.sin(shape[4])
    for d in range(3):
        model[d] = shape[0] * basis[0, d] + shape[1] * basis[1, d] + offset * normal[d]
        model[UX + d] = cosine * normal[d] + sine * (along * basis[0, d] + across * basis[1, d])
    model[RADIUS] = shape[3]
