"""`cylx export`: write the cylinders of a result for other programs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.batch.jobs import check_apart
from cylx.cli.batch.meshes import drawing_of, remarks_on
from cylx.cli.batch.summary import legible
from cylx.cli.options.configuration import complete_files, debug_option, json_option, overwrite_option
from cylx.cli.options.numbers import NumberRange
from cylx.cli.options.units import units_option
from cylx.cli.terminal.failures import answer, tell
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import InputError
from cylx.io.outputs import write_together
from cylx.wording import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylx.export import Drawing, Exported
    from cylx.export.geo import MapCrs
    from cylx.results import ResultCylinder
    from cylx.results.parts import InputCrs


@click.command(
    cls=ExampleCommand,
    examples=[
        "cylx export room.cylinders.json room.csv room.step --units m --min-confidence 0.9",
        "cylx export plant.runs.json plant.ifc plant.pcf --units m",
    ],
)
@click.argument("result", shell_complete=complete_files)
@click.argument("outputs", metavar="OUT...", nargs=-1, required=True, shell_complete=complete_files)
@units_option(".glb, .step, .ifc, .dxf and .pcf need")
@click.option(
    "--crs", "crs_text", metavar="TEXT", help="Coordinate reference system, if RESULT has none: EPSG:25832, or a WKT."
)
@click.option(
    "--min-confidence", type=NumberRange(0, 1), metavar="X", help="Leave out less certain cylinders and fittings."
)
@overwrite_option
@json_option
@debug_option
def export(
    *,
    result: str,
    outputs: tuple[str, ...],
    units: str | None,
    crs_text: str | None,
    min_confidence: float | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write the cylinders of RESULT for other programs.

    The suffix of each OUT selects the format: .ply, .obj, .glb and .stl are meshes, .csv is a table, .step and .stp are
    exact solids, .ifc has pipe segments, .dxf centre lines, .pcf piping components, and .gpkg and .geojson are maps of
    centre lines. If RESULT has fittings, as those of 'cylx runs', they are written too, and cylinders end where a
    fitting begins; the table stays as it is. All but .csv, .pcf and .gpkg need an extra, such as 'cylx[mesh]'.
    """
    from cylx.export import format_of, render
    from cylx.io import check_writable

    formats = {name: format_of(name) for name in outputs}
    check_apart([result], outputs)
    for name in formats:
        check_writable(name, overwrite=overwrite)
    drawing = _draw(result, units, crs_text, min_confidence)
    for name, known in formats.items():
        known.demand(name, drawing.unit)
    written = {name: render(drawing, known, name) for name, known in formats.items()}
    write_together({name: exported.data for name, exported in written.items()}, overwrite=overwrite)
    _report(result, drawing, written)
    if as_json:
        answer(json.dumps(_told(result, drawing, written), indent=2, ensure_ascii=False) + "\n", as_json=True)


def _told(result: str, drawing: Drawing, written: dict[str, Exported]) -> dict[str, Any]:
    """Return the JSON report of the files written."""
    return {
        "result": legible(result),
        "cylinders": len(drawing.cylinders),
        **({} if drawing.piping is None else {"fittings": drawing.piping.fittings}),
        "flat": drawing.flat,
        "units": drawing.unit,
        **({} if drawing.crs is None else {"crs": drawing.crs.name}),
        "files": [
            {"file": legible(name), "bytes": len(exported.data), "offset": exported.offset}
            for name, exported in written.items()
        ],
    }


def _draw(path: str, units: str | None, crs: str | None, min_confidence: float | None) -> Drawing:
    """Read a result and choose the cylinders to draw."""
    from cylx.io import read_json
    from cylx.results import Result

    content = Result.parse(read_json(path), path)
    chosen, fittings = content.cylinders, content.fittings or []
    if min_confidence is not None:
        chosen = _sure(path, chosen, min_confidence)
        fittings = [fitting for fitting in fittings if fitting.confidence >= min_confidence]
    system = map_crs(content.input.crs, crs)
    return drawing_of(chosen, units or content.input.units, path, fittings, content.runs or [], system)


def map_crs(found: InputCrs | None, given: str | None) -> MapCrs | None:
    """Return the CRS that is given, or else that of a result; None if there is none."""
    from cylx.export.geo import MapCrs
    from cylx.wkt import facts_of

    wkt, epsg = (None, None) if found is None else (found.wkt, found.epsg)
    if given is not None:
        from cylx.export.reproject import crs_of

        wkt, epsg = crs_of(given, "--crs")
    if wkt is None and epsg is None:
        return None
    facts = None if wkt is None else facts_of(wkt)
    name = facts.name if facts is not None else f"EPSG:{epsg}" if found is None else found.name
    metres = 1.0 if facts is None or facts.metres is None else facts.metres
    return MapCrs(wkt, epsg, name, metres)


def _sure(path: str, cylinders: Sequence[ResultCylinder], least: float) -> list[ResultCylinder]:
    """Return the cylinders with at least this confidence."""
    if any(cylinder.confidence is None for cylinder in cylinders):
        raise InputError(path, "its cylinders have no confidence", "leave --min-confidence out")
    return [cylinder for cylinder in cylinders if cylinder.confidence is not None and cylinder.confidence >= least]


def _report(path: str, drawing: Drawing, written: dict[str, Exported]) -> None:
    """Report the files written, with remarks for their reader."""
    said = counted(len(drawing.cylinders))
    if drawing.piping is not None:
        joined = drawing.piping.fittings
        said += f" and {joined} fitting{'' if joined == 1 else 's'}"
    tell(f"{path}: {said}, written to {', '.join(written)}")
    for remark in remarks_on(drawing, written):
        tell(f"warning: {remark}")
