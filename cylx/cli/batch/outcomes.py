"""The outcome of one scan among many: a record that can be sent between processes, and a line of the summary."""

from __future__ import annotations

import signal
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from cylx.cli.batch.summary import legible
from cylx.cli.terminal.failures import BUG, UNUSABLE, UnforeseenError, describe_failure
from cylx.cli.terminal.stopwatch import peak_memory
from cylx.errors import CylxError, NothingFoundError, OutputError

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job


@dataclass(frozen=True)
class Finished:
    """The report on a scan whose outputs are written.

    Parameters
    ----------
    points, cylinders : int
        Their numbers.
    warnings : sequence of str
        The warnings of the result.
    profile : dict, optional
        The times of the stages.
    blends : int
        Their number; 0 if they were not looked for.
    notes : sequence of str
        How the scan was read, and how its annotated cloud was written, if that needs a word.
    unwritten : sequence of str
        The outputs beside the JSON that could not be written.
    failure : Exception, optional
        Why not.
    """

    points: int
    cylinders: int
    warnings: Sequence[str]
    profile: dict[str, object] | None = None
    blends: int = 0
    notes: Sequence[str] = ()
    unwritten: Sequence[str] = ()
    failure: Exception | None = None


@dataclass(frozen=True)
class Outcome:
    """The outcome of one scan.

    Parameters
    ----------
    status : str
        `skipped` for a scan finished by an earlier run.
    finished : Finished or None
        None if there are no outputs.
    reason : str
        Reason of the failure, one line.
    exit_code : int
        The exit code that this scan alone would give.
    peak : int or None
        Largest memory use of its process so far, bytes.
    trace : str
        The traceback, if it is to be shown.
    """

    status: Literal["done", "skipped", "failed"]
    finished: Finished | None = None
    reason: str = ""
    exit_code: int = 0
    peak: int | None = None
    trace: str = ""


def check_finished(job: Job, finished: Finished, required: int | None) -> None:
    """Check that all outputs were written, and at least the required number of cylinders was found.

    Raises
    ------
    OutputError
        If an output could not be written; a bug is raised as it is.
    NothingFoundError
        If there are fewer cylinders.
    """
    if finished.failure is not None:
        raise finished.failure
    found = finished.cylinders
    if required is not None and found < required:
        fault = f"{found} found, {required} required"
        raise NothingFoundError(job.scan, f"cylinders: {fault}", "look at the scan, or require fewer")


def failure_of(scan: str, failed: Mapping[str, Exception]) -> Exception | None:
    """Return the failure to report for the outputs of a scan that could not be written; a bug comes first."""
    for name, failure in failed.items():
        if not isinstance(failure, CylxError | BrokenPipeError):
            return UnforeseenError(f"{scan}, and the output {name}", failure)
    first = next(iter(failed.values()), None)
    if isinstance(first, OutputError) and len(failed) > 1:
        places = [failure.place for failure in failed.values() if isinstance(failure, CylxError)]
        return OutputError(", ".join(places), first.fault, first.remedy)
    return first


def failed_outcome(failure: Exception, finished: Finished | None, *, debug: bool) -> Outcome:
    """Return the outcome of a scan that failed, with or without outputs."""
    line, code = describe_failure(failure)
    finished = None if finished is None else replace(finished, failure=None)  # not every exception can be sent
    trace = "".join(traceback.format_exception(failure)).rstrip() if debug else ""
    return Outcome("failed", finished, line.removeprefix("cylx: "), code, peak_memory(), trace)


def lost_outcome(job: Job, exit_code: int | None) -> Outcome:
    """Return the outcome of a scan whose process died."""
    from cylx.io import printable

    place = printable(job.scan)
    if exit_code is not None and exit_code == -getattr(signal, "SIGKILL", 9):
        fault = "its process was killed, probably because memory ran out"
        remedy = "give fewer --jobs, thin the scan, or cut it into parts"
        return Outcome("failed", None, f"{place}: {fault}; {remedy}", UNUSABLE)
    fault = f"its process ended with exit code {exit_code}, a bug of cylx or of a library"
    return Outcome("failed", None, f"{place}: {fault}; run it by itself with --debug", BUG)


def entry_of(job: Job, outcome: Outcome) -> dict[str, object]:
    """Return the entry of a scan in the summary; a scan finished earlier counts as done."""
    finished = outcome.finished
    return {
        "file": legible(job.scan),
        "status": "failed" if outcome.status == "failed" else "done",
        "reason": outcome.reason or None,
        "exit_code": outcome.exit_code,
        "points": None if finished is None else finished.points,
        "cylinders": None if finished is None else finished.cylinders,
        "warnings": [] if finished is None else list(finished.warnings),
    }
