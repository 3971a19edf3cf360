"""Small pieces of pipework with known truth: points on straights, bends, cones and discs, and the cylinders of them."""

from dataclasses import dataclass, field

import numpy as np

from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.records import CylinderFit
from cylx.runs import trace_runs

NOISE, DENSITY = 0.002, 4000.0
X, Y, Z = np.eye(3)


def fit_of(start, end, radius, inliers=500):
    """Make the fit of a cylinder between two ends, as certain as one of some hundred points."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = np.linalg.norm(end - start)
    tilt = 2.0 * NOISE / np.sqrt(inliers) / length
    offset = NOISE / np.sqrt(inliers)
    covariance = np.diag([offset**2, offset**2, tilt**2, tilt**2, offset**2])
    shape = Cylinder(0.5 * (start + end), end - start, radius, length)
    return CylinderFit(shape, inliers, NOISE, 2 * np.pi, 10, 0.9, 0.98, covariance=covariance, side="convex")


@dataclass
class Pipework:
    """Points and cylinders; `seen` is the share of the surface about each axis that has points."""

    seed: int = 0
    seen: float = 0.7
    points: list = field(default_factory=list)
    labels: list = field(default_factory=list)
    fits: list = field(default_factory=list)

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)

    def add(self, points, label=-1):
        self.points.append(points)
        self.labels.append(np.full(len(points), label, np.int32))

    def cone(self, start, end, radius, other, label=-1, axis=None):
        """Put points on a cone, or a cylinder, between two ends of its centre line; circles are across `axis`."""
        start, end = np.asarray(start, float), np.asarray(end, float)
        axis = (end - start) / np.linalg.norm(end - start) if axis is None else axis
        count = int(DENSITY * np.pi * (radius + other) * np.linalg.norm(end - start) * self.seen)
        share, angle = self.rng.random(count), 2 * np.pi * self.seen * self.rng.random(count)
        first, second = axis_basis(axis)
        out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        radii = (radius + share * (other - radius))[:, None]
        self.add(start + share[:, None] * (end - start) + radii * out, label)

    def pipe(self, start, end, radius, *, over=(0.0, 0.0), known=True):
        """Add a straight; it is known as a cylinder that is too long by `over` at its ends, or not known at all."""
        start, end = np.asarray(start, float), np.asarray(end, float)
        axis = (end - start) / np.linalg.norm(end - start)
        label = len(self.fits) if known else -1
        self.cone(start, end, radius, radius, label)
        if known:
            self.fits.append(fit_of(start - over[0] * axis, end + over[1] * axis, radius))
        return label

    def bend(self, start, direction, aside, bend_radius, angle, radius):
        """Put points on a bend; give its end and the direction there."""
        start, direction, aside = (np.asarray(one, float) for one in (start, direction, aside))
        count = int(DENSITY * 2 * np.pi * radius * bend_radius * angle * self.seen)
        along, about = angle * self.rng.random(count), 2 * np.pi * self.seen * self.rng.random(count)
        normal = np.cross(direction, aside)
        center = start + bend_radius * aside
        radial = -np.cos(along)[:, None] * aside + np.sin(along)[:, None] * direction
        out = np.cos(about)[:, None] * radial + np.sin(about)[:, None] * normal
        self.add(center + bend_radius * radial + radius * out)
        end = center - bend_radius * np.cos(angle) * aside + bend_radius * np.sin(angle) * direction
        return end, np.cos(angle) * direction + np.sin(angle) * aside

    def disc(self, center, axis, inner, outer):
        """Put points on a ring across an axis."""
        count = int(DENSITY * np.pi * (outer**2 - inner**2))
        radii = np.sqrt(self.rng.uniform(inner**2, outer**2, count))
        angle = 2 * np.pi * self.rng.random(count)
        first, second = axis_basis(axis)
        self.add(center + radii[:, None] * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second))

    def flange(self, center, axis, inner, outer, thickness):
        """Put points on a flange: two rings and the rim."""
        low, high = center - 0.5 * thickness * axis, center + 0.5 * thickness * axis
        self.disc(low, axis, inner, outer)
        self.disc(high, axis, inner, outer)
        self.cone(low, high, outer, outer)

    def cloud(self):
        """Give the points with noise, and their labels."""
        points = np.concatenate(self.points)
        return points + self.rng.normal(0, NOISE, points.shape), np.concatenate(self.labels)

    def traced(self, **options):
        """Trace the runs."""
        points, labels = self.cloud()
        return trace_runs(self.fits, points, labels, spacing=1 / np.sqrt(DENSITY), noise=NOISE, **options)


def of_kind(traced, kind):
    """Give the fittings of one kind."""
    return [one for one in traced.piping.fittings if one.kind == kind]
