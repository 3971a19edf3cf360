"""Solids that are nearly cylinders but for a belly, a waist, a bend, a taper or an oval section; and cylinders."""

import numpy as np
from drafts import Sketch, finish, with_strays
from rooms import HEIGHT, Space, add_cylinder
from solids import Elbow, Ellipsoid, Horn, Lathe, random_turn
from visibility import scanned

from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.surfaces import Wall, random_directions

CLEARLY = 0.06
"""What deviates by this much of its radius, over its height, is no cylinder; of what deviates by half as much or more
a scene may have either opinion."""
RATIOS = (0.02, 0.3)
"""Noise over spacing: what is told apart here must not be hidden by noise."""
BIN = 0.003  # radians
DENSE = 1_500_000


def turned(rng, kind, seed, points=None):
    """Make a room of such solids, seen from all around or by one camera."""
    width = rng.uniform(1, 4)
    space, sketch = Space(width, np.empty((0, 3)), np.empty(0)), Sketch.empty()
    for _ in range(rng.integers(1, 6)):
        add_cylinder(rng, sketch, space, (60, 360))
    for _ in range(rng.integers(6, 18)):
        thing = rng.choice([barrel, bent, oval, tapered, egg, horn])
        thing(rng, sketch, space)
    sketch.add(Wall(width * np.array([1, 1, HEIGHT]), 2, 0.0))
    total = points or int(10 ** rng.uniform(4.7, 5.4))
    if rng.random() < 0.5:
        view = width * np.array([0.5, rng.uniform(-0.6, -0.3), rng.uniform(0.3, 0.8)])
        draft, ranges = scanned(rng, sketch, [view], bin_width=BIN, dense=DENSE, count=total)
        draft = draft._replace(blur=(ranges / np.median(ranges)) ** 2)
    else:
        draft = sketch.draft(sketch.clouds(rng, total, jitter=1.6))
    return finish(rng, with_strays(rng, draft, rng.choice([0, 0.01, 0.05])), kind=kind, seed=seed, ratios=RATIOS)


def _sized(rng, space):
    """Draw a radius and a height, of half a radius to five."""
    radius = space.width * 10 ** rng.uniform(-1.6, -1.0)
    return radius, radius * np.exp(rng.uniform(np.log(0.5), np.log(5.0)))


def _deviation(rng):
    """Draw by how much a solid deviates, as a share of its radius."""
    return float(np.exp(rng.uniform(np.log(0.5 * CLEARLY), np.log(0.3))))


def _put(rng, sketch, space, radius, heights, radii, deviation, oval=0.0):
    """Put a profile turned about an axis somewhere; it is no cylinder if it deviates clearly."""
    height = float(heights[-1])
    center = space.place(rng, float(np.hypot(0.5 * height, 1.3 * radius)))
    if center is None:
        return
    direction = random_directions(rng, 1)[0]
    side = Lathe(center - 0.5 * height * direction, direction, heights, radii, oval=oval, open=True)
    if deviation < CLEARLY:
        sketch.add_cylinder(Cylinder(center, direction, radius, height), side, doubtful=True)
    else:
        sketch.add(side)


def barrel(rng, sketch, space):
    """Add a barrel, or something with a waist."""
    radius, height = _sized(rng, space)
    deviation, heights = _deviation(rng), np.linspace(0.0, height, 40)
    shares = deviation * rng.choice([-1.0, 1.0]) * ((2.0 * heights / height - 1.0) ** 2 - 1 / 3)
    _put(rng, sketch, space, radius, heights, radius * (1.0 + shares), deviation)


def tapered(rng, sketch, space):
    """Add a cone of more than 3 degrees, or of so little that either opinion is right."""
    radius, height = _sized(rng, space)
    slope = rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(np.log(0.03), np.log(0.4)))
    radii = np.maximum(radius + slope * height * np.array([-0.5, 0.5]), 0.05 * radius)
    _put(rng, sketch, space, radius, np.array([0.0, height]), radii, CLEARLY if abs(slope) > 0.052 else 0.0)


def oval(rng, sketch, space):
    """Add a straight tube of oval section: twice as oval as need be, for the half that is seen may look round."""
    radius, height = _sized(rng, space)
    deviation = _deviation(rng)
    _put(rng, sketch, space, radius, np.array([0.0, height]), np.full(2, radius), 0.5 * deviation, oval=deviation)


def bent(rng, sketch, space):
    """Add a tube that is bent, its axis on a circle of 2 to 7 of its radii."""
    tube, length = _sized(rng, space)
    bend = tube / np.exp(rng.uniform(np.log(0.15), np.log(0.5)))
    center = space.place(rng, 0.5 * length + 1.5 * tube)
    if center is not None:
        turn, angle = random_turn(rng), min(length / bend, 3.0)
        middle = np.cos(0.5 * angle) * turn[:, 0] + np.sin(0.5 * angle) * turn[:, 1]
        sketch.add(Elbow(center - bend * middle, turn, tube, bend, angle, open=True))


def horn(rng, sketch, space):
    """Add something bent that thins towards its ends."""
    tube = space.width * 10 ** rng.uniform(-1.7, -1.3)
    bend, angle = tube * rng.uniform(3, 15), rng.uniform(0.4, 1.5)
    center = space.place(rng, bend * np.sin(0.5 * angle) + 1.5 * tube)
    if center is not None:
        turn = random_turn(rng)
        flat = rng.uniform(0, 0.15)
        sketch.add(Horn(center - bend * turn[:, 0], turn, tube, bend, angle, rng.uniform(0.1, 0.8), flat))


def egg(rng, sketch, space):
    """Add an ellipsoid, long or flat."""
    radius = space.width * 10 ** rng.uniform(-1.6, -1.0)
    center = space.place(rng, 2.5 * radius)
    if center is not None:
        sketch.add(Ellipsoid(center, radius * np.array([rng.uniform(0.5, 2.5), 1, 1]), random_turn(rng)))
