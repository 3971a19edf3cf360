"""`cylx reproduce`: run the paper's experiments again."""

from __future__ import annotations

import json
import os
from math import isfinite
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click

from cylx.cli.options.configuration import complete_files, debug_option, json_option, with_messages
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import OutputError, UsageError
from cylx.io.existing import has_file
from cylx.version import __version__

if TYPE_CHECKING:
    from cylx.cli.terminal.display import Messages
    from cylx.experiments import Figure, ObjectScan, Summary, Trials

NUMBERS = tuple(str(number) for number in range(5, 13))
SAVED_EVERY = 5.0
"""Seconds between two saves of the trials."""


@click.command(
    cls=ExampleCommand,
    examples=["cylx reproduce 7 --trials 10", "cylx reproduce 11 --data 005_tomato_soup_can.ply --out experiments/"],
)
@click.argument("figures", metavar="FIGURE...", nargs=-1, required=True, type=click.Choice((*NUMBERS, "all")))
@click.option(
    "--trials", type=click.IntRange(min=1), metavar="N", default=100, show_default=True, help="Trials per setting."
)
@click.option("--jobs", type=click.IntRange(min=1), metavar="N", help="Processes to use.  [default: one per core]")
@click.option(
    "--curves",
    metavar="NAMES",
    help="Only these methods, separated by commas: gt, msac, line-fit, tran, jin, auto.  [default: all]",
)
@click.option(
    "--out",
    metavar="FOLDER",
    default="experiments",
    show_default=True,
    shell_complete=complete_files,
    help="Folder for the tables and pictures; trials already in it are not run again.",
)
@click.option(
    "--data",
    metavar="FILE",
    shell_complete=complete_files,
    help="Scan of an upright can for figures 11 and 12, such as the tomato soup can of the YCB objects.",
)
@with_messages
@json_option
@debug_option
def reproduce(
    *,
    figures: tuple[str, ...],
    trials: int,
    jobs: int | None,
    curves: str | None,
    out: str,
    data: str | None,
    messages: Messages,
    as_json: bool,
) -> None:
    """Run the paper's experiments again.

    FIGURE is a number from 5 to 12, or all. Each figure writes figure-N.csv, with a line per trial, and figure-N.png. A
    table of means goes to standard output; with --json all figures are printed at the end. An interrupted run can be
    continued by the same command. Times are those of this machine, with one thread in each of --jobs processes.
    """
    from cylx.experiments import FIGURES
    from cylx.io import read_object

    numbers = sorted({int(name) for name in NUMBERS if name in figures or "all" in figures})
    chosen = _only([FIGURES[number] for number in numbers], curves)
    if data is None and any(figure.needs_scan for figure in chosen):
        needing = [str(figure.number) for figure in chosen if figure.needs_scan]
        which = f"figure {needing[0]} needs" if len(needing) == 1 else f"figures {' and '.join(needing)} need"
        raise UsageError("--data", f"{which} the scan of a can", "give one by --data FILE")
    scan = None
    if data is not None:
        from cylx.experiments import ObjectScan

        scan = ObjectScan.of(*read_object(data))
    study = Study(Path(out), trials, jobs or os.cpu_count() or 1, messages)
    told = []
    for figure in chosen:
        summaries = study.run(figure, scan if figure.needs_scan else None)
        if as_json:
            told.append({"figure": figure.number, "title": figure.title, "cells": [_told(one) for one in summaries]})
        else:
            _show(figure, summaries)
    if as_json:
        answer(json.dumps({"figures": told}, indent=2, ensure_ascii=False) + "\n", as_json=True)


class Study:
    """The figures of one call, and the folder for their files.

    Parameters
    ----------
    folder : Path
    trials : int
        Trials per setting.
    jobs : int
        Number of processes.
    messages : Messages

    Raises
    ------
    OutputError
        If the folder cannot be created.
    """

    def __init__(self, folder: Path, trials: int, jobs: int, messages: Messages) -> None:
        self.folder = folder
        self.trials = trials
        self.jobs = jobs
        self.messages = messages
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            fault = f"cannot be created: {(error.strerror or str(error)).lower()}"
            raise OutputError(str(folder), fault, "give another folder by --out") from None

    def run(self, figure: Figure, scan: ObjectScan | None) -> list[Summary]:
        """Run the missing trials of a figure, draw it, and return its means.

        Raises
        ------
        OutputError
            If its files cannot be written, or existing files are something else.
        UsageError
            If matplotlib is not installed.
        """
        from cylx.cli.batch.workers import isolate_processes
        from cylx.cli.terminal.display import observed
        from cylx.experiments import draw, run_tasks, summarize, tasks_of
        from cylx.io import check_writable, write_bytes

        table, picture = self.folder / f"figure-{figure.number}.csv", self.folder / f"figure-{figure.number}.png"
        check_writable(picture, overwrite=True)
        made_by = __version__ if scan is None else f"{__version__} {scan.name}"
        done = self._read(table, made_by)
        draw(figure, summarize(figure, done), done)  # fails now if matplotlib is missing
        tasks = tasks_of(figure, self.trials, done)
        with self.messages.progress() as observer, observed(observer, f"figure {figure.number}", len(tasks)):
            saved = monotonic()
            try:
                with isolate_processes():
                    for key, outcome in run_tasks(tasks, self.jobs, scan):
                        done[key] = outcome
                        observer.stage_advanced(1)
                        if monotonic() - saved > SAVED_EVERY:
                            self._write(table, done, made_by)
                            saved = monotonic()
            finally:
                self._write(table, done, made_by)
        wanted = {key: outcome for key, outcome in done.items() if key.trial < self.trials}
        summaries = summarize(figure, wanted)
        write_bytes(picture, draw(figure, summaries, wanted), overwrite=True)
        self.messages.say(f"figure {figure.number}: {len(tasks)} trials run, written to {table} and {picture}")
        return summaries

    def _read(self, table: Path, made_by: str) -> Trials:
        """Read the finished trials."""
        from cylx.experiments import parse_trials
        from cylx.io import check_writable

        check_writable(table, overwrite=True)
        if not has_file(table):
            return {}
        try:
            trials = parse_trials(table.read_text(encoding="utf-8"), made_by)
        except (OSError, UnicodeDecodeError):
            trials = None
        if trials is None:
            raise OutputError(str(table), "exists and is not a table of trials", "give another folder by --out")
        return trials

    def _write(self, table: Path, trials: Trials, made_by: str) -> None:
        """Save all trials."""
        from cylx.experiments import header_line, trial_lines
        from cylx.io import write_text

        write_text(table, header_line() + trial_lines(sorted(trials.items()), made_by), overwrite=True)


def _only(figures: list[Figure], curves: str | None) -> list[Figure]:
    """Keep only the cells of some methods, and the figures that have them."""
    if curves is None:
        return figures
    from cylx.experiments.figures import CURVES

    names = [name.strip() for name in curves.split(",")]
    for name in names:
        if name not in CURVES:
            raise UsageError(f"--curves {curves}", f"'{name}' is not a method", f"the methods are {', '.join(CURVES)}")
    cut = [figure._replace(cells=tuple(cell for cell in figure.cells if cell.method in names)) for figure in figures]
    left = [figure for figure in cut if figure.cells]
    if not left:
        numbers = " and ".join(str(figure.number) for figure in figures)
        raise UsageError(f"--curves {curves}", f"figure {numbers} has none of them", "leave --curves out")
    return left


def _told(summary: Summary) -> dict[str, object]:
    """Return the means of a cell as a JSON object; unknown values are null."""
    names, cell = ("angle_deg", "offset_radii", "radius_percent", "seconds"), summary.cell
    known = {name: (mean, error) for name, mean, error in zip(names, summary.means, summary.errors, strict=True)}
    bound = dict(zip(names, summary.bound or (), strict=False))
    return {
        "panel": cell.panel,
        "curve": cell.curve,
        "x": cell.x,
        "trials": summary.trials,
        "found": _number(summary.found),
        "means": {name: _number(mean) for name, (mean, _) in known.items()},
        "standard_errors": {name: _number(error) for name, (_, error) in known.items()},
        "bounds": {name: _number(least) for name, least in bound.items()},
    }


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _show(figure: Figure, summaries: list[Summary]) -> None:
    """Show the means, and their ratios to the bound."""
    from cylx.cli.terminal.display import show_table

    errors = figure.kind in {"cylinder", "cans"}
    shown = {"cylinder": (0, 1, 2), "cans": (0,)}.get(figure.kind, (3,))
    names = ("angle, °", "offset, r", "radius, %", "seconds")
    header = ["panel", "curve", "x", "trials", "found", *(names[i] for i in shown)]
    bounded = figure.kind == "cylinder"
    header += ["angle / bound", "offset / bound", "radius / bound"] if bounded else []
    rows = []
    for summary in summaries:
        cell = summary.cell
        numbers = [f"{summary.means[i]:.3g} ± {summary.errors[i]:.1g}" for i in shown]
        over = [f"{summary.means[i] / summary.bound[i]:.2f}" for i in shown] if summary.bound else []
        rows.append(
            [cell.panel, cell.curve, f"{cell.x:g}", str(summary.trials), f"{summary.found:.2f}", *numbers, *over]
        )
    answer(f"figure {figure.number}: {figure.title}" + (", mean ± standard error" if errors else "") + "\n")
    show_table(header, rows)
