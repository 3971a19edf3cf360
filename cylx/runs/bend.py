"""The centre line of a bend: a straight, an arc that touches it, and the straight that goes on from there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arc import arc_coordinates
from cylx.geometry.arrays import FloatArray

LEAST_TURN = math.radians(3.0)
"""Directions that differ by less are those of one straight pipe."""


def _cross(a: FloatArray, b: FloatArray) -> tuple[float, float, float]:
    """Return the cross product of two vectors as plain numbers: arrays of three cost ten times as much."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """A bend between two directions.

    Parameters
    ----------
    meeting : ndarray of shape (3,)
        Where the two axes meet.
    first, second : ndarray of shape (3,)
        Unit directions, into the bend and out of it; not parallel.
    bend_radius : float
        Radius of the centre line, >= 0.
    """

    meeting: FloatArray
    first: FloatArray
    second: FloatArray
    bend_radius: float

    @property
    def angle(self) -> float:
        """Change of direction, radians."""
        across = _cross(self.first, self.second)
        return math.atan2(math.sqrt(sum(part * part for part in across)), float(self.first @ self.second))

    @property
    def tangent(self) -> float:
        """Distance of the ends of the arc from the meeting point."""
        return self.bend_radius * math.tan(0.5 * self.angle)

    @property
    def length(self) -> float:
        """Length of the arc."""
        return self.bend_radius * self.angle

    @property
    def normal(self) -> FloatArray:
        """Unit normal of its plane; the direction turns about it, right-handed."""
        across = np.array(_cross(self.first, self.second))
        return np.asarray(across / math.sqrt(float(across @ across)), dtype=np.float64)

    @property
    def inward(self) -> FloatArray:
        """Unit direction from the beginning of the arc to its centre."""
        return np.array(_cross(self.normal, self.first))

    @property
    def start(self) -> FloatArray:
        """Beginning of the arc."""
        return np.asarray(self.meeting - self.tangent * self.first)

    @property
    def end(self) -> FloatArray:
        """End of the arc."""
        return np.asarray(self.meeting + self.tangent * self.second)

    @property
    def center(self) -> FloatArray:
        """Centre of the arc; the meeting point if its radius is 0."""
        return np.asarray(self.start + self.bend_radius * self.inward)

    def coordinates(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far along the centre line points are, and how far from it.

        Parameters
        ----------
        points : ndarray of shape (N, 3)

        Returns
        -------
        along : ndarray of shape (N,)
            0 at the beginning of the arc, negative before it.
        distances : ndarray of shape (N,)
        """
        angle, radius, first, second = self.angle, self.bend_radius, self.first, self.second
        across = np.array(_cross(first, second))
        normal = across / math.sqrt(float(across @ across))
        inward = np.array(_cross(normal, first))
        tangent = radius * math.tan(0.5 * angle)
        start, end = self.meeting - tangent * first, self.meeting + tangent * second
        frame = np.stack([start + radius * inward, first, -inward, normal, end, second])
        return arc_coordinates(points, frame, radius, angle)
