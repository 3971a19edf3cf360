"""From surfaces to a scene: exact points first, then noise, then a frame with any unit and origin, then the truth."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from solids import random_turn

from cylx.geometry.cylinder import Cylinder, cylinder_coordinates
from cylx.synthetic import NOISE, OTHER_SURFACE, SyntheticScene, TrueCylinder
from cylx.synthetic.surfaces import Surface

LEAST_POINTS = 40
LEAST_COVERAGE_DEG = 25.0
LEAST_HEIGHT = 0.5  # of what is visible, in radii
LEAST_RADIUS = 3.0  # in standard deviations of the noise
RATIOS = (0.02, 1.5)  # noise over spacing


class Part(NamedTuple):
    """A surface, and the index of the cylinder it is the mantle of, or -1."""

    surface: Surface
    owner: int = OTHER_SURFACE


class Draft(NamedTuple):
    """The exact points of a scene, and what noise does to each of them.

    `shapes` are the true cylinders, and `doubtful` the indices of those of which a scene may have either opinion;
    `blur` is the noise of each point relative to the others; `rays` are unit vectors if noise goes along them.
    """

    points: np.ndarray
    labels: np.ndarray
    shapes: list
    doubtful: frozenset = frozenset()
    blur: np.ndarray | None = None
    rays: np.ndarray | None = None


@dataclass(slots=True)
class Sketch:
    """The parts of a scene while it is being made up."""

    parts: list
    shapes: list
    doubtful: set

    @classmethod
    def empty(cls):
        return cls([], [], set())

    def add(self, *surfaces):
        """Add surfaces that are no cylinders."""
        self.parts += [Part(surface) for surface in surfaces]

    def add_cylinder(self, shape, *mantles, doubtful=False):
        """Add a true cylinder by the surfaces that its mantle consists of."""
        if doubtful:
            self.doubtful.add(len(self.shapes))
        self.parts += [Part(mantle, len(self.shapes)) for mantle in mantles]
        self.shapes.append(shape)

    def clouds(self, rng, points, jitter=1.0):
        """Draw so many points, part by part: evenly but for a density that differs by up to the factor `jitter`."""
        areas = np.array([part.surface.area for part in self.parts])
        areas *= np.exp(rng.uniform(-np.log(jitter), np.log(jitter), len(areas)))
        counts = np.floor(points * areas / areas.sum()).astype(int)
        return [part.surface.sample(rng, int(n)) for part, n in zip(self.parts, counts, strict=True)]

    def draft(self, clouds):
        """Put the points of all parts together."""
        labels = np.repeat([part.owner for part in self.parts], [len(cloud) for cloud in clouds])
        return Draft(np.concatenate(clouds), labels, self.shapes, frozenset(self.doubtful))


def with_strays(rng, draft, share):
    """Add points that lie anywhere in the box of the scene, as a share of all points then."""
    count = int(share / (1 - share) * len(draft.points))
    low, high = draft.points.min(axis=0), draft.points.max(axis=0)
    labels = np.concatenate([draft.labels, np.full(count, NOISE)])
    blur = np.ones(len(draft.points)) if draft.blur is None else draft.blur
    return draft._replace(
        points=np.concatenate([draft.points, rng.uniform(low, high, (count, 3))]),
        labels=labels,
        blur=np.concatenate([blur, np.zeros(count)]),
        rays=None if draft.rays is None else np.concatenate([draft.rays, np.zeros((count, 3))]),
    )


def spacing_of(rng, draft):
    """Measure the typical spacing of the points on surfaces: 1 / sqrt(density)."""
    points = draft.points[draft.labels != NOISE]
    sample = points[rng.choice(len(points), min(2000, len(points)), replace=False)]
    distances, _ = cKDTree(points).query(sample, k=2)
    return float(np.median(distances[:, 1]) / np.sqrt(np.log(2) / np.pi))  # the median of a Poisson process in a plane


def finish(rng, draft, *, kind, seed, correlated=False, ratios=RATIOS):
    """Make a scene of a draft: noise of a random strength and law, then a random frame."""
    spacing = spacing_of(rng, draft)
    ratio = float(np.exp(rng.uniform(*np.log(ratios))))
    sigma = ratio * spacing
    heavy = bool(rng.random() < 0.3)
    blur = sigma * (np.ones(len(draft.points)) if draft.blur is None else draft.blur)
    if heavy:  # a tenth of the points has five times the noise
        blur = np.where(rng.random(len(blur)) < 0.1, 5.0 * blur, blur)
    if draft.rays is None:
        moves = blur[:, None] * rng.standard_normal(draft.points.shape)
    else:
        moves = (blur * rng.standard_normal(len(blur)))[:, None] * draft.rays
    if correlated:
        moves += blur[:, None] * rng.uniform(0.7, 2.5) * waves(rng, draft.points, spacing)
    order = rng.permutation(len(draft.points))
    scene = SyntheticScene(
        points=(draft.points + moves)[order],
        labels=draft.labels[order].astype(np.int32),
        cylinders=true_cylinders(draft, sigma),
        sigma=sigma,
        family=kind,
        seed=seed,
        params={"points": len(order), "ratio": ratio, "heavy": heavy, "correlated": correlated},
    )
    return in_some_frame(rng, scene)


def waves(rng, points, spacing, count=24):
    """Give vectors of unit variance that change slowly from point to point: noise that neighbours share."""
    field = np.zeros_like(points)
    for _ in range(count):
        direction, amplitude = rng.standard_normal((2, 3))
        length = spacing * 10 ** rng.uniform(0.9, 1.7)
        phase = points @ (direction / np.linalg.norm(direction)) * (2 * np.pi / length) + rng.uniform(0, 2 * np.pi)
        field += np.sin(phase)[:, None] * amplitude
    return field / field.std()


def in_some_frame(rng, scene):
    """Turn a scene, half of the time, and give it any unit and origin."""
    turn = random_turn(rng) if rng.random() < 0.5 else np.eye(3)
    turned = [replace(true, cylinder=_turned(true.cylinder, turn)) for true in scene.cylinders]  # x -> turn x
    scene = replace(scene, points=scene.points @ turn.T, cylinders=tuple(turned))
    scale = float(rng.choice([1.0, 1000.0, 39.37, 10 ** rng.uniform(-3, 3)]))
    extent = scale * float(np.ptp(scene.points, axis=0).max())
    reach = extent * float(rng.choice([0.0, 1.0, 100.0, 1e5]))
    return scene.moved(scale, reach * rng.uniform(-1, 1, 3))


def true_cylinders(draft, sigma):
    """Give the visible part of each true cylinder of a draft."""
    return tuple(
        true_cylinder(shape, draft.points[draft.labels == i], sigma, doubtful=i in draft.doubtful)
        for i, shape in enumerate(draft.shapes)
    )


def true_cylinder(shape, seen, sigma, *, doubtful=False):
    """Cut a cylinder to what is seen of it, and say whether it is enough to ask for it."""
    if len(seen) < 2:
        return TrueCylinder(shape, len(seen), 0.0, True)
    heights, _, angles = cylinder_coordinates(seen, shape.point, shape.direction)
    low, high = np.quantile(heights, [0.002, 0.998])
    visible = Cylinder(shape.point + 0.5 * (low + high) * shape.direction, shape.direction, shape.radius, high - low)
    coverage = covered_deg(angles)
    ignore = (
        doubtful
        or len(seen) < LEAST_POINTS
        or coverage < LEAST_COVERAGE_DEG
        or visible.height < LEAST_HEIGHT * shape.radius
        or shape.radius < LEAST_RADIUS * sigma
    )
    return TrueCylinder(visible, len(seen), coverage, bool(ignore))


def covered_deg(angles):
    """Give the angle covered by points about an axis, in steps of 5 degrees, or of more if they are few."""
    steps = int(np.clip(len(angles) // 4, 12, 72))
    filled = np.unique(np.floor((angles / (2 * np.pi) + 0.5) * steps).astype(int) % steps)
    return 360.0 / steps * len(filled)


def _turned(shape, turn):
    return Cylinder(turn @ shape.point, turn @ shape.direction, shape.radius, shape.height)
