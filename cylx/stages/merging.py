"""Pieces -> cylinders: join the pieces of one pipe, whatever clusters and gaps they came from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from cylx.evidence.ends import are_distinct
from cylx.evidence.sizes import LEAST_RADIUS_DIFFERENCE, is_another_size
from cylx.fits.robust import FIT_BEYOND_ENDS, TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, coordinates_of
from cylx.records import Finding, IndexedCloud, Segment

LEAST_COSINE_OF_PIECES = math.cos(math.radians(8.0))
"""Axes of two pieces of one pipe differ less; the rest is decided by a fit to both."""
LEAST_COSINE_OF_THE_SAME, MOST_RADIUS_DIFFERENCE, MOST_OFFSET_OF_THE_SAME = math.cos(math.radians(4.0)), 0.1, 0.15
"""A segment that differs less from a known one, in direction, relative radius and offset in radii, is the same."""
DEVIATIONS_OF_THE_SAME = 4.0
"""The relative radius may always differ by the least difference, else by so many deviations of the points of both."""
HALF, SPREAD = 7, 8
"""Where rows of segments have half the height and the spread."""
LEAST_RADIUS_RATIO = 0.75
"""Radii of two pieces of one pipe differ less."""
MOST_OFFSET_OF_PIECES, ERRORS_OF_OFFSET = 0.3, 4.0
"""Axes further apart than this, in radii, and than this many standard deviations belong to two pipes."""
FAR_APART = 2.0
"""Pieces with a gap of so many of their lengths between them are far apart."""
SHELL_RADII, SHELL_NOISES, LEAST_WIDTH = 0.1, 5.0, 3.0
"""Half width of the weights at the start of a common fit, in radii or noises, whichever is more, and at its end, in
noises: the pieces may lie as far off a common cylinder as their errors say."""
FIT_STEPS = 30
MOST_SPREAD_RATIO = 1.1
"""A common fit about which the points scatter more than this, compared with those of the pieces, explains less."""
SURFACE_WIDTH, MOST_SPREAD = 3.0, 2.0
"""Points within so many deviations are on the surface; no deviation is taken for more than so many noises."""
LEAST_SHARES_EXPLAINED = 0.9, 0.8
"""Shares of the points of the larger and the smaller piece that must be on the common surface."""
LOST_BEYOND_ERROR = 1.0
"""If the predicted axis error exceeds this many radii, the continuation of a piece may be another pipe, unless there
are points between the two."""
MOST_ERROR_OF_PIECES = 4.0
"""If the error exceeds this many radii, two pieces are never joined."""
LEAST_POINTS_BETWEEN = 12
"""Minimum number of points on the surface between two pieces to show a pipe there, too sparse for a cluster."""
BRIDGE_DENSITY_RATIO = 4.0
"""Minimum ratio of the density of points on that surface to that around it."""
MOST_CHI_SQUARE_IN_LINE = 9.5
"""Chi-square of four angles, which one in twenty true pairs exceeds."""
ENOUGH_OF_EACH_PIECE = 10000
"""Points of each piece used to test whether one cylinder explains both."""
MOST_CLAIMED_SHARE = 0.5
"""A cylinder that shares more than this share of its points with better ones is a duplicate."""

Judge = Callable[[Segment, Finding], Finding | None]


def merge_pieces(findings: list[Finding], indexed: IndexedCloud, judge: Judge) -> list[Finding]:
    """Join pairs of cylinders that one cylinder explains as well as two, until no such pair is left.

    Parameters
    ----------
    findings : list of Finding
        Accepted cylinders.
    indexed : IndexedCloud
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
        joined = _first_join(pool, i, indexed, judge)
        if joined is None:
            i += 1
        else:
            j, pool[i] = joined
            del pool[j]
    return pool


def _first_join(pool: list[Finding], i: int, indexed: IndexedCloud, judge: Judge) -> tuple[int, Finding] | None:
    """Return the first finding after i that can be joined with i, and the joined finding."""
    rest = pool[i + 1 :]
    if not rest:
        return None
    one = pool[i].segment.model
    others = np.array([finding.segment.model for finding in rest])
    ratios = others[:, RADIUS] / one[RADIUS]
    alike = np.abs(others[:, DIRECTION] @ one[DIRECTION]) >= LEAST_COSINE_OF_PIECES
    alike &= (ratios >= LEAST_RADIUS_RATIO) & (ratios * LEAST_RADIUS_RATIO <= 1.0)
    across = others[:, POINT] - one[POINT]
    heights = across @ one[DIRECTION]
    apart = np.linalg.norm(across - heights[:, None] * one[DIRECTION], axis=1)
    offsets = np.array([finding.offset_error for finding in rest])
    errors = np.sqrt(pool[i].offset_error ** 2 + offsets**2 + (pool[i].tilt_error * heights) ** 2)
    alike &= apart <= MOST_OFFSET_OF_PIECES * one[RADIUS] + ERRORS_OF_OFFSET * errors
    for k in np.flatnonzero(alike):
        joined = _join(pool[i], rest[k], float(errors[k]), indexed, judge)
        if joined is not None:
            return i + 1 + int(k), joined
    return None


def as_rows(segments: Sequence[Segment]) -> FloatArray:
    """Return segments as rows (n, 9): model, half height and spread."""
    return np.array([[*one.model, one.half, one.spread] for one in segments]).reshape(len(segments), 9)


def is_part_of(segment: Segment, known: FloatArray) -> bool:
    """Return whether a segment lies on a known one: axis within a sixth of the radius, radius within a tenth at most.

    Parameters
    ----------
    segment : Segment
    known : ndarray of shape (n, 9)
        From `as_rows`.
    """
    alike = np.abs(known[:, DIRECTION] @ segment.direction) >= LEAST_COSINE_OF_THE_SAME
    # walls whose points do not mix are two
    mixed = DEVIATIONS_OF_THE_SAME * (segment.spread + known[:, SPREAD]) / known[:, RADIUS]
    most = np.clip(mixed, LEAST_RADIUS_DIFFERENCE, MOST_RADIUS_DIFFERENCE)
    alike &= np.abs(segment.radius / known[:, RADIUS] - 1.0) <= most
    known = known[alike]
    across = segment.point - known[:, POINT]
    heights = (across * known[:, DIRECTION]).sum(axis=1)
    apart = np.linalg.norm(across - heights[:, None] * known[:, DIRECTION], axis=1)
    along = np.abs(heights) + 0.5 * segment.half < known[:, HALF] + 0.5 * known[:, RADIUS]
    return bool(((apart < MOST_OFFSET_OF_THE_SAME * known[:, RADIUS]) & along).any())


def drop_claimed(findings: list[Finding], count: int, before: list[Finding] | None = None) -> list[Finding]:
    """Drop the cylinders most of whose points belong to better ones.

    Parameters
    ----------
    findings : list of Finding
    count : int
        Points of the cloud.
    before : list of Finding, optional
        What has claimed its points already.
    """
    claimed = np.zeros(count, np.bool_)
    for finding in before or []:
        claimed[finding.points] = True
    kept = []
    for finding in sorted(findings, key=lambda finding: (-len(finding.points) * finding.payoff, -len(finding.points))):
        if claimed[finding.points].mean() <= MOST_CLAIMED_SHARE:
            claimed[finding.points] = True
            kept.append(finding)
    return kept


def _point_at_each_other(a: Finding, b: Finding) -> bool:
    """Return whether the line through the middles of two pieces has the direction of both, within their errors."""
    across = b.segment.point - a.segment.point
    distance = float(np.linalg.norm(across))
    place = (a.offset_error**2 + b.offset_error**2) / distance**2
    square = 0.0
    for finding in (a, b):
        sine = np.linalg.norm(np.cross(finding.segment.direction, across)) / distance
        square += float(sine) ** 2 / max(finding.tilt_error**2 + place, 1e-300)
    return square < MOST_CHI_SQUARE_IN_LINE


def _is_bridged(indexed: IndexedCloud, model: FloatArray, half: float, width: float) -> bool:
    """Return whether points lie on a cylinder about its middle, and almost none beside its surface."""
    reach = model[RADIUS] + max(0.5 * model[RADIUS], 4.0 * width)
    near = indexed.cells.near_cylinder(model, -half, half, 0.0, reach)
    _, residuals, _ = coordinates_of(indexed.points, near[indexed.may_be_on(near, model)], model)
    on = np.abs(residuals) < width
    areas = 4.0 * model[RADIUS] * width, reach**2 - 4.0 * model[RADIUS] * width
    about = float((~on).sum()) * areas[0] / areas[1]
    return bool(on.sum() >= LEAST_POINTS_BETWEEN and on.sum() > BRIDGE_DENSITY_RATIO * about)


def _join(a: Finding, b: Finding, error: float, indexed: IndexedCloud, judge: Judge) -> Finding | None:
    """Fit one cylinder to two similar pieces in line within an error; return None if it does not explain both."""
    one, two = a.segment, b.segment
    across = two.point - one.point
    height = float(across @ one.direction)
    gap, model = abs(height) - one.half - two.half, one.model.copy()
    if are_distinct(a, b, indexed, gap) or is_another_size(a, b, gap):
        return None
    far = gap > FAR_APART * (one.half + two.half) and error > MOST_OFFSET_OF_PIECES * one.radius
    if far:
        if error > MOST_ERROR_OF_PIECES * one.radius or not _point_at_each_other(a, b):
            return None
        model[DIRECTION] = across * math.copysign(1.0 / float(np.linalg.norm(across)), height)
    low, high = min(-one.half, height - two.half), max(one.half, height + two.half)
    model[POINT] += 0.5 * (low + high) * model[DIRECTION]
    half = 0.5 * (high - low)
    end = FIT_BEYOND_ENDS * half
    noise = indexed.noise_about(one.model, one.half)
    shell = max(SHELL_RADII * model[RADIUS], SHELL_NOISES * noise)
    schedule = WeightSchedule(shell, LEAST_WIDTH * noise, 1.0, TUKEY * TUKEY_SPREAD)
    pieces = [indexed.points[finding.points[:: 1 + len(finding.points) // ENOUGH_OF_EACH_PIECE]] for finding in (a, b)]
    fit = fit_cylinder(np.concatenate(pieces), model, low=-end, high=end, schedule=schedule, steps=FIT_STEPS)
    if fit is None:
        return None
    model, spread = fit
    spread *= TUKEY_SPREAD
    if spread > MOST_SPREAD_RATIO * max(one.spread, two.spread, noise):
        return None
    width = SURFACE_WIDTH * max(min(spread, MOST_SPREAD * noise), noise)
    for piece, share in zip(pieces, LEAST_SHARES_EXPLAINED, strict=True):
        offsets = piece - model[POINT]
        along = offsets @ model[DIRECTION]
        distances = np.sqrt(np.maximum((offsets**2).sum(axis=1) - along**2, 0.0))
        if (np.abs(distances - model[RADIUS]) < width).mean() < share:
            return None
    lost = far and error > LOST_BEYOND_ERROR * one.radius
    if lost and not _is_bridged(indexed, model, 0.5 * gap - abs(one.half - two.half), 0.5 * width):
        return None
    return judge(Segment(model, half, spread), a if a.payoff >= b.payoff else b)
