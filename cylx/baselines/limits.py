"""Limits on the cylinders to find, in one form for all competitors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on radius and direction.

    Parameters
    ----------
    radii : tuple of float
        Least and greatest radius, frame units.
    axis : ndarray of shape (3,) or None
        Unit direction of the axes; None for any.
    tilt : float
        Greatest angle between an axis and this direction, radians; ignored without it.
    """

    radii: tuple[float, float]
    axis: FloatArray | None = None
    tilt: float = math.pi / 2

    @property
    def numbers(self) -> FloatArray:
        """The same for a kernel, shape (6,): radii, axis, and the least cosine to it, -1 for any."""
        if self.axis is None:
            return np.array([*self.radii, 0.0, 0.0, 0.0, -1.0])
        return np.array([*self.radii, *self.axis, math.cos(self.tilt)])

    def admit(self, direction: FloatArray) -> bool:
        """Return whether this unit direction, up to sign, is allowed."""
        return self.axis is None or abs(float(direction @ self.axis)) >= math.cos(self.tilt)
