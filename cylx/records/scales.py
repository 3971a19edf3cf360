"""A cloud at one scale: thinned to the size of the windows used there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.morton import cell_starts, group, pick_one
from cylx.records.frames import Frame

LEVELS_TO_BLOCK = 2
"""Levels from a voxel to the block of voxels that shows how many points a voxel should have."""
SLIVER = 8
"""A surface hardly touches a voxel that has this many times fewer points than the fullest one of its block."""
CELL = 4
"""Levels from a voxel to the cells that windows gather points from: a cell lookup costs as much as many points."""


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """The points for windows of one radius: one point per voxel; a voxel is a sixth to a twelfth of the radius wide.

    Parameters
    ----------
    radius : float
        Radius of the windows, frame units.
    level : int
        Level of the voxels.
    points : ndarray of shape (n, 3)
        One point of each voxel, in Morton order.
    codes : ndarray of shape (n,)
        Their Morton codes.
    indices : ndarray of shape (n,)
        Their indices in the frame.
    cells, starts, side
        Cells sixteen voxels wide, for `gather_ball`.
    members : ndarray of shape (m,)
        Indices of the points of the frame before thinning, ascending.
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
        """Thin the kept points of a frame for windows of a radius."""
        level = frame.voxel_level + max(0, math.floor(math.log2(radius / frame.window)))
        members, voxels, runs = _without_slivers(*group(frame.codes, level, keep))
        indices = members[pick_one(voxels, runs)]
        codes = frame.codes[indices]
        cells, starts = cell_starts(codes, level + CELL)
        side = frame.unit * 2.0 ** (level + CELL)
        return cls(radius, level, frame.points[indices], codes, indices, cells, starts, side, members, runs)

    def seeds(self, enough: int, keep: MaskArray | None = None, least: int = 1) -> IndexArray:
        """Choose evenly spread places for windows: indices of points, one in each cell sixteen voxels wide.

        If that gives fewer than `enough`, the cells are eight or four voxels wide. Only points under `keep`, if given,
        are chosen, and only in cells with at least `least` of them.
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
    """What the points have been found to lie on; filled in from coarse to fine windows.

    Parameters
    ----------
    flatness : ndarray of shape (N,)
        Radius of the largest flat window that holds the point, 0 if there is none; frame units.
    curved : ndarray of shape (N,), bool
        Whether the point lies on a candidate of local curvature.
    """

    flatness: FloatArray
    curved: MaskArray


@dataclass(frozen=True, slots=True, eq=False)
class Nearby:
    """What the nearest points of each point show of the surface.

    Parameters
    ----------
    normals : ndarray of shape (N, 3), float32
        Unit normals, either way; zero where the points do not tell.
    looked_at : ndarray of int
        Indices of the points that were looked at: those in no large flat window.
    within : ndarray of bool
        Which of these lie within a plane, and not at its edge.
    """

    normals: NDArray[np.float32]
    looked_at: IndexArray
    within: MaskArray


def _without_slivers(members: IndexArray, voxels: IndexArray, runs: IndexArray) -> tuple[IndexArray, ...]:
    """Remove the voxels that a surface hardly touches.

    Where a surface runs along the faces of voxels, noise moves a few points across a face into voxels of their own.
    With one point per voxel, these few would weigh as much as all the others and bend the surface.
    """
    counts, blocks = np.diff(runs), voxels >> (3 * LEVELS_TO_BLOCK)
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    fullest = np.repeat(np.maximum.reduceat(counts, starts), np.diff(starts, append=len(blocks)))
    kept = SLIVER * counts >= fullest
    if kept.all():
        return members, voxels, runs
    return members[np.repeat(kept, counts)], voxels[kept], np.concatenate([[0], np.cumsum(counts[kept])])
