"""Which files a run writes: their names, that none of them is in the way, and that they appear together."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.errors import OutputError, UsageError
from cylx.io.outputs import STREAM, moved_at_the_end

if TYPE_CHECKING:
    from cylx.records import Extraction, PointCloud
    from cylx.results import Result

RESULT, ANNOTATED, REJECTED, TRUTH = ".cylinders.json", ".annotated", ".rejected.json", ".truth.json"
REPORT, PICTURE, MESH = ".report.html", ".cylinders.png", ".cylinders.obj"


@dataclass(frozen=True)
class Job:
    """One scan and the files to write for it.

    Parameters
    ----------
    scan : str
        The input, `-` for standard input.
    result : str
        The JSON, `-` for standard output.
    annotated : str or None
        The annotated cloud, `-` for standard output, None for none.
    rejected : str or None
        The JSON of what was not accepted, `-` for standard output, None for none.
    report : str or None
        The page to look at, `-` for standard output, None for none.
    picture : str or None
        The PNG, `-` for standard output, None for none.
    mesh : str or None
        The mesh of the cylinders, None for none.
    units : str or None
        Unit of the scan, for meshes that have one; None if it was not said.
    """

    scan: str
    result: str
    annotated: str | None
    rejected: str | None = None
    report: str | None = None
    picture: str | None = None
    mesh: str | None = None
    units: str | None = None

    @property
    def outputs(self) -> list[str]:
        """What it may write."""
        names = (self.result, self.annotated, self.rejected, self.report, self.picture, self.mesh)
        return [name for name in names if name is not None]

    def written(self, found: int) -> list[str]:
        """Leave out what is not written if so many cylinders are found: of none there is no mesh."""
        return [name for name in self.outputs if found or name != self.mesh]


def plan_jobs(
    scans: Sequence[str],
    output: str | None,
    annotate: bool | None,
    annotated: str | None,
    rejected: str | None = None,
    report: str | None = None,
    picture: str | None = None,
    mesh: str | None = None,
    units: str | None = None,
) -> list[Job]:
    """Name the outputs of every scan.

    They lie beside the scan, or where `-o` says: a file for one scan, a folder for one or several. The annotated cloud
    lies beside the JSON; what was not accepted, the report, the picture and the mesh are written only where an option
    says. What comes from standard input goes to standard output, unless `-o` says otherwise, and what goes to standard
    output goes there alone, unless an annotated cloud is asked for.

    Parameters
    ----------
    scans : sequence of str
        The inputs.
    output, annotated, rejected, report, picture, mesh, units : str or None
        `-o`, `--annotated`, `--rejected`, `--report`, `--png`, `--mesh` and `--units`.
    annotate : bool or None
        `--annotate` or `--no-annotate`, None for neither.

    Raises
    ------
    UsageError
        If two outputs, or an output and an input, are the same file, or an output has no name.
    """
    names = (output, annotated, rejected, report, picture)
    output, annotated, rejected, report, picture = (STREAM if name == "/dev/stdout" else name for name in names)
    if len(scans) > 1:
        folders = {"--rejected": rejected, "--report": report, "--png": picture, "--mesh": mesh}
        _check_batch(scans, output, annotated, folders)
    jobs = [_plan(scan, output, annotate, annotated) for scan in scans]
    if rejected is not None:
        jobs = [replace(job, rejected=_inside(rejected, job.scan, REJECTED)) for job in jobs]
    if report is not None:
        jobs = [replace(job, report=_inside(report, job.scan, REPORT)) for job in jobs]
    if picture is not None:
        jobs = [replace(job, picture=_inside(picture, job.scan, PICTURE)) for job in jobs]
    if mesh is not None:
        jobs = [replace(job, mesh=_inside(mesh, job.scan, MESH), units=units) for job in jobs]
    _check_twins(jobs)
    check_apart(scans, [name for job in jobs for name in job.outputs])
    return jobs


def check_apart(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Refuse outputs that are the same file as another output, or as an input.

    Raises
    ------
    UsageError
        If two are the same.
    """
    taken = {os.path.realpath(name): "is an input as well as an output" for name in inputs if name != STREAM}
    for name in outputs:
        key = name if name == STREAM else os.path.realpath(name)
        if key in taken:
            place = "standard output" if name == STREAM else name
            raise UsageError(place, taken[key], "choose another name")
        taken[key] = "is asked for by two outputs"


def check_outputs(jobs: Sequence[Job], others: Sequence[str], *, overwrite: bool) -> None:
    """Refuse outputs that could not be written, before anything is computed.

    Parameters
    ----------
    jobs : sequence of Job
        The scans; those that are not there are left to fail on their own.
    others : sequence of str
        Further files to be written.
    overwrite : bool
        Whether files that exist may be replaced.

    Raises
    ------
    OutputError
        If one of them could not be written.
    """
    from cylx.io import check_writable

    names = [name for job in jobs if _is_there(job.scan) for name in job.outputs]
    for name in [*names, *others]:
        check_writable(name, overwrite=overwrite)


def check_format(job: Job, cloud: PointCloud) -> None:
    """Refuse an annotated cloud of a format that could not hold the scan, before anything is computed.

    Raises
    ------
    OutputError
        If it could not.
    """
    from cylx.io import check_annotated

    if job.annotated is not None:
        check_annotated(job.annotated, cloud)


def _mesh(job: Job, content: Result) -> tuple[bytes | None, list[str]]:
    """Make the mesh that is asked for, and what its reader has to know."""
    if job.mesh is None:
        return None, []
    from cylx.cli.batch.meshes import mesh_of

    return mesh_of(job.mesh, content.cylinders, job.units)


def write_job(job: Job, extraction: Extraction, *, overwrite: bool) -> list[str]:
    """Write the JSON, and what else was asked for of one scan, all or nothing.

    Returns
    -------
    list of str
        What the reader of a mesh has to know.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    from cylx.io import write_annotated, write_bytes, write_text
    from cylx.results import Result

    content = Result.of(extraction)
    page, picture = _looks(job, extraction)
    mesh, remarks = _mesh(job, content)
    with contextlib.ExitStack() as stack:

        def staged(name: str) -> str | Path:
            """Return the name to write an output to for now."""
            return stack.enter_context(moved_at_the_end(name, overwrite=overwrite))

        result = staged(job.result)  # the first is moved last: where the result is, all is
        if job.annotated is not None:
            write_annotated(staged(job.annotated), extraction, overwrite=overwrite)
        if job.rejected is not None:
            from cylx.results import Rejections

            write_text(staged(job.rejected), Rejections.of(extraction).to_json(), overwrite=overwrite)
        if job.report is not None:
            write_text(staged(job.report), page, overwrite=overwrite)
        if job.picture is not None:
            write_bytes(staged(job.picture), picture, overwrite=overwrite)
        if job.mesh is not None and mesh is not None:
            write_bytes(staged(job.mesh), mesh, overwrite=overwrite)
        write_text(result, content.to_json(), overwrite=overwrite)
    if job.mesh is not None and mesh is None:  # that of an earlier result does not belong to this one
        Path(job.mesh).unlink(missing_ok=True)
    return remarks


def _looks(job: Job, extraction: Extraction) -> tuple[str, bytes]:
    """Make the report and the picture of a scan, if they are asked for."""
    if job.report is None and job.picture is None:
        return "", b""
    from cylx.report import html_of, png_of

    page = "" if job.report is None else html_of(extraction)
    return page, b"" if job.picture is None else png_of(extraction)


def _plan(scan: str, output: str | None, annotate: bool | None, annotated: str | None) -> Job:
    """Name the outputs of one scan."""
    stem = _stem(scan)
    if output is None:
        result = STREAM if scan == STREAM else str(Path(scan).parent / (stem + RESULT))
    else:
        result = _inside(output, scan, RESULT)
    if annotated is not None:
        if annotate is False:
            raise UsageError("--annotated", "contradicts --no-annotate", "leave one of them out")
        return Job(scan, result, annotated)
    if annotate is False or (annotate is None and result == STREAM):
        return Job(scan, result, None)
    if result != STREAM:
        folder_and_stem = result.removesuffix(RESULT) if result.endswith(RESULT) else str(Path(result).with_suffix(""))
        return Job(scan, result, folder_and_stem + _annotated(scan))
    if scan == STREAM:
        raise UsageError("--annotate", "the annotated cloud has no name", "give one by --annotated FILE")
    return Job(scan, result, str(Path(scan).parent / (stem + _annotated(scan))))


def _stem(scan: str) -> str:
    """Return the NAME in the names of the outputs of a scan."""
    from cylx.io import cloud_name

    return "stdin" if scan == STREAM else Path(cloud_name(scan)).stem


def _annotated(scan: str) -> str:
    """Return the ending of the annotated cloud: LAS and LAZ keep their format, the others become PLY."""
    from cylx.io import LAS_SUFFIXES

    suffix = Path(scan).suffix.lower()
    return ANNOTATED + (suffix if suffix in LAS_SUFFIXES else ".ply")


def _inside(output: str, scan: str, ending: str) -> str:
    """Name an output that may be a folder to put it into."""
    return str(Path(output) / (_stem(scan) + ending)) if is_folder(output) else output


def is_folder(output: str) -> bool:
    """Return whether an output is a folder, or is written as if it were one."""
    return output != STREAM and (Path(output).is_dir() or is_slashed(output))


def is_slashed(output: str) -> bool:
    """Return whether an output is written as a folder, which is then made."""
    return output.endswith(("/", os.sep))


def _check_batch(
    scans: Sequence[str], output: str | None, annotated: str | None, folders: Mapping[str, str | None]
) -> None:
    """Refuse what works for one scan only; `folders` are options that name a folder for several."""
    if STREAM in scans:
        raise UsageError("-", "standard input is one of several inputs", "give it alone")
    if annotated is not None:
        raise UsageError("--annotated", "names one file for several inputs", "leave it out, or give one input")
    if output is not None and (output == STREAM or Path(output).is_file()):
        raise UsageError(f"-o {output}", "is one file for several inputs", "give a folder, or one input")
    for option, name in folders.items():
        if name is not None and not is_folder(name):
            raise UsageError(f"{option} {name}", "is one file for several inputs", "give a folder, or one input")
    made = output is not None and is_slashed(output)
    for name in (None if made else output, *folders.values()):
        if name is not None and not Path(name).is_dir():
            raise OutputError(name, "no such folder", "create it first")


def _check_twins(jobs: Sequence[Job]) -> None:
    """Refuse two scans whose results would have the same name."""
    first: dict[str, str] = {}
    for job in jobs:
        twin = first.setdefault(os.path.realpath(job.result), job.scan)
        if twin != job.scan:
            fault = f"would be the result of {twin} and of {job.scan}"
            raise UsageError(job.result, fault, "rename one of them, or take each by itself into a folder of its own")


def _is_there(scan: str) -> bool:
    """Return whether an input can be looked for; what is missing is reported by whoever reads it."""
    return scan == STREAM or (Path(scan).exists() and not Path(scan).is_dir())
