"""The solids that pipes are made of: rods, bends, cones and mitres, as every format writes them in its own way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.geometry.numerics import cross


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """A part of a torus, from `start` about `normal` by the right-hand rule.

    Parameters
    ----------
    center : ndarray of shape (3,)
        Middle of the circle that the centre line follows, scene units.
    normal : ndarray of shape (3,)
        Unit normal of its plane.
    start : ndarray of shape (3,)
        First point of the centre line, in that plane, scene units.
    angle : float
        Radians, in (0, pi].
    radius : float
        Radius of the tube, scene units, less than the bend radius.
    """

    center: FloatArray
    normal: FloatArray
    start: FloatArray
    angle: float
    radius: float

    @property
    def bend_radius(self) -> float:
        """Radius of the centre line, scene units."""
        return float(np.linalg.norm(self.start - self.center))

    @property
    def radial(self) -> FloatArray:
        """Unit vector from the centre to the start."""
        away = self.start - self.center
        return np.asarray(away / np.linalg.norm(away))

    def at(self, angle: float) -> FloatArray:
        """Return the point of the centre line after an angle, radians."""
        return self.center + self.bend_radius * self.radial_at(angle)

    def radial_at(self, angle: float) -> FloatArray:
        """Return the unit vector from the centre to that point."""
        first, second = self.radial, cross(self.normal, self.radial)
        return np.asarray(np.cos(angle) * first + np.sin(angle) * second)


@dataclass(frozen=True, slots=True, eq=False)
class Cone:
    """A piece of a cone between two parallel discs, which need not face each other.

    Parameters
    ----------
    start, end : ndarray of shape (3,)
        Middles of the discs, scene units.
    axis : ndarray of shape (3,)
        Unit normal of both discs; `end - start` has a positive component along it.
    start_radius, end_radius : float
        Scene units, > 0.
    """

    start: FloatArray
    end: FloatArray
    axis: FloatArray
    start_radius: float
    end_radius: float

    @property
    def height(self) -> float:
        """Distance of the discs, scene units."""
        return float((self.end - self.start) @ self.axis)

    @property
    def shift(self) -> FloatArray:
        """How far the second disc is aside, in its plane, scene units."""
        return np.asarray(self.end - self.start - self.height * self.axis)


@dataclass(frozen=True, slots=True, eq=False)
class Mitre:
    """Two rods that are cut where they meet.

    Parameters
    ----------
    start, corner, end : ndarray of shape (3,)
        Its centre line, scene units.
    radius : float
        Scene units.
    """

    start: FloatArray
    corner: FloatArray
    end: FloatArray
    radius: float

    @property
    def directions(self) -> tuple[FloatArray, FloatArray]:
        """Unit directions of the rods, from start to end."""
        first, second = self.corner - self.start, self.end - self.corner
        return first / np.linalg.norm(first), second / np.linalg.norm(second)

    @property
    def cut(self) -> FloatArray:
        """Unit normal of the plane of the cut."""
        first, second = self.directions
        both = first + second
        return np.asarray(both / np.linalg.norm(both))


Solid = Cylinder | Bend | Cone | Mitre


def middle_of(solid: Solid) -> FloatArray:
    """Return a place in a solid, or near it, shape (3,), scene units."""
    if isinstance(solid, Cylinder):
        return solid.point
    if isinstance(solid, Bend):
        return solid.at(0.5 * solid.angle)
    if isinstance(solid, Cone):
        return np.asarray(0.5 * (solid.start + solid.end))
    return solid.corner


def radius_of(solid: Solid) -> float:
    """Return the smallest radius of a solid, scene units."""
    return min(solid.start_radius, solid.end_radius) if isinstance(solid, Cone) else solid.radius


def rings_of(solid: Bend | Cone | Mitre, sides: int) -> FloatArray:
    """Return rings of points on the surface of a solid, from its start to its end.

    Parameters
    ----------
    solid : Bend, Cone or Mitre
    sides : int
        Points of a ring; a bend has as many rings in a whole turn.

    Returns
    -------
    ndarray of shape (K, sides, 3)
        Relative to the middle of the solid; each is counterclockwise, seen against the centre line.
    """
    turn = 2.0 * np.pi * np.arange(sides) / sides
    middle = middle_of(solid)
    if isinstance(solid, Bend):
        count = max(1, int(np.ceil(solid.angle * sides / (2.0 * np.pi) - 1e-9)))
        steps = np.linspace(0.0, solid.angle, count + 1)
        return np.array(
            [_ring(solid.at(step) - middle, solid.normal, solid.radial_at(step), solid.radius, turn) for step in steps]
        )
    if isinstance(solid, Cone):
        first, second = axis_basis(solid.axis)
        return np.array(
            [
                _ring(solid.start - middle, first, second, solid.start_radius, turn),
                _ring(solid.end - middle, first, second, solid.end_radius, turn),
            ]
        )
    before, after = solid.directions
    across = cross(before, after)
    across = across / np.linalg.norm(across)
    cut = solid.cut
    long = 1.0 / float(cut @ before)
    return np.array(
        [
            _ring(solid.start - middle, across, cross(before, across), solid.radius, turn),
            _ring(np.zeros(3), across, long * cross(cut, across), solid.radius, turn),
            _ring(solid.end - middle, across, cross(after, across), solid.radius, turn),
        ]
    )


def _ring(center: FloatArray, first: FloatArray, second: FloatArray, radius: float, turn: FloatArray) -> FloatArray:
    """Return points on an ellipse with two half-axes in the ratio of two vectors."""
    ring: FloatArray = center + radius * (np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second))
    return ring


def unit(vector: ArrayLike, otherwise: FloatArray) -> FloatArray:
    """Return a vector of length 1; another one if it has no length."""
    out = np.asarray(vector, dtype=np.float64)
    length = float(np.linalg.norm(out))
    return out / length if length > 0.0 else otherwise
