"""The first fit of a candidate, to the points of its neighbourhood, and whether these bear it out."""

from __future__ import annotations

import math

import numpy as np

from cylx.fits.robust import TUKEY, TUKEY_SPREAD, fit_in_place
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import RADIUS, UX, UY, UZ
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import NUMBERS, fill_basis

POLISH_STEPS = 10
SOME, LAST_STEPS = 150, 3
"""Points that suffice for the first steps of a polish, and steps with all of them."""
SHARPEN_STEPS = 12
SHARP = 0.34
"""Largest spread of a polished candidate over the width of its weights: a Gaussian within it has 0.27 of the width, a
uniform background 0.378."""


@njit(cache=True, nogil=True, fastmath=NUMBERS)
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
