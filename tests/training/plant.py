"""A rack of pipes as four scanners around it see it."""

from dataclasses import dataclass

import numpy as np
from drafts import Sketch, finish, with_strays
from solids import Elbow, Ellipsoid, RoundedBox, beam, lid, random_dents, random_turn, worn
from visibility import scanned

from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.placement import segment_distances
from cylx.synthetic.surfaces import Box, Mantle, Sphere, Wall

MARGIN = 0.5  # of floor about the rack; all lengths in metres
RADII = (0.0125, 0.30)
BIN = 0.006  # radians
DENSE = 2_500_000
"""Points from which the scanners choose: a few in each of their bins."""
RATIOS = (0.02, 0.5)
"""Noise over spacing: a plant is scanned to see its pipes, of which the thinnest are hardly wider than the spacing."""
UP, DOWN = np.array([0.0, 0, 1]), np.array([0.0, 0, -1])


@dataclass(slots=True)
class Rack:
    """The pipes there are already, so that new ones keep clear of them."""

    sketch: Sketch
    starts: np.ndarray
    ends: np.ndarray
    radii: np.ndarray
    rng: np.random.Generator
    used: bool  # its pipes are out of round, and some are dented

    def is_free(self, start, end, radius, gap=0.01):
        return bool((segment_distances(start, end, self.starts, self.ends) > self.radii + radius + gap).all())

    def add(self, start, end, radius):
        """Add a pipe and give it as a cylinder."""
        along = end - start
        length = float(np.linalg.norm(along))
        shape = Cylinder(0.5 * (start + end), along, radius, length)
        self.sketch.add_cylinder(shape, self._mantle(shape))
        self.starts, self.ends = np.vstack([self.starts, start]), np.vstack([self.ends, end])
        self.radii = np.append(self.radii, radius)
        return shape

    def _mantle(self, shape):
        if not self.used:
            return Mantle(shape, 0.0, 2 * np.pi)
        oval, barrel = self.rng.uniform(0, 0.01), self.rng.uniform(-0.004, 0.004)
        dents = random_dents(self.rng, shape.radius, shape.height, most=0.15) if self.rng.random() < 0.15 else ()
        return worn(shape, 0.0, 2 * np.pi, oval, barrel, dents)


def plant(rng, kind, seed, points=None):
    """Make a rack of pipes between I-beams, on a floor with clutter, scanned from four sides."""
    size = rng.uniform(1.8, 3.2)
    rack = Rack(Sketch.empty(), np.empty((0, 3)), np.empty((0, 3)), np.empty(0), rng, used=rng.random() < 0.5)
    top = add_layers(rng, rack, size)
    for _ in range(rng.integers(0, 6)):
        add_riser(rng, rack, size, top)
    add_building(rng, rack.sketch, size, top)
    add_ground_clutter(rng, rack.sketch, size)
    total = points or int(10 ** rng.uniform(5.2, 5.6))
    draft = seen_by_scanners(rng, rack.sketch, size, total)
    if rng.random() < 0.5:
        draft = with_strays(rng, draft, rng.choice([0.002, 0.01, 0.03]))
    return finish(rng, draft, kind=kind, seed=seed, ratios=RATIOS)


def seen_by_scanners(rng, sketch, size, count):
    """Choose what four scanners see, in half of the scenes in lines; in half of them noise grows with the range."""
    far = size + 2 * MARGIN + 1.5
    corners = np.array([[0.5, -1.5, 1.7], [far, -1.5, 1.7], [0.5, far, 1.7], [far, far, 1.7]])
    views = corners + rng.uniform(-0.4, 0.4, (4, 3))
    draft, ranges = scanned(rng, sketch, views, bin_width=BIN, dense=DENSE, count=count, lines=rng.random() < 0.5)
    return draft._replace(blur=ranges / np.median(ranges)) if rng.random() < 0.5 else draft


def add_layers(rng, rack, size):
    """Add layers of parallel pipes, each across the one below and on I-beams; give the height of the rack."""
    level = rng.uniform(0.4, 0.8)
    first = int(rng.integers(0, 2))
    for layer in range(rng.integers(2, 5)):
        axis = (first + layer) % 2
        widest = np.exp(rng.uniform(np.log(3 * RADII[0]), np.log(RADII[1])))
        side = MARGIN
        for _ in range(rng.integers(3, 10)):
            radius = float(np.exp(rng.uniform(np.log(RADII[0]), np.log(widest))))
            side += rng.choice([0.02, 0.05, 0.1, 0.4]) + radius
            if side + radius > size + MARGIN:
                break
            add_run(rng, rack, axis, side, level + radius, radius, size)
            side += radius
        add_supports(rng, rack.sketch, axis, level, size)
        level += 2 * widest + rng.uniform(0.15, 0.5)
    return level


def add_run(rng, rack, axis, side, height, radius, size):
    """Add a level pipe along x or y, perhaps with a flange, a valve, a saddle, and elbows at its ends."""
    length = rng.uniform(0.5, 1.0) * size
    from_ = MARGIN + rng.uniform(0, size - length)
    direction, across = np.eye(3)[axis], np.eye(3)[1 - axis]
    start = from_ * direction + side * across + height * UP
    end = start + length * direction
    rack.add(start, end, radius)
    place = start + rng.uniform(0.2, 0.8) * length * direction
    extra = rng.random()
    if extra < 0.15:  # a flange: a cylinder, but too short a one to be asked for
        disc = Cylinder(place, direction, 1.4 * radius, 0.5 * radius)
        rack.sketch.add_cylinder(disc, Mantle(disc, 0.0, 2 * np.pi), doubtful=True)
        rack.sketch.add(lid(disc, -1), lid(disc, 1))
    elif extra < 0.3:
        turn = np.column_stack([direction, across, np.cross(direction, across)])
        rack.sketch.add(Ellipsoid(place, radius * np.array([2.5, 1.7, 1.7]), turn))
    elif extra < 0.45:
        sides = radius * (0.8 * direction + 2.0 * across + 1.0 * UP)
        rack.sketch.add(Box(place - 1.2 * radius * UP, sides, np.eye(3)))
    for point, outward in ((start, -direction), (end, direction)):
        if rng.random() < 0.3:
            add_elbow(rng, rack, point, outward, radius)


def add_elbow(rng, rack, point, outward, radius):
    """Bend a pipe at its end, if there is room, and let it go on for a while."""
    aside = np.cross(UP, outward)
    onward = [UP, DOWN, aside, -aside][rng.integers(4)]
    bend = radius * rng.uniform(1.5, 4)
    corner = point + bend * (outward + onward)
    length = rng.uniform(2, 20) * radius
    if onward is DOWN:
        length = min(length, corner[2])
    beyond = corner + max(length, 0.0) * onward
    if length > 0 and rack.is_free(point + (bend + 0.01) * outward + 0.5 * bend * onward, beyond, radius):
        turn = np.column_stack([-onward, outward, np.cross(-onward, outward)])
        rack.sketch.add(Elbow(point + bend * onward, turn, radius, bend, 0.5 * np.pi))
        rack.add(corner, beyond, radius)


def add_riser(rng, rack, size, top):
    """Add an upright pipe where there is room for one."""
    for _ in range(50):
        radius = float(np.exp(rng.uniform(np.log(RADII[0]), np.log(0.5 * RADII[1]))))
        x, y = MARGIN + size * rng.random(2)
        start = np.array([x, y, rng.choice([0.0, 0.3])])
        end = np.array([x, y, rng.uniform(0.7, 1.2) * top])
        if rack.is_free(start, end, radius):
            rack.add(start, end, radius)
            return


def add_supports(rng, sketch, axis, level, size):
    """Add I-beams under a layer, across its pipes."""
    depth = rng.uniform(0.06, 0.16)
    turn = np.column_stack([np.eye(3)[1 - axis], np.eye(3)[axis], UP])
    middle = 0.5 * size + MARGIN
    for share in (0.2, 0.8):
        place = middle * np.eye(3)[1 - axis] + (MARGIN + share * size) * np.eye(3)[axis]
        place = place + (level - 0.5 * depth - 0.006) * UP
        sketch.add(*beam(place, turn, size, 0.7 * depth, depth, 0.012))


def add_building(rng, sketch, size, top):
    """Add floor, walls, and H-beam columns at the corners."""
    edge = size + 2 * MARGIN
    floor = np.array([edge, edge, 2.5])
    sketch.add(Wall(floor, 2, 0.0))
    if rng.random() < 0.6:
        sketch.add(Wall(floor, 0, 0.0))
    width = rng.uniform(0.08, 0.2)
    upright = np.column_stack([UP, np.eye(3)[0], np.eye(3)[1]])
    for x in (0.6 * MARGIN, edge - 0.6 * MARGIN):
        for y in (0.6 * MARGIN, edge - 0.6 * MARGIN):
            sketch.add(*beam(np.array([x, y, 0.5 * top]), upright, top, width, width, 0.012))


def add_ground_clutter(rng, sketch, size):
    """Add boxes, sharp and rounded, and round things on the floor."""
    for _ in range(rng.integers(3, 12)):
        x, y = MARGIN + size * rng.random(2)
        extent = rng.uniform(0.05, 0.4)
        if rng.random() < 0.7:
            sides = extent * rng.uniform(0.4, 1.0, 3)
            angle = rng.uniform(0, np.pi)
            turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
            box = Box(np.array([x, y, 0.5 * sides[2]]), sides, turn)
            sketch.add(RoundedBox(box, 0.1 * sides.min()) if rng.random() < 0.5 else box)
        elif rng.random() < 0.5:
            sketch.add(Sphere(np.array([x, y, 0.3 * extent]), 0.4 * extent))
        else:
            axes = 0.5 * extent * rng.uniform(0.5, 1.0, 3)
            sketch.add(Ellipsoid(np.array([x, y, 0.5 * axes.min()]), axes, random_turn(rng)))
