"""The mesh that `cylx extract` writes beside a result, and code shared with `cylx export`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cylx.errors import UsageError

if TYPE_CHECKING:
    from cylx.export import Drawing, Exported
    from cylx.results import Result, ResultCylinder
    from cylx.results.fittings import AnyFitting, ResultRun


def check_meshes(names: Sequence[str], units: str | None) -> None:
    """Refuse meshes that cannot be written, before anything is computed.

    Parameters
    ----------
    names : sequence of str
        Names of the meshes; empty if no mesh is wanted.
    units : str or None
        Unit of the scan.

    Raises
    ------
    UsageError
        If a suffix is not that of a mesh, the unit or the library is missing, or the format cannot have the unit.
    """
    if not names:
        if units is not None:
            raise UsageError("--units", "is for meshes, and none is requested", "give --mesh FILE, or leave it out")
        return
    from cylx.export import format_of

    for name in names:
        known = format_of(name)
        if known.home != "meshes":
            remedy = "use .ply, .obj, .glb or .stl; 'cylx export' writes the others"
            raise UsageError(f"--mesh {name}", f"{known.suffix} is not a mesh format", remedy)
        known.demand(name, units)


def mesh_of(name: str, content: Result, units: str | None) -> tuple[bytes | None, list[str]]:
    """Make the mesh of the cylinders of a result, and of their fittings.

    Parameters
    ----------
    name : str
        File name; its suffix selects the format.
    content : Result
    units : str or None
        Unit of the scan.

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
    drawing = drawing_of(content.cylinders, units, name, content.fittings or (), content.runs or ())
    exported = render(drawing, format_of(name), name)
    return exported.data, remarks_on(drawing, {name: exported})


def drawing_of(
    cylinders: Sequence[ResultCylinder],
    units: str | None,
    place: str,
    fittings: Sequence[AnyFitting] = (),
    runs: Sequence[ResultRun] = (),
) -> Drawing:
    """Return a drawing of the cylinders of a result, in their colours in the annotated cloud, and of their fittings."""
    import numpy as np

    from cylx.export import draw
    from cylx.palette import cylinder_colors

    ids = np.array([cylinder.id for cylinder in cylinders], dtype=np.int64)
    return draw(cylinders, cylinder_colors(ids), unit=units, place=place, fittings=fittings, runs=runs)


def remarks_on(drawing: Drawing, written: dict[str, Exported]) -> list[str]:
    """Return remarks for the reader of the written files."""
    out = []
    if drawing.flat and any(not name.lower().endswith(".csv") for name in written):
        out.append(f"height 0, written to tables only: cylinder {', '.join(map(str, drawing.flat))}")
    for name, exported in written.items():
        if exported.offset is not None:
            x, y, z = exported.offset
            out.append(f"{name}: add {x:.0f} {y:.0f} {z:.0f} to all coordinates; they are too large for the file")
    return out
