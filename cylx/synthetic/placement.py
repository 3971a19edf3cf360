"""Placement of objects in a room so that they do not touch."""

from __future__ import annotations

import numpy as np

from cylx.errors import UsageError
from cylx.geometry.arrays import FloatArray
from cylx.synthetic.surfaces import random_directions

_ATTEMPTS = 4000


class Room:
    """Places capsules (segments with a radius) in a box so that they touch neither each other nor the walls.

    Parameters
    ----------
    size : ndarray of shape (3,)
        One corner is the origin, the other is this one.
    """

    def __init__(self, size: FloatArray) -> None:
        self.size = size
        self.gap = 0.01 * float(size[0])
        self.starts, self.ends, self.radii = np.empty((0, 3)), np.empty((0, 3)), np.empty(0)

    def place(self, rng: np.random.Generator, length: float, radius: float, what: str) -> tuple[FloatArray, FloatArray]:
        """Find space for a capsule; return its middle and its direction."""
        for _ in range(_ATTEMPTS):
            direction = random_directions(rng, 1)[0]
            reach = 0.5 * length * np.abs(direction) + radius + self.gap
            free = self.size - 2 * reach
            if (free <= 0).any():
                continue
            middle = reach + free * rng.random(3)
            start, end = middle - 0.5 * length * direction, middle + 0.5 * length * direction
            clearance = segment_distances(start, end, self.starts, self.ends) - self.radii - radius
            if (clearance > self.gap).all():
                self.starts, self.ends = np.vstack([self.starts, start]), np.vstack([self.ends, end])
                self.radii = np.append(self.radii, radius)
                return middle, direction
        raise UsageError(
            what, f"no room for all of them in a room {self.size[0]:g} wide", "ask for fewer, or a larger room"
        )


def segment_distances(start: FloatArray, end: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distance of one segment to each of n others; segments may be single points."""
    own, others, between = end - start, ends - starts, start - starts
    a, e = own @ own, np.einsum("ij,ij->i", others, others)
    b, c, f = others @ own, between @ own, np.einsum("ij,ij->i", others, between)
    tiny = 1e-300
    cross = a * e - b * b
    s = np.where(cross > 1e-12 * a * e, np.clip((b * f - c * e) / np.maximum(cross, tiny), 0, 1), 0.0)
    t = np.clip((b * s + f) / np.maximum(e, tiny), 0, 1)
    s = np.clip((b * t - c) / max(float(a), tiny), 0, 1)  # the best s for the clipped t
    return np.asarray(np.linalg.norm(between + s[:, None] * own - t[:, None] * others, axis=1))
