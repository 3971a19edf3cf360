"""The outputs of an earlier run: which scans are finished, and which files cylx may replace."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylx.errors import CylxError, InputError, OutputError
from cylx.io.existing import has_file
from cylx.io.outputs import STREAM

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job
    from cylx.config import Config
    from cylx.records import Selection
    from cylx.results import Result

_MOST_HEADER = 1 << 20
_OWN_JSON = re.compile(rb'\s*\{\s*"schema": "cylx\.')
_PAGE, _PAGE_DATA = b"<title>cylx</title>", re.compile(rb'<script id="data"[^>]*>(.*?)</script>', re.DOTALL)
_PNG, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
_OWN_MESH = {
    ".ply": re.compile(rb"ply\n.*?\ncomment cylx", re.DOTALL),
    ".obj": re.compile(rb"# \d+ cylinders\n"),
    ".glb": re.compile(rb'glTF.*"z up"', re.DOTALL),
}
"""Marks of the meshes that have one."""


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
    if STREAM in (job.scan, *job.outputs) or not all(has_file(name) for name in job.written(0)):
        return None
    try:
        result = Result.parse(read_json(job.result), job.result)
        if result.cylx_version != __version__ or result.input.file != recorded_name(job.scan):
            return None
        same = is_of_settings(result, settings) and result.input.is_of(selection)
        same = same and all(has_file(name) for name in job.written(len(result.cylinders)))
        same = same and _has_units(job, result) and _belong(job, result) and result.input.sha256 == sha256_of(job.scan)
    except (CylxError, OSError):
        return None
    return result if same else None


def written_by(job: Job) -> dict[str, Any] | None:
    """Return the result that a scan has on the disk; None if it was damaged meanwhile."""
    from cylx.io import read_json
    from cylx.results import Result

    try:
        content = read_json(job.result)
        Result.parse(content, job.result)
    except InputError:
        return None
    return content


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


def _has_units(job: Job, result: Result) -> bool:
    """Return whether a result has the unit that is given, or that of its scan if that may say one."""
    from cylx.io.formats import MAY_SAY_UNITS

    return result.input.units == job.units or (job.units is None and result.input.format in MAY_SAY_UNITS)


def _belong(job: Job, result: Result) -> bool:
    """Return whether the other outputs belong to this result and unit, as far as can be checked, and are whole."""
    from cylx.cli.batch.meshes import mesh_of
    from cylx.io import read_json
    from cylx.io.whole import is_whole_cloud

    if job.annotated is not None and not is_whole_cloud(job.annotated, result.input.points):
        return False
    if job.report is not None and not _is_page_of(Path(job.report).read_bytes(), result):
        return False
    if job.picture is not None and not _is_picture(Path(job.picture).read_bytes()):
        return False
    if job.rejected is not None:
        rejected = read_json(job.rejected)
        content = result.to_object()
        if any(rejected.get(key) != content[key] for key in ("cylx_version", "input", "config")):
            return False
    if job.mesh is None:
        return True
    mesh, _ = mesh_of(job.mesh, result)
    file = Path(job.mesh)
    return (file.read_bytes() if has_file(file) else None) == mesh


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
            if has_file(name) and not _is_own(name, job):
                fault = "exists already, and cylx did not write it"
                raise OutputError(printable(name), fault, "choose another name, or give --overwrite")


def is_own_json(name: str) -> bool:
    """Return whether a file is a JSON object with one of our schemas, even if it is cut short, or is empty."""
    from cylx.io import read_json

    try:
        return str(read_json(name).get("schema")).startswith("cylx.")
    except InputError:
        head = _head(name)
        return not head or _OWN_JSON.match(head) is not None


def _is_own(name: str, job: Job) -> bool:
    """Return whether cylx wrote an output, or it is empty; one without a mark is judged by the result beside it."""
    if name.endswith(".json") or name == job.result:
        return is_own_json(name)
    head = _head(name)
    if not head:
        return True
    if name == job.annotated:
        return re.search(rb"\bcylinder_id\b", head) is not None
    if name == job.report:
        return _PAGE in head
    if name == job.picture and not (head.startswith(_PNG) and b"Matplotlib" in head):
        return False
    mark = _OWN_MESH.get(Path(name).suffix.lower())
    if name == job.mesh and mark is not None:
        return mark.match(head) is not None
    return has_file(job.result) and is_own_json(job.result)


def _head(name: str) -> bytes:
    """Return the beginning of a file."""
    try:
        with Path(name).open("rb") as file:
            return file.read(_MOST_HEADER)
    except OSError:
        return b"?"


def _is_page_of(page: bytes, result: Result) -> bool:
    """Return whether a page shows this result."""
    found = _PAGE_DATA.search(page)
    content = result.to_object()
    del content["config"]
    try:
        return found is not None and json.loads(found[1])["result"] == content and page.rstrip().endswith(b"</html>")
    except (ValueError, KeyError, TypeError):
        return False


def _is_picture(picture: bytes) -> bool:
    """Return whether a picture is not cut short."""
    return picture.startswith(_PNG) and picture.endswith(_PNG_END)
