"""Frame -> candidates: the second source beside the paper's slices.

The paper leaves open where candidates come from (section 3.2). A window that is small against a cylinder holds a piece
of a quadric, whose curvatures give the cylinder (`cylx.geometry.quadric`). Windows of all sizes are tried, coarse to
fine; what is flat in a large window is not looked at again in smaller ones.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.config import CandidatesConfig
from cylx.fits.polish import move_to_foot, polish
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import RADIUS, UX, UZ
from cylx.geometry.kernels import njit
from cylx.geometry.morton import cell_starts, gather_ball
from cylx.geometry.numerics import fill_basis
from cylx.geometry.quadric import fit_plane, osculating_cylinder
from cylx.records import CELL, Candidates, Explained, Frame, Scale, StageReport

WINDOW_CAPACITY = 2048
"""Most points of a window; thinned windows over one surface hold about 600."""
FEW_SEEDS = 3000
"""Scales with fewer windows than this get them more closely."""
FLAT_SHARE = 0.9
"""Share of a window's points within three noises of its plane that makes it flat."""
OUTCOMES = ("too few points", "flat", "no curvature", "does not fit", "badly supported", "kept")
LEAST_POINTS_OF_SCALE = 25
LEAST_POINTS_OF_CELL = 4
"""No window is laid about points that have fewer than this in their cell: most of them are noise."""
WINDOW_COLUMNS = 9
"""Numbers a window fills in: the model (7), inliers, extent."""


def find_curved_windows(
    frame: Frame, radius_range: tuple[float, float], config: CandidatesConfig, threads: int
) -> tuple[Candidates, Explained, StageReport]:
    """Propose a cylinder for each window whose points are curved one way.

    Parameters
    ----------
    frame : Frame
    radius_range : tuple of float
        Least and greatest radius, frame units.
    config : CandidatesConfig
    threads : int
        Does not change the result.

    Returns
    -------
    candidates : Candidates
    explained : Explained
        Which points lie in flat windows, and which on candidates.
    report : StageReport
    """
    explained = Explained(np.zeros(len(frame.points)), np.zeros(len(frame.points), np.bool_))
    parts: list[Candidates] = []
    counts = np.zeros(len(OUTCOMES), np.int64)
    for radius in reversed(frame.window_radii(config.octave)):
        scale = Scale.of(frame, radius, explained.flatness == 0)
        if len(scale.points) < LEAST_POINTS_OF_SCALE:
            continue
        seeds = scale.seeds(FEW_SEEDS, least=LEAST_POINTS_OF_CELL)
        rows, outcome, planes, marks = _look(frame, scale, seeds, radius_range, config, threads)
        counts += np.bincount(outcome, minlength=len(OUTCOMES))
        scale.spread(marks, explained.curved)
        flat = outcome == 1
        if flat.any():
            _mark_flat(frame, scale, seeds[flat], planes[flat], explained.flatness)
        parts.append(Candidates.of_windows(rows[outcome == 5], radius, scale.points[seeds[outcome == 5]]))
    found = Candidates.joined(parts)
    rejected = {name: int(n) for name, n in zip(OUTCOMES[:5], counts[:5], strict=True) if n}
    return found, explained, StageReport("curvature", int(counts.sum()), len(found), rejected)


def _look(
    frame: Frame,
    scale: Scale,
    seeds: IndexArray,
    radius_range: tuple[float, float],
    config: CandidatesConfig,
    threads: int,
) -> tuple[FloatArray, IndexArray, FloatArray, MaskArray]:
    """Look through the windows about all seeds, in chunks over threads."""
    rows, planes = np.zeros((len(seeds), WINDOW_COLUMNS)), np.zeros((len(seeds), 6))
    outcome, marks = np.zeros(len(seeds), np.int64), np.zeros(len(scale.points), np.bool_)
    noises = frame.noise.about(scale.points[seeds], 2.0 * scale.radius)
    chunks = np.array_split(np.arange(len(seeds)), max(1, min(8 * threads, len(seeds) // 64)))

    def work(chunk: IndexArray) -> None:
        if len(chunk) == 0:
            return
        first, last = int(chunk[0]), int(chunk[-1]) + 1
        _scan(
            scale.points,
            scale.cells,
            scale.starts,
            scale.side,
            seeds[first:last],
            scale.radius,
            noises[first:last],
            radius_range[0],
            radius_range[1],
            config.min_inliers,
            config.min_share,
            rows[first:last],
            outcome[first:last],
            planes[first:last],
            marks,
        )

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, chunks))
    return rows, outcome, planes, marks


@njit(cache=True, nogil=True)
def _scan(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    seeds: IndexArray,
    radius: float,
    noises: FloatArray,
    least: float,
    greatest: float,
    min_inliers: int,
    min_share: float,
    rows: FloatArray,
    outcome: IndexArray,
    planes: FloatArray,
    marks: MaskArray,
) -> None:
    found = np.empty(WINDOW_CAPACITY, np.int64)
    around, inner = np.empty((3, WINDOW_CAPACITY)), np.empty((3, WINDOW_CAPACITY))
    plane, local = np.empty((2, 3)), np.empty((4, WINDOW_CAPACITY))
    matrix, vectors = np.empty((6, 6)), np.empty((3, 3))
    right, axes = np.empty(6), np.empty((2, 3))
    quality = np.empty(3)
    for s in range(len(seeds)):
        seed, model, noise = points[seeds[s]], rows[s, :7], noises[s]
        n = gather_ball(points, cells, starts, side, seed, 2.0 * radius, found)
        m = _center_window(points, found, n, seed, radius, around, inner)
        if m < 12 or n < 20:
            outcome[s] = 0
            continue
        if fit_plane(around, n, noise, plane[0], plane[1], matrix, vectors) > FLAT_SHARE:
            outcome[s] = 1
            for d in range(3):
                planes[s, d] = plane[0, d] + seed[d]
                planes[s, 3 + d] = plane[1, d]
            continue
        outcome[s] = 2
        fit_plane(inner, m, noise, plane[0], plane[1], matrix, vectors)
        if not osculating_cylinder(inner, m, noise, plane[0], plane[1], model, matrix, right, axes, local):
            continue
        if not (max(0.35 * radius, 4.0 * noise) <= model[RADIUS] <= 14.0 * radius):
            continue
        outcome[s] = 3
        low, high = max(0.3 * radius, 4.0 * noise, least), min(16.0 * radius, greatest)
        outcome[s] += polish(around, n, model, noise, low, high, min_inliers, min_share, 0.8 * radius, quality)
        if outcome[s] < 5:
            continue
        _mark_explained(around, found, n, model, 3.0 * noise, axes, marks)
        move_to_foot(model, seed)
        rows[s, 7], rows[s, 8] = quality[0], quality[1]


@njit(cache=True, nogil=True)
def _center_window(
    points: FloatArray,
    found: IndexArray,
    n: int,
    seed: FloatArray,
    radius: float,
    around: FloatArray,
    inner: FloatArray,
) -> int:
    """Copy a window's points, its seed at zero, to `around`, and those within `radius` to `inner`; count these."""
    m = 0
    for a in range(n):
        square = 0.0
        for d in range(3):
            around[d, a] = points[found[a], d] - seed[d]
            square += around[d, a] ** 2
        if square < radius * radius:
            for d in range(3):
                inner[d, m] = around[d, a]
            m += 1
    return m


@njit(cache=True, nogil=True)
def _mark_explained(
    xyz: FloatArray,
    found: IndexArray,
    n: int,
    model: FloatArray,
    width: float,
    basis: FloatArray,
    marks: MaskArray,
) -> None:
    """Mark the points of a window that lie on its cylinder; threads may mark the same ones, which does no harm."""
    fill_basis(model[UX : UZ + 1], basis)
    for i in range(n):
        dx, dy, dz = xyz[0, i] - model[0], xyz[1, i] - model[1], xyz[2, i] - model[2]
        x = dx * basis[0, 0] + dy * basis[0, 1] + dz * basis[0, 2]
        y = dx * basis[1, 0] + dy * basis[1, 1] + dz * basis[1, 2]
        if abs(math.sqrt(x * x + y * y) - model[RADIUS]) < width:
            marks[found[i]] = True


def _mark_flat(frame: Frame, scale: Scale, seeds: IndexArray, planes: FloatArray, flatness: FloatArray) -> None:
    """Return the points about flat windows, within three noises of their planes, the radius of the window."""
    cells, starts = cell_starts(frame.codes, scale.level + CELL)
    places = scale.points[seeds]
    widths = 3.0 * frame.noise.about(places, 2.0 * scale.radius)
    _mark(frame.points, cells, starts, scale.side, places, planes, 2.0 * scale.radius, widths, flatness)


@njit(cache=True, nogil=True)
def _mark(
    points: FloatArray,
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    seeds: FloatArray,
    planes: FloatArray,
    reach: float,
    widths: FloatArray,
    flatness: FloatArray,
) -> None:
    found = np.empty(len(points), np.int64)
    for s in range(len(seeds)):
        n = gather_ball(points, cells, starts, side, seeds[s], reach, found)
        for a in range(n):
            i = found[a]
            if flatness[i] == 0.0:
                height = 0.0
                for d in range(3):
                    height += (points[i, d] - planes[s, d]) * planes[s, 3 + d]
                if abs(height) < widths[s]:
                    flatness[i] = reach
