"""A cloud at one scale: thinned to the size of the windows that look at it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.morton import cell_starts, group, pick_one
from cylx.records.clouds import Frame

LEVELS_TO_BLOCK = 2
"""Levels from a voxel to the block of voxels that tells how many points one should have."""
SLIVER = 8
"""A voxel with so many times fewer points than the fullest one of its block is one that a surface hardly touches."""
CELL = 4
"""Levels from a voxel to the cells that windows gather points from: to look a cell up takes as long as many points."""


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """The points that windows of one radius see: one of each voxel, a sixth to a twelfth of the radius wide.

    Parameters
    ----------
    radius : float
        Of the windows, frame units.
    level : int
        Level of the voxels.
    points : ndarray of shape (n, 3)
        One point of each voxel, in Morton order.
    codes : ndarray of shape (n,)
        Their Morton codes.
    indices : ndarray of shape (n,)
        Which points of the frame they are.
    cells, starts, side
        Cells of sixteen voxels' width for `gather_ball`.
    members : ndarray of shape (m,)
        The points of the frame that were thinned, ascending.
    runs : ndarray of shape (n + 1,)
        Members `runs[i]:runs[i + 1]` lie in the voxel of point i.
    """

    radius: float
    level: int
    points: FloatArray
    codes: IndexArray
    indices: IndexArray
    cells: IndexArray
    starts: IndexArray
    side: float
    members: IndexArray
    runs: IndexArray

    @classmethod
    def of(cls, frame: Frame, radius: float, keep: MaskArray) -> Scale:
        """Thin the points to keep of a frame for windows of a radius."""
        level = frame.voxel_level + max(0, math.floor(math.log2(radius / frame.window)))
        members, voxels, runs = _without_slivers(*group(frame.codes, level, keep))
        indices = members[pick_one(voxels, runs)]
        codes = frame.codes[indices]
        cells, starts = cell_starts(codes, level + CELL)
        side = frame.unit * 2.0 ** (level + CELL)
        return cls(radius, level, frame.points[indices], codes, indices, cells, starts, side, members, runs)

    def seeds(self, enough: int, keep: MaskArray | None = None, least: int = 1) -> IndexArray:
        """Choose places for windows, evenly: indices of points, one of each cell of sixteen voxels' width.

        Of eight or of four where that makes fewer than `enough`; only points to `keep`, if given, and only where a cell
        holds at least so many of them.
        """
        members = np.arange(len(self.codes)) if keep is None else np.flatnonzero(keep)
        for shift in (4, 3, 2):
            cells, starts = cell_starts(self.codes[members], self.level + shift)
            if len(cells) >= enough:
                break
        return members[pick_one(cells, starts)[np.diff(starts) >= least]]

    def spread(self, marks: MaskArray, out: MaskArray) -> None:
        """Mark all members of the voxels whose point is marked."""
        out[self.members[np.repeat(marks, np.diff(self.runs))]] = True


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """What the points have been found to lie on, filled in as the windows become finer.

    Parameters
    ----------
    flatness : ndarray of shape (N,)
        Radius of the largest flat window that holds the point, 0 if there is none; frame units.
    curved : ndarray of shape (N,), bool
        Whether a candidate of local curvature passes by the point.
    """

    flatness: FloatArray
    curved: MaskArray


def _without_slivers(members: IndexArray, voxels: IndexArray, runs: IndexArray) -> tuple[IndexArray, ...]:
    """Leave out the voxels that a surface hardly touches.

    Where a surface runs along the faces of voxels, the few points that noise has moved across a face have voxels of
    their own. With one point of each voxel they would have as great a say as all the others, and bend the surface.
    """
    counts, blocks = np.diff(runs), voxels >> (3 * LEVELS_TO_BLOCK)
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    fullest = np.repeat(np.maximum.reduceat(counts, starts), np.diff(starts, append=len(blocks)))
    kept = SLIVER * counts >= fullest
    if kept.all():
        return members, voxels, runs
    return members[np.repeat(kept, counts)], voxels[kept], np.concatenate([[0], np.cumsum(counts[kept])])
