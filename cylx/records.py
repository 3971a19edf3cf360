"""What travels between the stages: shapes with their evidence, and the counts of what was dropped on the way.

Many things of one kind travel as a structure of arrays (`Candidates`, `EllipseFits`); the few cylinders that come out travel
one by one (`CylinderFit`). All records are frozen: a stage makes new ones and never changes those it was given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.cylinder import Cylinder

if TYPE_CHECKING:
    from cylx.config import Config

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
MaskArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Source:
    """Where a cloud came from.

    Parameters
    ----------
    file : str
        The name as the user gave it, `-` for standard input, `<array>` for an array.
    format : str
        `ply`, `pcd`, `xyz` or `array`.
    sha256 : str or None
        Digest of the bytes read; None for an array.
    """

    file: str
    format: str
    sha256: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """The finite points of a file, and the file's whole table beside them.

    Parameters
    ----------
    points : ndarray of shape (N, 3), float64
        The finite points, in scene units, in the order of the file. Made read-only.
    table : ndarray of shape (rows,), structured, or None
        Every property of every row as read, rows without finite coordinates included; None if there is nothing but `points`.
    valid : ndarray of shape (rows,), bool, or None
        Which rows of the file `points` are; None if all of them.
    source : Source
        Where the cloud came from.
    """

    points: FloatArray
    table: NDArray[np.void] | None = None
    valid: MaskArray | None = None
    source: Source = Source("<array>", "array")

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"points must have shape (N, 3), not {points.shape}")
        if not np.isfinite(points).all():
            raise ValueError("points must be finite; PointCloud.from_array drops the others")
        points.setflags(write=False)
        object.__setattr__(self, "points", points)

    @classmethod
    def from_array(cls, coordinates: Any) -> PointCloud:
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
        valid = np.isfinite(array).all(axis=1)
        return cls(array[valid], valid=None if valid.all() else valid)

    @property
    def rows(self) -> int:
        """Number of rows of the file, finite or not."""
        return len(self.points) if self.valid is None else len(self.valid)

    def spread(self, values: NDArray[Any], fill: object) -> NDArray[Any]:
        """Lay values of the finite points out over the rows of the file.

        Parameters
        ----------
        values : ndarray of shape (N,)
            One value a finite point.
        fill : object
            The value of rows without finite coordinates.

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
    """

    spacing: float
    noise: float
    extent: float


@dataclass(frozen=True, slots=True)
class StageReport:
    """What a stage looked at, what it kept, and why it dropped the rest.

    Parameters
    ----------
    name : str
        The stage.
    considered, kept : int
        Things that came in, things that went on.
    rejected : mapping of str to int
        Reason to count, no zero counts.
    """

    name: str
    considered: int
    kept: int
    rejected: Mapping[str, int] = field(default_factory=dict)


class Observer(Protocol):
    """Somebody who watches the pipeline: a progress display, a profile."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps, None if their number is not known."""

    def stage_advanced(self, steps: int) -> None:
        """Count `steps` further steps of the present stage."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """End a stage that took `seconds`."""


class SilentObserver:
    """The observer nobody listens to."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Ignore."""

    def stage_advanced(self, steps: int) -> None:
        """Ignore."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """Ignore."""


@dataclass(frozen=True, slots=True, eq=False)
class CylinderFit:
    """A cylinder and the evidence for it.

    Parameters
    ----------
    cylinder : Cylinder
        The shape; its point is the middle of the visible extent.
    inliers : int
        Points of the cloud that carry its label.
    rmse : float
        Root mean square of the inliers' distances to the surface, scene units.
    coverage : float
        Angle about the axis that the inliers cover, radians, in (0, 2 pi].
    support : int
        Candidates in its cluster.
    payoff : float
        Mean payoff of the cluster, in [0, 1].
    evidence : mapping of str to float
        What the verification measured, by the name of the test.
    """

    cylinder: Cylinder
    inliers: int
    rmse: float
    coverage: float
    support: int
    payoff: float
    evidence: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Extraction:
    """All that one run found out about one cloud.

    Parameters
    ----------
    cylinders : tuple of CylinderFit
        Ordered by inliers, descending; the index is the `id`.
    labels : ndarray of shape (N,), int32
        Cylinder of each finite point of the cloud, -1 for none.
    residuals : ndarray of shape (N,), float32
        Signed distance of each labelled point to its cylinder's surface, scene units, + is outside; NaN without a label.
    cloud : PointCloud
        What was looked at.
    scene : Scene
        What the cloud says about itself.
    stages : tuple of StageReport
        Counts per stage, in order.
    config : Config
        The resolved configuration: nothing in it is None that the run depended on.
    warnings : tuple of str
        What a user should know before trusting the answer.
    """

    cylinders: tuple[CylinderFit, ...]
    labels: NDArray[np.int32]
    residuals: NDArray[np.float32]
    cloud: PointCloud
    scene: Scene
    stages: tuple[StageReport, ...]
    config: Config
    warnings: tuple[str, ...] = ()
