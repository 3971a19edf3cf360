"""The output of a run on a cloud that was cut into tiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.records.clouds import Scene
from cylx.records.cylinders import CylinderFit, RejectedFit, arrays_of
from cylx.records.progress import StageReport
from cylx.records.sources import Selection, Source
from cylx.wording import counted

if TYPE_CHECKING:
    from cylx.config import Config


@dataclass(frozen=True, slots=True)
class Tiling:
    """How a cloud was cut.

    Parameters
    ----------
    count : int
        Number of tiles.
    size : float or None
        Greatest side of a tile as asked for, scene units; None if the number of points decided alone.
    buffer : float
        Margin about each tile in which it sees the points of its neighbours, scene units.
    most_points : int
        Points of the largest tile, without its margin.
    joined : int
        Groups of cylinders of several tiles that were fitted together.
    """

    count: int
    size: float | None
    buffer: float
    most_points: int
    joined: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TiledExtraction:
    """The output of one run on a cloud in tiles: that of `Extraction`, but for the points.

    Parameters
    ----------
    cylinders : tuple of CylinderFit
        Ordered by confidence, then inliers, descending; the index is the `id`.
    sources : tuple of Source
        The files of the cloud.
    rows : tuple of int
        Number of rows of each.
    bounds : ndarray of shape (2, 3)
        Least and greatest coordinates of the points used.
    selection : Selection
        Which points were used.
    scene : Scene
        Scale and noise: the medians over the tiles, each weighed by its points.
    stages : tuple of StageReport
        Counts per stage, summed over the tiles. What is in a margin counts in each tile.
    config : Config
        The resolved configuration of the whole. What `null` means is told by each tile for itself.
    tiling : Tiling
        How the cloud was cut.
    warnings : tuple of str
        What a user should know before trusting the result.
    blends : tuple of CylinderFit or None
        Arcs that go on tangentially, ordered as the cylinders; None if they were not looked for.
    rejected : tuple of RejectedFit
        The rejected cylinders, as those of `Extraction`, if they were asked for. Where tiles adjoin, some may be told
        by both.
    """

    cylinders: tuple[CylinderFit, ...]
    sources: tuple[Source, ...]
    rows: tuple[int, ...]
    bounds: FloatArray
    selection: Selection
    scene: Scene
    stages: tuple[StageReport, ...]
    config: Config
    tiling: Tiling
    warnings: tuple[str, ...] = ()
    blends: tuple[CylinderFit, ...] | None = None
    rejected: tuple[RejectedFit, ...] = ()

    def __repr__(self) -> str:
        found = counted(len(self.cylinders), len(self.blends or ()))
        return f"{found} in {sum(self.rows)} points in {self.tiling.count} tile{'s' * (self.tiling.count != 1)}"

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the cylinders as arrays, in their order; see `Extraction.to_arrays`."""
        return arrays_of(self.cylinders)
