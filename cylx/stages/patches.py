"""Frame -> candidates: where the noise is so low that the nearest points of each point show the surface.

Windows are too large for short and small surfaces: the rim of a disc, a bore of eighty points. Where the noise is a
small share of the spacing, sixteen points tell the normal and the curvature. A cylinder that osculates a patch is
fitted to the points about it whose normals are radial, so that what meets its surface at an edge has no say.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cylx.config import CandidatesConfig
from cylx.fits.polish import move_to_foot, polish
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.kernels import njit
from cylx.geometry.morton import cell_starts, gather_ball
from cylx.geometry.patches import SIZE, TERMS, choose_patches, fit_patches, osculating_of
from cylx.geometry.planar import find_planar
from cylx.records import Candidates, Explained, Frame, Nearby, StageReport

MOST_NOISE = 0.28
"""Noise in spacings up to which patches of sixteen points show the curvature of a surface."""
PEELED = 0.07
"""Noise in spacings up to which the points of planes are told from those of what meets them."""
MOST_PATCHES = 60000
"""Most points that get a patch."""
REACH = 2.6, 12.0
"""The nearest points are looked for within so many spacings at first, and at last."""
SHARP = 0.05
"""Scatter of a patch on one surface, as a share of its radius, beyond what the noise makes."""
PAIRS = 24
"""Pairs of points whose normals are tried at a place."""
SUPPORT = 12
"""Points that must support one."""
LEAST_SINE = 0.3
"""Normals that enclose a smaller angle tell little of the axis."""
MOST_SEEDS = 6000
"""Places where a cylinder is looked for, evenly over the points."""
RADIAL = 0.9
"""Cosine between the normal of a point and the direction from the axis, from which the point may be on a cylinder."""
CAPACITY = 8192
MOST = 400
"""Points that suffice for a candidate."""
OUTCOMES = ("no curvature", "does not fit", "badly supported", "kept")


def find_curved_patches(
    frame: Frame, explained: Explained, radius_range: tuple[float, float], config: CandidatesConfig, threads: int
) -> tuple[Candidates, Nearby | None, StageReport]:
    """Propose a cylinder for each patch of nearest points that is curved one way.

    Returns
    -------
    candidates : Candidates
        Of patches, which are drawn evenly over the surface.
    nearby : Nearby or None
        None if the noise hides what the nearest points show.
    report : StageReport
    """
    noise = frame.noise.least
    peeled = noise <= PEELED
    which = np.flatnonzero(explained.flatness <= (2.01 * frame.window if peeled else 0.0))
    which = np.ascontiguousarray(which[:: 1 + len(which) // MOST_PATCHES])  # one layout: one compiled kernel
    if noise > MOST_NOISE or len(which) < SIZE:
        return Candidates.joined([]), None, StageReport("patches", 0, 0, {})
    normals = np.zeros((len(frame.points), 3), np.float32)
    level = max(0, round(math.log2(REACH[0] / frame.unit)))
    side = frame.unit * 2.0**level
    cells, starts = cell_starts(frame.codes, level)
    planes, planar = np.zeros((len(which), 3), np.float32), np.zeros(len(which), np.bool_)

    def peel(part: slice) -> None:
        find_planar(frame.points, cells, starts, side, which[part], *REACH, noise, planes[part], planar[part])

    if peeled:
        _in_parts(peel, len(which), threads)
    normals[which] = planes
    within = planar & planes.any(axis=1)
    # what lies on no plane is looked at by itself, so that no patch of it crosses an edge
    rest = which[~planar]
    if len(rest) < SIZE:
        return Candidates.joined([]), Nearby(normals, which, within), StageReport("patches", 0, 0, {})
    points, every = np.ascontiguousarray(frame.points[rest]), np.arange(len(rest))
    own_cells, own_starts = cell_starts(frame.codes[rest], level)
    patches, members = np.empty((len(rest), TERMS)), np.empty((len(rest), SIZE), np.int64)

    def fit(part: slice) -> None:
        fit_patches(points, own_cells, own_starts, side, every[part], *REACH, patches[part], members[part])

    _in_parts(fit, len(rest), threads)
    owners, own = np.empty(len(rest), np.int64), np.empty((len(rest), 3))
    choose_patches(points, every, every, patches, members, owners, own)
    sharp = (owners >= 0) & (patches[owners, 13] < np.maximum(3.0 * noise, SHARP * patches[owners, 14]))
    own[~sharp] = 0.0
    normals[rest] = own
    seeds = np.unique(owners[sharp])
    seeds = np.ascontiguousarray(seeds[:: 1 + len(seeds) // MOST_SEEDS])
    kept_patches = patches[seeds]
    cells, starts = own_cells, own_starts
    seen = normals[rest]
    rows, outcome = np.zeros((len(seeds), 10)), np.zeros(len(seeds), np.int64)

    def look(part: slice) -> None:
        _propose(
            points, seen, cells, starts, side, kept_patches[part], seeds[part], noise, radius_range[0], radius_range[1],
            config.min_inliers, rows[part], outcome[part],
        )  # fmt: skip

    _in_parts(look, len(seeds), threads)
    kept = rows[outcome == 3]
    found = Candidates.of_windows(kept[:, :9], kept[:, 9], points[seeds[outcome == 3]])
    counts = np.bincount(outcome, minlength=4)
    rejected = {name: int(n) for name, n in zip(OUTCOMES[:3], counts[:3], strict=True) if n}
    return found, Nearby(normals, which, within), StageReport("patches", len(seeds), len(kept), rejected)


def _in_parts(work: Callable[[slice], None], count: int, threads: int) -> None:
    """Call a function for slices of so many things, over threads."""
    step = max(1, -(-count // (8 * threads)))
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, [slice(first, first + step) for first in range(0, count, step)]))


@njit(cache=True, nogil=True)
def _propose(
    points: FloatArray,
    normals: NDArray[np.float32],
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    patches: FloatArray,
    seeds: IndexArray,
    noise: float,
    least: float,
    greatest: float,
    min_inliers: int,
    rows: FloatArray,
    outcome: IndexArray,
) -> None:
    found, own = np.empty(CAPACITY, np.int64), np.empty((3, CAPACITY))
    terms, basis, model, quality = np.empty(6), np.empty((2, 3)), np.empty(7), np.empty(3)
    for s in range(len(patches)):
        patch, size = patches[s], patches[s, 14]
        smallest, largest = max(0.3 * size, 4.0 * noise, least), min(40.0 * size, greatest)
        # what the curve of the patch rises by must exceed what noise and the quadric leave open
        curved = osculating_of(patch, terms, basis, model) and smallest <= model[6] <= largest
        if curved and size * size >= 4.0 * max(noise, patch[13]) * model[6]:
            outcome[s] = 1 + _settle(
                points, normals, cells, starts, side, patch[:3], size, noise, least, greatest, min_inliers,
                model, found, own, quality,
            )  # fmt: skip
        if outcome[s] < 3:
            n = gather_ball(points, cells, starts, side, points[seeds[s]], 2.5 * size, found)
            if _fill_from_normals(points, normals, seeds[s], found, n, noise, smallest, largest, model):
                outcome[s] = 1 + _settle(
                    points, normals, cells, starts, side, patch[:3], size, noise, least, greatest, min_inliers,
                    model, found, own, quality,
                )  # fmt: skip
        if outcome[s] == 3:
            for d in range(3):
                model[d] -= patch[d]
            move_to_foot(model, patch[:3])
            for d in range(7):
                rows[s, d] = model[d]
            reach = min(max(2.5 * size, 1.5 * model[6]), 10.0 * size)
            rows[s, 7], rows[s, 8], rows[s, 9] = quality[0], quality[1], 0.5 * reach


@njit(cache=True, nogil=True)
def _settle(
    points: FloatArray,
    normals: NDArray[np.float32],
    cells: IndexArray,
    starts: IndexArray,
    side: float,
    center: FloatArray,
    size: float,
    noise: float,
    least: float,
    greatest: float,
    min_inliers: int,
    model: FloatArray,
    found: IndexArray,
    own: FloatArray,
    quality: FloatArray,
) -> int:
    """Fit a rough cylinder to more and more of the points about a place whose normals are radial; as `polish` says."""
    reach, fit = 2.5 * size, 0
    for turn in range(3):
        n = gather_ball(points, cells, starts, side, center, reach, found)
        band = max(0.1 * model[6], 0.5 * reach * reach / model[6]) if turn == 0 else 0.05 * model[6]
        band = min(max(band, 6.0 * noise), 0.5 * model[6])
        m = _pick_radial(points, normals, found, n, center, model, 0.5 if turn == 0 else RADIAL, band, own)
        if m < min_inliers:
            return 0
        for d in range(3):
            model[d] -= center[d]
        low, high = max(0.5 * model[6], least), min(2.0 * model[6], greatest)
        fit = polish(own, m, model, noise, low, high, min_inliers, 0.5, 0.5 * size, quality)
        for d in range(3):
            model[d] += center[d]
        if fit == 0:
            return 0
        reach = min(max(2.5 * size, 1.5 * model[6]), 2.5 * reach, 10.0 * size)
    return fit


@njit(cache=True, nogil=True)
def _fill_from_normals(
    points: FloatArray,
    normals: NDArray[np.float32],
    seed: int,
    found: IndexArray,
    n: int,
    noise: float,
    least: float,
    greatest: float,
    model: FloatArray,
) -> bool:
    """Fill in the cylinder through a point and one of those about it, with their normals, that most of these support.

    Two points with their normals are a minimal sample of a cylinder: the axis is across both normals, and meets both.
    """
    trial, most = np.empty(7), 0
    stride = 1 + n // PAIRS
    for a in range(0, n, stride):
        if not _fill_from_pair(points, normals, seed, found[a], trial) or not least <= trial[6] <= greatest:
            continue
        tolerance, count = max(3.0 * noise, 0.03 * trial[6]), 0
        for b in range(n):
            i = found[b]
            dx, dy, dz = points[i, 0] - trial[0], points[i, 1] - trial[1], points[i, 2] - trial[2]
            height = dx * trial[3] + dy * trial[4] + dz * trial[5]
            dx, dy, dz = dx - height * trial[3], dy - height * trial[4], dz - height * trial[5]
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            if abs(distance - trial[6]) < tolerance:
                turn = abs(dx * normals[i, 0] + dy * normals[i, 1] + dz * normals[i, 2])
                count += 1 if turn > RADIAL * distance else 0
        if count > most:
            most = count
            for d in range(7):
                model[d] = trial[d]
    return most >= SUPPORT


@njit(cache=True, nogil=True)
def _fill_from_pair(points: FloatArray, normals: NDArray[np.float32], i: int, j: int, model: FloatArray) -> bool:
    """Fill in the cylinder through two points with their normals; False if these are nearly parallel."""
    ax, ay, az = float(normals[i, 0]), float(normals[i, 1]), float(normals[i, 2])
    bx, by, bz = float(normals[j, 0]), float(normals[j, 1]), float(normals[j, 2])
    ux, uy, uz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    if length < LEAST_SINE:
        return False
    ux, uy, uz = ux / length, uy / length, uz / length
    dx, dy, dz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    # where the line along the first normal passes the other one: both lie across the axis
    cx, cy, cz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    one = (cx * ux + cy * uy + cz * uz) / length
    cx, cy, cz = dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax
    other = (cx * ux + cy * uy + cz * uz) / length
    if one * other == 0.0:
        return False
    radius = 0.5 * (abs(one) + abs(other))
    if abs(abs(one) - abs(other)) > 0.3 * radius:
        return False
    model[0], model[1], model[2] = points[i, 0] + one * ax, points[i, 1] + one * ay, points[i, 2] + one * az
    model[3], model[4], model[5], model[6] = ux, uy, uz, radius
    return True


@njit(cache=True, nogil=True)
def _pick_radial(
    points: FloatArray,
    normals: NDArray[np.float32],
    found: IndexArray,
    n: int,
    seed: FloatArray,
    model: FloatArray,
    cosine: float,
    band: float,
    own: FloatArray,
) -> int:
    """Fill in the points, the seed at zero, whose normals are radial; count them."""
    m, stride = 0, 1 + n // CAPACITY
    for a in range(0, n, stride):
        i = found[a]
        dx, dy, dz = points[i, 0] - model[0], points[i, 1] - model[1], points[i, 2] - model[2]
        height = dx * model[3] + dy * model[4] + dz * model[5]
        dx, dy, dz = dx - height * model[3], dy - height * model[4], dz - height * model[5]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        turn = abs(dx * normals[i, 0] + dy * normals[i, 1] + dz * normals[i, 2])
        if turn > cosine * distance and abs(distance - model[6]) < band:
            for d in range(3):
                own[d, m] = points[i, d] - seed[d]
            m += 1
    return m
