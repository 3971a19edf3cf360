"""Pieces -> cylinders: join the pieces of one pipe, whatever clusters and gaps they came from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cylx.fits.robust import TUKEY, TUKEY_SPREAD, Kernel, fit_cylinder
from cylx.geometry.cylinder import coordinates_of
from cylx.records import Finding, Ground, Segment

FloatArray = NDArray[np.float64]

COSINE = math.cos(math.radians(8.0))
SAME_COSINE = math.cos(math.radians(4.0))
RADIUS_RATIO = 0.75
OFFSET = 0.3
"""Axes further apart than this, in radii, and than four standard deviations belong to two pipes."""
LOST = 1.0
"""If the predicted axis error exceeds this many radii, the continuation of a piece may be another pipe, unless there
are points between the two."""
FARTHEST = 4.0
"""If the error exceeds this many radii, two pieces are never joined."""
BETWEEN = 12
"""Minimum number of points on the surface between two pieces to show a pipe there, too sparse for a cluster."""
DENSER = 4.0
"""Minimum ratio of the density of points on that surface to that around it."""
IN_LINE = 9.5
"""Chi-square of four angles, which one in twenty true pairs exceeds."""
ENOUGH = 10000
"""Points of each piece used to test whether one cylinder explains both."""
CLAIMED = 0.5
"""A cylinder that shares more than this share of its points with better ones is a duplicate."""

Judge = Callable[[Segment, Finding], Finding | None]


def merge_pieces(findings: list[Finding], ground: Ground, judge: Judge) -> list[Finding]:
    """Join pairs of cylinders that one cylinder explains as well as two, until no such pair is left.

    Parameters
    ----------
    findings : list of Finding
        Accepted cylinders.
    ground : Ground
        The cloud.
    judge : callable
        Refits and verifies a joined segment, given the better of its parts; None if it is rejected.

    Returns
    -------
    list of Finding
        By inliers, descending.
    """
    pool = sorted(findings, key=lambda finding: -len(finding.points))
    i = 0
    while i < len(pool):
        joined = _first_join(pool, i, ground, judge)
        if joined is None:
            i += 1
        else:
            j, pool[i] = joined
            del pool[j]
    return pool


def _first_join(pool: list[Finding], i: int, ground: Ground, judge: Judge) -> tuple[int, Finding] | None:
    """Return the first finding after i that can be joined with i, and the joined finding."""
    rest = pool[i + 1 :]
    if not rest:
        return None
    one = pool[i].segment.model
    others = np.array([finding.segment.model for finding in rest])
    ratios = others[:, 6] / one[6]
    alike = np.abs(others[:, 3:6] @ one[3:6]) >= COSINE
    alike &= (ratios >= RADIUS_RATIO) & (ratios * RADIUS_RATIO <= 1.0)
    across = others[:, :3] - one[:3]
    heights = across @ one[3:6]
    apart = np.linalg.norm(across - heights[:, None] * one[3:6], axis=1)
    offsets = np.array([finding.offset_error for finding in rest])
    errors = np.sqrt(pool[i].offset_error ** 2 + offsets**2 + (pool[i].tilt_error * heights) ** 2)
    alike &= apart <= OFFSET * one[6] + 4.0 * errors
    for k in np.flatnonzero(alike):
        joined = _join(pool[i], rest[k], float(errors[k]), ground, judge)
        if joined is not None:
            return i + 1 + int(k), joined
    return None


def as_rows(segments: Sequence[Segment]) -> FloatArray:
    """Return segments as rows (n, 8): model and half height."""
    return np.array([[*segment.model, segment.half] for segment in segments]).reshape(len(segments), 8)


def is_part_of(segment: Segment, known: FloatArray) -> bool:
    """Return whether a segment lies on a known one: axis within a sixth of the radius, radius within a tenth.

    Parameters
    ----------
    segment : Segment
    known : ndarray of shape (n, 8)
        From `as_rows`.
    """
    model, radii = segment.model, known[:, 6]
    alike = (np.abs(known[:, 3:6] @ model[3:6]) >= SAME_COSINE) & (np.abs(model[6] / radii - 1.0) <= 0.1)
    known = known[alike]
    across = model[:3] - known[:, :3]
    heights = (across * known[:, 3:6]).sum(axis=1)
    apart = np.linalg.norm(across - heights[:, None] * known[:, 3:6], axis=1)
    along = np.abs(heights) + 0.5 * segment.half < known[:, 7] + 0.5 * known[:, 6]
    return bool(((apart < 0.15 * known[:, 6]) & along).any())


def drop_claimed(findings: list[Finding], count: int) -> list[Finding]:
    """Drop the cylinders most of whose points belong to better ones.

    Parameters
    ----------
    findings : list of Finding
    count : int
        Points of the cloud.
    """
    claimed = np.zeros(count, np.bool_)
    kept = []
    for finding in sorted(findings, key=lambda finding: (-len(finding.points) * finding.payoff, -len(finding.points))):
        if claimed[finding.points].mean() <= CLAIMED:
            claimed[finding.points] = True
            kept.append(finding)
    return kept


def _point_at_each_other(a: Finding, b: Finding) -> bool:
    """Return whether the line through the middles of two pieces has the direction of both, within their errors."""
    across = b.segment.model[:3] - a.segment.model[:3]
    distance = float(np.linalg.norm(across))
    place = (a.offset_error**2 + b.offset_error**2) / distance**2
    square = 0.0
    for finding in (a, b):
        sine = np.linalg.norm(np.cross(finding.segment.model[3:6], across)) / distance
        square += float(sine) ** 2 / max(finding.tilt_error**2 + place, 1e-300)
    return square < IN_LINE


def _is_bridged(ground: Ground, model: FloatArray, half: float, width: float) -> bool:
    """Return whether points lie on a cylinder about its middle, and almost none beside its surface."""
    reach = model[6] + max(0.5 * model[6], 4.0 * width)
    near = ground.cells.near_cylinder(model, -half, half, 0.0, reach)
    _, residuals, _ = coordinates_of(ground.points, near[ground.may_be_on(near, model[6])], model)
    on = np.abs(residuals) < width
    areas = 4.0 * model[6] * width, reach**2 - 4.0 * model[6] * width
    about = float((~on).sum()) * areas[0] / areas[1]
    return bool(on.sum() >= BETWEEN and on.sum() > DENSER * about)


def _join(a: Finding, b: Finding, error: float, ground: Ground, judge: Judge) -> Finding | None:
    """Fit one cylinder to two similar pieces in line within an error; return None if it does not explain both."""
    one, two = a.segment, b.segment
    across = two.model[:3] - one.model[:3]
    height = float(across @ one.model[3:6])
    gap, model = abs(height) - one.half - two.half, one.model.copy()
    far = gap > 2.0 * (one.half + two.half) and error > OFFSET * one.model[6]
    if far:
        if error > FARTHEST * one.model[6] or not _point_at_each_other(a, b):
            return None
        model[3:6] = across * math.copysign(1.0 / float(np.linalg.norm(across)), height)
    low, high = min(-one.half, height - two.half), max(one.half, height + two.half)
    model[:3] += 0.5 * (low + high) * model[3:6]
    half = 0.5 * (high - low)
    noise = ground.noise_about(one.model, one.half)
    kernel = Kernel(max(0.1 * model[6], 5.0 * noise), 3.0 * noise, 1.0, TUKEY * TUKEY_SPREAD)
    pieces = [ground.points[finding.points[:: 1 + len(finding.points) // ENOUGH]] for finding in (a, b)]
    fit = fit_cylinder(np.concatenate(pieces), model, low=-1.02 * half, high=1.02 * half, kernel=kernel, steps=30)
    if fit is None:
        return None
    model, spread = fit
    spread *= TUKEY_SPREAD
    if spread > 1.1 * max(one.spread, two.spread, noise):
        return None
    width = 3.0 * max(min(spread, 2.0 * noise), noise)
    for piece, share in zip(pieces, (0.9, 0.8), strict=True):
        offsets = piece - model[:3]
        along = offsets @ model[3:6]
        distances = np.sqrt(np.maximum((offsets**2).sum(axis=1) - along**2, 0.0))
        if (np.abs(distances - model[6]) < width).mean() < share:
            return None
    lost = far and error > LOST * one.model[6]
    if lost and not _is_bridged(ground, model, 0.5 * gap - abs(one.half - two.half), 0.5 * width):
        return None
    return judge(Segment(model, half, spread), a if a.payoff >= b.payoff else b)
