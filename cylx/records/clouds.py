"""The cloud as it was read, and what was measured of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.records.sources import ARRAY, Source


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """The points of a file that take part, and the file's whole table beside them.

    Parameters
    ----------
    points : ndarray of shape (N, 3), float64
        The points, all finite, in scene units, in the order of the file. Made read-only.
    table : ndarray of shape (rows,), structured, or None
        Every property of every row as read, rows without finite coordinates included; None if there is nothing but
        `points`.
    valid : ndarray of shape (rows,), bool, or None
        Which rows of the file `points` are; None if all of them.
    source : Source
        Where the cloud came from.
    """

    points: FloatArray
    table: NDArray[np.void] | None = None
    valid: MaskArray | None = None
    source: Source = ARRAY

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"points must have shape (N, 3), not {points.shape}")
        if not np.isfinite(points).all():
            raise ValueError("points must be finite; PointCloud.from_array drops the others")
        points.setflags(write=False)
        object.__setattr__(self, "points", points)

    @classmethod
    def from_array(cls, coordinates: ArrayLike) -> PointCloud:
        """Make a cloud of an (N, 3) array; rows that are not finite are kept as rows without a label.

        Parameters
        ----------
        coordinates : array_like of shape (N, 3)
            Coordinates in scene units.

        Raises
        ------
        ValueError
            If the shape is not (N, 3).
        """
        array = np.asarray(coordinates, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"points must have shape (N, 3), not {array.shape}")
        valid: MaskArray = np.asarray(np.isfinite(array).all(axis=1), dtype=np.bool_)
        return cls(array[valid], valid=None if valid.all() else valid)

    @property
    def rows(self) -> int:
        """Number of rows of the file, finite or not."""
        return len(self.points) if self.valid is None else len(self.valid)

    def spread(self, values: NDArray[Any], fill: object) -> NDArray[Any]:
        """Lay values of the points out over the rows of the file.

        Parameters
        ----------
        values : ndarray of shape (N,)
            One value a point.
        fill : object
            The value of the other rows.

        Returns
        -------
        ndarray of shape (rows,)
        """
        if self.valid is None:
            return values
        out = np.full(self.rows, fill, dtype=values.dtype)
        out[self.valid] = values
        return out


@dataclass(frozen=True, slots=True)
class Scene:
    """What the cloud says about itself: the meaning of `null` in the configuration.

    Parameters
    ----------
    spacing : float
        Typical distance of neighbouring points on a surface, scene units.
    noise : float
        Standard deviation of the points about their surface, scene units.
    extent : float
        Diagonal of the bounding box, scene units.
    given : tuple of str
        Which of `spacing` and `noise` the configuration gave; the others were measured.
    """

    spacing: float
    noise: float
    extent: float
    given: tuple[str, ...] = ()
