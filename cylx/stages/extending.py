"""Pieces -> whole pipes: extend a cylinder along its axis where the points are too sparse for it to grow.

Growth requires slices as dense as those of the piece. Where a thin pipe recedes from the scanner, only a few points
per metre are left. If they lie on the extrapolated surface, and almost none beside it, they belong to the pipe, and
determine its direction far better than the piece does.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cylx.evidence.ends import ends_in_cut, rim_height
from cylx.fits.robust import TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder
from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.geometry.coverage import sector_of
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, coordinates_of
from cylx.records import Finding, IndexedCloud, Segment

WIDE_GAP = 8.0
"""Points beyond a cut end that begin after a gap of so many of their usual ones belong to another cylinder."""

Judge = Callable[[Segment, Finding], Finding | None]

EXTENSION_ROUNDS = 6
MOST_AXIS_ERROR = 0.5
"""Largest uncertainty of the axis, in radii, at which points are searched for."""
LENGTH_FACTORS = 4.0, 12.0, 40.0
"""Largest factor by which a cylinder may become longer in one round; near points are used first, and determine the
direction towards far ones."""
LEAST_POINTS_BEYOND_END = 10
"""Minimum number of points found beyond an end."""
EXTENSION_DENSITY_RATIO = 4.0
"""Minimum ratio of the density on the surface to that beside it."""
SPARSEST_SHARE = 0.25
"""The cylinder ends where the points per length fall below this share of the mean."""
WIDEST_GAP_SHARE = 0.5
"""Widest gap, as a share of the added length."""
MOST_CONFIDENCE_LOST = 0.1
"""Largest allowed loss of confidence of the longer cylinder."""


STRIP_SHARE = 0.25
"""Share of the sectors of the arc that must be filled beyond an end, or of as many sectors as there are points."""


def extend(finding: Finding, indexed: IndexedCloud, judge: Judge) -> Finding:
    """Extend a cylinder at both ends as long as there are points on it and almost none beside it.

    Parameters
    ----------
    finding : Finding
        Accepted.
    indexed : IndexedCloud
        The cloud.
    judge : callable
        Refits and verifies a segment, given the finding it came from; None if it is rejected.

    Returns
    -------
    Finding
        The longer one, or the original.
    """
    for _ in range(EXTENSION_ROUNDS):
        judged = next((one for times in LENGTH_FACTORS if (one := _longer(finding, indexed, judge, times))), None)
        if judged is None:
            break
        finding = judged
    return finding


def _longer(finding: Finding, indexed: IndexedCloud, judge: Judge, times: float) -> Finding | None:
    """Return the cylinder extended by up to `times` its length, if it passes as well as before."""
    longer = _lengthened(finding, indexed, times)
    judged = None if longer is None else judge(longer, finding)
    return judged if judged is not None and judged.confidence >= finding.confidence - MOST_CONFIDENCE_LOST else None


def _lengthened(finding: Finding, indexed: IndexedCloud, times: float) -> Segment | None:
    """Fit a cylinder to a piece and the points beyond its ends; None if there are almost none."""
    model, half = finding.segment.model, finding.segment.half
    noise = indexed.noise_about(model, half)
    allowed = (MOST_AXIS_ERROR * model[RADIUS]) ** 2 - finding.offset_error**2
    reach = min(math.sqrt(max(allowed, 0.0)) / max(finding.tilt_error, 1e-12), times * half)
    if reach < half + model[RADIUS]:
        return None
    outer = model[RADIUS] + max(0.5 * model[RADIUS], 10.0 * noise)
    near = indexed.cells.near_cylinder(model, -reach, reach, 0.0, outer)
    near = near[indexed.may_be_on(near, model)]
    heights, residuals, _ = coordinates_of(indexed.points, near, model)
    astray = np.hypot(finding.offset_error, finding.tilt_error * heights)
    on = np.abs(residuals) < 3.0 * noise + 2.0 * astray
    for sign in (-1.0, 1.0):
        if ends_in_cut(finding, indexed, sign > 0.0) and _is_behind_gap(sign * heights[on], half + rim_height(finding)):
            kept = sign * heights <= half
            near, heights, residuals, on = near[kept], heights[kept], residuals[kept], on[kept]
    fresh = (np.abs(heights) > half) & on
    astray = np.hypot(finding.offset_error, finding.tilt_error * heights)
    if fresh.sum() < LEAST_POINTS_BEYOND_END:
        return None
    points = indexed.points[np.concatenate([finding.points, near[fresh]])]
    shell = max(3.0 * noise, 2.0 * float(astray.max()))
    schedule = WeightSchedule(shell, 3.0 * noise, 1.0, TUKEY * TUKEY_SPREAD)
    fit = fit_cylinder(points, model, low=-reach, high=reach, schedule=schedule, steps=30)
    if fit is None:
        return None
    longer, spread = fit
    spread *= TUKEY_SPREAD
    if spread > 1.1 * max(finding.segment.spread, noise):
        return None
    heights, residuals, angles = coordinates_of(indexed.points, near, longer)
    on = np.abs(residuals) < 2.0 * noise
    area = 8.0 * noise * longer[RADIUS]  # on the surface, over pi
    share = area / (outer**2 - area)
    low, high = -_end(-heights, on, half, reach, share), _end(heights, on, half, reach, share)
    if low > -half - longer[RADIUS] and high < half + longer[RADIUS]:
        return None
    for beyond in (on & (heights < -half) & (heights >= low), on & (heights > half) & (heights <= high)):
        if beyond.any() and _is_strip(angles[beyond], angles[on & (np.abs(heights) <= half)]):
            return None
    longer[POINT] += 0.5 * (low + high) * longer[DIRECTION]
    return Segment(longer, 0.5 * (high - low), spread)


def _is_behind_gap(heights: FloatArray, end: float) -> bool:
    """Return whether the points beyond an end, and what adjoins it, begin further from it than they are apart."""
    beyond = heights[heights > end]
    if len(beyond) < 2:
        return False
    first = float(beyond.min())
    return first - end > WIDE_GAP * (float(beyond.max()) - first) / len(beyond)


def _is_strip(beyond: FloatArray, before: FloatArray) -> bool:
    """Return whether points beyond an end cover so little of the arc that something else runs beside the cylinder."""
    filled, expected = len(np.unique(sector_of(beyond))), len(np.unique(sector_of(before)))
    return filled < STRIP_SHARE * min(expected, len(beyond))


def _end(heights: FloatArray, on: MaskArray, half: float, reach: float, share: float) -> float:
    """Return the height at which the points on the surface end; `half` if there are too few beyond it.

    Along the axis each point on the surface counts one. Each point beside it subtracts the number expected on the
    surface, and each length without points subtracts too; the end is where the sum is largest. Points behind a wide gap
    belong to something that crosses.
    """
    past = np.flatnonzero((heights > half) & (heights <= reach))
    past = past[np.argsort(heights[past])]
    along, is_on, end = heights[past], on[past], reach
    worth = np.where(is_on, 1.0, -EXTENSION_DENSITY_RATIO * share)
    while True:
        count = int(is_on.sum())
        if count < LEAST_POINTS_BEYOND_END:
            return half
        total = np.cumsum(worth - SPARSEST_SHARE * count / (end - half) * np.diff(along, prepend=half))
        last = int(total.argmax())
        if total[last] < 0.5 * LEAST_POINTS_BEYOND_END:
            return half
        gaps = np.diff(along[: last + 1][is_on[: last + 1]], prepend=half)
        wide = np.flatnonzero(gaps > WIDEST_GAP_SHARE * (along[last] - half))
        kept = last + 1 if len(wide) == 0 else int(np.flatnonzero(is_on)[wide[0]])
        if kept == len(along):
            return float(along[last])
        along, is_on, worth = along[:kept], is_on[:kept], worth[:kept]
        end = float(along[-1]) if kept else half
