"""Which files a run writes: their names, that none of them is in the way, and that they appear together."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.errors import OutputError, UsageError

if TYPE_CHECKING:
    from cylx.records import Extraction

RESULT, ANNOTATED, REJECTED, TRUTH = ".cylinders.json", ".annotated.ply", ".rejected.json", ".truth.json"
STREAM = "-"


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
        The annotated PLY, `-` for standard output, None for none.
    rejected : str or None
        The JSON of what was not accepted, `-` for standard output, None for none.
    """

    scan: str
    result: str
    annotated: str | None
    rejected: str | None = None

    @property
    def outputs(self) -> list[str]:
        """What it writes."""
        return [name for name in (self.result, self.annotated, self.rejected) if name is not None]


def plan_jobs(
    scans: Sequence[str],
    output: str | None,
    annotate: bool | None,
    annotated: str | None,
    rejected: str | None = None,
) -> list[Job]:
    """Name the outputs of every scan.

    They lie beside the scan, or where `-o` says: a file for one scan, an existing folder for one or several. The
    annotated PLY lies beside the JSON; what was not accepted is written only where `--rejected` says. What comes from
    standard input goes to standard output, unless `-o` says otherwise, and what goes to standard output goes there
    alone, unless an annotated PLY is asked for.

    Parameters
    ----------
    scans : sequence of str
        The inputs.
    output : str or None
        `-o`.
    annotate : bool or None
        `--annotate` or `--no-annotate`, None for neither.
    annotated : str or None
        `--annotated`.
    rejected : str or None
        `--rejected`.

    Raises
    ------
    UsageError
        If two outputs, or an output and an input, are the same file, or an output has no name.
    """
    names = (output, annotated, rejected)
    output, annotated, rejected = (STREAM if name == "/dev/stdout" else name for name in names)
    if len(scans) > 1:
        _check_batch(scans, output, annotated, rejected)
    jobs = [_plan(scan, output, annotate, annotated) for scan in scans]
    if rejected is not None:
        jobs = [replace(job, rejected=_inside(rejected, job.scan, REJECTED)) for job in jobs]
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


def write_job(job: Job, extraction: Extraction, *, overwrite: bool) -> None:
    """Write the JSON, the annotated PLY and what was not accepted of one scan, all or nothing.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    from cylx.io import write_annotated, write_text
    from cylx.rejections import Rejections
    from cylx.results import Result

    text = Result.of(extraction).to_json()
    with contextlib.ExitStack() as stack:

        def staged(name: str) -> str | Path:
            """Give the name to write an output to for now; a stream or a device has no other."""
            return stack.enter_context(_moved_at_the_end(name, overwrite=overwrite)) if _is_new_or_file(name) else name

        if job.annotated is not None:
            write_annotated(staged(job.annotated), extraction, overwrite=overwrite)
        if job.rejected is not None:
            write_text(staged(job.rejected), Rejections.of(extraction).to_json(), overwrite=overwrite)
        write_text(job.result, text, overwrite=overwrite)


def write_together(contents: Mapping[str, bytes], *, overwrite: bool) -> None:
    """Write several files, all or nothing.

    Parameters
    ----------
    contents : mapping of str to bytes
        What to write, by file; not to streams.
    overwrite : bool
        Whether files that exist may be replaced.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    from cylx.io import write_bytes

    with contextlib.ExitStack() as stack:
        for name, data in contents.items():
            staged = (
                stack.enter_context(_moved_at_the_end(name, overwrite=overwrite)) if _is_new_or_file(name) else name
            )
            write_bytes(staged, data, overwrite=overwrite)


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
        return Job(scan, result, folder_and_stem + ANNOTATED)
    if scan == STREAM:
        raise UsageError("--annotate", "the annotated cloud has no name", "give one by --annotated FILE")
    return Job(scan, result, str(Path(scan).parent / (stem + ANNOTATED)))


def _stem(scan: str) -> str:
    """Give the NAME in the names of the outputs of a scan."""
    return "stdin" if scan == STREAM else Path(scan).stem


def _inside(output: str, scan: str, ending: str) -> str:
    """Name an output that may be a folder to put it into."""
    return str(Path(output) / (_stem(scan) + ending)) if _is_folder(output) else output


def _is_folder(output: str) -> bool:
    """Tell whether an output is a folder, or is written as if it were one."""
    return output != STREAM and (Path(output).is_dir() or output.endswith(("/", os.sep)))


def _check_batch(scans: Sequence[str], output: str | None, annotated: str | None, rejected: str | None) -> None:
    """Refuse what works for one scan only."""
    if STREAM in scans:
        raise UsageError("-", "standard input is one of several inputs", "give it alone")
    if annotated is not None:
        raise UsageError("--annotated", "names one file for several inputs", "leave it out, or give one input")
    if output is not None and (output == STREAM or Path(output).is_file()):
        raise UsageError(f"-o {output}", "is one file for several inputs", "give a folder, or one input")
    if rejected is not None and not _is_folder(rejected):
        raise UsageError(f"--rejected {rejected}", "is one file for several inputs", "give a folder, or one input")
    for name in (output, rejected):
        if name is not None and not Path(name).is_dir():
            raise OutputError(name, "no such folder", "create it first")


def _is_there(scan: str) -> bool:
    """Say whether an input can be looked for; what is missing is reported by whoever reads it."""
    return scan == STREAM or (Path(scan).exists() and not Path(scan).is_dir())


def _is_new_or_file(name: str) -> bool:
    """Say whether an output is a file, and not a stream or a device."""
    return name != STREAM and (Path(name).is_file() or not Path(name).exists())


@contextlib.contextmanager
def _moved_at_the_end(name: str, *, overwrite: bool) -> Iterator[Path]:
    """Give a temporary name beside `name`, moved there if all goes well, removed if not."""
    from cylx.io import check_writable

    check_writable(name, overwrite=overwrite)
    target = Path(os.path.realpath(name))
    staged = target.with_name(f".cylx-{secrets.token_hex(8)}{target.suffix}")
    try:
        yield staged
        staged.replace(target)
    finally:
        staged.unlink(missing_ok=True)
