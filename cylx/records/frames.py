"""The cloud as the stages work on it: in units of its spacing, with its noise, and with an index of its points."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.bounding_box import extent_of
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import POINT, RADIUS, UX, UY, UZ, Cylinder
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import sort_in_place

SMALL_PATCH = 2.0
"""Patches of a cylinder's surface have at most its radius over this."""
ENOUGH_PATCHES = 5
MOST_NOISE = 4.0
"""No surface is taken for this many times noisier than usual: it would be none."""
RADIAL = 0.8
"""Cosine between a normal and the direction from the axis, below which a point is not on a cylinder."""
TOO_FLAT = 2.0
"""A window this many radii across that is flat shows no cylinder."""


def cell_keys(cells: IndexArray) -> IndexArray:
    """Return one number for each cell (n, 3), shape (n,)."""
    low = cells & 0x1FFFFF
    return np.asarray((low[:, 0] << 42) | (low[:, 1] << 21) | low[:, 2], dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """How far points scatter about their surface: by the size of the surface looked at, and by place.

    Neighbouring points of a stereo or depth camera err together, so the noise of a large piece exceeds that of a small
    one; and scanners see distant, dark or slanted surfaces less exactly.

    Parameters
    ----------
    sizes : ndarray of shape (k,)
        Radii of the pieces, ascending.
    deviations : ndarray of shape (k,)
        Standard deviations, ascending.
    side : float
        Side of the cells in which the noise was measured by itself.
    cells : ndarray of shape (C,)
        Keys of the cells where it was, ascending; none if it is the same everywhere.
    factors : ndarray of shape (C,)
        How many times the usual it is there.
    patches : ndarray of shape (m, 5)
        Small pieces of surface: place (3), radius, and the noise about it as a multiple of the usual.
    """

    sizes: FloatArray
    deviations: FloatArray
    side: float = 1.0
    cells: IndexArray = field(default_factory=lambda: np.empty(0, np.int64))
    factors: FloatArray = field(default_factory=lambda: np.empty(0))
    patches: FloatArray = field(default_factory=lambda: np.empty((0, 5)))

    def at(self, size: float) -> float:
        """Return the usual standard deviation over a piece of this radius; ends of the table hold beyond them."""
        return float(np.exp(np.interp(np.log(max(size, 1e-300)), np.log(self.sizes), np.log(self.deviations))))

    def about(self, places: FloatArray, size: float) -> FloatArray:
        """Return the standard deviations over pieces of this radius at places (n, 3), shape (n,)."""
        return self.at(size) * self.factors_at(places)

    def factors_at(self, places: FloatArray, unknown: float = 1.0) -> FloatArray:
        """Return how many times the usual the noise is at places (n, 3), shape (n,); `unknown` where nobody knows."""
        out = np.full(len(places), unknown)
        if len(self.cells):
            keys = cell_keys(np.floor(places / self.side).astype(np.int64))
            where = np.minimum(np.searchsorted(self.cells, keys), len(self.cells) - 1)
            known = self.cells[where] == keys
            out[known] = self.factors[where[known]]
        return out

    @property
    def least(self) -> float:
        """The standard deviation over the smallest pieces."""
        return float(self.deviations[0])


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A cloud in its own units and order: what all stages work on.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        In units of the spacing, from the corner of the cloud, in Morton order.
    order : ndarray of shape (N,)
        `order[i]` is the index in the cloud of the frame's point i.
    codes : ndarray of shape (N,)
        Sorted Morton codes of the points.
    unit : float
        Side of the smallest cell, in spacings.
    voxel_level : int
        Cells of this level are voxels: six of their sides make the radius of the smallest window.
    window : float
        Radius of the smallest window, in spacings.
    noise : Noise
        Scatter of points about their surface, in spacings.
    origin : ndarray of shape (3,)
        Where the frame's zero lies, scene units.
    spacing : float
        The frame's unit, scene units.
    """

    points: FloatArray
    order: IndexArray
    codes: IndexArray
    unit: float
    voxel_level: int
    window: float
    noise: Noise
    origin: FloatArray
    spacing: float

    def window_radii(self, factor: float) -> list[float]:
        """Return the radii of windows of all scales, ascending, up to an eighth of the cloud's extent."""
        extent = extent_of(self.points)
        steps = max(1, math.ceil(math.log(max(extent / 8.0 / self.window, 1.0)) / math.log(factor)) + 1)
        return [self.window * factor**k for k in range(steps)]

    def to_scene(self, cylinder: Cylinder) -> Cylinder:
        """Return a cylinder of the frame in scene units."""
        return cylinder.moved(self.origin, self.spacing)


@dataclass(frozen=True, slots=True, eq=False)
class IndexedCloud:
    """What cylinders are fitted to: the points in cells, how flat each one's surroundings are, and the noise.

    Parameters
    ----------
    cells : Cells
        All points of the frame.
    flatness : ndarray of shape (N,)
        Radius of the largest flat window that holds the point, 0 if there is none; frame units.
    noise : Noise
        Frame units.
    normals : ndarray of shape (N, 3), float32, optional
        Unit normals, either way, of the points whose nearest neighbours tell it; zero where they do not.
    planes : ndarray of shape (k, 3)
        Unit normals of the directions that planes have in the cloud, either way.
    """

    cells: Cells
    flatness: FloatArray
    noise: Noise
    normals: NDArray[np.float32] | None = None
    planes: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    @classmethod
    def of(
        cls,
        frame: Frame,
        flatness: FloatArray,
        normals: NDArray[np.float32] | None = None,
        planes: FloatArray | None = None,
    ) -> IndexedCloud:
        """Put the points of a frame into cells."""
        known = np.empty((0, 3)) if planes is None else planes
        return cls(Cells(frame.points, frame.codes), flatness, frame.noise, normals, known)

    @property
    def points(self) -> FloatArray:
        """The points, shape (N, 3)."""
        return self.cells.points

    def noise_about(self, model: FloatArray, half: float = 0.0) -> float:
        """Return the noise over the surface of a cylinder (7,), a piece as large as its diameter.

        Its own patches of surface say whether it is noisier than usual: a camera sees steep sides less exactly than the
        floor. Patches that are not small against the cylinder show its curvature rather than noise.
        """
        radius = float(model[RADIUS])
        usual = self.noise.at(2.0 * radius)
        own, count = _noise_on(self.noise.patches, model, half, max(0.1 * radius, 4.0 * usual))
        if count < ENOUGH_PATCHES:
            return usual * max(1.0, float(self.noise.factors_at(model[None, POINT])[0]))
        return usual * min(own, MOST_NOISE) if own > 1.2 else usual

    def may_be_on(self, indices: IndexArray, model: FloatArray, share: float = 1.0) -> MaskArray:
        """Return which points may lie on a cylinder (7,).

        Those in large flat windows belong to something flatter; those whose normal is not radial, to what meets it.
        """
        may = np.asarray(self.flatness[indices] < share * self.too_flat(model[6]), dtype=np.bool_)
        if self.normals is not None:
            _drop_not_radial(self.points, self.normals, indices, model, RADIAL, may)
        return may

    def too_flat(self, radius: float) -> float:
        """Return the flatness from which a point belongs to something flatter than a cylinder of this radius."""
        return TOO_FLAT * radius


@njit(cache=True, nogil=True)
def _drop_not_radial(
    points: FloatArray,
    normals: NDArray[np.float32],
    indices: IndexArray,
    model: FloatArray,
    cosine: float,
    may: MaskArray,
) -> None:
    for a in range(len(indices)):
        i = indices[a]
        if may[a] and (normals[i, 0] != 0.0 or normals[i, 1] != 0.0 or normals[i, 2] != 0.0):
            dx, dy, dz = points[i, 0] - model[0], points[i, 1] - model[1], points[i, 2] - model[2]
            height = dx * model[3] + dy * model[4] + dz * model[5]
            dx, dy, dz = dx - height * model[3], dy - height * model[4], dz - height * model[5]
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            may[a] = abs(dx * normals[i, 0] + dy * normals[i, 1] + dz * normals[i, 2]) >= cosine * distance


@njit(cache=True, nogil=True)
def _noise_on(patches: FloatArray, model: FloatArray, half: float, width: float) -> tuple[float, int]:
    """Return the median noise of the patches on a cylinder's surface that are small against it, and their number."""
    values, n = np.empty(len(patches)), np.int64(0)
    for i in range(len(patches)):
        if patches[i, 3] * SMALL_PATCH >= model[RADIUS]:
            continue
        dx, dy, dz = patches[i, 0] - model[0], patches[i, 1] - model[1], patches[i, 2] - model[2]
        height = dx * model[UX] + dy * model[UY] + dz * model[UZ]
        if abs(height) >= half:
            continue
        distance = math.sqrt(max(0.0, dx * dx + dy * dy + dz * dz - height * height))
        if abs(distance - model[RADIUS]) < width:
            values[n] = patches[i, 4]
            n += 1
    if n == 0:
        return 1.0, 0
    sort_in_place(values, n)
    return float(0.5 * (values[(n - 1) // 2] + values[n // 2])), n
