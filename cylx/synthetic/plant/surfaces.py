"""Surfaces of pipes and fittings: points with outward normals, and the solids that hide what is behind or inside them.

A solid is a row of numbers (see `cylx.synthetic.plant.visibility`), so that one kernel tests all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis

SOLID_NUMBERS = 15
REVOLVED, BLOCK = 0.0, 1.0
_STEP_OF_BENDS = math.radians(5.0)


class PipingSurface(Protocol):
    """A surface with a normal, and what it encloses."""

    @property
    def area(self) -> float:
        """Area in squared scene units."""

    @property
    def lift(self) -> float:
        """How far off the surface a point is surely outside of the surface's own solids, scene units."""

    def sample(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Draw n points, evenly over the area, with their outward unit normals; both of shape (n, 3)."""

    def solids(self) -> FloatArray:
        """Return the solids; shape (S, SOLID_NUMBERS), S may be 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Revolved:
    """Circles about a line: cylinder, cone (straight or oblique), ellipsoid of revolution.

    The circle at height s, low <= s <= high, is perpendicular to `direction`, has its centre at
    base + s (direction + skew) and the radius sqrt((radius + slope s)^2 - bulge s^2).

    Parameters
    ----------
    base, direction : ndarray of shape (3,)
        Centre at height 0, scene units, and a unit vector.
    low, high : float
        Range of the height, scene units.
    radius : float
        At height 0, scene units, > 0.
    slope, bulge : float
        Both 0 for a cylinder; slope for a cone, bulge for an ellipsoid.
    skew : ndarray of shape (3,)
        Perpendicular to `direction`; 0 unless the cone is oblique.
    """

    base: FloatArray
    direction: FloatArray
    low: float
    high: float
    radius: float
    slope: float = 0.0
    bulge: float = 0.0
    skew: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        s = np.linspace(self.low, self.high, 65)
        angles = 2 * np.pi * (np.arange(64) + 0.5) / 64
        density = self._density(s[:, None], angles[None, :])[0].mean(axis=1) * 2 * np.pi
        width = (self.high - self.low) / 64
        return float(width * (density.sum() - 0.5 * (density[0] + density[-1])))

    @property
    def lift(self) -> float:
        """How far off the surface a point is surely outside of the surface's own solids, scene units."""
        return 0.02 * self.radius

    def _density(self, s: FloatArray, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return area per height and angle, and the rate at which the surface widens there."""
        first, second = axis_basis(self.direction)
        straight = self.radius + self.slope * s
        rho = np.sqrt(np.maximum(straight**2 - self.bulge * s**2, 0.0))
        widening = straight * self.slope - self.bulge * s  # rho times the derivative of rho
        leaning = (self.skew @ first) * np.cos(angles) + (self.skew @ second) * np.sin(angles)
        return np.sqrt(rho**2 + (widening + rho * leaning) ** 2), widening + rho * leaning

    def sample(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Draw n points, evenly over the area, with their outward unit normals; both of shape (n, 3)."""
        grid = np.linspace(self.low, self.high, 65)
        top = 1.02 * float(self._density(grid[:, None], np.linspace(0, 2 * np.pi, 65)[None, :])[0].max())
        even = self.slope == 0 and self.bulge == 0
        s, angles = np.empty(0), np.empty(0)
        while len(s) < n:
            more = n - len(s)
            drawn = rng.uniform(self.low, self.high, more)
            turned = rng.uniform(0, 2 * np.pi, more)
            kept = np.full(more, True) if even else rng.random(more) * top < self._density(drawn, turned)[0]
            s, angles = np.append(s, drawn[kept]), np.append(angles, turned[kept])
        first, second = axis_basis(self.direction)
        outward = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
        rho = np.sqrt(np.maximum((self.radius + self.slope * s) ** 2 - self.bulge * s**2, 0.0))
        points = self.base + s[:, None] * (self.direction + self.skew) + rho[:, None] * outward
        density, widening = self._density(s, angles)
        normals = (rho[:, None] * outward - widening[:, None] * self.direction) / density[:, None]
        return points, normals

    def solids(self) -> FloatArray:
        """Return the solids; shape (1, SOLID_NUMBERS)."""
        shape = (self.low, self.high, self.radius, self.slope, self.bulge)
        return np.concatenate([[REVOLVED], self.base, self.direction, self.skew, shape])[None, :]


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A flat disc with a hole: the face of a flange, the end of an insulation. Its solid belongs to the mantle.

    Parameters
    ----------
    center, normal : ndarray of shape (3,)
        Scene units; the normal is a unit vector that points outwards.
    inner, outer : float
        Radii, scene units, 0 <= inner < outer.
    """

    center: FloatArray
    normal: FloatArray
    inner: float
    outer: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return math.pi * (self.outer**2 - self.inner**2)

    @property
    def lift(self) -> float:
        """How far off the surface a point is surely outside of the surface's own solids, scene units."""
        return 1e-3 * self.outer

    def sample(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Draw n points, evenly over the area, with their outward unit normals; both of shape (n, 3)."""
        rho = np.sqrt(self.inner**2 + (self.outer**2 - self.inner**2) * rng.random(n))
        angles = 2 * np.pi * rng.random(n)
        first, second = axis_basis(self.normal)
        x, y = rho * np.cos(angles), rho * np.sin(angles)
        return self.center + x[:, None] * first + y[:, None] * second, np.tile(self.normal, (n, 1))

    def solids(self) -> FloatArray:
        """Return no solid; shape (0, SOLID_NUMBERS)."""
        return np.empty((0, SOLID_NUMBERS))


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """A part of a torus.

    Parameters
    ----------
    center, normal : ndarray of shape (3,)
        Centre of the bend circle, scene units, and the unit normal of its plane.
    outward : ndarray of shape (3,)
        Unit vector from the centre to the start of the centre line; the bend turns about `normal`.
    bend_radius, radius : float
        Of the centre line and of the pipe, scene units, bend_radius > radius > 0.
    angle : float
        Radians, in (0, pi].
    """

    center: FloatArray
    normal: FloatArray
    outward: FloatArray
    bend_radius: float
    radius: float
    angle: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return 2 * math.pi * self.radius * self.bend_radius * self.angle

    @property
    def lift(self) -> float:
        """How far off the surface a point is surely outside of the surface's own solids, scene units."""
        return 0.02 * self.radius + 0.001 * self.bend_radius

    def at(self, turned: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points of the centre line, and the unit vectors from the centre to them; both of shape (n, 3)."""
        sideways = np.cross(self.normal, self.outward)
        radial = np.cos(turned)[:, None] * self.outward + np.sin(turned)[:, None] * sideways
        return self.center + self.bend_radius * radial, radial

    def sample(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Draw n points, evenly over the area, with their outward unit normals; both of shape (n, 3)."""
        about = np.empty(0)
        while len(about) < n:
            drawn = rng.uniform(0, 2 * np.pi, n - len(about))
            wide = self.bend_radius + self.radius * np.cos(drawn)  # the area grows with the distance from the centre
            about = np.append(about, drawn[rng.random(len(drawn)) * (self.bend_radius + self.radius) < wide])
        line, radial = self.at(self.angle * rng.random(n))
        normals = np.cos(about)[:, None] * radial + np.sin(about)[:, None] * self.normal
        return line + self.radius * normals, normals

    def solids(self) -> FloatArray:
        """Return a chain of short cylinders along the centre line; shape (S, SOLID_NUMBERS)."""
        nodes = self.at(np.linspace(0, self.angle, 1 + math.ceil(self.angle / _STEP_OF_BENDS)))[0]
        return np.concatenate([pipe(a, b, self.radius).solids() for a, b in pairwise(nodes)])


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """A box.

    Parameters
    ----------
    center, sides : ndarray of shape (3,)
        Scene units.
    turn : ndarray of shape (3, 3)
        Its columns are the directions of the edges, right-handed.
    """

    center: FloatArray
    sides: FloatArray
    turn: FloatArray

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return 2 * float((self.sides.prod() / self.sides).sum())

    @property
    def lift(self) -> float:
        """How far off the surface a point is surely outside of the surface's own solids, scene units."""
        return 1e-3 * float(self.sides.min())

    def sample(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Draw n points, evenly over the area, with their outward unit normals; both of shape (n, 3)."""
        faces = self.sides.prod() / self.sides
        inside, normals = rng.random((n, 3)) - 0.5, np.zeros((n, 3))
        axes, signs = rng.choice(3, n, p=faces / faces.sum()), rng.choice([-1.0, 1.0], n)
        inside[np.arange(n), axes], normals[np.arange(n), axes] = 0.5 * signs, signs
        return self.center + (inside * self.sides) @ self.turn.T, normals @ self.turn.T

    def solids(self) -> FloatArray:
        """Return the box; shape (1, SOLID_NUMBERS)."""
        halves = 0.5 * self.sides
        return np.concatenate([[BLOCK], self.center, self.turn[:, 0], self.turn[:, 1], halves, [0.0, 0.0]])[None, :]


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A side of the room, seen from within; it hides nothing in the room.

    Parameters
    ----------
    size : ndarray of shape (3,)
        The room is between the origin and this corner, scene units.
    axis : int
        The coordinate that is constant.
    level : float
        Its value: 0 or that of `size`.
    """

    size: FloatArray
    axis: int
    level: float

    @property
    def area(self) -> float:
        """Area in squared scene units."""
        return float(np.delete(self.size, self.axis).prod())

    @property
    def lift(self) -> float:
        """How far off the surface a point is surely outside of the surface's own solids, scene units."""
        return 1e-4 * float(self.size.min())

    def sample(self, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
        """Draw n points, evenly over the area, with their unit normals into the room; both of shape (n, 3)."""
        points, normal = self.size * rng.random((n, 3)), np.zeros(3)
        points[:, self.axis], normal[self.axis] = self.level, 1.0 if self.level == 0 else -1.0
        return points, np.tile(normal, (n, 1))

    def solids(self) -> FloatArray:
        """Return no solid; shape (0, SOLID_NUMBERS)."""
        return np.empty((0, SOLID_NUMBERS))


def pipe(start: FloatArray, end: FloatArray, radius: float) -> Revolved:
    """Return the mantle of a cylinder between two points of its axis."""
    length = float(np.linalg.norm(end - start))
    return Revolved(start, (end - start) / length, 0.0, length, radius)
