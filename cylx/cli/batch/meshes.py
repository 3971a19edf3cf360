"""The mesh that `cylx extract` writes beside a result, and code shared with `cylx export`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cylx.errors import UsageError

if TYPE_CHECKING:
    from cylx.export import Drawing, Exported
    from cylx.export.geo import MapCrs
    from cylx.results import Result, ResultCylinder
    from cylx.results.fittings import AnyFitting, ResultRun


def check_meshes(names: Sequence[str], units: str | None, scans: Sequence[str]) -> None:
    """Refuse meshes that cannot be written, before anything is computed.

    Parameters
    ----------
    names : sequence of str
        Names of the meshes; empty if no mesh is wanted.
    units : str or None
        Unit of the scans.
    scans : sequence of str
        Names of the scans: some say their unit themselves, which shows once they are read.

    Raises
    ------
    UsageError
        If a suffix is not that of a mesh, the unit or the library is missing, or the format cannot have the unit.
    """
    if not names:
        return
    from cylx.export import format_of
    from cylx.io.formats import cloud_suffix, silent_suffixes

    silent = all(cloud_suffix(scan) in silent_suffixes() for scan in scans)
    for name in names:
        known = format_of(name)
        if known.home != "meshes":
            remedy = "use .ply, .obj, .glb or .stl; 'cylx export' writes the others"
            raise UsageError(f"--mesh {name}", f"{known.suffix} is not a mesh format", remedy)
        known.demand(name, units if silent else units or "m")


def check_unit(name: str | None, units: str | None) -> None:
    """Refuse a mesh of a format that has a unit, if the scan that was read says none.

    Raises
    ------
    UsageError
    """
    if name is not None:
        from cylx.export import format_of

        format_of(name).demand(name, units)


def mesh_of(name: str, content: Result) -> tuple[bytes | None, list[str]]:
    """Make the mesh of the cylinders of a result, and of their fittings.

    Parameters
    ----------
    name : str
        File name; its suffix selects the format.
    content : Result
        With the unit of the scan, if that is known.

    Returns
    -------
    mesh : bytes or None
        None if there is no cylinder: a mesh cannot be empty.
    remarks : list of str
        Remarks for the reader.
    """
    from cylx.export import format_of, render

    if not content.cylinders:
        return None, [f"{name}: not written, as there are no cylinders"]
    units = content.input.units
    drawing = drawing_of(content.cylinders, units, name, content.fittings or (), content.runs or ())
    exported = render(drawing, format_of(name), name)
    return exported.data, remarks_on(drawing, {name: exported})


def drawing_of(
    cylinders: Sequence[ResultCylinder],
    units: str | None,
    place: str,
    fittings: Sequence[AnyFitting] = (),
    runs: Sequence[ResultRun] = (),
    crs: MapCrs | None = None,
) -> Drawing:
    """Return a drawing of the cylinders of a result, in their colours in the annotated cloud, and of their fittings."""
    import numpy as np

    from cylx.export import draw
    from cylx.palette import cylinder_colors

    ids = np.array([cylinder.id for cylinder in cylinders], dtype=np.int64)
    return draw(cylinders, cylinder_colors(ids), unit=units, place=place, fittings=fittings, runs=runs, crs=crs)


def remarks_on(drawing: Drawing, written: dict[str, Exported]) -> list[str]:
    """Return remarks for the reader of the written files."""
    out = []
    if drawing.flat and any(not name.lower().endswith((".csv", ".gpkg", ".geojson")) for name in written):
        out.append(f"height 0, written to tables only: cylinder {', '.join(map(str, drawing.flat))}")
    for name, exported in written.items():
        if exported.offset is not None:
            x, y, z = exported.offset
            out.append(f"{name}: add {x:.0f} {y:.0f} {z:.0f} to all coordinates; they are too large for the file")
    return out
