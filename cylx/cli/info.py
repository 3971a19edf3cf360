"""`cylx info`: what is in a file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.failures import answer, tell
from cylx.cli.group import ExampleCommand
from cylx.cli.options import complete_files, debug_option, json_option
from cylx.cli.selecting import selecting
from cylx.errors import InputError

if TYPE_CHECKING:
    from cylx.records import PointCloud, Selection


@click.command(cls=ExampleCommand, examples=["cylx info scan.ply", "cylx info scan.ply --json | jq .scene.spacing"])
@click.argument("scan", shell_complete=complete_files)
@click.option(
    "--seed", type=click.IntRange(min=0), metavar="N", default=0, show_default=True, help="Seed of the measurement."
)
@selecting
@json_option
@debug_option
def info(*, scan: str, seed: int, selection: Selection, as_json: bool) -> None:
    """Show what is in a scan: fields, points, bounds, spacing, noise.

    SCAN is a PLY, PCD, XYZ, LAS, LAZ, E57 or NPY file, or - for standard input. Spacing and noise are measured as
    'cylx extract' does, in the unit of the scan. If only some points take part, bounds and scale are theirs.
    """
    from cylx.io import read_cloud
    from cylx.scene import check_usable, measure_scene
    from cylx.selection import select

    whole = read_cloud(scan, scan=selection.scan)
    cloud = select(whole, selection)
    facts = describe_cloud(whole, cloud)
    try:
        check_usable(cloud.points, cloud.source.file)
        scene = measure_scene(cloud.points, seed)
        facts["scene"] = {"spacing": scene.spacing, "noise": scene.noise}
    except InputError as failure:
        tell(f"warning: {failure.place}: {failure.fault}; cylinders cannot be looked for in it")
    answer(json.dumps(facts, indent=2, ensure_ascii=False) + "\n" if as_json else as_text(facts))


def describe_cloud(whole: PointCloud, cloud: PointCloud) -> dict[str, Any]:
    """Give what a file says of itself as a JSON object; bounds and extent are those of the points that take part."""
    table = whole.table
    names = ("x", "y", "z") if table is None or table.dtype.names is None else table.dtype.names
    fields = [{"name": n, "type": "float64" if table is None else str(table.dtype[n])} for n in names]
    facts: dict[str, Any] = {
        "file": cloud.source.file,
        "format": cloud.source.format,
        "sha256": cloud.source.sha256,
        "points": cloud.rows,
        "finite": len(whole.points),
        "fields": fields,
    }
    if cloud is not whole:
        facts["selected"] = len(cloud.points)
    if len(cloud.points):
        low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
        facts["bounds"] = {"min": low.tolist(), "max": high.tolist()}
        facts["size"] = (high - low).tolist()
        facts["extent"] = float(((high - low) ** 2).sum() ** 0.5)
    return facts


def as_text(facts: dict[str, Any]) -> str:
    """Write the facts for reading."""
    lines = {
        "file": facts["file"],
        "format": facts["format"],
        "points": f"{facts['points']}, {facts['finite']} of them finite",
        **({"selected": str(facts["selected"])} if "selected" in facts else {}),
        "fields": ", ".join(f"{field['name']} ({field['type']})" for field in facts["fields"]),
    }
    if "bounds" in facts:
        lines["min"] = _vector(facts["bounds"]["min"])
        lines["max"] = _vector(facts["bounds"]["max"])
        lines["size"] = _vector(facts["size"])
        lines["extent"] = f"{facts['extent']:.6g}"
    if "scene" in facts:
        lines["spacing"] = f"{facts['scene']['spacing']:.4g}"
        lines["noise"] = f"{facts['scene']['noise']:.4g}"
    return "".join(f"{name:<8} {value}\n" for name, value in lines.items())


def _vector(values: list[float]) -> str:
    """Write three coordinates."""
    return " ".join(f"{value:.10g}" for value in values)
