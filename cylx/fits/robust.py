"""Robust orthogonal-distance fit of a cylinder to points: one kernel for candidates, clusters and pieces.

Minimises sum rho(d_i - r) over the five degrees of freedom of a cylinder, d_i being the distance of point i from the
axis, by Gauss-Newton steps under Tukey's biweight. Started in the basin it reaches the Cramer-Rao bound; the radius
keeps the bias sigma^2 / (2 r) of orthogonal distances, which `unbiased_radius` takes off (Al-Sharadqah and Chernov, EJS
3, 2009).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import RADIUS, UX, UY, UZ
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import NUMBERS, fill_basis, solve_in_place

TUKEY = 4.685
"""Tuning constant of the biweight at 95 % efficiency, in standard deviations."""
TUKEY_SPREAD = 1.0989
"""Standard deviation of Gaussian residuals over that of the same residuals weighted by the biweight at 4.685."""


FIT_BEYOND_ENDS = 1.02
"""A fit goes this much further than the ends: the outermost points lie on them, and rounding would choose."""
POLISH_STEPS = 10
SOME, LAST_STEPS = 150, 3
"""Points that suffice for the first steps of a polish, and steps with all of them."""
BLOCK = 256
"""Points of a block of the normal equations; its scratch stays in the fastest memory."""
SHARPEN_STEPS = 12
SHARP = 0.34
"""Largest spread of a polished candidate over the width of its weights: a Gaussian within it has 0.27 of the width, a
uniform background 0.378."""


class WeightSchedule(NamedTuple):
    """Width of the biweight over the steps of a fit.

    Each step takes `decay` times the last width or `tuning` times the spread, whichever is less.

    Parameters
    ----------
    start, floor : float
        First and least half width, length.
    decay : float
        Factor a step, at most 1.
    tuning : float
        Half width in standard deviations of the weighted residuals; infinite: a fixed schedule.
    tolerance : float
        The fit ends when a step is shorter than this share of the spread, and the width has settled.
    """

    start: float
    floor: float
    decay: float
    tuning: float
    tolerance: float = 1e-9


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_block(
    xyz: FloatArray,
    start: int,
    count: int,
    model: FloatArray,
    basis: FloatArray,
    low: float,
    high: float,
    width: float,
    block: FloatArray,
) -> None:
    """Fill in cosine, sine, weight, residual and height of some points.

    What needs roots and divisions sums nothing, so that the processor does several points at once.
    """
    px, py, pz, radius = model[0], model[1], model[2], model[RADIUS]
    ux, uy, uz = model[UX], model[UY], model[UZ]
    fx, fy, fz = basis[0, 0], basis[0, 1], basis[0, 2]
    gx, gy, gz = basis[1, 0], basis[1, 1], basis[1, 2]
    for k in range(count):
        i = start + k
        dx, dy, dz = xyz[0, i] - px, xyz[1, i] - py, xyz[2, i] - pz
        z = dx * ux + dy * uy + dz * uz
        x = dx * fx + dy * fy + dz * fz
        y = dx * gx + dy * gy + dz * gz
        distance = math.sqrt(x * x + y * y) + 1e-300
        residual = distance - radius
        ratio = residual / width
        rest = 1.0 - ratio * ratio
        weight = rest * rest if rest > 0.0 else 0.0
        weight = weight if z >= low else 0.0
        weight = weight if z <= high else 0.0
        block[0, k], block[1, k], block[2, k] = x / distance, y / distance, weight
        block[3, k], block[4, k] = residual, z


@njit(cache=True, nogil=True, error_model="numpy")
def _accumulate(
    xyz: FloatArray,
    n: int,
    model: FloatArray,
    low: float,
    high: float,
    width: float,
    normal: FloatArray,
    right: FloatArray,
    basis: FloatArray,
    sums: FloatArray,
) -> None:
    """Fill the weighted normal equations of a step; `sums` gets the weights, and the squares of residuals."""
    fill_basis(model[UX : UZ + 1], basis)
    block = np.empty((5, BLOCK))
    weights, squares = 0.0, 0.0
    # with (cos, sin, z cos, z sin, 1) as the row of a point, sums of products are shared; scalars stay in registers
    c, s, cc, cs, ss = 0.0, 0.0, 0.0, 0.0, 0.0
    zc, zs, zcc, zcs, zss = 0.0, 0.0, 0.0, 0.0, 0.0
    zzcc, zzcs, zzss = 0.0, 0.0, 0.0
    rc, rs, rzc, rzs, r = 0.0, 0.0, 0.0, 0.0, 0.0
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        _fill_block(xyz, start, count, model, basis, low, high, width, block)
        for k in range(count):
            weight = block[2, k]
            if weight == 0.0:
                continue
            cosine, sine, residual, z = block[0, k], block[1, k], block[3, k], block[4, k]
            wc, ws, wr = weight * cosine, weight * sine, weight * residual
            wcc, wcs, wss, zr = wc * cosine, wc * sine, ws * sine, z * wr
            zwcc, zwcs, zwss = z * wcc, z * wcs, z * wss
            c, s, cc, cs, ss = c + wc, s + ws, cc + wcc, cs + wcs, ss + wss
            zc, zs, zcc, zcs, zss = zc + z * wc, zs + z * ws, zcc + zwcc, zcs + zwcs, zss + zwss
            zzcc, zzcs, zzss = zzcc + z * zwcc, zzcs + z * zwcs, zzss + z * zwss
            rc, rs, r = rc + wr * cosine, rs + wr * sine, r + wr
            rzc, rzs = rzc + zr * cosine, rzs + zr * sine
            weights += weight
            squares += wr * residual
    normal[0, 0], normal[0, 1], normal[0, 2], normal[0, 3], normal[0, 4] = cc, cs, zcc, zcs, c
    normal[1, 1], normal[1, 2], normal[1, 3], normal[1, 4] = ss, zcs, zss, s
    normal[2, 2], normal[2, 3], normal[2, 4] = zzcc, zzcs, zc
    normal[3, 3], normal[3, 4], normal[4, 4] = zzss, zs, weights
    right[0], right[1], right[2], right[3], right[4] = rc, rs, rzc, rzs, r
    for a in range(5):
        normal[a, a] *= 1.0 + 1e-9
        for b in range(a):
            normal[a, b] = normal[b, a]
    sums[0], sums[1] = weights, squares


@njit(cache=True, nogil=True)
def _advance(model: FloatArray, right: FloatArray, basis: FloatArray, reach: float) -> float:
    """Move the model by a step, at most half a radius long; give the undamped length of the step."""
    size = max(max(abs(right[0]), abs(right[1])), abs(right[4]))
    size = max(size, max(abs(right[2]), abs(right[3])) * reach)
    damping = 1.0 if size < 0.5 * model[RADIUS] else 0.5 * model[RADIUS] / size
    length = 0.0
    for d in range(3):
        model[d] += damping * (right[0] * basis[0, d] + right[1] * basis[1, d])
        model[UX + d] += damping * (right[2] * basis[0, d] + right[3] * basis[1, d])
        length += model[UX + d] ** 2
    length = math.sqrt(length)
    for d in range(3):
        model[UX + d] /= length
    model[RADIUS] += damping * right[4]
    return float(size)


@njit(cache=True, nogil=True)
def fit_in_place(
    xyz: FloatArray,
    n: int,
    model: FloatArray,
    low: float,
    high: float,
    schedule: FloatArray,
    normal: FloatArray,
    right: FloatArray,
    basis: FloatArray,
) -> float:
    """Fit `model` = (point, direction, radius), shape (7,), to xyz[:, :n] whose height lies in [low, high].

    Heights are measured from the model's point along its direction. `schedule` (6,) has what a `WeightSchedule` has,
    and the most steps. `normal` (5, 5), `right` (5,) and `basis` (2, 3) are scratch.

    Returns
    -------
    float
        Standard deviation of the weighted residuals at the last step; negative if the fit broke down.
    """
    width, floor, decay, tuning, tolerance = schedule[0], schedule[1], schedule[2], schedule[3], schedule[4]
    spread = width / 3.0
    sums = np.empty(2)
    for _ in range(int(schedule[5])):
        _accumulate(xyz, n, model, low, high, width, normal, right, basis, sums)
        # of heights spread evenly the greatest is sqrt(3) times the root mean square
        reach = math.sqrt(3.0 * max(normal[2, 2] + normal[3, 3], 0.0) / max(sums[0], 1.0))
        if sums[0] < 8.0 or not solve_in_place(normal, right):
            return -1.0
        spread = math.sqrt(sums[1] / sums[0])
        size = _advance(model, right, basis, reach)
        if not (0.0 < model[RADIUS] < 1e12):
            return -1.0
        last = width
        width = max(floor, min(decay * width, tuning * spread))
        if size < tolerance * spread and abs(width - last) <= tolerance * width:
            break
    return float(spread)


def fit_cylinder(
    points: FloatArray, model: FloatArray, *, low: float, high: float, schedule: WeightSchedule, steps: int
) -> tuple[FloatArray, float] | None:
    """Fit a cylinder robustly, starting from a rough one.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    model : ndarray of shape (7,)
        Start: a point of the axis, its unit direction, the radius. Not changed.
    low, high : float
        Only points whose height from the model's point lies between these take part.
    schedule : WeightSchedule
        Schedule of the weight function's width.
    steps : int
        Most Gauss-Newton steps.

    Returns
    -------
    model : ndarray of shape (7,)
        The fitted cylinder.
    spread : float
        Standard deviation of the weighted residuals.

    None if fewer than about eight points take part or the fit diverges.
    """
    fitted = np.array(model, dtype=np.float64)
    scratch = np.empty((5, 5)), np.empty(5), np.empty((2, 3))
    numbers = np.array([*schedule, steps], dtype=np.float64)
    spread = fit_in_place(np.ascontiguousarray(points.T), len(points), fitted, low, high, numbers, *scratch)
    return None if spread < 0 else (fitted, float(spread))


def unbiased_radius(radius: float, spread: float) -> float:
    """Take off the radius the bias sigma^2 / (2 r) that orthogonal distances under isotropic noise have."""
    return radius - spread * spread / (2.0 * radius)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=NUMBERS)
def candidate_quality(
    xyz: FloatArray, n: int, model: FloatArray, width: float, basis: FloatArray, quality: FloatArray
) -> None:
    """Fill the first two of `quality` with what supports a cylinder among xyz[:, :n].

    The inliers (within `width` of the surface), and the extent of their heights.
    """
    fill_basis(model[UX : UZ + 1], basis)
    px, py, pz, radius = model[0], model[1], model[2], model[RADIUS]
    ux, uy, uz = model[UX], model[UY], model[UZ]
    fx, fy, fz = basis[0, 0], basis[0, 1], basis[0, 2]
    gx, gy, gz = basis[1, 0], basis[1, 1], basis[1, 2]
    lowest, highest, count = 1e300, -1e300, 0
    for i in range(n):
        dx, dy, dz = xyz[0, i] - px, xyz[1, i] - py, xyz[2, i] - pz
        x = dx * fx + dy * fy + dz * fz
        y = dx * gx + dy * gy + dz * gz
        z = dx * ux + dy * uy + dz * uz
        on = abs(math.sqrt(x * x + y * y) - radius) < width
        lowest, highest = min(lowest, z if on else 1e300), max(highest, z if on else -1e300)
        count += 1 if on else 0
    quality[0], quality[1] = float(count), highest - lowest if count > 0 else 0.0


@njit(cache=True, nogil=True)
def polish(
    xyz: FloatArray,
    n: int,
    model: FloatArray,
    noise: float,
    least: float,
    greatest: float,
    min_inliers: int,
    min_share: float,
    min_extent: float,
    quality: FloatArray,
) -> int:
    """Fit a rough cylinder to the points of its neighbourhood, and say whether it is one.

    Parameters
    ----------
    xyz : ndarray of shape (3, >= n)
    n : int
    model : ndarray of shape (7,)
        Changed.
    noise : float
    least, greatest : float
        Radius it may have.
    min_inliers, min_share, min_extent
        What must support it: points, their share of all, and the length along the axis.
    quality : ndarray of shape (3,)
        Filled by `candidate_quality`, and with the spread.

    Returns
    -------
    int
        2 if it does, 1 if it is badly supported, 0 if it does not fit.
    """
    matrix, right, basis = np.empty((5, 5)), np.empty(5), np.empty((2, 3))
    schedule = np.empty(6)
    floor = max(3.0 * noise, 0.01 * model[RADIUS])
    schedule[0], schedule[1], schedule[2] = max(0.3 * model[RADIUS], 4.0 * noise), floor, 0.6
    schedule[3], schedule[4], schedule[5] = math.inf, 1e-2, POLISH_STEPS
    stride = max(1, n // SOME)
    if stride > 1:
        count = (n + stride - 1) // stride
        some = np.empty((3, count))
        for i in range(count):
            for d in range(3):
                some[d, i] = xyz[d, i * stride]
        spread = fit_in_place(some, count, model, -math.inf, math.inf, schedule, matrix, right, basis)
        if not 0.0 <= spread <= 1.2 * SHARP * floor:
            return 0
        schedule[0], schedule[5] = floor, LAST_STEPS  # some of the points brought it near, all decide
    spread = fit_in_place(xyz, n, model, -math.inf, math.inf, schedule, matrix, right, basis)
    if spread < 0.0 or spread > SHARP * floor or not (least <= model[RADIUS] <= greatest):
        return 0
    if floor > 3.0 * noise:
        spread = _sharpen(xyz, n, model, noise, floor, schedule, matrix, right, basis)
        if spread < 0.0 or not (least <= model[6] <= greatest):
            return 0
    candidate_quality(xyz, n, model, 3.0 * max(noise, TUKEY_SPREAD * spread), basis, quality)
    quality[2] = spread
    supported = quality[0] >= min_inliers and quality[0] >= min_share * n and quality[1] >= min_extent
    return 2 if supported else 1


@njit(cache=True, nogil=True)
def _sharpen(
    xyz: FloatArray,
    n: int,
    model: FloatArray,
    noise: float,
    width: float,
    schedule: FloatArray,
    normal: FloatArray,
    right: FloatArray,
    basis: FloatArray,
) -> float:
    """Fit a cylinder again under a weight function that narrows to its own scatter, or to the noise; give the spread.

    What meets the surface at an edge lies within a hundredth of a large radius, and bends the fit.
    """
    schedule[0], schedule[1], schedule[2] = width, 3.0 * noise, 0.5
    schedule[3], schedule[4], schedule[5] = TUKEY * TUKEY_SPREAD, 1e-2, SHARPEN_STEPS
    return float(fit_in_place(xyz, n, model, -math.inf, math.inf, schedule, normal, right, basis))


@njit(cache=True, nogil=True)
def move_to_foot(model: FloatArray, center: FloatArray) -> None:
    """Take a model given about `center` back to the frame of `center`, its point at the axis point nearest to it."""
    foot = 0.0
    for d in range(3):
        foot -= model[d] * model[UX + d]
    for d in range(3):
        model[d] += foot * model[UX + d] + center[d]
