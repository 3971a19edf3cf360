"""The mesh that `cylx extract` writes beside a result, and what `cylx export` has in common with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cylx.errors import UsageError

if TYPE_CHECKING:
    from cylx.export import Drawing, Exported
    from cylx.results import ResultCylinder


def check_meshes(names: Sequence[str], units: str | None) -> None:
    """Refuse meshes that could not be written, before anything is computed.

    Parameters
    ----------
    names : sequence of str
        Files; none if no mesh is wanted.
    units : str or None
        Unit of the scan.

    Raises
    ------
    UsageError
        If a suffix is that of no mesh, or the unit or the library is missing, or there is no mesh for the unit.
    """
    if not names:
        if units is not None:
            raise UsageError("--units", "is that of a mesh, and none is asked for", "give --mesh FILE, or leave it out")
        return
    from cylx.export import format_of

    for name in names:
        known = format_of(name)
        if known.home != "meshes":
            remedy = "use .ply, .obj, .glb or .stl; 'cylx export' writes the others"
            raise UsageError(f"--mesh {name}", f"{known.suffix} is no mesh", remedy)
        known.demand(name, units)


def mesh_of(name: str, cylinders: Sequence[ResultCylinder], units: str | None) -> tuple[bytes | None, list[str]]:
    """Make the mesh of the cylinders of a result.

    Parameters
    ----------
    name : str
        Its file, whose suffix says the format.
    cylinders : sequence of ResultCylinder
    units : str or None
        Unit of the scan.

    Returns
    -------
    mesh : bytes or None
        None if there is no cylinder: a mesh cannot be empty.
    remarks : list of str
        What its reader has to know.
    """
    from cylx.export import format_of, render

    if not cylinders:
        return None, [f"{name}: is not written, as there is no cylinder"]
    drawing = drawing_of(cylinders, units, name)
    exported = render(drawing, format_of(name), name)
    return exported.data, remarks_on(drawing, {name: exported})


def drawing_of(cylinders: Sequence[ResultCylinder], units: str | None, place: str) -> Drawing:
    """Draw the cylinders of a result, in the colours that they have in the annotated cloud."""
    import numpy as np

    from cylx.export import draw
    from cylx.palette import cylinder_colors

    ids = np.array([cylinder.id for cylinder in cylinders], dtype=np.int64)
    return draw(cylinders, cylinder_colors(ids), unit=units, place=place)


def remarks_on(drawing: Drawing, written: dict[str, Exported]) -> list[str]:
    """Return what the reader of some files has to know."""
    out = []
    if drawing.flat and any(not name.lower().endswith(".csv") for name in written):
        out.append(f"of height 0, and only in tables: cylinder {', '.join(map(str, drawing.flat))}")
    for name, exported in written.items():
        if exported.offset is not None:
            x, y, z = exported.offset
            out.append(f"{name}: add {x:.0f} {y:.0f} {z:.0f} to all coordinates; they are too large for its numbers")
    return out
