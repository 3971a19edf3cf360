"""Pieces -> whole pipes: extend a cylinder along its axis where the points are too sparse for it to grow.

Growth requires slices as dense as those of the piece. Where a thin pipe recedes from the scanner, only a few points
per metre are left. If they lie on the extrapolated surface, and almost none beside it, they belong to the pipe, and
determine its direction far better than the piece does.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cylx.fits.robust import TUKEY, TUKEY_SPREAD, Kernel, fit_cylinder
from cylx.geometry.cylinder import coordinates_of
from cylx.records import Finding, Ground, Segment

FloatArray = NDArray[np.float64]
Judge = Callable[[Segment, Finding], Finding | None]

ROUNDS = 6
REACH = 0.5
"""Largest uncertainty of the axis, in radii, at which points are searched for."""
FURTHER = 4.0, 12.0, 40.0
"""Largest factor by which a cylinder may become longer in one round; near points are used first, and determine the
direction towards far ones."""
BEYOND = 10
"""Minimum number of points found beyond an end."""
DENSER = 4.0
"""Minimum ratio of the density on the surface to that beside it."""
THINNER = 0.25
"""The cylinder ends where the points per length fall below this share of the mean."""
GAP = 0.5
"""Widest gap, as a share of the added length."""
LESS = 0.1
"""Largest allowed loss of confidence of the longer cylinder."""


def extend(finding: Finding, ground: Ground, judge: Judge) -> Finding:
    """Extend a cylinder at both ends as long as there are points on it and almost none beside it.

    Parameters
    ----------
    finding : Finding
        Accepted.
    ground : Ground
        The cloud.
    judge : callable
        Refits and verifies a segment, given the finding it came from; None if it is rejected.

    Returns
    -------
    Finding
        The longer one, or the original.
    """
    for _ in range(ROUNDS):
        judged = next((one for times in FURTHER if (one := _longer(finding, ground, judge, times))), None)
        if judged is None:
            break
        finding = judged
    return finding


def _longer(finding: Finding, ground: Ground, judge: Judge, times: float) -> Finding | None:
    """Return the cylinder extended by up to `times` its length, if it passes as well as before."""
    longer = _lengthened(finding, ground, times)
    judged = None if longer is None else judge(longer, finding)
    return judged if judged is not None and judged.confidence >= finding.confidence - LESS else None


def _lengthened(finding: Finding, ground: Ground, times: float) -> Segment | None:
    """Fit a cylinder to a piece and the points beyond its ends; None if there are almost none."""
    model, half = finding.segment.model, finding.segment.half
    noise = ground.noise_about(model, half)
    allowed = (REACH * model[6]) ** 2 - finding.offset_error**2
    reach = min(math.sqrt(max(allowed, 0.0)) / max(finding.tilt_error, 1e-12), times * half)
    if reach < half + model[6]:
        return None
    outer = model[6] + max(0.5 * model[6], 10.0 * noise)
    near = ground.cells.near_cylinder(model, -reach, reach, 0.0, outer)
    near = near[ground.may_be_on(near, model[6])]
    heights, residuals, _ = coordinates_of(ground.points, near, model)
    astray = np.hypot(finding.offset_error, finding.tilt_error * heights)
    fresh = (np.abs(heights) > half) & (np.abs(residuals) < 3.0 * noise + 2.0 * astray)
    if fresh.sum() < BEYOND:
        return None
    points = ground.points[np.concatenate([finding.points, near[fresh]])]
    shell = max(3.0 * noise, 2.0 * float(astray.max()))
    kernel = Kernel(shell, 3.0 * noise, 1.0, TUKEY * TUKEY_SPREAD)
    fit = fit_cylinder(points, model, low=-reach, high=reach, kernel=kernel, steps=30)
    if fit is None:
        return None
    longer, spread = fit
    spread *= TUKEY_SPREAD
    if spread > 1.1 * max(finding.segment.spread, noise):
        return None
    heights, residuals, _ = coordinates_of(ground.points, near, longer)
    on = np.abs(residuals) < 2.0 * noise
    share = longer[6] * 8.0 * noise / (outer**2 - 8.0 * longer[6] * noise)  # of the areas on and beside the surface
    low, high = -_end(-heights, on, half, reach, share), _end(heights, on, half, reach, share)
    if low > -half - longer[6] and high < half + longer[6]:
        return None
    longer[:3] += 0.5 * (low + high) * longer[3:6]
    return Segment(longer, 0.5 * (high - low), spread)


def _end(heights: FloatArray, on: NDArray[np.bool_], half: float, reach: float, share: float) -> float:
    """Return the height at which the points on the surface end; `half` if there are too few beyond it.

    Along the axis each point on the surface counts one. Each point beside it subtracts the number expected on the
    surface, and each length without points subtracts too; the end is where the sum is largest. Points behind a wide gap
    belong to something that crosses.
    """
    past = np.flatnonzero((heights > half) & (heights <= reach))
    past = past[np.argsort(heights[past])]
    along, is_on, end = heights[past], on[past], reach
    worth = np.where(is_on, 1.0, -DENSER * share)
    while True:
        count = int(is_on.sum())
        if count < BEYOND:
            return half
        total = np.cumsum(worth - THINNER * count / (end - half) * np.diff(along, prepend=half))
        last = int(total.argmax())
        if total[last] < 0.5 * BEYOND:
            return half
        gaps = np.diff(along[: last + 1][is_on[: last + 1]], prepend=half)
        wide = np.flatnonzero(gaps > GAP * (along[last] - half))
        kept = last + 1 if len(wide) == 0 else int(np.flatnonzero(is_on)[wide[0]])
        if kept == len(along):
            return float(along[last])
        along, is_on, worth = along[:kept], is_on[:kept], worth[:kept]
        end = float(along[-1]) if kept else half
