"""The export formats by suffix: the module that writes each, the extra it needs, and whether it has a unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import PurePath
from typing import cast

from cylx.errors import OutputError, UsageError
from cylx.export.drawing import Drawing, Exported
from cylx.optional.extras import LIBRARIES, require
from cylx.units import METRES

__all__ = ["FORMATS", "METRES", "Format", "format_of", "render"]


@dataclass(frozen=True, slots=True)
class Format:
    """A format for cylinders.

    Parameters
    ----------
    suffix : str
        With its dot, in lower case.
    home : str
        Module of this package that writes it.
    library : str or None
        Library that it needs; None if that is installed with cylx.
    has_unit : bool
        Whether its lengths have a unit.
    may_be_empty : bool
        Whether a file without cylinders is valid.
    """

    suffix: str
    home: str
    library: str | None = None
    has_unit: bool = False
    may_be_empty: bool = False

    @property
    def extra(self) -> str | None:
        """Name of the extra that brings the library."""
        return None if self.library is None else LIBRARIES[self.library].extra

    def demand(self, place: str, unit: str | None) -> None:
        """Check that the library is installed and the unit is given.

        Parameters
        ----------
        place : str
            Name of the output in an error.
        unit : str or None
            Unit of the scan.

        Raises
        ------
        UsageError
            If one of them is missing.
        """
        if self.has_unit and unit is None:
            units = ", ".join(METRES)
            raise UsageError(place, f"{self.suffix} has a unit of length", f"give that of the scan by --units: {units}")
        if self.library is not None:
            require(self.library, place=place, needed_by=self.suffix)


FORMATS = {
    known.suffix: known
    for known in (
        Format(".ply", "meshes", "trimesh"),
        Format(".obj", "meshes", "trimesh"),
        Format(".glb", "meshes", "trimesh", has_unit=True),
        Format(".stl", "meshes", "trimesh"),
        Format(".csv", "csv_text", may_be_empty=True),
        Format(".step", "step", "OCP", has_unit=True),
        Format(".stp", "step", "OCP", has_unit=True),
        Format(".ifc", "ifc", "ifcopenshell", has_unit=True, may_be_empty=True),
        Format(".dxf", "dxf", "ezdxf", has_unit=True, may_be_empty=True),
        Format(".pcf", "pcf", has_unit=True, may_be_empty=True),
        Format(".gpkg", "maps", may_be_empty=True),
        Format(".geojson", "maps", may_be_empty=True),
    )
}


def format_of(name: str) -> Format:
    """Return the format of a file by its suffix.

    Raises
    ------
    UsageError
        If there is no such format.

    Examples
    --------
    >>> format_of("pipes.STL").extra
    'mesh'
    """
    suffix = PurePath(name).suffix.lower()
    if suffix not in FORMATS:
        fault = f"{suffix} is not a known format" if suffix else "has no suffix that names a format"
        raise UsageError(name, fault, f"use one of {', '.join(FORMATS)}")
    return FORMATS[suffix]


def render(drawing: Drawing, known: Format, place: str) -> Exported:
    """Write a drawing in a format.

    Parameters
    ----------
    drawing : Drawing
    known : Format
    place : str
        Name of the output in an error.

    Raises
    ------
    OutputError
        If there is nothing to write, and a file of the format cannot be empty.
    UsageError
        If the library that writes it is not installed.
    """
    known.demand(place, drawing.unit)
    if not (drawing.pieces or known.may_be_empty):
        raise OutputError(place, f"there is no cylinder, and a {known.suffix} file cannot be empty", "use .csv")
    write = import_module(f"cylx.export.{known.home}").write
    return cast("Callable[[Drawing, str], Exported]", write)(drawing, known.suffix)
