"""The runs of a result: its cylinders joined by their fittings."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from cylx.fits.nominal_radius import Catalogue
from cylx.records import Extraction, Observer, RejectedFit, SilentObserver
from cylx.runs import trace_runs

if TYPE_CHECKING:
    from cylx.config import Config


def with_runs(extraction: Extraction, observer: Observer | None = None) -> Extraction:
    """Join the cylinders of an extraction to runs, and find and fit what joins them.

    Parameters
    ----------
    extraction : Extraction
        The cylinders, and the cloud that they were found in.
    observer : Observer, optional
        Is told of the stage `runs` and its time.

    Returns
    -------
    Extraction
        With `piping`. Cylinders end where their fittings begin. Those that are a part of a fitting, such as the rim of
        a flange, are among the rejected; short ones that were found along a run come last.
    """
    watching = observer or SilentObserver()
    watching.stage_started("runs", None)
    began = time.perf_counter()
    catalogue, names = catalogue_of(extraction.config)
    traced = trace_runs(
        extraction.cylinders,
        extraction.cloud.points,
        extraction.labels,
        spacing=extraction.scene.spacing,
        noise=extraction.scene.noise,
        catalogue=catalogue,
        names=names,
    )
    kept = set(traced.origins)
    parts = [RejectedFit(fit, "part of a fitting") for i, fit in enumerate(extraction.cylinders) if i not in kept]
    watching.stage_finished("runs", time.perf_counter() - began)
    return replace(
        extraction,
        cylinders=traced.cylinders,
        labels=traced.labels,
        residuals=traced.residuals,
        rejected=(*parts, *extraction.rejected),
        piping=traced.piping,
    )


def catalogue_of(config: Config) -> tuple[Catalogue | None, Sequence[str | None]]:
    """Return the nominal radii of a configuration, scene units, and their names."""
    entries = config.scene.catalogue
    if not entries:
        return None, ()
    radii = tuple(entry.radius for entry in entries)
    return Catalogue(radii, tuple(entry.spread for entry in entries)), [entry.name for entry in entries]
