"""Steelwork as four scanners around it see it: many edges of plates hardly wider than the spacing, and a few pipes."""

import numpy as np
from drafts import Sketch, finish, with_strays
from plant import MARGIN, RADII, RATIOS, UP, Rack, add_building, add_ground_clutter, add_riser, seen_by_scanners
from solids import beam

from cylx.synthetic.surfaces import Box

THICKNESS = (0.005, 0.02)
"""Of the plates, metres, as of rolled sections from 80 to 300 mm."""


def steelwork(rng, kind, seed, points=None):
    """Make a frame of rolled sections, braced, with handrails and some pipes on it, on a floor with clutter."""
    size, top = rng.uniform(1.8, 3.2), rng.uniform(1.2, 2.5)
    rack = Rack(Sketch.empty(), np.empty((0, 3)), np.empty((0, 3)), np.empty(0), rng, used=rng.random() < 0.5)
    for _ in range(rng.integers(1, 6)):
        add_level_pipe(rng, rack, size, top)
    for _ in range(rng.integers(0, 4)):
        add_riser(rng, rack, size, top)
    for _ in range(rng.integers(12, 40)):
        add_member(rng, rack, size, top)
    add_building(rng, rack.sketch, size, top)
    add_ground_clutter(rng, rack.sketch, size)
    draft = seen_by_scanners(rng, rack.sketch, size, points or int(10 ** rng.uniform(5.0, 5.6)))
    if rng.random() < 0.5:
        draft = with_strays(rng, draft, rng.choice([0.002, 0.01, 0.03]))
    return finish(rng, draft, kind=kind, seed=seed, ratios=RATIOS)


def add_level_pipe(rng, rack, size, top):
    """Add a level pipe where there is room for one: a handrail as likely as something wider."""
    for _ in range(50):
        radius = float(np.exp(rng.uniform(np.log(RADII[0]), np.log(0.5 * RADII[1]))))
        start, end = _stretch(rng, size, top, np.eye(3)[rng.integers(2)])
        if rack.is_free(start, end, radius):
            rack.add(start, end, radius)
            return


def add_member(rng, rack, size, top):
    """Add a rolled section where no pipe is: upright, level, or a brace across."""
    for _ in range(20):
        way = np.eye(3)[rng.integers(3)]
        if rng.random() < 0.25:
            way = way + rng.choice([-1.0, 1.0]) * np.roll(way, 1)
            way /= np.linalg.norm(way)
        start, end = _stretch(rng, size, top, way)
        width, depth = rng.uniform(0.03, 0.2, 2)
        if rack.is_free(start, end, 0.75 * max(width, depth)):
            rack.sketch.add(*_section(rng, start, end, width, depth))
            return


def _stretch(rng, size, top, way):
    """Give the ends of something that runs along `way` within the frame."""
    room = np.array([size, size, top])
    length = rng.uniform(0.4, 1.0) * (room / np.maximum(np.abs(way), 1e-9)).min()
    free = room - length * np.abs(way)
    corner = free * rng.random(3) + np.array([MARGIN, MARGIN, 0.05])
    start = corner + length * np.maximum(-way, 0.0)
    return start, start + length * way


def _section(rng, start, end, width, depth):
    """Give the plates of an I-, L-, U- or flat section, or of a square tube."""
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / length
    aside = np.cross(UP if abs(along[2]) < 0.9 else np.eye(3)[0], along)
    aside /= np.linalg.norm(aside)
    turn = np.column_stack([along, aside, np.cross(along, aside)])
    if rng.random() < 0.5:
        turn = turn @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    middle, thick = 0.5 * (start + end), rng.uniform(*THICKNESS)
    lying = Box(middle - 0.5 * depth * turn[:, 2], np.array([length, width, thick]), turn)
    lid = Box(middle + 0.5 * depth * turn[:, 2], np.array([length, width, thick]), turn)
    side = Box(middle + 0.5 * (width - thick) * turn[:, 1], np.array([length, thick, depth]), turn)
    return {
        "I": lambda: beam(middle, turn, length, width, depth, thick),
        "L": lambda: [lying, side],
        "U": lambda: [lying, side, lid],
        "flat": lambda: [lying],
        "tube": lambda: [Box(middle, np.array([length, width, depth]), turn)],
    }[rng.choice(["I", "L", "U", "flat", "tube"], p=[0.35, 0.25, 0.15, 0.15, 0.1])]()
