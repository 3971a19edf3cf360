"""The result of a competitor: a cylinder, and the number of its hypotheses that support it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import Segment


class Proposal(NamedTuple):
    """A cylinder found by a competitor, in the frame of the cloud.

    Parameters
    ----------
    segment : Segment
        Its height is that of the points or shapes it was found from.
    support : int
        Hypotheses that led to it: ellipses, seeds, spheres; 1 for sample consensus, where a single one wins.
    """

    segment: Segment
    support: int

    @classmethod
    def spanning(
        cls, point: FloatArray, direction: FloatArray, radius: float, on: FloatArray, support: int
    ) -> Proposal:
        """Make a cylinder as long as the points (n, 3) it was found on."""
        heights = (on - point) @ direction
        low, high = float(heights.min()), float(heights.max())
        middle = point + 0.5 * (low + high) * direction
        return cls(Segment(np.concatenate([middle, direction, [radius]]), 0.5 * (high - low), 0.0), support)
