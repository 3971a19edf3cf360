"""Surfaces beside those of `cylx.synthetic.surfaces`: all that is not a cylinder, or not quite one.

As there, `sample(rng, n)` draws points evenly over the area. `normals(points)` gives unit normals of such points, which
point outwards; surfaces without an inside say so by `open`.
"""

from dataclasses import dataclass, field

import numpy as np

from cylx.geometry.cylinder import Cylinder, axis_basis, cylinder_coordinates
from cylx.synthetic.surfaces import Box, Mantle, Sphere, Wall, random_directions


@dataclass(frozen=True, slots=True)
class Dent:
    """A hollow in a surface of revolution, as a blow leaves it: a bell, its depth a share of the radius."""

    height: float
    angle: float
    depth: float
    length: float  # standard deviation along the axis
    width: float  # and about it, radians

    def share(self, heights, angles):
        """Give the depth at places, as a share of the radius there."""
        about = (angles - self.angle + np.pi) % (2 * np.pi) - np.pi
        bell = ((heights - self.height) / self.length) ** 2 + (about / self.width) ** 2
        return self.depth * np.exp(-0.5 * bell)


@dataclass(frozen=True, slots=True, eq=False)
class Lathe:
    """A profile turned about an axis: cones, lids, shoulders of bottles, cups, bowls, cylinders that bulge.

    `heights` and `radii` are the corners of the profile; `first` and `arc` the part about the axis that is there;
    `oval` the amplitude of an ovality, as a share of the radius; `dents` change radii, but normals not.
    """

    foot: np.ndarray
    direction: np.ndarray
    heights: np.ndarray
    radii: np.ndarray
    first: float = 0.0
    arc: float = 2 * np.pi
    oval: float = 0.0
    open: bool = False
    dents: tuple = ()

    def _areas(self):
        run, rise = np.diff(self.radii), np.diff(self.heights)
        return 0.5 * self.arc * (self.radii[1:] + self.radii[:-1]) * np.hypot(run, rise)

    @property
    def area(self):
        return float(self._areas().sum())

    def sample(self, rng, n):
        areas = self._areas()
        piece = rng.choice(len(areas), n, p=areas / areas.sum())
        low, high = self.radii[piece], self.radii[piece + 1]
        radii = np.sqrt(low**2 + (high**2 - low**2) * rng.random(n))  # more area where it is wide
        straight = np.isclose(low, high)
        share = np.where(straight, rng.random(n), (radii - low) / np.where(straight, 1.0, high - low))
        heights = self.heights[piece] + share * (self.heights[piece + 1] - self.heights[piece])
        angles = self.first + self.arc * rng.random(n)
        shares = 1 + self.oval * np.cos(2 * angles) - sum(dent.share(heights, angles) for dent in self.dents)
        return self.foot + _turned_about(self.direction, heights, radii * shares, angles)

    def normals(self, points):
        heights, distances, angles = cylinder_coordinates(points, self.foot, self.direction)
        run, rise = np.diff(self.radii), np.diff(self.heights)
        length = np.hypot(run, rise)
        along = ((distances[:, None] - self.radii[:-1]) * run + (heights[:, None] - self.heights[:-1]) * rise) / length
        along = np.clip(along, 0, length)
        nearest = np.hypot(
            distances[:, None] - self.radii[:-1] - along * run / length,
            heights[:, None] - self.heights[:-1] - along * rise / length,
        ).argmin(axis=1)
        out, up = (rise / length)[nearest], (-run / length)[nearest]
        return _turned_about(self.direction, up, out, angles)


@dataclass(frozen=True, slots=True, eq=False)
class Elbow:
    """A bent pipe: part of a torus about the third column of `turn`, beginning at the first."""

    center: np.ndarray
    turn: np.ndarray
    tube: float
    bend: float
    angle: float
    open: bool = False

    @property
    def area(self):
        return 2 * np.pi * self.tube * self.bend * self.angle

    def sample(self, rng, n):
        grid = np.linspace(0, 2 * np.pi, 257)
        about = np.interp(2 * np.pi * rng.random(n), grid + self.tube / self.bend * np.sin(grid), grid)
        along = self.angle * rng.random(n)
        out = self.bend + self.tube * np.cos(about)
        local = np.column_stack([out * np.cos(along), out * np.sin(along), self.tube * np.sin(about)])
        return self.center + local @ self.turn.T

    def normals(self, points):
        local = (points - self.center) @ self.turn
        ring = local[:, :2] * (self.bend / np.linalg.norm(local[:, :2], axis=1, keepdims=True))
        local[:, :2] -= ring
        return _unit(local @ self.turn.T)


@dataclass(frozen=True, slots=True, eq=False)
class Horn:
    """A bent solid that thins towards its ends, its section flattened: a banana, a gourd, a handle.

    Its middle line is an arc of `bend` and `angle` about the third column of `turn`; `thin` is the share of the tube's
    radius that is missing at the ends, `flat` the amplitude of the section's ovality as a share of its radius.
    """

    center: np.ndarray
    turn: np.ndarray
    tube: float
    bend: float
    angle: float
    thin: float
    flat: float
    open: bool = False

    @property
    def area(self):
        return 2 * np.pi * self.tube * (1 - self.thin / 3) * self.bend * self.angle

    def sample(self, rng, n):
        along, about = rng.uniform(-1, 1, 4 * n + 8), rng.uniform(0, 2 * np.pi, 4 * n + 8)
        tube = self._tube(along)
        likely = tube * (1 + tube / self.bend * np.cos(about))
        kept = np.flatnonzero(rng.random(len(along)) * self.tube * (1 + self.tube / self.bend) < likely)
        kept = np.resize(kept, n)  # enough of them, but for the unluckiest of draws
        along, about, tube = 0.5 * self.angle * along[kept], about[kept], tube[kept]
        tube = tube * (1 + self.flat * np.cos(2 * about))
        out = self.bend + tube * np.cos(about)
        local = np.column_stack([out * np.cos(along), out * np.sin(along), tube * np.sin(about)])
        return self.center + local @ self.turn.T

    def _tube(self, along):
        return self.tube * (1 - self.thin * along**2)

    def normals(self, points):
        local = (points - self.center) @ self.turn
        local[:, :2] *= 1 - self.bend / np.maximum(np.linalg.norm(local[:, :2], axis=1, keepdims=True), 1e-12)
        return _unit(local @ self.turn.T)


@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoid:
    """An ellipsoid with its semi-axes along the columns of `turn`."""

    center: np.ndarray
    axes: np.ndarray
    turn: np.ndarray
    open: bool = False

    @property
    def area(self):
        p = 1.6075  # Knud Thomsen's formula, within 1.1 %
        pairs = self.axes * np.roll(self.axes, 1)
        return float(4 * np.pi * np.mean(pairs**p) ** (1 / p))

    def sample(self, rng, n):
        directions = random_directions(rng, 4 * n + 8)
        stretch = np.linalg.norm(directions / self.axes, axis=1)
        chosen = rng.choice(len(directions), n, replace=False, p=stretch / stretch.sum())
        return self.center + (directions[chosen] * self.axes) @ self.turn.T

    def normals(self, points):
        return _unit((points - self.center) @ self.turn / self.axes**2 @ self.turn.T)


@dataclass(frozen=True, slots=True, eq=False)
class RoundedBox:
    """A box whose edges and corners are rounded with the radius `edge`."""

    box: Box
    edge: float
    open: bool = False

    @property
    def area(self):
        return self.box.area

    def _from_core(self, points):
        local = (points - self.box.center) @ self.box.turn
        core = np.clip(local, self.edge - 0.5 * self.box.sides, 0.5 * self.box.sides - self.edge)
        return core, _unit(local - core)

    def sample(self, rng, n):
        core, out = self._from_core(self.box.sample(rng, n))
        return self.box.center + (core + self.edge * out) @ self.box.turn.T

    def normals(self, points):
        return self._from_core(points)[1] @ self.box.turn.T


@dataclass(frozen=True, slots=True, eq=False)
class Wave:
    """A square sheet with waves in both directions, like a cloth or a corrugated roof."""

    corner: np.ndarray
    turn: np.ndarray
    side: float
    amplitude: float
    wavelength: float
    open: bool = field(default=True, init=False)

    @property
    def area(self):
        return self.side**2

    def sample(self, rng, n):
        x, y = self.side * rng.random((2, n))
        phase = 2 * np.pi / self.wavelength
        z = self.amplitude * np.sin(phase * x) * np.cos(0.7 * phase * y)
        return self.corner + np.column_stack([x, y, z]) @ self.turn.T


def cone(middle, direction, radius, height, slope, closed=False):
    """Make a cone that is cut off, with `radius` in its middle and the tangent `slope` of its half-angle."""
    radii = np.maximum(radius + 0.5 * height * slope * np.array([-1.0, 1.0]), 0.05 * radius)
    return Lathe(middle - 0.5 * height * direction, direction, np.array([0.0, height]), radii, open=not closed)


def lid(shape, end):
    """Make the lid of a cylinder at its end -1 or 1."""
    foot = shape.point + 0.5 * end * shape.height * shape.direction
    radii = np.array([shape.radius, 0.0]) if end > 0 else np.array([0.0, shape.radius])
    return Lathe(foot, shape.direction, np.zeros(2), radii)


def worn(shape, first, arc, oval, barrel, dents=()):
    """Make the mantle of a cylinder out of round by the share `oval`, that bulges by the share `barrel`, with dents."""
    along = np.linspace(-1, 1, 13)
    radii = shape.radius * (1 + barrel * (along**2 - 1 / 3))
    return Lathe(shape.start, shape.direction, 0.5 * (along + 1) * shape.height, radii, first, arc, oval, dents=dents)


def random_dents(rng, radius, height, most):
    """Draw one dent or two, as deep as the share `most` of the radius at the most."""
    return tuple(
        Dent(
            rng.uniform(0, height),
            rng.uniform(0, 2 * np.pi),
            most * rng.uniform(0.1, 1.0),
            radius * rng.uniform(0.15, 0.8),
            rng.uniform(0.15, 0.6),
        )
        for _ in range(rng.integers(1, 3))
    )


def beam(middle, turn, length, width, depth, thickness):
    """Make an I-beam of three plates, along the first column of `turn`."""
    flange, web = np.array([length, width, thickness]), np.array([length, thickness, depth])
    shift = 0.5 * depth * turn[:, 2]
    return [Box(middle + shift, flange, turn), Box(middle - shift, flange, turn), Box(middle, web, turn)]


def random_turn(rng):
    """Draw a rotation."""
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return turn * np.linalg.det(turn)


def normals_of(surface, points):
    """Give the outward unit normals of points on a surface; of surfaces that are open, on either side."""
    if isinstance(surface, Mantle):
        return _unit(points - _feet(points, surface.shape))
    if isinstance(surface, Sphere):
        return _unit(points - surface.center)
    if isinstance(surface, Wall):
        return np.broadcast_to(np.eye(3)[surface.axis], points.shape)
    if isinstance(surface, Box):
        local = (points - surface.center) @ surface.turn / surface.sides
        face = np.abs(local).argmax(axis=1)
        return surface.turn.T[face] * np.sign(np.take_along_axis(local, face[:, None], axis=1))
    return surface.normals(points)


def is_open(surface):
    """Tell whether a surface is seen from both sides."""
    return isinstance(surface, Wall) or getattr(surface, "open", False)


def _feet(points, shape: Cylinder):
    along = (points - shape.point) @ shape.direction
    return shape.point + along[:, None] * shape.direction


def _turned_about(direction, along, distances, angles):
    first, second = axis_basis(direction)
    x, y = distances * np.cos(angles), distances * np.sin(angles)
    return x[:, None] * first + y[:, None] * second + along[:, None] * direction


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
