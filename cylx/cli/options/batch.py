"""The options of `cylx extract` that are about many scans at once."""

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


def with_batch_options(command: Command) -> Command:
    """Add the options about many scans; the command gets `options`."""

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
