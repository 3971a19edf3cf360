"""The cylinders of a cloud as pipes with two ends, and the points about them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import Cylinder, axis_basis, canonical_direction, cylinder_coordinates
from cylx.geometry.morton import BITS, morton_codes
from cylx.records import CylinderFit
from cylx.records.fittings import End as Where

End = Literal["start", "end"]
ENDS: tuple[End, End] = ("start", "end")
UNKNOWN_TILT, UNKNOWN_OFFSET = 0.01, 0.03
"""Standard deviations of a cylinder whose covariance is not known: of a tilt, and of the others in radii."""
LEAST_SPREAD = 0.004
"""Real pipes deviate from cylinders by as much at least, in radii."""
CLAIMED = np.iinfo(np.int32).max
"""Label of points that belong to a fitting."""
ON_SURFACE = 3.0
"""Points within so many standard deviations are on a surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Pipe:
    """A straight piece of pipe, in coordinates about the middle of the cloud.

    Parameters
    ----------
    start, end : ndarray of shape (3,)
        Ends of its axis, in the order of the direction of its cylinder.
    radius : float
    spread : float
        Standard deviation of its points about its surface.
    covariance : ndarray of shape (5, 5)
        Of two offsets at the middle of its axis, two tilts and the radius, as in `CylinderFit`.
    label : int
        What `Surroundings` calls its points.
    source : int or None
        Index of the cylinder that it was; None for one that was found along a run.
    is_other : bool
        Whether it is no pipe: its surface is seen from inside, or it winds.
    length : float
        Length of its axis.
    middle : ndarray of shape (3,)
        Middle of its axis.
    direction : ndarray of shape (3,)
        Unit direction from start to end.
    basis : pair of ndarray of shape (3,)
        `axis_basis` of the direction.
    """

    start: FloatArray
    end: FloatArray
    radius: float
    spread: float
    covariance: FloatArray
    label: int
    source: int | None = None
    is_other: bool = False
    length: float = field(init=False)
    middle: FloatArray = field(init=False)
    direction: FloatArray = field(init=False)
    basis: tuple[FloatArray, FloatArray] = field(init=False)

    def __post_init__(self) -> None:
        along = self.end - self.start
        length = math.sqrt(float(along @ along))
        object.__setattr__(self, "length", length)
        object.__setattr__(self, "middle", 0.5 * (self.start + self.end))
        direction = along / max(length, 1e-300)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "basis", axis_basis(direction))

    @classmethod
    def of(cls, index: int, fit: CylinderFit, origin: FloatArray, noise: float) -> Pipe:
        """Describe number `index` of the cylinders of a cloud."""
        shape = fit.cylinder
        offset, tilt = UNKNOWN_OFFSET * shape.radius, UNKNOWN_TILT
        unknown = np.diag([offset**2, offset**2, tilt**2, tilt**2, offset**2])
        covariance = unknown if fit.covariance is None else np.asarray(fit.covariance, np.float64)
        spread = max(fit.rmse if fit.inliers else noise, LEAST_SPREAD * shape.radius)
        return cls(
            shape.start - origin,
            shape.end - origin,
            shape.radius,
            spread,
            covariance,
            index,
            index,
            fit.side == "concave",
        )

    def at(self, end: End) -> FloatArray:
        """Return the place of an end."""
        return self.start if end == "start" else self.end

    def outward(self, end: End) -> FloatArray:
        """Return the unit direction out of an end."""
        return -self.direction if end == "start" else self.direction

    def model(self, end: End | None = None) -> FloatArray:
        """Return it as a row of seven numbers: from its middle, or out of one of its ends."""
        if end is None:
            return np.concatenate([self.middle, self.direction, [self.radius]])
        return np.concatenate([self.at(end), self.outward(end), [self.radius]])

    def axis_deviation(self, place: FloatArray) -> float:
        """Return the standard deviation of its axis at a place along it."""
        along = float((place - self.middle) @ self.direction)
        offsets, tilts = self.covariance[:2, :2], self.covariance[2:4, 2:4]
        mixed = self.covariance[:2, 2:4]
        variance = offsets + along**2 * tilts + along * (mixed + mixed.T)
        return float(np.sqrt(max(np.trace(variance), 0.0)))

    def with_ends(self, start: FloatArray, end: FloatArray) -> Pipe:
        """Return it with other ends on its axis; its covariance is that at its new middle."""
        axis, middle = self.direction, self.middle
        low, high = float((start - middle) @ axis), float((end - middle) @ axis)
        shift = 0.5 * (low + high)
        move = np.eye(5)
        move[0, 2] = move[1, 3] = shift
        covariance = move @ self.covariance @ move.T
        return replace(self, start=middle + low * axis, end=middle + high * axis, covariance=covariance)

    def with_end(self, end: End, place: FloatArray) -> Pipe:
        """Return it with one end moved along its axis to the foot of a place."""
        return self.with_ends(place, self.end) if end == "start" else self.with_ends(self.start, place)

    @property
    def is_turned(self) -> bool:
        """Whether a cylinder has its ends the other way round."""
        return float(canonical_direction(self.direction) @ self.direction) < 0

    def canonical(self) -> Pipe:
        """Return it with its ends as a cylinder has them, and its covariance in the basis of that direction."""
        if not self.is_turned:
            return self
        signs = np.array([-1.0, 1.0, 1.0, -1.0, 1.0])
        return replace(self, start=self.end, end=self.start, covariance=self.covariance * np.outer(signs, signs))

    def cylinder(self, origin: FloatArray) -> Cylinder:
        """Return its shape in scene units."""
        return Cylinder(self.middle + origin, self.direction, self.radius, self.length)


def turned(start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Order two ends as a cylinder has them: along the canonical direction."""
    forward = float(canonical_direction(end - start) @ (end - start)) > 0
    return (start, end) if forward else (end, start)


OTHER: dict[Where, Where] = {"start": "end", "end": "start", "side": "side"}


def swapped(ends: Sequence[Where], joins: Sequence[int], changed: set[int]) -> tuple[Where, ...]:
    """Return the names of ends with those of some pipes the other way round."""
    return tuple(OTHER[end] if pipe in changed else end for end, pipe in zip(ends, joins, strict=True))


class Surroundings:
    """The points of a cloud, found by place, and the pipes that they belong to.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units.
    labels : ndarray of shape (N,)
        Cylinder of each point, -1 for none.
    spacing, noise : float
        Of the cloud, scene units.
    """

    def __init__(self, points: FloatArray, labels: NDArray[np.int32], spacing: float, noise: float) -> None:
        # column by column: along the first axis of three columns the same takes ten times as long
        corner, top = (
            np.array([getattr(column, what)() for column in points.T]) if len(points) else np.zeros(3)
            for what in ("min", "max")
        )
        self.origin = 0.5 * (corner + top)
        side = float((top - corner).max()) if len(points) else 1.0
        unit = max(0.5 * spacing, side / (2.0**BITS - 2), 1e-300)
        codes = morton_codes(points - corner, unit)
        self.order = np.argsort(codes, kind="stable")
        self.places = np.empty(len(points), np.int64)
        self.places[self.order] = np.arange(len(points))
        self.points = np.ascontiguousarray((points - self.origin)[self.order])
        self.labels = np.asarray(labels, np.int32)[self.order]
        self._next = int(self.labels.max(initial=-1)) + 1000
        self.cells = Cells(self.points, codes[self.order]) if len(points) else None
        self.spacing, self.noise = spacing, noise
        self.low, self.high = corner - self.origin, top - self.origin

    def origin_points(self, indices: IndexArray) -> FloatArray:
        """Return points of the cloud, by their indices in it, in coordinates about its middle."""
        return self.points[self.places[indices]]

    def about(
        self, point: FloatArray, direction: FloatArray, low: float, high: float, outer: float, inner: float = 0.0
    ) -> IndexArray:
        """Return the points between two heights along an axis and two distances from it."""
        if self.cells is None or not high > low:
            return np.empty(0, np.int64)
        return self.cells.near_cylinder(np.concatenate([point, direction, [1.0]]), low, high, inner, outer)

    def free(self, indices: IndexArray, own: Sequence[int] = ()) -> MaskArray:
        """Return which of some points belong to nothing, or to one of the pipes whose labels are given."""
        labels = self.labels[indices]
        out = np.asarray(labels < 0, dtype=np.bool_)
        for label in own:
            out |= labels == label
        return out

    def new_label(self) -> int:
        """Return a label that no pipe has."""
        self._next += 1
        return self._next

    def label(self, indices: IndexArray, label: int = CLAIMED) -> None:
        """Give points to a pipe, or to a fitting, whose they are for good; -1 makes them free."""
        self.labels[indices] = label

    def release(self, pipe: Pipe) -> None:
        """Make the points of a pipe free that lie beyond its ends."""
        margin = ON_SURFACE * pipe.spread
        reach = pipe.radius + 4.0 * margin
        for end in ENDS:
            beyond = self.about(pipe.at(end), pipe.outward(end), margin, math.inf, reach)
            self.label(beyond[self.labels[beyond] == pipe.label], -1)

    def unclaim(self) -> None:
        """Make the points of all fittings free."""
        self.labels[self.labels == CLAIMED] = -1

    def on(self, pipe: Pipe, extra: Sequence[int] = ()) -> IndexArray:
        """Return the free points on a pipe, and its own."""
        half, reach = 0.5 * pipe.length, ON_SURFACE * pipe.spread
        inner = max(0.0, pipe.radius - reach)
        found = self.about(pipe.middle, pipe.direction, -half, half, pipe.radius + reach, inner)
        return found[self.free(found, (pipe.label, *extra))]

    def density(self, pipe: Pipe) -> float:
        """Return the points per area on a pipe's own surface, as if all of it were seen; 0 without points."""
        if self.cells is None or pipe.length <= 0:
            return 0.0
        reach = ON_SURFACE * pipe.spread
        half = 0.5 * pipe.length
        near = self.about(pipe.middle, pipe.direction, -half, half, pipe.radius + reach, max(0.0, pipe.radius - reach))
        return len(near) / (2.0 * np.pi * pipe.radius * pipe.length)


def sectors_of(points: FloatArray, center: FloatArray, direction: FloatArray, sectors: int) -> IndexArray:
    """Return the sector about an axis of each point."""
    _, _, angles = cylinder_coordinates(points, center, direction)
    return np.floor((angles / (2.0 * np.pi) + 0.5) * sectors).astype(np.int64) % sectors


def tilted(pipe: Pipe, change: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return middle and unit direction of a pipe's axis after two offsets and two tilts."""
    first, second = pipe.basis
    direction = pipe.direction + change[2] * first + change[3] * second
    middle = pipe.middle + change[0] * first + change[1] * second
    return middle, direction / math.sqrt(float(direction @ direction))


def axis_change(pipe: Pipe, other: Pipe, change: FloatArray) -> FloatArray:
    """Return the offsets and tilts that bring a pipe to where another, of about the same axis, is after its own."""
    middle, direction = tilted(other, change)
    first, second = pipe.basis
    along = float((pipe.middle - middle) @ direction)
    away = middle + along * direction - pipe.middle
    slope = direction / float(direction @ pipe.direction)
    return np.array([away @ first, away @ second, slope @ first, slope @ second])
