"""The cylinders of a result as shapes to export, each with a name and a colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cylx.errors import InputError
from cylx.export.geo import MapCrs
from cylx.export.parts import Piping, piping_of
from cylx.export.solids import Solid
from cylx.geometry.cylinder import Cylinder
from cylx.results import ResultCylinder
from cylx.results.fittings import AnyFitting, ResultRun


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A finite cylinder to draw.

    Parameters
    ----------
    id : int
        Its number in the result.
    shape : Cylinder
        Scene units; its height is > 0.
    color : tuple of int
        Red, green and blue, 0 to 255.
    found : ResultCylinder
        Its entry in the result.
    """

    id: int
    shape: Cylinder
    color: tuple[int, int, int]
    found: ResultCylinder

    @property
    def name(self) -> str:
        """Its name in formats with names."""
        return f"cylinder {self.id}"


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Something to draw: one or more solids with a name and a colour.

    Parameters
    ----------
    name : str
    color : tuple of int
        Red, green and blue, 0 to 255.
    solids : tuple of solid
        They may overlap.
    cylinder, fitting : int
        Id of the cylinder, or the fitting, it is; -1 for none.
    """

    name: str
    color: tuple[int, int, int]
    solids: tuple[Solid, ...]
    cylinder: int
    fitting: int = -1


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """The content of a file.

    Parameters
    ----------
    cylinders : tuple of ResultCylinder
        The cylinders of the result.
    pieces : tuple of Piece
        The cylinders that have a height.
    unit : str or None
        Unit of the scan, a key of `METRES`; None if unknown.
    piping : Piping or None
        The cylinders with their fittings; None if there are none.
    crs : MapCrs or None
        Coordinate reference system of the scan; None if unknown.
    """

    cylinders: tuple[ResultCylinder, ...]
    pieces: tuple[Piece, ...]
    unit: str | None = None
    piping: Piping | None = None
    crs: MapCrs | None = None

    @property
    def bodies(self) -> tuple[Body, ...]:
        """What is drawn: the cylinders, or straights and fittings that meet."""
        if self.piping is None:
            return tuple(Body(piece.name, piece.color, (piece.shape,), piece.id) for piece in self.pieces)
        return tuple(
            Body(
                part.name,
                part.color,
                part.solids,
                -1 if part.cylinder is None else part.cylinder.id,
                -1 if part.fitting is None else part.fitting.id,
            )
            for part in self.piping.parts
            if part.solids
        )

    def joined(self, fittings: Sequence[AnyFitting] = (), runs: Sequence[ResultRun] = ()) -> Piping:
        """Return the pieces as piping."""
        return piping_of([one.found for one in self.pieces], [one.color for one in self.pieces], fittings, runs)

    @property
    def flat(self) -> list[int]:
        """Ids of the cylinders without a height, which cannot be drawn."""
        drawn = {piece.id for piece in self.pieces}
        return [cylinder.id for cylinder in self.cylinders if cylinder.id not in drawn]


@dataclass(frozen=True, slots=True, eq=False)
class Exported:
    """The bytes of a file, with a remark for its reader.

    Parameters
    ----------
    data : bytes
    offset : tuple of float or None
        Offset subtracted from all coordinates, scene units; None if they are as in the scan.
    """

    data: bytes
    offset: tuple[float, float, float] | None = None


def draw(
    cylinders: Sequence[ResultCylinder],
    colors: NDArray[np.uint8],
    *,
    unit: str | None = None,
    crs: MapCrs | None = None,
    place: str = "result",
    fittings: Sequence[AnyFitting] = (),
    runs: Sequence[ResultRun] = (),
) -> Drawing:
    """Make the shapes of cylinders.

    Parameters
    ----------
    cylinders : sequence of ResultCylinder
    colors : ndarray of shape (M, 3), uint8
        Red, green and blue of each.
    unit : str, optional
        Unit of the scan: `m`, `mm`, `cm`, `in`, `ft` or `us-ft`.
    crs : MapCrs, optional
        Coordinate reference system of the scan.
    place : str
        Name of the result in an error.
    fittings : sequence of fittings
        Without any, each cylinder is drawn as it was found.
    runs : sequence of ResultRun

    Raises
    ------
    InputError
        If the axis of a cylinder has no direction, or fittings are where no cylinder can be.
    """
    pieces = []
    for cylinder, color in zip(cylinders, colors.tolist(), strict=True):
        try:
            shape = Cylinder(
                np.array(cylinder.axis_point), np.array(cylinder.axis_direction), cylinder.radius, cylinder.height
            )
        except ValueError as error:
            where = f"{place}: cylinder {cylinder.id}"
            raise InputError(where, str(error), "give a result as cylx writes it") from None
        if shape.height > 0.0:
            pieces.append(Piece(cylinder.id, shape, (color[0], color[1], color[2]), cylinder))
    drawing = Drawing(tuple(cylinders), tuple(pieces), unit, crs=crs)
    if not fittings:
        return drawing
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            return replace(drawing, piping=drawing.joined(fittings, runs))
    except (ValueError, ArithmeticError):
        fault = "they are where no pipes can be, or of no size"
        raise InputError(f"{place}: fittings", fault, "give a result as cylx writes it") from None
