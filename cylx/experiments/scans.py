"""Scenes made from the scan of one object: two copies (figure 11), or five among other objects (figure 12)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.optional.open3d import estimate_normals

FaceArray = IndexArray

SCANNED = 373_205
"""Points of the paper's scan of the soup can; a mesh is sampled with as many."""
NOISE_OF_SCAN = 0.002
"""Noise added to the points of a mesh, as a share of its extent: 0.3 mm for a soup can."""
APART = 1.5
"""Distance of two cans, in extents."""


@dataclass(frozen=True, slots=True, eq=False)
class ObjectScan:
    """A scan of one upright object.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    extent : float
        Diagonal of its box.
    """

    points: FloatArray
    extent: float

    @classmethod
    def of(cls, vertices: FloatArray, faces: FaceArray | None) -> ObjectScan:
        """Take points as they are; sample the faces of a mesh evenly, with a little noise."""
        extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        a, b, c = (vertices[[] if faces is None else faces[:, k]] for k in range(3))
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        if faces is None or not areas.any():
            return cls(vertices, extent)
        rng = np.random.default_rng(0)
        face = rng.choice(len(faces), SCANNED, p=areas / areas.sum())
        u, v = rng.random((2, SCANNED, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        points = a[face] + u * (b - a)[face] + v * (c - a)[face]
        return cls(points + NOISE_OF_SCAN * extent * rng.standard_normal(points.shape), extent)

    @property
    def name(self) -> str:
        """Eight digits that identify the scan."""
        return hashlib.sha256(self.points.tobytes()).hexdigest()[:8]

    @property
    def center(self) -> FloatArray:
        """Middle of its box, shape (3,)."""
        return np.asarray(0.5 * (self.points.min(axis=0) + self.points.max(axis=0)))

    def seen_from(self, view_deg: float, side: float = 1.0, neighbours: int = 80) -> ObjectScan:
        """Keep the points whose outward normal is at least this angle from the view (0, `side`, 0), degrees."""
        if view_deg <= 0:
            return self
        normals = estimate_normals(self.points, neighbours)
        normals *= np.where(((self.points - self.center) * normals).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        angles = np.degrees(np.arccos(np.clip(side * normals[:, 1], -1.0, 1.0)))
        return ObjectScan(self.points[angles >= view_deg], self.extent)


def two_cans(
    scan: ObjectScan, center: FloatArray, share: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Place a copy of a scan beside it, in a random direction, and keep a random share of all points.

    Parameters
    ----------
    scan : ObjectScan
    center : ndarray of shape (3,)
        Middle of the whole object.
    share : float
        In (0, 1].
    rng : numpy.random.Generator

    Returns
    -------
    points : ndarray of shape (n, 3)
    centers : ndarray of shape (2, 3)
    """
    step = rng.standard_normal(3)
    step *= APART * scan.extent / np.linalg.norm(step)
    points = np.concatenate([scan.points, scan.points + step])
    return points[rng.random(len(points)) < share], np.array([center, center + step])


def cans_among_clutter(
    scan: ObjectScan, cans: int, points: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Place several copies of an object, a floor, boxes and spheres side by side, and keep this many points.

    Parameters
    ----------
    scan : ObjectScan
    cans : int
    points : int
    rng : numpy.random.Generator

    Returns
    -------
    points : ndarray of shape (points, 3)
    centers : ndarray of shape (cans, 3)
    """
    extent, noise = scan.extent, NOISE_OF_SCAN * scan.extent
    places = np.array([(x, y, 0.0) for x in range(3) for y in range(3)])[rng.permutation(9)] * 1.3 * extent
    dense = len(scan.points) // 2  # points of each other object
    parts, centers = [], []
    for place in places[:cans]:
        turn = rng.uniform(0, 2 * np.pi)
        turned = _turned(scan.points - scan.center, turn) + place
        parts.append(turned)
        centers.append(place)
    for k, place in enumerate(places[cans:]):
        parts.append(place + (_box if k % 2 else _sphere)(dense, extent, rng) + noise * rng.standard_normal((dense, 3)))
    floor = np.column_stack([rng.uniform(-1.0, 3.6, (dense, 2)) * extent, np.full(dense, -0.5 * extent)])
    parts.append(floor + noise * rng.standard_normal(floor.shape))
    cloud = np.concatenate(parts)
    return cloud[rng.choice(len(cloud), points, replace=len(cloud) < points)], np.array(centers)


def _turned(points: FloatArray, angle: float) -> FloatArray:
    """Rotate points about the vertical."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]))


def _box(n: int, extent: float, rng: np.random.Generator) -> FloatArray:
    """Draw points on the faces of a box."""
    inside = rng.random((n, 3)) - 0.5
    inside[np.arange(n), rng.integers(3, size=n)] = rng.choice([-0.5, 0.5], n)
    return np.asarray(_turned(inside * np.array([0.7, 0.5, 0.8]) * extent, rng.uniform(0, np.pi)))


def _sphere(n: int, extent: float, rng: np.random.Generator) -> FloatArray:
    """Draw points on a sphere."""
    directions = rng.standard_normal((n, 3))
    return np.asarray(0.3 * extent * directions / np.linalg.norm(directions, axis=1, keepdims=True))
