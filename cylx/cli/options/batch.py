"""The options of `cylx extract` that are about many scans at once."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from cylx.cli.batch.jobs import is_folder, is_slashed
from cylx.cli.batch.memory import cores, memory_available, memory_needed
from cylx.cli.batch.summary import LIST, TABLE
from cylx.cli.options.configuration import Command, complete_files
from cylx.errors import OutputError, UsageError

AUTO = 0

if TYPE_CHECKING:
    NumberType = click.ParamType[int]
else:
    NumberType = click.ParamType  # not generic in older versions


class Processes(NumberType):
    """A number of processes, 0 and `auto` being as many as there is room for."""

    name = "n"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Read the number."""
        if value == "auto":
            return AUTO
        try:
            number = int(str(value))
        except ValueError:
            number = -1
        if number < 0:
            self.fail(f"'{value}' is no number of processes, nor auto", param, ctx)
        return number


class Many(NamedTuple):
    """What was asked for with many scans in mind.

    Parameters
    ----------
    out_dir : str or None
        `--out-dir`.
    recursive : bool
        `--recursive`.
    jobs : int or None
        `--jobs`; 0 for as many as there is room for, None for this process alone.
    resume : bool
        `--resume`.
    summary : bool or None
        `--summary` or `--no-summary`, None for neither.
    """

    out_dir: str | None
    recursive: bool
    jobs: int | None
    resume: bool
    summary: bool | None

    def output(self, output: str | None) -> str | None:
        """Give what `-o` amounts to, a folder that is to be made having a slash at its end.

        Raises
        ------
        UsageError
            If `-o` is given, too, or the folder is something else.
        """
        if self.out_dir is None:
            return output
        if output is not None:
            raise UsageError("--out-dir", "is given beside -o", "leave one of them out")
        if Path(self.out_dir).exists() and not Path(self.out_dir).is_dir():
            raise UsageError(f"--out-dir {self.out_dir}", "is no folder", "choose another name")
        return self.out_dir if is_slashed(self.out_dir) else self.out_dir + os.sep

    def summaries(self, output: str | None, scans: Sequence[str]) -> list[str]:
        """Name the files of the summary; none of them if none is wanted.

        Raises
        ------
        UsageError
            If one is asked for, and there is no folder for it.
        """
        folder = output if output is not None and is_folder(output) else None
        if self.summary and folder is None:
            raise UsageError("--summary", "has no folder to go to", "name one by --out-dir")
        wanted = self.summary if self.summary is not None else len(scans) > 1
        return [] if folder is None or not wanted else [str(Path(folder) / name) for name in (TABLE, LIST)]

    def processes(self, scans: Sequence[str]) -> int | None:
        """Give the number of processes for some scans; None for this process alone."""
        if self.jobs is None or not scans:
            return None
        if self.jobs != AUTO:
            return min(self.jobs, len(scans))
        available, room, most = memory_available(), 0, min(cores(), len(scans))
        for need in sorted(map(memory_needed, scans), reverse=True)[:most]:
            if available is not None and need > available:
                break
            available = None if available is None else available - need
            room += 1
        return max(room, 1)


@contextmanager
def made_folder(output: str | None) -> Iterator[None]:
    """Make the folder that the outputs go to, if its name ends in a slash; remove it again if nothing came into it.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    if output is None or not is_slashed(output) or Path(output).is_dir():
        yield
        return
    try:
        Path(output).mkdir(parents=True)
    except (OSError, ValueError) as error:
        from cylx.io import printable

        fault = f"cannot be made: {(getattr(error, 'strerror', None) or str(error)).lower()}"
        raise OutputError(printable(output), fault, "choose another folder") from None
    try:
        yield
    finally:
        with suppress(OSError):
            Path(output).rmdir()


def with_many(command: Command) -> Command:
    """Add the options about many scans; the command gets `many`."""

    @functools.wraps(command)
    def with_options(
        *args: object,
        out_dir: str | None,
        recursive: bool,
        jobs: int | None,
        resume: bool,
        summary: bool | None,
        **others: object,
    ) -> object:
        return command(*args, many=Many(out_dir, recursive, jobs, resume, summary), **others)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options  # type: ignore[return-value]  # click keeps the signature


_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--out-dir",
        metavar="FOLDER",
        shell_complete=complete_files,
        help="Folder for all outputs; it is made if it is not there.",
    ),
    click.option("--recursive", is_flag=True, help="Look into the folders in a folder, too."),
    click.option(
        "--jobs",
        type=Processes(),
        metavar="N",
        help="Processes that take a scan each; 0 or auto: as many as cores and memory allow."
        "  [default: one scan after the other in this process]",
    ),
    click.option(
        "--resume", is_flag=True, help="Leave out what is done and unchanged; do the rest, and what is stale."
    ),
    click.option(
        "--summary/--no-summary",
        default=None,
        help="Write summary.csv and summary.json into the folder.  [default: yes, of several scans]",
    ),
)
