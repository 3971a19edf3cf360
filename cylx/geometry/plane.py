"""The plane: a point, a normal, and a frame in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane with a right-handed basis (first, second, normal).

    Parameters
    ----------
    point : ndarray of shape (3,)
        Origin of its coordinates.
    normal : ndarray of shape (3,)
        Unit vector.
    """

    point: FloatArray
    normal: FloatArray

    def project(self, points: FloatArray) -> FloatArray:
        """Return coordinates of points (N, 3) projected along the normal onto the plane, shape (N, 2)."""
        first, second = axis_basis(self.normal)
        return (points - self.point) @ np.column_stack([first, second])

    def lift(self, coordinates: FloatArray) -> FloatArray:
        """Return the points in space with coordinates (..., 2) in the plane, shape (..., 3)."""
        return self.point + self.lift_vectors(coordinates)

    def lift_vectors(self, vectors: FloatArray) -> FloatArray:
        """Return the vectors in space of vectors (..., 2) in the plane, shape (..., 3)."""
        return np.asarray(vectors @ np.stack(axis_basis(self.normal)))


def random_directions(count: int, rng: np.random.Generator) -> FloatArray:
    """Draw unit vectors evenly from the sphere, shape (count, 3)."""
    vectors = rng.standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
