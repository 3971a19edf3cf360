"""`cylx diff`: compare two results."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from cylx.cli.batch.jobs import check_apart
from cylx.cli.options.configuration import complete_files, debug_option, json_option, overwrite_option
from cylx.cli.options.numbers import NumberRange
from cylx.cli.terminal.failures import answer, called_by_file
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import UsageError
from cylx.io.outputs import STANDARD_OUTPUT, check_writable, write_bytes
from cylx.wording import counted, number

if TYPE_CHECKING:
    from cylx.evaluation import Comparison, Difference

_TOLERANCE = NumberRange(min=0)


@click.command(
    cls=ExampleCommand,
    examples=[
        "cylx diff golden/room.cylinders.json room.cylinders.json",
        "cylx diff before.json after.json --radius 0.001 --junit diff.xml",
    ],
)
@click.argument("a", shell_complete=complete_files)
@click.argument("b", shell_complete=complete_files)
@click.option(
    "--angle", "angle_deg", type=_TOLERANCE, default=0.1, show_default=True, help="Angle between the axes, degrees."
)
@click.option("--offset", type=_TOLERANCE, default=0.01, show_default=True, help="Distance of the axes, in radii.")
@click.option("--radius", type=_TOLERANCE, default=0.005, show_default=True, help="Radius, relative.")
@click.option("--height", type=_TOLERANCE, default=0.05, show_default=True, help="Length and position, relative.")
@click.option("--inliers", type=_TOLERANCE, default=0.05, show_default=True, help="Number of inliers, relative.")
@click.option(
    "--junit",
    "junit_file",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write the comparison for a CI server, as JUnit XML: a test for each cylinder, blend, fitting and run.",
)
@overwrite_option
@json_option
@debug_option
def diff(*, a: str, b: str, junit_file: str | None, overwrite: bool, as_json: bool, **tolerances: float) -> None:
    """Compare the cylinders, the blends, and the fittings and runs of the results A and B within tolerances.

    Their order does not matter. The exit code is 0 if the results agree and 1 if not; the differences
    are shown.
    """
    from cylx.evaluation import Tolerances, compare
    from cylx.io import read_json

    if junit_file is not None:
        _check_junit(junit_file, (a, b), overwrite=overwrite, as_json=as_json)
    documents = read_json(a), read_json(b)
    with called_by_file({"a": a, "b": b}):
        comparison = compare(*documents, tolerances=Tolerances(**tolerances))
    if junit_file is not None:
        from cylx.evaluation.junit import junit

        write_bytes(junit_file, junit(*documents, comparison, (a, b)), overwrite=overwrite)
    if junit_file not in STANDARD_OUTPUT:
        _show(comparison, as_json=as_json)
    if not comparison.same:
        raise click.exceptions.Exit(1)


def _check_junit(name: str, inputs: tuple[str, str], *, overwrite: bool, as_json: bool) -> None:
    """Refuse a JUnit file that cannot be written, before anything is compared."""
    if as_json and name in STANDARD_OUTPUT:
        raise UsageError("--junit", "goes to standard output, and so does --json", "give --junit a file")
    check_apart(inputs, [name])
    check_writable(name, overwrite=overwrite)


def _show(comparison: Comparison, *, as_json: bool) -> None:
    """Print the comparison."""
    from cylx.cli.terminal.display import show_table

    if as_json:
        answer(json.dumps(comparison.to_dict(), indent=2) + "\n", as_json=True)
    elif comparison.differences:
        header = ["what", "id in A", "id in B", "of", "A", "B", "difference", "tolerance"]
        show_table(header, [_row(difference) for difference in comparison.differences])
    else:
        piping = comparison.piping
        also = f" and {piping.counts['fittings_matched']} fittings" if piping is not None and piping.counts else ""
        answer(f"the same {counted(comparison.matched, comparison.blends_matched)}{also}\n")


def _row(difference: Difference) -> list[str]:
    """Format one row of the table."""
    prefix = "" if difference.of == "cylinders" else f"{difference.of.removesuffix('s')} "
    ids = ["" if number is None else f"{prefix}{number}" for number in (difference.id_a, difference.id_b)]
    values = (difference.a, difference.b, difference.difference, difference.tolerance)
    return [difference.kind, *ids, difference.what, *("" if v is None else number(v, 6) for v in values)]
