"""Surfaces from which points are drawn evenly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis


class Surface(Protocol):
    """A surface that points can lie on."""

    @property
    def area(self) -> float:
        """Area in squared scene units."""

    def sample(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw n points, evenly over the area; shape (n, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Mantle:
    """The part of a cylinder's surface between two angles about its axis.

    Parameters
    ----------
    shape : Cylinder
        The cylinder.
    first, arc : float
        Start and size of the angular range about the axis, radians.
    """

    shape: Cylinder
    first: float
    arc: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return self.shape.radius * self.arc * self.shape.height

    def sample(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw n points, evenly over the area; shape (n, 3)."""
        angles = self.first + self.arc * rng.random(n)
        along = self.shape.height * (rng.random(n) - 0.5)
        distances = np.full(n, self.shape.radius)
        return _about_axis(self.shape.point, self.shape.direction, along, distances, angles)


@dataclass(frozen=True, slots=True, eq=False)
class Frustum:
    """The mantle of a truncated cone.

    Parameters
    ----------
    middle, direction : ndarray of shape (3,)
        Middle of the axis, and the unit direction in which it widens.
    narrow, wide : float
        Radii at the two ends, scene units, 0 <= narrow < wide.
    height : float
        Length of the axis, scene units.
    """

    middle: FloatArray
    direction: FloatArray
    narrow: float
    wide: float
    height: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return float(np.pi * (self.wide + self.narrow) * np.hypot(self.height, self.wide - self.narrow))

    def sample(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw n points, evenly over the area; shape (n, 3)."""
        distances = np.sqrt(
            self.narrow**2 + (self.wide**2 - self.narrow**2) * rng.random(n)
        )  # the area grows with the radius
        along = self.height * ((distances - self.narrow) / (self.wide - self.narrow) - 0.5)
        return _about_axis(self.middle, self.direction, along, distances, 2 * np.pi * rng.random(n))


@dataclass(frozen=True, slots=True, eq=False)
class Sphere:
    """A whole sphere.

    Parameters
    ----------
    center : ndarray of shape (3,)
        Scene units.
    radius : float
        Scene units.
    """

    center: FloatArray
    radius: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return 4 * np.pi * self.radius**2

    def sample(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw n points, evenly over the area; shape (n, 3)."""
        return self.center + self.radius * random_directions(rng, n)


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """The six faces of a box.

    Parameters
    ----------
    center : ndarray of shape (3,)
        Scene units.
    sides : ndarray of shape (3,)
        Lengths of the edges, scene units.
    turn : ndarray of shape (3, 3)
        Its columns are the directions of the edges.
    """

    center: FloatArray
    sides: FloatArray
    turn: FloatArray

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return 2 * float((self.sides.prod() / self.sides).sum())

    def sample(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw n points, evenly over the area; shape (n, 3)."""
        faces = self.sides.prod() / self.sides
        inside = rng.random((n, 3)) - 0.5
        inside[np.arange(n), rng.choice(3, n, p=faces / faces.sum())] = rng.choice([-0.5, 0.5], n)
        return np.asarray(self.center + (inside * self.sides) @ self.turn.T)


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A face of the box between the origin and `size`.

    Parameters
    ----------
    size : ndarray of shape (3,)
        Scene units.
    axis : int
        The coordinate that is constant on the face.
    level : float
        Its value, scene units.
    """

    size: FloatArray
    axis: int
    level: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return float(np.delete(self.size, self.axis).prod())

    def sample(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Draw n points, evenly over the area; shape (n, 3)."""
        points = self.size * rng.random((n, 3))
        points[:, self.axis] = self.level
        return np.asarray(points)


def random_directions(rng: np.random.Generator, n: int) -> FloatArray:
    """Draw n unit vectors, evenly over the sphere; shape (n, 3)."""
    vectors = rng.standard_normal((n, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _about_axis(
    point: FloatArray, direction: FloatArray, along: FloatArray, distances: FloatArray, angles: FloatArray
) -> FloatArray:
    first, second = axis_basis(direction)
    x, y = distances * np.cos(angles), distances * np.sin(angles)
    return np.asarray(point + x[:, None] * first + y[:, None] * second + along[:, None] * direction)
