"""The scatter of small pieces of surface about their quadrics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, MaskArray

MAD_SHRINKAGE = 0.93
"""What the median absolute deviation of 48 quadric residuals shows of a Gaussian's standard deviation, as a share."""


def half_sample_mode(values: FloatArray) -> float:
    """Return the mode of positive values: the half-sample mode of their logarithms.

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


FINEST = 3.0, 0.15
"""A mode this many times lower, of so large a share of the patches, is that of the surfaces; the other one is edges."""


def finest_mode(values: FloatArray, least: float) -> float:
    """Return the lowest mode that a good share of the values has; what is below `least` counts as that."""
    kept = np.maximum(values, least)
    mode = half_sample_mode(kept)
    while True:
        lower = kept[kept * FINEST[0] < mode]
        if len(lower) < max(FINEST[1] * len(values), 4):
            return mode
        mode = half_sample_mode(lower)


def quadric_spread(patches: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a quadric over the plane of each patch by least squares.

    Parameters
    ----------
    patches : ndarray of shape (m, k, 3)

    Returns
    -------
    deviations, widths, least : ndarray of shape (m,)
        Standard deviation of the residuals, k - 6 degrees of freedom; in-plane root mean square, and that along the
        narrower of the two directions: a filament is long, but no surface.
    """
    design, height, width, narrow = _over_own_plane(patches)
    residuals = _residuals(design, height, np.ones_like(height))
    count = patches.shape[1]
    return np.sqrt((residuals**2).mean(axis=1) * count / (count - 6)), width, narrow


ROUND = 0.3
"""A cross-section is a circle if its points scatter about it by less than this share of its radius."""
ALL_ROUND = 0.5
"""Length of the mean direction from the middle to the points: 0 all round, 0.64 for half a circle."""
SLIM = 0.4
"""A piece of a rod is less wide than this share of its length."""


def rod_spread(long: FloatArray, near: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Fit a circle to the cross-section of each piece of a rod.

    Parameters
    ----------
    long : ndarray of shape (m, k, 3)
        Pieces that tell the direction of the rods.
    near : ndarray of shape (m, n, 3)
        Pieces at the same places whose points are fitted.

    Returns
    -------
    deviations : ndarray of shape (m,)
        Standard deviation about the circle, n - 3 degrees of freedom.
    rods : ndarray of shape (m,), bool
        Whether a piece is slim, and its cross-section a circle rather than a blot.

    References
    ----------
    I. Kasa, A circle fitting procedure and its error analysis, IEEE Trans. Instrum. Meas. 25 (1976).
    """
    offsets = long - long.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(offsets.transpose(0, 2, 1) @ offsets)
    slim = np.sqrt(np.maximum(variances[:, 1], 0.0)) < SLIM * np.sqrt(variances[:, 2])
    x, y = ((near - near.mean(axis=1, keepdims=True)) @ axes[:, :, :2]).transpose(2, 0, 1)
    design = np.stack([x, y, np.ones_like(x)], axis=-1)
    gram = design.transpose(0, 2, 1) @ design
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    terms = np.linalg.solve(gram, design.transpose(0, 2, 1) @ (x * x + y * y)[..., None])[..., 0]
    middle = 0.5 * terms[:, :2]
    radius = np.sqrt(np.maximum(terms[:, 2] + (middle**2).sum(axis=1), 0.0))
    x, y = x - middle[:, :1], y - middle[:, 1:]
    distances = np.hypot(x, y)
    residuals = distances - radius[:, None]
    aside = np.hypot((x / (distances + 1e-300)).mean(axis=1), (y / (distances + 1e-300)).mean(axis=1))
    spread = np.sqrt((residuals**2).sum(axis=1) / (near.shape[1] - 3))
    length = np.sqrt(variances[:, 2] / long.shape[1])
    return spread, slim & (spread < ROUND * radius) & (radius < length) & (aside < ALL_ROUND)


def core_spread(patches: FloatArray) -> FloatArray:
    """Return the scatter of the core of each patch about its quadric, by the median: outliers move it little."""
    design, height, _, _ = _over_own_plane(patches)
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


def _over_own_plane(patches: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return design matrix (m, k, 6), heights (m, k), in-plane rms and the least rms in the plane, (m,), of patches."""
    offsets = patches - patches.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(offsets.transpose(0, 2, 1) @ offsets)
    height, x, y = (axes.transpose(0, 2, 1) @ offsets.transpose(0, 2, 1)).transpose(1, 0, 2)
    width = np.sqrt((x * x + y * y).mean(axis=1))
    narrow = np.sqrt((x * x).mean(axis=1))  # eigenvectors come by ascending eigenvalue
    scale = np.where(width > 0, width, 1.0)[:, None]
    x, y = x / scale, y / scale
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1), height, width, narrow


def _residuals(design: FloatArray, height: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the residuals of one weighted least-squares fit a patch: design (m, k, 6), height and weights (m, k)."""
    weighted = design * weights[..., None]
    gram = weighted.transpose(0, 2, 1) @ design
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    terms = np.linalg.solve(gram, weighted.transpose(0, 2, 1) @ height[..., None])
    return np.asarray(height - (design @ terms)[..., 0], dtype=np.float64)


def _masked_median(values: FloatArray, mask: MaskArray) -> FloatArray:
    """Return the median of the masked values of each row, shape (m, 1); each row has some."""
    ordered = np.sort(np.where(mask, values, np.inf), axis=1)
    count = np.maximum(mask.sum(axis=1, keepdims=True), 1)
    low, high = (np.take_along_axis(ordered, half, axis=1) for half in ((count - 1) // 2, count // 2))
    return np.asarray(0.5 * (low + high), dtype=np.float64)
