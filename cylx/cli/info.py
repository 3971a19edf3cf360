"""`cylx info`: describe a scan."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.batch.memory import free_memory, memory_for
from cylx.cli.options.configuration import complete_files, debug_option, json_option
from cylx.cli.options.selection import selecting
from cylx.cli.terminal.failures import answer, tell
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import InputError
from cylx.harmless import visible
from cylx.wording import number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.io import Glance
    from cylx.records import PointCloud, Selection, Source
    from cylx.scene.cautions import Caution

LARGE = 50_000_000
"""Of more points only a sample is read."""


@click.command(cls=ExampleCommand, examples=["cylx info scan.ply", "cylx info scan.ply --json | jq .scene.spacing"])
@click.argument("scan", shell_complete=complete_files)
@click.option(
    "--seed", type=click.IntRange(min=0), metavar="N", default=0, show_default=True, help="Seed of the measurement."
)
@selecting
@json_option
@debug_option
def info(*, scan: str, seed: int, selection: Selection, as_json: bool) -> None:
    """Show the contents of a scan, the radii that can be found in it, and likely problems.

    SCAN is a PLY, PCD, XYZ, LAS, LAZ, E57, PTX or NPY file, or - for standard input. Spacing and noise are measured as
    'cylx extract' does, in the unit of the scan; the range of radii and the memory needed follow from them. If only
    some points are used, all values are for these points. Standard error shows one line for each likely problem. Of a
    LAS, LAZ, NPY or binary PLY of more than 50 million points, only the header and a sample are read.
    """
    from cylx.io import expected_points, glance_at, read_cloud
    from cylx.scene import select

    narrowed = selection.narrows or selection.scan is not None
    seen = None if narrowed or expected_points(scan) <= LARGE else glance_at(scan)
    if seen is not None:
        whole = cloud = seen.sample
        facts = describe_glance(seen)
    else:
        whole = read_cloud(scan, scan=selection.scan)
        cloud = select(whole, selection)
        facts = describe_cloud(whole, cloud)
    try:
        prospects, found = look_ahead(whole, cloud, seed)
        facts.update(prospects)
    except InputError as failure:
        from cylx.scene.cautions import Caution

        found = [Caution("unusable", failure.fault, "no cylinders can be found in it")]
    found += _scarce_memory(facts["extract_memory_bytes"])
    if seen is not None:
        found.append(_sampled(seen))
    facts["warnings"] = [asdict(caution) for caution in found]
    for caution in found:
        tell(f"warning: {cloud.source.file}: {caution}")
    for note in cloud.source.notes:
        tell(f"note: {cloud.source.file}: {note}")
    answer(json.dumps(facts, indent=2, ensure_ascii=False) + "\n" if as_json else as_text(facts), as_json=as_json)


def look_ahead(whole: PointCloud, cloud: PointCloud, seed: int) -> tuple[dict[str, Any], list[Caution]]:
    """Measure the scale of a cloud, and derive the range of radii and likely problems.

    Parameters
    ----------
    whole : PointCloud
        As it was read.
    cloud : PointCloud
        The points that are used.
    seed : int
        Seed of the measurement.

    Returns
    -------
    facts : dict
        `scene` and `radius`.
    found : list of Caution

    Raises
    ------
    InputError
        If the cloud is unusable for finding cylinders.
    """
    from cylx.config import load_config
    from cylx.scene import check_usable, measure_scene, resolve, thinnest
    from cylx.scene.cautions import cautions

    check_usable(cloud.points, cloud.source.file)
    scene = measure_scene(cloud.points, seed)
    settings = resolve(load_config(), scene)
    limits, least = settings.scene, settings.verification.min_inliers
    facts = {
        "scene": {"spacing": scene.spacing, "noise": scene.noise},
        "radius": {"min": limits.radius_min, "found_from": thinnest(scene)[1], "max": limits.radius_max},
    }
    return facts, cautions(whole, cloud, scene, least)


def _scarce_memory(needed: int) -> list[Caution]:
    """Return a caution if the extraction may not fit into the free memory."""
    from cylx.scene.cautions import Caution

    available = free_memory()
    if available is None or needed <= available:
        return []
    fault = f"'cylx extract' needs about {needed / 1e9:.2g} GB, and {available / 1e9:.2g} GB are free"
    return [Caution("memory", fault, "take a part of the scan by --crop or --voxel")]


def describe_cloud(whole: PointCloud, cloud: PointCloud) -> dict[str, Any]:
    """Return the facts about a file as a JSON object; bounds and extent are those of the points that are used."""
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
    facts |= _reference(cloud.source)
    if cloud is not whole:
        facts["selected"] = len(cloud.points)
    facts["extract_memory_bytes"] = memory_for(cloud.rows if cloud is whole else len(cloud.points))
    if len(cloud.points):
        facts |= _measured(cloud.points.min(axis=0), cloud.points.max(axis=0))
    return facts


def describe_glance(seen: Glance) -> dict[str, Any]:
    """Return the facts about a file of which only a sample was read as a JSON object."""
    source, points = seen.sample.source, seen.sample.points
    low, high = (points.min(axis=0), points.max(axis=0)) if seen.bounds is None else seen.bounds
    facts: dict[str, Any] = {
        "file": source.file,
        "format": source.format,
        "points": seen.rows,
        "sampled": len(points),
        "fields": [{"name": name, "type": str(seen.dtype[name])} for name in seen.dtype.names or ()],
        **_reference(source),
        "extract_memory_bytes": memory_for(seen.rows),
    }
    return facts | _measured(low, high)


def _sampled(seen: Glance) -> Caution:
    from cylx.scene.cautions import Caution

    fault = f"only {len(seen.sample.points)} of {seen.rows} points were looked at"
    return Caution("sample", fault, "if the rows are in no order, the spacing is smaller than said here")


def _reference(source: Source) -> dict[str, Any]:
    """Return the unit and the CRS, as far as they are known."""
    facts: dict[str, Any] = {} if source.units is None else {"units": source.units}
    if source.crs is not None:
        facts["crs"] = {key: value for key, value in asdict(source.crs).items() if value is not None}
    return facts


def _measured(low: NDArray[Any], high: NDArray[Any]) -> dict[str, Any]:
    """Return the bounds of a cloud and its size."""
    return {
        "bounds": {"min": low.tolist(), "max": high.tolist()},
        "size": (high - low).tolist(),
        "extent": float(((high - low) ** 2).sum() ** 0.5),
    }


def _looked_at(facts: dict[str, Any]) -> str:
    return f"{facts['sampled']} of them looked at" if "sampled" in facts else f"{facts['finite']} of them finite"


def as_text(facts: dict[str, Any]) -> str:
    """Format the facts as text."""
    lines = {
        "file": facts["file"],
        "format": facts["format"],
        "points": f"{facts['points']}, {_looked_at(facts)}",
        **({"selected": str(facts["selected"])} if "selected" in facts else {}),
        "fields": ", ".join(f"{field['name']} ({field['type']})" for field in facts["fields"]),
    }
    if "units" in facts:
        lines["units"] = facts["units"]
    if "crs" in facts:
        code = f", EPSG:{facts['crs']['epsg']}" if "epsg" in facts["crs"] else ""
        lines["crs"] = facts["crs"]["name"] + ("" if code[2:] == facts["crs"]["name"] else code)
    if "bounds" in facts:
        lines["min"] = _vector(facts["bounds"]["min"])
        lines["max"] = _vector(facts["bounds"]["max"])
        lines["size"] = _vector(facts["size"])
        lines["extent"] = number(facts["extent"], 6)
    if "scene" in facts:
        lines["spacing"] = number(facts["scene"]["spacing"], 4)
        lines["noise"] = number(facts["scene"]["noise"], 4)
        radius = facts["radius"]
        lines["radii"] = "{} to {}, usually found from {}".format(
            *(number(radius[name], 4) for name in ("min", "max", "found_from"))
        )
    lines["memory"] = f"{facts['extract_memory_bytes'] / 1e9:.2g} GB for cylx extract"
    return "".join(f"{name:<8} {visible(value)}\n" for name, value in lines.items())


def _vector(values: list[float]) -> str:
    """Format three coordinates."""
    return " ".join(
        number(value, 10) if abs(value) < 1e5 else f"{value:.4f}".rstrip("0").rstrip(".") for value in values
    )
