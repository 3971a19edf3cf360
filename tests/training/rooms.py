"""Rooms full of cylinders of every kind and of things that are none: `room`, `arcs`, `correlated` and `clutter`."""

from dataclasses import dataclass

import numpy as np
from drafts import Draft, Sketch, finish, with_strays
from solids import Elbow, Ellipsoid, RoundedBox, Wave, beam, cone, lid, random_turn, worn

from cylx.geometry.cylinder import Cylinder
from cylx.synthetic import NOISE, multi
from cylx.synthetic.surfaces import Box, Wall, random_directions

HEIGHT = 0.65  # of a room, in widths


@dataclass(slots=True)
class Space:
    """Keeps balls in a room from touching each other; a ball that finds no place is left out."""

    width: float
    centers: np.ndarray
    radii: np.ndarray

    def is_free(self, center, radius, gap):
        return bool((np.linalg.norm(self.centers - center, axis=1) > self.radii + radius + gap).all())

    def take(self, center, radius):
        self.centers, self.radii = np.vstack([self.centers, center]), np.append(self.radii, radius)

    def place(self, rng, radius, standing=False):
        """Find a center for a ball, or None; what stands has the height 0 there."""
        high = np.array([self.width - radius, self.width - radius, max(1.01 * radius, 0.6 * self.width)])
        for _ in range(300):
            center = rng.uniform(radius, np.maximum(high, radius))
            center[2] = 0.0 if standing else center[2]
            if self.is_free(center, radius, 0.0 if standing else 0.02 * self.width):
                self.take(center, radius)
                return center
        return None


def room(rng, kind, seed, points=None):
    """Make a room; kind `arcs` shows little of most cylinders, kind `correlated` has noise that neighbours share."""
    width = rng.uniform(2, 8)
    space, sketch = Space(width, np.empty((0, 3)), np.empty(0)), Sketch.empty()
    arc = (25, 120) if kind == "arcs" else (60, 360)
    for _ in range(rng.integers(3, 20)):
        add_cylinder(rng, sketch, space, arc)
    add_round_things(rng, sketch, space)
    add_angular_things(rng, sketch, space)
    size = width * np.array([1, 1, HEIGHT])
    sketch.add(Wall(size, 2, 0.0))
    if rng.random() < 0.8:
        sketch.add(Wall(size, 0, 0.0))
    total = points or int(10 ** rng.uniform(4.75, 5.55))
    share = rng.choice([0, 0.02, 0.05, 0.1, 0.2])
    draft = sketch.draft(sketch.clouds(rng, int((1 - share) * total), jitter=1.6))
    draft = with_strays(rng, draft, share)
    return finish(rng, draft, kind=kind, seed=seed, correlated=kind == "correlated")


def add_cylinder(rng, sketch, space, arc_deg):
    """Add a cylinder: in the air, standing on the floor, or along wall or floor at a small distance."""
    width = space.width
    radius = width * 10 ** rng.uniform(-2.5, -1.1)
    height = float(np.clip(radius * rng.uniform(1, 15), 0.02 * width, 0.5 * width))
    reach, manner = float(np.hypot(0.5 * height, radius)), rng.random()
    if manner < 0.2:
        center, direction = beside_a_wall(rng, width, radius, height)
        if not space.is_free(center, reach, 0.0):
            return
        space.take(center, reach)
    else:
        standing = manner < 0.4
        center = space.place(rng, reach, standing)
        if center is None:
            return
        direction = np.array([0.0, 0, 1]) if standing else random_directions(rng, 1)[0]
        center = center + np.array([0, 0, 0.5 * height]) if standing else center
    shape = Cylinder(center, direction, radius, height)
    arc = np.radians(rng.uniform(*arc_deg) if rng.random() < 0.7 else 360)
    oval = rng.uniform(0, 0.015) if rng.random() < 0.4 else 0.0
    barrel = rng.uniform(-0.01, 0.01) if rng.random() < 0.3 else 0.0
    sketch.add_cylinder(shape, worn(shape, rng.uniform(0, 2 * np.pi), arc, oval, barrel))
    if rng.random() < 0.4:
        sketch.add(lid(shape, -1), lid(shape, 1))


def beside_a_wall(rng, width, radius, height):
    """Place a pipe along the wall x = 0 or the floor; give its middle and direction."""
    gap = radius + rng.choice([0, 0.005, 0.01, 0.03]) * width
    along = rng.uniform(0.5 * height, width - 0.5 * height)
    if rng.random() < 0.5:  # on the wall, upright or level
        level = rng.uniform(0.5 * height + radius, max(0.51 * height + radius, 0.6 * width))
        direction = np.array([0.0, 1, 0]) if rng.random() < 0.5 else np.array([0, 0, 1.0])
        return np.array([gap, along, level]), direction
    return np.array([rng.uniform(0.1, 0.9) * width, along, gap]), np.array([0.0, 1, 0])


def add_round_things(rng, sketch, space):
    """Add cones (more than 3.5 degrees), elbows, spheres and ellipsoids."""
    width = space.width
    for _ in range(rng.integers(1, 7)):
        radius = width * 10 ** rng.uniform(-2, -1)
        height, slope = radius * rng.uniform(2, 6), np.tan(np.radians(rng.uniform(3.5, 25)))
        center = space.place(rng, float(np.hypot(0.5 * height, radius + 0.5 * height * slope)))
        if center is not None:
            sketch.add(cone(center, random_directions(rng, 1)[0], radius, height, slope))
    for _ in range(rng.integers(1, 7)):
        tube = width * 10 ** rng.uniform(-2.3, -1.3)
        bend = tube * rng.uniform(1.3, 4)
        center = space.place(rng, tube + bend)
        if center is not None:
            sketch.add(Elbow(center, random_turn(rng), tube, bend, rng.uniform(0.7, 3.2)))
    for _ in range(rng.integers(1, 7)):
        radius = width * 10 ** rng.uniform(-2, -0.9)
        center = space.place(rng, 1.5 * radius)
        if center is not None:
            axes = radius * (rng.uniform(0.6, 1.5, 3) if rng.random() < 0.5 else np.ones(3))
            sketch.add(Ellipsoid(center, axes, random_turn(rng)))


def add_angular_things(rng, sketch, space):
    """Add boxes, sharp and rounded, I-beams, which may go through anything, and sheets with waves."""
    width = space.width
    for _ in range(rng.integers(2, 9)):
        sides = width * rng.uniform(0.03, 0.2, 3)
        edge = rng.choice([0, 0, 0.05, 0.1, 0.2]) * sides.min()
        center = space.place(rng, 0.5 * float(np.linalg.norm(sides)))
        if center is not None:
            box = Box(center, sides, random_turn(rng) if rng.random() < 0.6 else np.eye(3))
            sketch.add(RoundedBox(box, edge) if edge else box)
    for _ in range(rng.integers(0, 5)):
        side = width * rng.uniform(0.01, 0.04)
        turn = np.eye(3) if rng.random() < 0.5 else np.eye(3)[:, [2, 0, 1]]
        middle = width * rng.uniform([0, 0, 0.1], [1, 1, 0.6])
        sketch.add(*beam(middle, turn, width * rng.uniform(0.3, 0.95), side, side, side * rng.uniform(0.05, 0.15)))
    for _ in range(rng.integers(0, 3)):
        turn = np.eye(3) if rng.random() < 0.5 else random_turn(rng)
        side, height = width * rng.uniform(0.2, 0.5), width * rng.uniform(0.005, 0.04)
        sketch.add(Wave(width * rng.random(3), turn, side, height, width * rng.uniform(0.1, 0.4)))


def clutter(rng, kind, seed, points=None):
    """Make a room of `cylx.synthetic.multi` with parameters of any size."""
    radius = 10 ** rng.uniform(-2, -0.5)
    scene = multi(
        points=points or int(10 ** rng.uniform(4.75, 5.55)),
        cylinders=int(rng.integers(1, 25)),
        planes=int(rng.integers(0, 7)),
        boxes=int(rng.integers(0, 9)),
        spheres=int(rng.integers(0, 9)),
        cones=int(rng.integers(0, 7)),
        noise=float(rng.choice([0, 0.02, 0.05, 0.1, 0.2, 0.3])),
        sigma=0.0,
        seed=int(rng.integers(2**31)),
        radius_min=radius * rng.uniform(0.15, 0.8),
        radius_max=radius,
        coverage_min_deg=float(rng.choice([40, 90, 150, 300])),
    )
    shapes = [true.cylinder for true in scene.cylinders]
    blur = (scene.labels != NOISE).astype(float)
    return finish(rng, Draft(scene.points, scene.labels, shapes, blur=blur), kind=kind, seed=seed)
