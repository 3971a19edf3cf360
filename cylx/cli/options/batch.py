"""The options of `cylx extract` about many scans."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.batch.options import AUTO, BatchOptions
from cylx.cli.options.configuration import Command, complete_files

if TYPE_CHECKING:
    NumberType = click.ParamType[int]
else:
    NumberType = click.ParamType  # not generic in older versions


class Processes(NumberType):
    """A number of processes; 0 and `auto` mean as many as cores and memory allow."""

    name = "n"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Parse the number."""
        if value == "auto":
            return AUTO
        try:
            number = int(str(value))
        except ValueError:
            number = -1
        if number < 0:
            self.fail(f"'{value}' is not a number of processes or auto", param, ctx)
        return number


def with_batch_options(command: Command) -> Command:
    """Add the options about many scans; the command receives `options`."""

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
        return command(*args, options=BatchOptions(out_dir, recursive, jobs, resume, summary), **others)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options  # type: ignore[return-value]  # click keeps the signature


_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--out-dir",
        metavar="FOLDER",
        shell_complete=complete_files,
        help="Folder for all outputs; it is created if it does not exist.",
    ),
    click.option("--recursive", is_flag=True, help="Search subfolders too."),
    click.option(
        "--jobs",
        type=Processes(),
        metavar="N",
        help="Number of processes, with one scan at a time in each; 0 or auto: as many as cores and memory allow."
        "  [default: one scan after the other in this process]",
    ),
    click.option("--resume", is_flag=True, help="Skip scans that are finished and unchanged; process the others."),
    click.option(
        "--summary/--no-summary",
        default=None,
        help="Write summary.csv and summary.json into the folder.  [default: yes, for several scans]",
    ),
)
