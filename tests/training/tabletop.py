"""Household things on a table: the view of one depth camera, or a scan from all around."""

import numpy as np
from drafts import Sketch, finish
from solids import Elbow, Ellipsoid, Horn, Lathe, RoundedBox, lid, random_dents, random_turn
from visibility import scanned

from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.synthetic.surfaces import Box, Mantle, Sphere, Wall

TABLE = np.array([1.2, 0.8, 0.0])  # metres
BIN = 0.0025  # radians
DENSE = 1_500_000
UP = np.array([0.0, 0, 1])


def tabletop(rng, kind, seed, points=None):
    """Make a table with cans, bottles, cups, boxes, bowls and balls."""
    sketch, taken = Sketch.empty(), []
    sketch.add(Wall(TABLE, 2, 0.0))
    for _ in range(rng.integers(3, 13)):
        thing = rng.choice([can, bottle, cup, carton, bowl, ball, fruit])
        thing(rng, sketch, taken)
    total = points or int(10 ** rng.uniform(4.7, 5.5))
    draft = (
        seen_by_camera(rng, sketch, total)
        if rng.random() < 0.6
        else sketch.draft(sketch.clouds(rng, total, jitter=1.5))
    )
    return finish(rng, draft, kind=kind, seed=seed)


def seen_by_camera(rng, sketch, count):
    """Choose what a camera sees; noise grows with the distance squared, and may go along the rays only."""
    elevation, azimuth = np.radians(rng.uniform(20, 65)), rng.uniform(0, 2 * np.pi)
    level = np.cos(elevation)
    view = 0.5 * TABLE + rng.uniform(0.8, 1.4) * np.array(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    )
    draft, ranges = scanned(rng, sketch, [view], bin_width=BIN, dense=DENSE, count=count)
    rays = (draft.points - view) / ranges[:, None] if rng.random() < 0.5 else None
    return draft._replace(blur=(ranges / np.median(ranges)) ** 2, rays=rays)


def spot(rng, taken, reach):
    """Find a free place for something so wide on the table, or None."""
    for _ in range(200):
        x, y = rng.uniform(0.5 * reach, TABLE[:2] - 0.5 * reach)
        if all(np.hypot(x - a, y - b) > reach + c + 0.005 for a, b, c in taken):
            taken.append((x, y, reach))
            return np.array([x, y, 0.0])
    return None


def stand_or_lie(rng, taken, radius, height, lying=0.2):
    """Find a place for a thing of revolution: its foot and its direction, or None."""
    if rng.random() < lying:
        place = spot(rng, taken, max(0.5 * height, radius))
        angle = rng.uniform(0, 2 * np.pi)
        direction = np.array([np.cos(angle), np.sin(angle), 0])
        return None if place is None else (place + radius * UP - 0.5 * height * direction, direction)
    place = spot(rng, taken, radius)
    return None if place is None else (place, UP)


def can(rng, sketch, taken):
    """Add a closed can, or a mug: open, with a handle."""
    radius = rng.uniform(0.015, 0.055)
    height = radius * (rng.uniform(0.6, 1.2) if rng.random() < 0.3 else rng.uniform(1.0, 4.5))
    is_mug = rng.random() < 0.2
    placed = stand_or_lie(rng, taken, radius * (1.8 if is_mug else 1.0), height, lying=0.0 if is_mug else 0.2)
    if placed is None:
        return
    foot, direction = placed
    shape = Cylinder(foot + 0.5 * height * direction, direction, radius, height)
    real = rng.random() < 0.7
    sketch.add_cylinder(shape, formed(rng, foot, direction, radius, height) if real else Mantle(shape, 0.0, 2 * np.pi))
    if is_mug:
        first, second = axis_basis(direction)
        angle = rng.uniform(0, 2 * np.pi)
        out = np.cos(angle) * first + np.sin(angle) * second
        turn = np.column_stack([-direction, out, np.cross(-direction, out)])
        sketch.add(Elbow(shape.point + radius * out, turn, 0.12 * radius, 0.3 * height, np.pi))
    else:
        depth = rng.uniform(0.0, 0.12) * radius if real else 0.0  # lids of tins lie below their rims
        inner = Cylinder(shape.point, shape.direction, radius, height - 2 * depth)
        sketch.add(lid(inner, -1), lid(inner, 1))
        if real and rng.random() < 0.5:  # rolled rims
            bead = rng.uniform(0.0007, 0.0025)
            turn = np.column_stack([*axis_basis(direction), direction])
            sketch.add(*(Elbow(end, turn, bead, radius, 2 * np.pi) for end in (shape.start, shape.end)))


def formed(rng, foot, direction, radius, height):
    """Give the mantle of a real can: rims, ribs, a belly, a neck, a little out of round, by a hundredth; and dents."""
    heights = np.linspace(0.0, height, 90)
    along = heights / height
    share = rng.uniform(-0.006, 0.006) * (4 * (along - 0.5) ** 2 - 1 / 3)
    if rng.random() < 0.5:
        rim = min(rng.uniform(0.002, 0.004), 0.1 * height)
        share = share + rng.uniform(0.005, 0.035) * ((heights < rim) | (heights > height - rim))
    if rng.random() < 0.4:
        ribbed = (along > 0.2) & (along < 0.8)
        pitch = rng.uniform(0.004, 0.012)
        share = share + rng.uniform(0.002, 0.012) * np.sin(2 * np.pi * heights / pitch) * ribbed
    if rng.random() < 0.2:
        share = share - rng.uniform(0.01, 0.12) * np.clip((along - 0.9) / 0.1, 0, 1)
    oval = rng.uniform(0, 0.008)
    dents = random_dents(rng, radius, height, most=0.2) if rng.random() < 0.25 else ()
    return Lathe(foot, direction, heights, radius * (1 + share), oval=oval, open=True, dents=dents)


def bottle(rng, sketch, taken):
    """Add a bottle: body, shoulder and neck; one in three is oval, and so no cylinder."""
    radius = rng.uniform(0.02, 0.05)
    body, shoulder, neck = radius * rng.uniform([1.5, 0.5, 0.4], [4.5, 1.8, 1.8])
    narrow = radius * rng.uniform(0.25, 0.5)
    placed = stand_or_lie(rng, taken, radius, body + shoulder + neck)
    if placed is None:
        return
    foot, direction = placed
    bent = np.linspace(0, 0.5 * np.pi, 6)
    slope_heights = body + shoulder * np.sin(bent)
    slope_radii = narrow + (radius - narrow) * np.cos(bent)
    if rng.random() < 1 / 3:
        heights = np.concatenate([[0, 0], slope_heights, [slope_heights[-1] + neck] * 2])
        radii = np.concatenate([[0, radius], slope_radii, [narrow, 0]])
        oval = rng.uniform(0.15, 0.35)
        sketch.add(Lathe(foot + oval * radius * (UP - direction), direction, heights, radii, oval=oval))
        return
    for low, length, width, end in ((0.0, body, radius, -1), (body + shoulder, neck, narrow, 1)):
        shape = Cylinder(foot + (low + 0.5 * length) * direction, direction, width, length)
        sketch.add_cylinder(shape, Mantle(shape, 0.0, 2 * np.pi))
        upside = 1 if direction @ shape.direction > 0 else -1
        sketch.add(lid(shape, end * upside))
    sketch.add(Lathe(foot, direction, slope_heights, slope_radii))


def cup(rng, sketch, taken):
    """Add a cup: tapered by more than 3 degrees, or by so little that either opinion is right."""
    radius = rng.uniform(0.02, 0.05)
    height = radius * rng.uniform(1.5, 3.5)
    nearly = rng.random() < 0.3
    slope = np.tan(np.radians(rng.uniform(0, 1.5) if nearly else rng.uniform(3.2, 12)))
    placed = stand_or_lie(rng, taken, radius + 0.5 * height * slope, height, lying=0.15)
    if placed is None:
        return
    foot, direction = placed
    radii = radius + 0.5 * height * slope * np.array([-1.0, 1.0]) * rng.choice([-1, 1])
    side = Lathe(foot, direction, np.array([0.0, height]), radii, open=True)
    if nearly:
        shape = Cylinder(foot + 0.5 * height * direction, direction, radius, height)
        sketch.add_cylinder(shape, side, doubtful=True)
    else:
        sketch.add(side)
    sketch.add(Lathe(foot, direction, np.zeros(2), np.array([0.0, radii[0]]), open=True))


def carton(rng, sketch, taken):
    """Add a box with edges more or less rounded."""
    sides = rng.uniform([0.03, 0.03, 0.02], [0.2, 0.12, 0.25])
    place = spot(rng, taken, 0.5 * float(np.hypot(*sides[:2])))
    if place is None:
        return
    angle = rng.uniform(0, np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    edge = rng.choice([0, 0.03, 0.1, 0.2, 0.35]) * sides.min()
    box = Box(place + 0.5 * sides[2] * UP, sides, turn)
    sketch.add(RoundedBox(box, edge) if edge else box)


def bowl(rng, sketch, taken):
    """Add a bowl: a part of a sphere, or of something flatter."""
    radius = rng.uniform(0.04, 0.1)
    place = spot(rng, taken, radius)
    if place is None:
        return
    bent = np.linspace(0.2, rng.uniform(0.35, 0.5) * np.pi, 10)
    depth = radius * rng.uniform(0.5, 1.0)
    sketch.add(Lathe(place, UP, depth * (np.cos(bent[0]) - np.cos(bent)), radius * np.sin(bent), open=True))


def ball(rng, sketch, taken):
    """Add a ball, or a fruit."""
    radius = rng.uniform(0.02, 0.07)
    place = spot(rng, taken, 1.4 * radius)
    if place is None:
        return
    if rng.random() < 0.5:
        sketch.add(Sphere(place + radius * UP, radius))
    else:
        sketch.add(Ellipsoid(place + radius * UP, radius * rng.uniform(0.6, 1.4, 3), random_turn(rng)))


def fruit(rng, sketch, taken):
    """Add something bent that thins towards its ends: a banana, a gourd, a loose handle, lying."""
    tube = rng.uniform(0.006, 0.03)
    bend, angle = tube * rng.uniform(3, 12), rng.uniform(0.6, 2.2)
    place = spot(rng, taken, bend * np.sin(0.5 * angle) + tube)
    if place is None:
        return
    first = rng.uniform(0, 2 * np.pi)
    out = np.array([np.cos(first), np.sin(first), 0])
    turn = np.column_stack([out, np.cross(UP, out), UP])
    thin, flat = rng.uniform(0.1, 0.8), rng.uniform(0, 0.15)
    sketch.add(Horn(place + tube * UP - bend * out, turn, tube, bend, angle, thin, flat))
