"""The centre line of a bend: a straight, an arc that touches it, and the straight that goes on from there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.numerics import cross

LEAST_TURN = math.radians(3.0)
"""Directions that differ by less are those of one straight pipe."""


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
        return float(math.atan2(np.linalg.norm(cross(self.first, self.second)), float(self.first @ self.second)))

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
        across = cross(self.first, self.second)
        return np.asarray(across / np.linalg.norm(across), dtype=np.float64)

    @property
    def inward(self) -> FloatArray:
        """Unit direction from the beginning of the arc to its centre."""
        return cross(self.normal, self.first)

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
        angle, radius = self.angle, self.bend_radius
        away = points - (self.start + radius * self.inward)
        x, y, z = away @ self.first, -(away @ self.inward), away @ self.normal
        out = np.hypot(x, y)
        # the middle of the arc is at zero, so that what lies behind the centre is cut in half
        turn = np.arctan2(x, y) - 0.5 * angle
        turn = np.where(turn > math.pi, turn - 2.0 * math.pi, turn)
        turn = np.where(turn < -math.pi, turn + 2.0 * math.pi, turn)
        beyond = points - self.end
        further = beyond @ self.second
        across = beyond - further[:, None] * self.second
        # the end is where the second straight begins, whatever the angle says of a point
        before = turn < -0.5 * angle
        after = turn > 0.5 * angle
        square = np.where(before, (y - radius) ** 2, (out - radius) ** 2) + z**2
        square = np.where(after, np.einsum("ij,ij->i", across, across), square)
        along = np.where(before, x, radius * (turn + 0.5 * angle))
        along = np.where(after, self.length + further, along)
        return along, np.sqrt(square)
