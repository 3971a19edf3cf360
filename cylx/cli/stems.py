"""`cylx stems`: the stems of a plot, with their diameters at breast height."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Literal

import click

from cylx.cli.batch.jobs import check_apart
from cylx.cli.options.configuration import complete_files, debug_option, json_option, overwrite_option
from cylx.cli.options.numbers import NumberRange
from cylx.cli.options.selection import selecting
from cylx.cli.options.units import units_option
from cylx.cli.terminal.failures import answer, tell
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import UsageError

if TYPE_CHECKING:
    from cylx.records import PointCloud, Selection
    from cylx.records.stems import StemPlot
    from cylx.results.stems import ResultStem, Stems

_HEADER = ("id", "x", "y", "ground", "dbh, cm", "lean", "followed", "seen", "quality", "remarks")
_MAPS = (".gpkg", ".geojson")


@click.command(
    cls=ExampleCommand,
    examples=[
        "cylx stems plot.laz -o plot.csv",
        "cylx stems plot.laz -o plot.stems.json -o plot.gpkg --annotated plot.trees.laz --report plot.html",
    ],
)
@click.argument("scan", shell_complete=complete_files)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    metavar="FILE",
    shell_complete=complete_files,
    help="Write the stems: .csv, .json, .gpkg or .geojson; may be given several times.",
)
@click.option(
    "--annotated",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write the cloud with the treeID of each point: .ply, .pcd, or for LAS and LAZ .las or .laz.",
)
@click.option("--report", metavar="FILE", shell_complete=complete_files, help="Write an HTML page with a map.")
@click.option(
    "--ground",
    type=click.Choice(["classes", "cloth", "lowest"]),
    help="How the ground is found.  [default: class 2 if points have it, or else a cloth if installed]",
)
@click.option(
    "--min-dbh", type=NumberRange(min=0.02), default=0.05, show_default=True, metavar="X",
    help="Least diameter at breast height, metres.",
)  # fmt: skip
@units_option("metres are taken for")
@selecting
@overwrite_option
@json_option
@debug_option
def stems(
    *,
    scan: str,
    outputs: tuple[str, ...],
    annotated: str | None,
    report: str | None,
    ground: Literal["classes", "cloth", "lowest"] | None,
    min_dbh: float,
    units: str | None,
    selection: Selection,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Find the stems of SCAN, a plot of a forest, and measure each at 1.3 m above the ground.

    z points upwards. The table has the place of each stem, the height of the ground, the diameter at breast height with
    its standard deviation, roundness, lean, taper, the heights between which it was followed, the arc seen and a
    quality; it goes to standard error, or as JSON to standard output with --json. Diameters are in metres, places in
    the unit of the scan.
    """
    from cylx.api.stems import find_stems
    from cylx.io import check_annotated, check_writable, read_cloud
    from cylx.results.stems import Stems
    from cylx.scene import select

    named = [name for name in (*outputs, annotated, report) if name is not None]
    check_apart([scan], named)
    for name in outputs:
        _check_suffix(name)
    for name in named:
        check_writable(name, overwrite=overwrite)
    cloud = select(read_cloud(scan, scan=selection.scan, units=units), selection)
    if annotated is not None:
        check_annotated(annotated, cloud)
    plot = find_stems(cloud, units=units, ground=ground, min_dbh=min_dbh)
    content = Stems.of(plot, units or cloud.source.units or "m")
    _write(plot, content, outputs, annotated, report, overwrite=overwrite)
    if as_json:
        answer(json.dumps(content.to_object(), indent=2, ensure_ascii=False) + "\n", as_json=True)
    _show(cloud, content, named)


def _check_suffix(name: str) -> None:
    if not name.lower().endswith((".csv", ".json", *_MAPS)):
        raise UsageError(name, "is no format of stems", "choose a name that ends in .csv, .json, .gpkg or .geojson")


def _write(
    plot: StemPlot,
    content: Stems,
    outputs: tuple[str, ...],
    annotated: str | None,
    report: str | None,
    *,
    overwrite: bool,
) -> None:
    """Write the outputs that were asked for, all or none."""
    from cylx.io.outputs import all_or_none, write_bytes, write_text

    with all_or_none(overwrite=overwrite) as temporary:
        for name in outputs:
            write_bytes(temporary(name), _rendered(name, plot, content))
        if annotated is not None:
            from cylx.io import write_trees

            write_trees(temporary(annotated), plot.cloud, plot.labels)
        if report is not None:
            from cylx.report.stems import stems_page

            write_text(temporary(report), stems_page(content, plot.ground, plot.unit))


def _rendered(name: str, plot: StemPlot, content: Stems) -> bytes:
    """Return the stems as the suffix has them."""
    suffix = name.lower()
    if suffix.endswith(".csv"):
        return content.to_csv().encode()
    if suffix.endswith(".json"):
        return content.to_json().encode()
    from cylx.cli.export import map_crs
    from cylx.export.stems import stems_map

    crs = map_crs(content.input.crs, None)
    return stems_map(content, crs, name, 1.0 if crs is None else plot.unit / crs.metres)


def _show(cloud: PointCloud, content: Stems, written: list[str]) -> None:
    """Show a line about the stems, and their table."""
    from cylx.cli.terminal.display import show_table
    from cylx.io import printable

    count = len(content.stems)
    names = ", ".join(printable(name) for name in written)
    said = f"{count} stem{'' if count == 1 else 's'}, ground by {content.ground_by}"
    tell(f"{printable(cloud.source.file)}: {said}" + (f", written to {names}" if names else ""))
    if content.stems:
        show_table(_HEADER, [_row(stem) for stem in content.stems], err=True)


def _row(stem: ResultStem) -> list[Any]:
    return [
        str(stem.id), f"{stem.x:.2f}", f"{stem.y:.2f}", f"{stem.ground:.2f}",
        f"{100 * stem.dbh:.1f} ± {100 * stem.dbh_sd:.2f}", f"{stem.lean_deg:.1f}°",
        f"{stem.lowest:.1f} to {stem.highest:.1f} m", f"{stem.arc_deg:.0f}°", f"{stem.quality:.2f}",
        "; ".join(stem.flags),
    ]  # fmt: skip
