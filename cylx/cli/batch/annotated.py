"""The format of the annotated cloud of a scan: checked before anything is computed, and PLY where LAS cannot be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.io.existing import has_file

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job
    from cylx.records import PointCloud


def check_format(job: Job, cloud: PointCloud, *, overwrite: bool = False) -> tuple[Job, list[str]]:
    """Check before anything is computed that the format of the annotated cloud can hold the scan.

    A LAS or LAZ file that laspy cannot write again gives a PLY file instead.

    Parameters
    ----------
    job : Job
    cloud : PointCloud
    overwrite : bool
        Whether the PLY file may replace one.

    Returns
    -------
    job : Job
        With the name of the annotated cloud that will be written.
    notes : list of str
        What to say if it is another one.

    Raises
    ------
    OutputError
        If the format cannot hold it, or the PLY file cannot be written.
    """
    from cylx.io import check_annotated, check_writable, las_obstacle, printable

    if job.annotated is None:
        return job, []
    obstacle = las_obstacle(job.annotated, cloud)
    if not obstacle:
        check_annotated(job.annotated, cloud)
        return job, []
    instead = replace(job, annotated=_as_ply(job.annotated))
    check_writable(str(instead.annotated), overwrite=overwrite)
    return instead, [f"{obstacle}; the annotated cloud is {printable(str(instead.annotated))}"]


def as_written(job: Job) -> Job:
    """Return a job with the PLY file that was written where its LAS or LAZ file could not be."""
    from cylx.io import LAS_SUFFIXES

    name = job.annotated
    if name is None or Path(name).suffix.lower() not in LAS_SUFFIXES or has_file(name):
        return job
    return replace(job, annotated=_as_ply(name)) if has_file(_as_ply(name)) else job


def _as_ply(name: str) -> str:
    return str(Path(name).with_suffix(".ply"))
