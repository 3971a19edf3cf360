"""Ends that face each other along one line: reducers between two sizes, and gaps within one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import axis_basis
from cylx.runs.bend import LEAST_TURN
from cylx.runs.pipes import ENDS, ON_SURFACE, End, Pipe, Surroundings, sectors_of
from cylx.runs.trials import fill_cone_costs

LONGEST_REDUCER = 8.0
"""Distance of the ends, in the larger radius."""
LONGEST_GAP = 24.0
"""Gaps within one size that are longer, in radii, are not bridged."""
OVERLAP = 5.0
"""Ends may have been found so many radii too long: into the reducer."""
SAME_SIZE = 0.05
"""Radii that differ by less are those of one size, beside their uncertainty."""
BESIDE = 0.25
"""Axes further apart, in radii, are not one line."""
STEEPEST = 1.3
"""Radii change by less than this for each length of a reducer; the end of an insulation is a step."""
STEPS = 16
MOST_POINTS = 1000
LEAST_INLIERS = 10
FOREIGN = 0.4
"""More points of other pipes where a reducer is, for each point of it, say that there is another pipe between."""
PIECES = 6
LEAST_LENGTHWISE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Facing:
    """Two ends that face each other.

    Parameters
    ----------
    pipes : tuple of int
    ends : tuple of {'start', 'end'}
    gap : float
        Distance of the ends along the axis; negative where they overlap.
    offset : float
        Distance of the two axes.
    same_size : bool
    """

    pipes: tuple[int, int]
    ends: tuple[End, End]
    gap: float
    offset: float
    same_size: bool


@dataclass(frozen=True, slots=True, eq=False)
class FittedCone:
    """A reducer that was fitted to points.

    Parameters
    ----------
    start, end : ndarray of shape (3,)
        Ends of its centre line, on either axis.
    indices : ndarray of shape (n,)
        Points on it.
    rms, lengthwise, coverage : float
    std : dict of str to float
    """

    facing: Facing
    start: FloatArray
    end: FloatArray
    indices: IndexArray
    rms: float
    lengthwise: float
    coverage: float
    std: dict[str, float]


def facing_ends(pipes: list[Pipe], taken: set[tuple[int, End]]) -> Iterator[Facing]:
    """Yield the pairs of free ends that face each other along one line."""
    keys = [(i, end) for i in range(len(pipes)) for end in ENDS if (i, end) not in taken]
    if len(keys) < 2:
        return
    places = np.array([pipes[i].at(end) for i, end in keys])
    directions = np.array([pipes[i].outward(end) for i, end in keys])
    radii = np.array([pipes[i].radius for i, _ in keys])
    owners = np.array([i for i, _ in keys])
    for a, (i, end) in enumerate(keys):
        near = np.linalg.norm(places - places[a], axis=1) < LONGEST_GAP * np.maximum(radii, radii[a])
        against = directions @ directions[a] < -0.97
        for b in np.flatnonzero(near & against & (owners > i)):
            other = keys[int(b)]
            found = _facing(pipes, (i, other[0]), (end, other[1]))
            if found is not None:
                yield found


def _facing(pipes: list[Pipe], which: tuple[int, int], ends: tuple[End, End]) -> Facing | None:
    one, two = pipes[which[0]], pipes[which[1]]
    place, direction, other = one.at(ends[0]), one.outward(ends[0]), two.at(ends[1])
    small, large = sorted((one.radius, two.radius))
    sd = math.hypot(*(math.sqrt(max(pipe.covariance[4, 4], 0.0)) for pipe in (one, two)))
    same = large - small < SAME_SIZE * small + ON_SURFACE * sd and large < 1.25 * small
    gap = float((other - place) @ direction)
    if gap > (LONGEST_GAP * small if same else LONGEST_REDUCER * large) or gap < -OVERLAP * large:
        return None
    if gap < 0 and -gap > 0.5 * max(one.length, two.length):
        return None
    tilt = math.sqrt(max(float(np.trace(one.covariance[2:4, 2:4]) + np.trace(two.covariance[2:4, 2:4])), 0.0))
    turn = math.atan2(
        float(np.linalg.norm(np.cross(direction, two.outward(ends[1])))), -float(direction @ two.outward(ends[1]))
    )
    if turn > LEAST_TURN + ON_SURFACE * tilt or turn > 0.25:
        return None
    middle = 0.5 * (place + other)
    feet = [pipe.middle + float((middle - pipe.middle) @ pipe.direction) * pipe.direction for pipe in (one, two)]
    offset = float(np.linalg.norm(feet[0] - feet[1]))
    uncertain = ON_SURFACE * math.hypot(one.axis_deviation(middle), two.axis_deviation(middle))
    most = BESIDE * small if same else 1.2 * (large - small) + 0.1 * small
    if offset > most + uncertain:
        return None
    return Facing(which, ends, gap, offset, same)


def fit_reducer(facing: Facing, pipes: list[Pipe], near: Surroundings) -> FittedCone | None:
    """Fit the cone between two ends of different radius to the points; None if they do not show it."""
    one, two = (pipes[i] for i in facing.pipes)
    first, axis = one.at(facing.ends[0]), one.outward(facing.ends[0])
    large = max(one.radius, two.radius)
    if near.cells is None:
        none = np.empty(0, np.int64)
        return FittedCone(facing, first, two.at(facing.ends[1]), none, 0.0, 0.0, 0.0, {}) if facing.gap > 0 else None
    spread = max(one.spread, two.spread)
    before, after = min(OVERLAP * large, 0.8 * one.length), min(OVERLAP * large, 0.8 * two.length)
    indices = near.about(first, axis, -before - large, facing.gap + after + large, 1.4 * large + facing.offset)
    indices = indices[near.free(indices, (one.label, two.label))]
    if len(indices) < LEAST_INLIERS:
        return None
    points = near.points[indices[:: max(1, len(indices) // MOST_POINTS)]]
    shape = _Cone(one, two, facing, first, axis)
    low, high = -before, facing.gap + after
    best = _search(shape, points, low, high, spread)
    for _ in range(3):  # around the best, ever finer
        step = (high - low) / STEPS
        low, high = min(best) - 2 * step, max(best) + 2 * step
        best = _search(shape, points, best[0], best[1], spread, step)
        low, high = best[0] - step, best[1] + step
    return _judged(shape, best, indices, near, spread)


@dataclass(frozen=True, slots=True, eq=False)
class _Cone:
    """The family of cones between two pipes: each begins and ends somewhere along the first axis."""

    one: Pipe
    two: Pipe
    facing: Facing
    origin: FloatArray
    axis: FloatArray

    def ends(self, low: float, high: float) -> tuple[FloatArray, FloatArray]:
        """Return the ends of the centre line: on the axis of each pipe."""
        place = self.origin + high * self.axis
        onward = -self.two.outward(self.facing.ends[1])
        along = float((place - self.two.middle) @ onward)
        return self.origin + low * self.axis, self.two.middle + along * onward

    def local(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points in a basis of the first axis, and the second axis in it, as `fill_cone_costs` takes them."""
        basis = np.stack([self.axis, *axis_basis(self.axis)])
        onward = -self.two.outward(self.facing.ends[1])
        middle, way = basis @ (self.two.middle - self.origin), basis @ onward
        back = float((self.origin - self.two.middle) @ onward)
        second = np.array([middle[1], middle[2], back, way[0], way[1], way[2]])
        return np.ascontiguousarray((points - self.origin) @ basis.T), second

    def errors(self, points: FloatArray, heights: FloatArray, low: float, high: float) -> FloatArray:
        """Return the signed distances of points from pipe, cone and pipe."""
        start, end = self.ends(low, high)
        share = np.clip((heights - low) / (high - low), 0.0, 1.0)
        # across the axis, where the centre line only shifts
        across = np.stack(axis_basis(self.axis))
        onward = across @ -self.two.outward(self.facing.ends[1])
        x, y = across @ (points - start).T
        shift, beyond = across @ (end - start), np.maximum(heights - high, 0.0)
        away = np.hypot(x - share * shift[0] - beyond * onward[0], y - share * shift[1] - beyond * onward[1])
        radii = self.one.radius + share * (self.two.radius - self.one.radius)
        slope = (self.two.radius - self.one.radius) / (high - low)
        between = (heights > low) & (heights < high)
        slant = np.where(between, 1.0 / math.sqrt(1.0 + slope**2), 1.0)
        return np.asarray((away - radii) * slant)


def _search(
    shape: _Cone, points: FloatArray, low: float, high: float, spread: float, step: float | None = None
) -> tuple[float, float]:
    """Return the ends of the best cone: between two heights, or about two ends."""
    local, second = shape.local(points)
    change = abs(shape.two.radius - shape.one.radius)
    if step is None:
        grid = np.linspace(low, high, STEPS)
        tried = [(float(a), float(b)) for a in grid for b in grid if b - a > 0.3 * change]
    else:
        grid = np.linspace(-step, step, 7)
        tried = [(low + float(a), high + float(b)) for a in grid for b in grid if high + b - low - a > 0.1 * change]
    costs, radii = np.empty(len(tried)), np.array([shape.one.radius, shape.two.radius])
    fill_cone_costs(local, np.array(tried), radii, second, ON_SURFACE * spread, costs)
    return tried[int(np.argmin(costs))]


def _judged(
    shape: _Cone, ends: tuple[float, float], indices: IndexArray, near: Surroundings, spread: float
) -> FittedCone | None:
    low, high = ends
    points = near.points[indices]
    heights = (points - shape.origin) @ shape.axis
    errors = shape.errors(points, heights, low, high)
    large, small = max(shape.one.radius, shape.two.radius), min(shape.one.radius, shape.two.radius)
    width = ON_SURFACE * spread + 0.01 * large
    between = (heights > low) & (heights < high)
    own = between & (np.abs(errors) < width)
    length = high - low
    if (large - small) > STEEPEST * length or own.sum() < LEAST_INLIERS:
        return None
    tube = near.about(shape.origin, shape.axis, low, high, large + shape.facing.offset + width)
    foreign = ~near.free(tube, (shape.one.label, shape.two.label))
    if foreign.sum() > FOREIGN * own.sum():
        return None
    inside = between & (errors < -width - 0.1 * small)
    outside = between & (errors > width) & (errors < width + 0.3 * large)
    if inside.sum() + outside.sum() > own.sum():
        return None
    pieces = int(np.clip(length / max(2.0 * near.spacing, 1e-12), 1, PIECES))
    rows = np.clip(((heights[own] - low) / length * pieces).astype(np.int64), 0, pieces - 1)
    lengthwise = len(np.unique(rows)) / pieces
    if lengthwise < LEAST_LENGTHWISE:
        return None
    start, end = shape.ends(low, high)
    sectors = _sectors(points[own], start, end, heights[own], low, high)
    coverage = len(np.unique(rows * 12 + sectors)) / (12.0 * pieces)
    rms = float(np.sqrt((errors[own] ** 2).mean()))
    slope = (large - small) / length
    end_sd = spread * math.sqrt(2.0 / max(int(own.sum()), 1)) / max(slope, 1e-3)
    sds = [math.sqrt(max(pipe.covariance[4, 4], 0.0)) for pipe in (shape.one, shape.two)]
    offset_sd = math.hypot(shape.one.axis_deviation(start), shape.two.axis_deviation(end))
    std = {"start": end_sd, "end": end_sd, "start_radius": sds[0], "end_radius": sds[1], "offset": offset_sd}
    return FittedCone(shape.facing, start, end, indices[own], rms, lengthwise, coverage, std)


def _sectors(
    points: FloatArray, start: FloatArray, end: FloatArray, heights: FloatArray, low: float, high: float
) -> IndexArray:
    axis = (end - start) / np.linalg.norm(end - start)
    return sectors_of(points, start, axis, 12)
