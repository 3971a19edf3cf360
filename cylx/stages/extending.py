"""Pieces -> whole pipes: a cylinder goes on along its axis where points are too sparse for it to have grown.

Growth asks for slices that are filled as those of the piece are. Of a thin pipe that recedes from the scanner only a
few points a metre are left; but if they lie on the surface that the piece foretells, and next to none beside it, they
are the pipe's, and tell its direction far better than the piece does.
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
"""How uncertain the axis may be, in radii, where points are looked for."""
FURTHER = 4.0, 12.0, 40.0
"""How many times longer a cylinder may become in one round; what is near is looked at first, and tells the direction
of what is far."""
BEYOND = 10
"""Fewest points that must be found beyond an end."""
DENSER = 4.0
"""How much denser they must lie on the surface than beside it."""
THINNER = 0.25
"""Where there is less than this share of the mean number of points a length, the cylinder has ended."""
GAP = 0.5
"""Widest gap, as a share of what is added."""
LESS = 0.1
"""How much less confident the longer one may be."""


def extend(finding: Finding, ground: Ground, judge: Judge) -> Finding:
    """Let a cylinder go on at both ends for as long as there are points on it and next to none beside it.

    Parameters
    ----------
    finding : Finding
        Accepted.
    ground : Ground
        The cloud.
    judge : callable
        Refits and verifies a segment, in the light of what it was; None if it does not pass.

    Returns
    -------
    Finding
        The longer one, or the same.
    """
    for _ in range(ROUNDS):
        judged = next((one for times in FURTHER if (one := _longer(finding, ground, judge, times))), None)
        if judged is None:
            break
        finding = judged
    return finding


def _longer(finding: Finding, ground: Ground, judge: Judge, times: float) -> Finding | None:
    """Return a cylinder with what lies within so many times its length, if it passes as well as before."""
    longer = _lengthened(finding, ground, times)
    judged = None if longer is None else judge(longer, finding)
    return judged if judged is not None and judged.confidence >= finding.confidence - LESS else None


def _lengthened(finding: Finding, ground: Ground, times: float) -> Segment | None:
    """Fit a cylinder to a piece and what lies beyond its ends; None if that is next to nothing."""
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
    """Return the height at which the points on the surface end, `half` if there are too few beyond it.

    Along the axis each point on the surface counts one, each beside it takes off what is to be expected on the surface,
    and so does each length without any; the end is where the sum is largest. What lies behind a wide gap is something
    that crosses.
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
