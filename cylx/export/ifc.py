"""IFC: pipe segments, circles swept along their axes, and fittings between them, by ifcopenshell."""

from __future__ import annotations

from typing import Any

from cylx.export.drawing import Drawing, Exported, Piece
from cylx.export.ifc_model import Model
from cylx.export.ifc_piping import add_piping, values_of
from cylx.geometry.cylinder import axis_basis


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write an IFC4 file with an `IfcPipeSegment` for each cylinder, in the unit of the scan.

    Each is placed at the start of its cylinder, with its z axis along the cylinder. The property set `cylx` has its
    number, its radius, and its confidence and uncertainty. Identifiers are made of the content. With fittings, there is
    also an `IfcPipeFitting` for each; see `add_piping`. In a projected CRS, coordinates count from a place near the
    pipes, and an `IfcMapConversion` says where that is on the map.

    Parameters
    ----------
    drawing : Drawing
        With a unit.
    suffix : str
        `.ifc`.
    """
    model = Model(drawing)
    if drawing.piping is None:
        model.contain([_segment(model, piece) for piece in drawing.pieces])
    else:
        add_piping(model, drawing.piping)
    return Exported(model.text().encode())


def _segment(model: Model, piece: Piece) -> Any:  # noqa: ANN401  has no types
    """Make the pipe segment of a cylinder."""
    shape = piece.shape
    across, _ = axis_basis(shape.direction)
    place = model.make(
        "IfcAxis2Placement3D", model.place(shape.start), model.direction(shape.direction), model.direction(across)
    )
    center = model.make("IfcAxis2Placement2D", model.point((0.0, 0.0)))
    circle = model.make("IfcCircleProfileDef", "AREA", piece.name, center, shape.radius)
    here = model.make("IfcAxis2Placement3D", model.point((0.0, 0.0, 0.0)))
    solid = model.make("IfcExtrudedAreaSolid", circle, here, model.direction((0.0, 0.0, 1.0)), shape.height)
    model.paint(solid, piece.name, piece.color)
    body = model.make("IfcShapeRepresentation", model.body, "Body", "SweptSolid", [solid])
    segment = model.root(
        "IfcPipeSegment",
        piece.name,
        ObjectPlacement=model.make("IfcLocalPlacement", model.building.ObjectPlacement, place),
        Representation=model.make("IfcProductDefinitionShape", None, None, [body]),
        PredefinedType="NOTDEFINED",
    )
    model.properties(segment, piece.name, values_of(piece.found))
    return segment
