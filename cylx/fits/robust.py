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
from cylx.geometry.numerics import fill_basis, solve_in_place

TUKEY = 4.685
"""Tuning constant of the biweight at 95 % efficiency, in standard deviations."""
TUKEY_SPREAD = 1.0989
"""Standard deviation of Gaussian residuals over that of the same residuals weighted by the biweight at 4.685."""


FIT_BEYOND_ENDS = 1.02
"""A fit goes this much further than the ends: the outermost points lie on them, and rounding would choose."""
BLOCK = 256
"""Points of a block of the normal equations; its scratch stays in the fastest memory."""


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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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
