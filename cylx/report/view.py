"""The drawable content of a result: cylinders, and points if available, from any form of a result."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cylx.errors import UsageError
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder
from cylx.records import Extraction, PointCloud
from cylx.report.fittings import labels_with_fittings, pieces_of, runs_of
from cylx.report.points import original_colors
from cylx.results.parts import Input

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from cylx.results import Result


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Cylinders and the points around them.

    Parameters
    ----------
    name : str
        Name of the cloud.
    shapes : tuple of Cylinder
        Scene units; the index is the `id`.
    points : ndarray of shape (N, 3)
        Scene units; empty if not available.
    labels : ndarray of shape (N,), int32
        Cylinder of each point, -1 for none.
    residuals : ndarray of shape (N,), float32
        Signed distance to it, + is outside, scene units; NaN where unknown.
    colors : ndarray of shape (N, 3), uint8, or None
        Original colours of the points.
    spacing, noise : float
        Spacing and noise of the scene, scene units.
    seed : int
        Seed for the choice of points.
    blends : tuple of Cylinder
        Scene units; drawn in a muted colour.
    runs : tuple of int or None
        Run of each cylinder; None if they were not looked for.
    fittings : tuple of (int, Cylinder)
        Pieces of the fittings between cylinders, each with the cylinder that it is shown with.
    """

    name: str
    shapes: tuple[Cylinder, ...]
    points: FloatArray
    labels: NDArray[np.int32]
    residuals: NDArray[np.float32]
    colors: NDArray[np.uint8] | None
    spacing: float
    noise: float
    seed: int = 0
    blends: tuple[Cylinder, ...] = ()
    runs: tuple[int, ...] | None = None
    fittings: tuple[tuple[int, Cylinder], ...] = ()

    @classmethod
    def of(cls, found: Extraction | Result, cloud: PointCloud | ArrayLike | None = None) -> View:
        """Collect the drawable content.

        Parameters
        ----------
        found : Extraction or Result
        cloud : PointCloud or array_like of shape (N, 3), optional
            The points of a `Result`. Points of an annotated cloud have their cylinders and residuals; points of any
            other cloud have none. An `Extraction` has its own.

        Raises
        ------
        UsageError
            If a cloud is given with an extraction.
        ValueError
            If the shape of the points is not (N, 3).
        """
        if isinstance(found, Extraction):
            if cloud is not None:
                raise UsageError("cloud", "an extraction has its points already", "leave the cloud out")
            piping = found.piping
            return cls(
                Input.of(found).file,
                tuple(fit.cylinder for fit in found.cylinders),
                found.cloud.points,
                labels_with_fittings(found),
                found.residuals,
                original_colors(found.cloud),
                float(found.scene.spacing),
                float(found.scene.noise),
                found.config.seed,
                tuple(fit.cylinder for fit in found.blends or ()),
                None if piping is None else runs_of(piping, len(found.cylinders)),
                () if piping is None else tuple(pieces_of(piping)),
            )
        if cloud is None:
            cloud = PointCloud(np.empty((0, 3)))
        elif not isinstance(cloud, PointCloud):
            cloud = PointCloud.from_array(cloud)
        shapes, blends = (
            tuple(
                Cylinder(np.array(one.axis_point), np.array(one.axis_direction), one.radius, one.height)
                for one in listed
            )
            for listed in (found.cylinders, found.blends or ())
        )
        labels, residuals = _annotations(cloud, len(shapes))
        colors = original_colors(cloud)
        scale = found.scene
        spacing, noise = scale.spacing, scale.noise
        return cls(found.input.file, shapes, cloud.points, labels, residuals, colors, spacing, noise, blends=blends)

    def thinned(self, most: int) -> View:
        """Return about `most` of the points, at equal steps of their order."""
        step = max(1, len(self.points) // max(most, 1))
        if step == 1:
            return self
        colors = None if self.colors is None else self.colors[::step]
        return replace(
            self,
            points=self.points[::step],
            labels=self.labels[::step],
            residuals=self.residuals[::step],
            colors=colors,
            spacing=self.spacing * math.sqrt(step),
        )

    def first(self, count: int) -> View:
        """Return the first cylinders and blends, and all points; points of the other cylinders lose their labels."""
        if len(self.shapes) <= count:
            return replace(self, blends=self.blends[:count])
        runs = None if self.runs is None else self.runs[:count]
        fittings = tuple(one for one in self.fittings if one[0] < count)
        labels = np.where(self.labels < count, self.labels, -1).astype(np.int32)
        shown = self.shapes[:count]
        return replace(self, shapes=shown, labels=labels, blends=self.blends[:count], runs=runs, fittings=fittings)


def _annotations(cloud: PointCloud, count: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Read cylinder and residual of each point from an annotated cloud; -1 and NaN if it has none."""
    labels, residuals = np.full(len(cloud.points), -1, np.int32), np.full(len(cloud.points), np.nan, np.float32)
    rows: Any = slice(None) if cloud.valid is None else cloud.valid
    table = cloud.table
    if table is None or not {"cylinder_id", "residual"} <= set(table.dtype.names or ()):
        return labels, residuals
    ids = np.asarray(table["cylinder_id"][rows])
    known = (ids >= 0) & (ids < count)
    labels[known] = ids[known]
    residuals[known] = table["residual"][rows][known]
    return labels, residuals
