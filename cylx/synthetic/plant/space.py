"""Free space in the room: capsules about all that is built, which must not touch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.synthetic.placement import segment_distances

CLEARANCE = 0.03
"""Between pipes of different parts, metres."""


class Space:
    """Capsules in a room, each with the number of the part it belongs to.

    Parameters
    ----------
    size : ndarray of shape (3,)
        The room is between the origin and this corner, metres.
    obstacles : ndarray of shape (N, 3)
        Scanners: nothing comes closer than `berth`.
    berth : float
        Metres.
    """

    def __init__(self, size: FloatArray, obstacles: FloatArray, berth: float) -> None:
        self.size = size
        self._rows = np.column_stack([obstacles, obstacles, np.full((len(obstacles), 2), (berth, -1.0))])
        self._count = len(obstacles)

    def __len__(self) -> int:
        return self._count

    def cut(self, count: int) -> None:
        """Forget all but the first capsules."""
        self._count = count

    def inside(self, start: FloatArray, end: FloatArray, radius: float) -> bool:
        """Return whether a capsule is in the room, off its sides."""
        reach = radius + CLEARANCE
        ends = np.stack([start, end])
        return bool((ends >= reach).all() and (ends <= self.size - reach).all())

    def free(self, start: FloatArray, end: FloatArray, radius: float, skip: Sequence[int]) -> bool:
        """Return whether a capsule touches none of the others, but for those of the parts to skip."""
        rows = self._rows[: self._count]
        rows = rows[~np.isin(rows[:, 7], skip)]
        distances = segment_distances(start, end, rows[:, :3], rows[:, 3:6])
        return bool((distances > rows[:, 6] + radius + CLEARANCE).all())

    def add(self, start: FloatArray, end: FloatArray, radius: float, part: int) -> None:
        """Add a capsule."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros((64 + len(self._rows), 8))])
        self._rows[self._count] = [*start, *end, radius, part]
        self._count += 1

    def parts_at(self, point: FloatArray) -> list[int]:
        """Return the parts whose capsules contain a point."""
        rows = self._rows[: self._count]
        distances = segment_distances(point, point, rows[:, :3], rows[:, 3:6])
        return sorted({int(part) for part in rows[distances < rows[:, 6], 7]})
