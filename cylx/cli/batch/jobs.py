"""The output files of a run: name them, and check that none is in the way."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cylx.errors import OutputError, UsageError
from cylx.io.existing import has_anything, has_file, has_folder
from cylx.io.outputs import STANDARD_OUTPUT, STREAM

RESULT, ANNOTATED, REJECTED, TRUTH = ".cylinders.json", ".annotated", ".rejected.json", ".truth.json"
REPORT, PICTURE, MESH = ".report.html", ".cylinders.png", ".cylinders.obj"


@dataclass(frozen=True)
class Job:
    """One scan and its output files.

    Parameters
    ----------
    scan : str
        The input, `-` for standard input.
    result : str
        The JSON, `-` for standard output.
    annotated : str or None
        The annotated cloud, `-` for standard output, None to write none.
    rejected : str or None
        The JSON of the rejected fits, `-` for standard output, None to write none.
    report : str or None
        The HTML report, `-` for standard output, None to write none.
    picture : str or None
        The PNG, `-` for standard output, None to write none.
    mesh : str or None
        The mesh of the cylinders, None to write none.
    units : str or None
        Unit of the scan; None for what the scan says.
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
        """The files that may be written."""
        names = (self.result, self.annotated, self.rejected, self.report, self.picture, self.mesh)
        return [name for name in names if name is not None]

    def without(self, names: Collection[str]) -> Job:
        """Return the same job without some of the outputs beside the result."""
        beside = (self.annotated, self.rejected, self.report, self.picture, self.mesh)
        annotated, rejected, report, picture, mesh = (None if name in names else name for name in beside)
        return replace(self, annotated=annotated, rejected=rejected, report=report, picture=picture, mesh=mesh)

    def written(self, found: int) -> list[str]:
        """Return the files written for this number of cylinders; without cylinders there is no mesh."""
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

    The outputs lie beside the scan, or where `-o` says: a file for one scan, a folder for one or several. The annotated
    cloud lies beside the JSON. The rejected fits, the report, the picture and the mesh are written only if an option
    asks for them. A scan from standard input goes to standard output unless `-o` names a file. If the JSON goes to
    standard output, the annotated cloud is written only on request.

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
    output, annotated, rejected, report, picture = (STREAM if name in STANDARD_OUTPUT else name for name in names)
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
        jobs = [replace(job, mesh=_inside(mesh, job.scan, MESH)) for job in jobs]
    jobs = [replace(job, units=units) for job in jobs]
    _check_twins(jobs)
    check_apart(scans, [name for job in jobs for name in job.outputs])
    return jobs


def check_apart(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Refuse outputs that name the same file as another output or an input.

    Raises
    ------
    UsageError
        If two names are the same file.
    """
    taken = {os.path.realpath(name): "is an input as well as an output" for name in inputs if name != STREAM}
    for name in outputs:
        key = name if name == STREAM else os.path.realpath(name)
        if key in taken:
            place = "standard output" if name == STREAM else name
            raise UsageError(place, taken[key], "choose another name")
        taken[key] = "is asked for by two outputs"


def check_outputs(jobs: Sequence[Job], others: Sequence[str], *, overwrite: bool) -> None:
    """Refuse outputs that cannot be written, before anything is computed.

    Parameters
    ----------
    jobs : sequence of Job
        The scans; a missing scan is not checked here and fails later.
    others : sequence of str
        Further files to write.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    from cylx.io import check_writable

    names = [name for job in jobs if _is_there(job.scan) for name in job.outputs]
    for name in [*names, *others]:
        check_writable(name, overwrite=overwrite)


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
    """Return the stem (NAME) of the output names of a scan."""
    from cylx.io import cloud_name

    return "stdin" if scan == STREAM else Path(cloud_name(scan)).stem


def _annotated(scan: str) -> str:
    """Return the suffix of the annotated cloud: LAS and LAZ keep their format, other formats become PLY."""
    from cylx.io import LAS_SUFFIXES

    suffix = Path(scan).suffix.lower()
    return ANNOTATED + (suffix if suffix in LAS_SUFFIXES else ".ply")


def _inside(output: str, scan: str, ending: str) -> str:
    """Return the path of an output inside `output` if that is a folder, otherwise `output`."""
    return str(Path(output) / (_stem(scan) + ending)) if is_folder(output) else output


def is_folder(output: str) -> bool:
    """Return whether an output is a folder, or its name ends like one."""
    return output != STREAM and (has_folder(output) or is_slashed(output))


def is_slashed(output: str) -> bool:
    """Return whether the name of an output ends in a slash; such a folder is created."""
    return output.endswith(("/", os.sep))


def _check_batch(
    scans: Sequence[str], output: str | None, annotated: str | None, folders: Mapping[str, str | None]
) -> None:
    """Refuse options that work for one scan only; `folders` are options that must name a folder for several scans."""
    if STREAM in scans:
        raise UsageError("-", "standard input is one of several inputs", "give it alone")
    if annotated is not None:
        raise UsageError("--annotated", "names one file for several inputs", "leave it out, or give one input")
    if output is not None and (output == STREAM or has_file(output)):
        raise UsageError(f"-o {output}", "is one file for several inputs", "give a folder, or one input")
    for option, name in folders.items():
        if name is not None and not is_folder(name):
            raise UsageError(f"{option} {name}", "is one file for several inputs", "give a folder, or one input")
    made = output is not None and is_slashed(output)
    for name in (None if made else output, *folders.values()):
        if name is not None and not has_folder(name):
            raise OutputError(name, "no such folder", "create it first")


def _check_twins(jobs: Sequence[Job]) -> None:
    """Refuse two scans whose results would have the same name."""
    first: dict[str, str] = {}
    for job in jobs:
        twin = first.setdefault(os.path.realpath(job.result), job.scan)
        if twin != job.scan:
            fault = f"would be the result of {twin} and of {job.scan}"
            raise UsageError(job.result, fault, "rename one of them, or run each by itself into its own folder")


def _is_there(scan: str) -> bool:
    """Return whether an input exists as far as can be checked; the reader reports missing files."""
    return scan == STREAM or (has_anything(scan) and not has_folder(scan))
