"""`cylx runs`: join the cylinders of a result to runs of pipe."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cylx.cli.batch.jobs import RESULT, check_apart
from cylx.cli.options.configuration import complete_files, debug_option, overwrite_option, with_messages
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleCommand
from cylx.io.outputs import STANDARD_OUTPUT, STREAM

if TYPE_CHECKING:
    from cylx.cli.terminal.display import Messages
    from cylx.records import Extraction, PointCloud
    from cylx.results import Result

RUNS = ".runs.json"


@click.command(
    cls=ExampleCommand,
    examples=[
        "cylx runs rack.cylinders.json rack.annotated.ply",
        "cylx runs rack.runs.json --table",
    ],
)
@click.argument("result", shell_complete=complete_files)
@click.argument("scan", required=False, shell_complete=complete_files)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    shell_complete=complete_files,
    help="Name of the JSON; - for standard output.  [default: NAME.runs.json for NAME.cylinders.json]",
)
@click.option("--table", is_flag=True, help="Print the bill of quantities as CSV; write no JSON without -o.")
@click.option(
    "--fit-runs", is_flag=True, help="Move cylinders so that axes meet and angles are round, where uncertainties allow."
)
@click.option(
    "--annotated",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write the cloud with cylinder, fitting and run of each point: .ply, .pcd, or for LAS and LAZ .las or .laz.",
)
@click.option(
    "--report",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write an HTML page with the cloud and its runs in 3-D; - for standard output.",
)
@overwrite_option
@with_messages
@debug_option
def runs(
    *,
    result: str,
    scan: str | None,
    output: str | None,
    table: bool,
    fit_runs: bool,
    annotated: str | None,
    report: str | None,
    overwrite: bool,
    messages: Messages,
) -> None:
    """Join the cylinders of RESULT to runs of pipe, by fittings that are fitted to SCAN.

    SCAN is the annotated cloud of RESULT, or the scan it is of. Without SCAN the axes alone tell the fittings. A RESULT
    that has runs already is shown, and with SCAN they are looked for again. Elbows, tees, crosses, reducers, flanges,
    caps, things in line such as valves, and gaps are found; a table of the runs goes to standard error.
    """
    from cylx.io import check_writable, read_cloud, read_json
    from cylx.results import Result

    output = None if output is None else STREAM if output in STANDARD_OUTPUT else output
    content = Result.parse(read_json(result), result)
    again = scan is not None or content.runs is None or fit_runs
    if output is None and not table and again:
        output = _beside(result)
    outputs = [name for name in (output, annotated, report) if name is not None]
    check_apart([name for name in (result, scan) if name is not None], outputs)
    for name in outputs:
        check_writable(name, overwrite=overwrite)
    if scan is None and (annotated or report):
        _demand_scan("--annotated" if annotated else "--report")
    cloud = None if scan is None else read_cloud(scan)
    if again:
        content, found = _found(content, cloud, fit=fit_runs)
    else:
        found = None
    _write(content, found, output, annotated, report, overwrite=overwrite)
    if table:
        from cylx.results.quantities import quantities_csv

        answer(quantities_csv(content))
    elif not messages.quiet:
        _show(result, content, outputs)


def _beside(result: str) -> str:
    """Return the default name of the JSON."""
    if result == STREAM:
        return STREAM
    stem = result.removesuffix(RESULT).removesuffix(RUNS)
    return (stem if stem != result else str(Path(result).with_suffix(""))) + RUNS


def _demand_scan(option: str) -> None:
    from cylx.errors import UsageError

    raise UsageError(option, "needs the points", "name the scan after the result")


def _found(content: Result, cloud: PointCloud | None, *, fit: bool) -> tuple[Result, Extraction | None]:
    """Find the runs of a result; with a cloud, also as an extraction."""
    from cylx.api.piping import extraction_of, find_runs

    if cloud is None:
        return find_runs(content, fit=fit), None
    extraction = find_runs(extraction_of(content, cloud), fit=fit)
    lists = content.lists_of(extraction.cylinders, extraction.piping)
    return content.model_copy(update=lists | {"warnings": list(extraction.warnings)}), extraction


def _write(
    content: Result,
    found: Extraction | None,
    output: str | None,
    annotated: str | None,
    report: str | None,
    *,
    overwrite: bool,
) -> None:
    """Write the outputs that were asked for."""
    from cylx.io import write_annotated, write_text

    if output is not None:
        write_text(output, content.to_json(), overwrite=overwrite)
    if annotated is not None and found is not None:
        write_annotated(annotated, found, overwrite=overwrite)
    if report is not None and found is not None:
        from cylx.report import html_of

        write_text(report, html_of(found), overwrite=overwrite)


def _show(path: str, content: Result, outputs: list[str]) -> None:
    """Show a line about a result, and a table of its runs."""
    from cylx.cli.terminal.display import show_table
    from cylx.cli.terminal.failures import tell
    from cylx.io import printable
    from cylx.results.runs_table import RUNS_HEADER, runs_rows
    from cylx.wording import piping_counted

    written = ", ".join(printable(name) for name in outputs if name != STREAM)
    said = piping_counted(len(content.runs or ()), [one.kind for one in content.fittings or ()])
    tell(f"{printable(path)}: {said}" + (f", written to {written}" if written else ""))
    for warning in content.warnings:
        tell(f"warning: {warning}")
    if content.adjustments:
        applied = sum(one.applied for one in content.adjustments)
        tell(f"{applied} constraints applied, {len(content.adjustments) - applied} refused; see 'adjustments'")
    rows = runs_rows(content)
    if rows:
        show_table(RUNS_HEADER, rows, err=True)
