"""What the cylinders looked for must keep to, as all competitors are told it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Limits:
    """Which radii and directions cylinders may have.

    Parameters
    ----------
    radii : tuple of float
        Least and greatest radius, frame units.
    axis : ndarray of shape (3,) or None
        Unit direction of the axes looked for; None if any will do.
    tilt : float
        Greatest angle of an axis to it, radians; means nothing without it.
    """

    radii: tuple[float, float]
    axis: FloatArray | None = None
    tilt: float = math.pi / 2

    @property
    def numbers(self) -> FloatArray:
        """The same for a kernel, shape (6,): radii, axis, and the least cosine to it, which is -1 if any will do."""
        if self.axis is None:
            return np.array([*self.radii, 0.0, 0.0, 0.0, -1.0])
        return np.array([*self.radii, *self.axis, math.cos(self.tilt)])

    def admit(self, direction: FloatArray) -> bool:
        """Return whether cylinders may have this unit direction, either way."""
        return self.axis is None or abs(float(direction @ self.axis)) >= math.cos(self.tilt)
