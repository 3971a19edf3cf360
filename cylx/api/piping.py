"""The runs of a result: its cylinders joined by their fittings."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from cylx.config import Config
from cylx.fits.nominal_radius import Catalogue
from cylx.records import CylinderFit, Extraction, Observer, PointCloud, RejectedFit, Scene, SilentObserver
from cylx.results import Result
from cylx.runs import trace_runs
from cylx.runs.constraints import fit_runs
from cylx.runs.labels import nearest_cylinders

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from cylx.runs import Traced

Found = TypeVar("Found", Extraction, Result)

ENOUGH = 0.05
"""Share of the points of a cylinder that a cloud has at least, also a thinned one, if it is that of the result."""
MOST_ASKED = 20_000
"""Points of an annotated cloud that are asked whether their cylinders are those of the result."""


def find_runs(
    found: Found, cloud: PointCloud | ArrayLike | None = None, *, fit: bool = False, observer: Observer | None = None
) -> Found:
    """Join cylinders to runs, and find and fit what joins them; the same as `cylx runs`.

    Cylinders end afterwards where their fittings begin. Those that are a part of a fitting, such as the rim of a
    flange, are among the rejected of an extraction; short ones that were found along a run come last.

    Parameters
    ----------
    found : Extraction or Result
        The cylinders.
    cloud : PointCloud or array_like of shape (N, 3), optional
        The points of a `Result`, best those of its annotated cloud. Without points the axes alone tell the fittings.
        An `Extraction` has its own.
    fit : bool
        Whether cylinders move so that axes meet and angles are round, where the uncertainties allow.
    observer : Observer, optional
        Is told of the stage `runs` and its time.

    Returns
    -------
    Extraction or Result
        As given, with fittings and runs.

    Raises
    ------
    ValueError
        If the shape of the points is not (N, 3), or a cloud is given with an extraction.

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> pipe = cylx.synthetic.single(points=2000, seed=1)
    >>> found = cylx.find_runs(cylx.extract(pipe.points))
    >>> len(found.piping.runs), len(found.piping.fittings)
    (1, 0)
    """
    watching = observer or SilentObserver()
    watching.stage_started("runs", None)
    began = time.perf_counter()
    if isinstance(found, Extraction):
        if cloud is not None:
            raise ValueError("an extraction has its points already; leave the cloud out")
        out = _with_runs(found, fit=fit)
    else:
        points = cloud if isinstance(cloud, PointCloud) or cloud is None else PointCloud.from_array(cloud)
        out = _result_with_runs(found, points, fit=fit)
    watching.stage_finished("runs", time.perf_counter() - began)
    return out


def _with_runs(extraction: Extraction, *, fit: bool) -> Extraction:
    traced = _trace(
        extraction.cylinders, extraction.cloud.points, extraction.labels, extraction.scene, extraction.config
    )
    cylinders, piping = fit_runs(traced.cylinders, traced.piping) if fit else (traced.cylinders, traced.piping)
    kept = set(traced.origins)
    parts = [RejectedFit(fit, "part of a fitting") for i, fit in enumerate(extraction.cylinders) if i not in kept]
    return replace(
        extraction,
        cylinders=cylinders,
        labels=traced.labels,
        residuals=traced.residuals,
        rejected=(*parts, *extraction.rejected),
        piping=piping,
    )


def _result_with_runs(result: Result, cloud: PointCloud | None, *, fit: bool) -> Result:
    extraction = extraction_of(result, PointCloud(np.empty((0, 3))) if cloud is None else cloud)
    traced = _with_runs(extraction, fit=fit)
    new = Result.lists_of(traced.cylinders, traced.piping)
    return result.model_copy(update=new | {"warnings": list(traced.warnings)})


def extraction_of(result: Result, cloud: PointCloud) -> Extraction:
    """Return a result with a cloud as an extraction; points of an annotated cloud have their cylinders.

    Parameters
    ----------
    result : Result
    cloud : PointCloud
    """
    fits = tuple(one.to_fit() for one in result.cylinders)
    scene = Scene(result.scene.spacing, result.scene.noise, 0.0)
    labels = _labels_of(cloud, fits, scene)
    blends = None if result.blends is None else tuple(one.to_fit() for one in result.blends)
    config = Config.model_validate(result.config, strict=False)
    residuals = np.full(len(labels), np.nan, np.float32)
    warnings = tuple(dict.fromkeys([*result.warnings, *_doubts(fits, labels)]))
    return Extraction(fits, labels, residuals, cloud, scene, (), config, warnings, blends=blends)


def _are_theirs(ids: NDArray[np.integer[Any]], fits: Sequence[CylinderFit], points: NDArray[np.float64]) -> bool:
    """Return whether most points lie about the cylinder they are said to be of; otherwise another result said it."""
    there = np.flatnonzero(ids >= 0)
    there = there[:: max(1, len(there) // MOST_ASKED)]
    near = 0
    for index in np.unique(ids[there]):
        shape = fits[int(index)].cylinder
        away = points[there[ids[there] == index]] - shape.point
        along = away @ shape.direction
        across = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - along**2, 0.0))
        near += int((np.abs(across - shape.radius) < 0.5 * shape.radius).sum())
    return 2 * near >= len(there)


def _doubts(fits: Sequence[CylinderFit], labels: NDArray[np.int32]) -> list[str]:
    """Return the warning that most cylinders have hardly any of their points in a cloud, if that is so."""
    if not len(labels):
        return []
    there = np.bincount(labels[labels >= 0], minlength=len(fits))
    without = sum(int(count < ENOUGH * fit.inliers) for count, fit in zip(there, fits, strict=True))
    if without <= 0.5 * len(fits):
        return []
    return [
        f"{without} of {len(fits)} cylinders have hardly any points in the cloud; "
        "check that it is the one of the result, in the same unit and place"
    ]


def _labels_of(cloud: PointCloud, fits: Sequence[CylinderFit], scene: Scene) -> NDArray[np.int32]:
    """Return the cylinder of each point: that of an annotated cloud, or the nearest."""
    table = cloud.table
    if table is not None and "cylinder_id" in (table.dtype.names or ()):
        ids = np.asarray(table["cylinder_id"][slice(None) if cloud.valid is None else cloud.valid])
        if ids.max(initial=-1) < len(fits) and _are_theirs(ids, fits, cloud.points):
            return np.asarray(ids, dtype=np.int32)
    return nearest_cylinders(fits, cloud.points, scene.spacing, scene.noise)


def _trace(
    fits: Sequence[CylinderFit], points: NDArray[np.float64], labels: NDArray[np.int32], scene: Scene, config: Config
) -> Traced:
    catalogue, names = catalogue_of(config)
    return trace_runs(fits, points, labels, spacing=scene.spacing, noise=scene.noise, catalogue=catalogue, names=names)


def catalogue_of(config: Config) -> tuple[Catalogue | None, Sequence[str | None]]:
    """Return the nominal radii of a configuration, scene units, and their names."""
    entries = config.scene.catalogue
    if not entries:
        return None, ()
    radii = tuple(entry.radius for entry in entries)
    return Catalogue(radii, tuple(entry.spread for entry in entries)), [entry.name for entry in entries]
