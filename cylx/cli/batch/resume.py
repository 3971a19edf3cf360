"""The outputs of an earlier run: which scans are finished, and which files cylx may replace."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.errors import InputError, OutputError
from cylx.io.outputs import STREAM

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job
    from cylx.config import Config
    from cylx.records import Selection
    from cylx.results import Result

_MOST_HEADER = 1 << 20


def finished_before(job: Job, settings: Config, selection: Selection) -> Result | None:
    """Return the earlier result of a scan if all outputs exist and version, input, selection and settings agree.

    Parameters
    ----------
    job : Job
        The scan and its outputs.
    settings : Config
        The configuration, before null values are derived from the cloud.
    selection : Selection
        Which points are used.

    Returns
    -------
    Result or None
        None if the scan has to be processed.
    """
    from cylx.cli.batch.annotated import as_written
    from cylx.io import read_json, recorded_name, sha256_of
    from cylx.results import Result
    from cylx.version import __version__

    job = as_written(job)
    if STREAM in (job.scan, *job.outputs) or not all(Path(name).is_file() for name in job.written(0)):
        return None
    try:
        result = Result.parse(read_json(job.result), job.result)
        if result.cylx_version != __version__ or result.input.file != recorded_name(job.scan):
            return None
        same = is_of_settings(result, settings) and result.input.is_of(selection)
        same = same and all(Path(name).is_file() for name in job.written(len(result.cylinders)))
        same = same and _belong(job, result) and result.input.sha256 == sha256_of(job.scan)
    except InputError:
        return None
    return result if same else None


def is_of_settings(result: Result, settings: Config) -> bool:
    """Return whether these settings would give the configuration of a result.

    Null values are derived from the spacing, the noise and the bounds of the cloud, which the result contains. The
    result also says whether spacing and noise were given: then the settings must give them again, otherwise not.

    Parameters
    ----------
    result : Result
    settings : Config
    """
    import numpy as np

    from cylx.records import Scene
    from cylx.scene import resolve

    bounds, known = result.input.bounds, settings.scene
    if known.given != tuple(result.scene.given or ()):
        return False
    extent = float(np.linalg.norm(np.subtract(bounds.max, bounds.min)))
    scene = Scene(known.spacing or result.scene.spacing, known.noise or result.scene.noise, extent)
    return resolve(settings, scene).model_dump(mode="json") == result.config


def _belong(job: Job, result: Result) -> bool:
    """Return whether the other outputs belong to this result and unit, as far as can be checked."""
    from cylx.cli.batch.meshes import mesh_of
    from cylx.io import read_json

    if job.rejected is not None:
        rejected = read_json(job.rejected)
        content = result.to_object()
        if any(rejected.get(key) != content[key] for key in ("cylx_version", "input", "config")):
            return False
    if job.mesh is None:
        return True
    mesh, _ = mesh_of(job.mesh, result.cylinders, job.units)
    file = Path(job.mesh)
    return (file.read_bytes() if file.is_file() else None) == mesh


def check_own(jobs: Sequence[Job]) -> None:
    """Refuse existing outputs that cylx did not write.

    Raises
    ------
    OutputError
        If there is one.
    """
    from cylx.io import printable

    for job in jobs:
        for name in job.outputs:
            if Path(name).is_file() and not _is_own(name, job):
                fault = "exists already, and cylx did not write it"
                raise OutputError(printable(name), fault, "choose another name, or give --overwrite")


def is_own_json(name: str) -> bool:
    """Return whether a file is a JSON object with one of our schemas."""
    from cylx.io import read_json

    try:
        return str(read_json(name).get("schema")).startswith("cylx.")
    except InputError:
        return False


def _is_own(name: str, job: Job) -> bool:
    """Return whether cylx wrote an output; files without a mark are judged by the result beside them."""
    if name.endswith(".json") or name == job.result:
        return is_own_json(name)
    if name == job.annotated:
        with Path(name).open("rb") as file:
            return re.search(rb"\bcylinder_id\b", file.read(_MOST_HEADER)) is not None
    return Path(job.result).is_file() and is_own_json(job.result)
