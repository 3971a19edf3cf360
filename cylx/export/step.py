"""STEP: exact cylinders, and the tori and cones of fittings, as solids, by Open CASCADE."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from cylx.export.drawing import Body, Drawing, Exported
from cylx.export.solids import Bend, Cone, Mitre, Solid
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.units import METRES

SHARE = 16
"""Bodies that the writer is given at a time: it goes through all that it has for each of them."""
_DATA, _END = b"\nDATA;\n", b"ENDSEC;\n"
_NUMBERS = re.compile(rb"'(?:[^']|'')*'|#(\d+)")
_NO_TIME = "1970-01-01T00:00:00"
_STAMP = re.compile(rb"(FILE_NAME\('[^']*',')\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write a STEP file (AP214) with a named, coloured solid for each cylinder and fitting, in the unit of the scan.

    Parameters
    ----------
    drawing : Drawing
        With one cylinder or more, and a unit.
    suffix : str
        `.step` or `.stp`.
    """
    from OCP.Interface import Interface_Static  # noqa: PLC0415  an extra
    from OCP.Message import Message, Message_Gravity  # noqa: PLC0415  an extra
    from OCP.STEPControl import STEPControl_Controller  # noqa: PLC0415  an extra

    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)  # otherwise it writes statistics to standard output
    unit = drawing.unit or "m"
    STEPControl_Controller.Init_s()  # the unit can only be set after this
    before = Interface_Static.CVal_s("write.step.unit")
    if not Interface_Static.SetCVal_s("write.step.unit", "M" if unit == "us-ft" else unit.upper()):  # STEP has it not
        raise RuntimeError(f"Open CASCADE does not know the unit {unit}")
    bodies = drawing.bodies
    try:
        shares = [_share(bodies[k : k + SHARE], METRES[unit]) for k in range(0, len(bodies), SHARE)]
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)
    text, stamps = _STAMP.subn(rb"\g<1>" + _NO_TIME.encode(), _joined(shares), count=1)
    if stamps != 1:
        raise RuntimeError("Open CASCADE wrote no header that we know")
    return Exported(text)


def _share(bodies: Sequence[Body], metres: float) -> bytes:
    """Return some bodies as a file of their own, by the length of the unit in metres."""
    from OCP.STEPCAFControl import STEPCAFControl_Writer  # noqa: PLC0415  an extra
    from OCP.STEPControl import STEPControl_StepModelType  # noqa: PLC0415  an extra
    from OCP.TCollection import TCollection_ExtendedString  # noqa: PLC0415  an extra
    from OCP.TDocStd import TDocStd_Document  # noqa: PLC0415  an extra
    from OCP.XCAFDoc import XCAFDoc_DocumentTool  # noqa: PLC0415  an extra

    document = TDocStd_Document(TCollection_ExtendedString("cylx"))
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, metres)
    labels = [_add(document, body) for body in bodies]
    writer = STEPCAFControl_Writer()
    writer.SetColorMode(True)
    writer.SetNameMode(True)
    for label in labels:  # one by one: all at once their colours come in any order
        writer.Transfer(label, STEPControl_StepModelType.STEPControl_AsIs)
    stream = io.BytesIO()
    writer.WriteStream(stream)
    return stream.getvalue()


def _joined(files: Sequence[bytes]) -> bytes:
    """Return files as one, with the header of the first: the numbers of each go on from those before it."""
    parts: list[bytes] = []
    most = 0
    for number, text in enumerate(files):
        top, begin, rest = text.partition(_DATA)
        content, end, bottom = rest.rpartition(_END)
        if not (begin and end):
            raise RuntimeError("Open CASCADE wrote no data that we know")
        first, seen = most, 0

        def moved(match: re.Match[bytes], first: int = first) -> bytes:
            nonlocal seen
            if match[1] is None:  # a text
                return match[0]
            seen = max(seen, int(match[1]))
            return b"#%d" % (first + int(match[1]))

        content = _NUMBERS.sub(moved, content)
        most += seen
        parts += [top, begin, content] if number == 0 else [content]
        if number == len(files) - 1:
            parts += [end, bottom]
    return b"".join(parts)


def _add(document: Any, body: Body) -> Any:  # noqa: ANN401  OCP has no types
    """Add a body to a document and return its label."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse  # noqa: PLC0415  an extra
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor  # noqa: PLC0415  an extra
    from OCP.TCollection import TCollection_ExtendedString  # noqa: PLC0415  an extra
    from OCP.TDataStd import TDataStd_Name  # noqa: PLC0415  an extra
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool  # noqa: PLC0415  an extra

    solid = _shape(body.solids[0])
    for other in body.solids[1:]:
        solid = BRepAlgoAPI_Fuse(solid, _shape(other)).Shape()
    label = XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(solid, False)
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(body.name))
    color = Quantity_Color(*(part / 255 for part in body.color), Quantity_TypeOfColor.Quantity_TOC_sRGB)
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    colors.SetColor(label, color, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    return label


def _shape(solid: Solid) -> Any:  # noqa: ANN401  OCP has no types
    """Return a solid as a shape of Open CASCADE."""
    from OCP.BRepPrimAPI import (  # noqa: PLC0415  an extra
        BRepPrimAPI_MakeCone,
        BRepPrimAPI_MakeCylinder,
        BRepPrimAPI_MakeTorus,
    )

    if isinstance(solid, Cylinder):
        return BRepPrimAPI_MakeCylinder(_place(solid.start, solid.direction), solid.radius, solid.height).Shape()
    if isinstance(solid, Bend):
        place = _place(solid.center, solid.normal, solid.radial)
        return BRepPrimAPI_MakeTorus(place, solid.bend_radius, solid.radius, solid.angle).Shape()
    if isinstance(solid, Mitre):
        return _mitre(solid)
    same = abs(solid.start_radius - solid.end_radius) < 1e-9 * solid.start_radius
    if np.linalg.norm(solid.shift) > 1e-9 * solid.height or same:
        return _loft(solid)
    place = _place(solid.start, solid.axis)
    return BRepPrimAPI_MakeCone(place, solid.start_radius, solid.end_radius, solid.height).Shape()


def _place(point: FloatArray, direction: FloatArray, across: FloatArray | None = None) -> Any:  # noqa: ANN401  an entity of the library, which has no types
    """Return a placement: a point, its z axis, and its x axis if that matters."""
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt  # noqa: PLC0415  an extra

    here, along = gp_Pnt(*point.tolist()), gp_Dir(*direction.tolist())
    return gp_Ax2(here, along) if across is None else gp_Ax2(here, along, gp_Dir(*across.tolist()))


def _loft(cone: Cone) -> Any:  # noqa: ANN401  OCP has no types
    """Return the solid between two discs that do not face each other."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeWire  # noqa: PLC0415  an extra
    from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections  # noqa: PLC0415  an extra
    from OCP.gp import gp_Circ  # noqa: PLC0415  an extra

    loft, (across, _) = BRepOffsetAPI_ThruSections(True, True), axis_basis(cone.axis)
    for center, radius in ((cone.start, cone.start_radius), (cone.end, cone.end_radius)):
        edge = BRepBuilderAPI_MakeEdge(gp_Circ(_place(center, cone.axis, across), radius)).Edge()
        loft.AddWire(BRepBuilderAPI_MakeWire(edge).Wire())
    return loft.Shape()


def _mitre(mitre: Mitre) -> Any:  # noqa: ANN401  OCP has no types
    """Return two rods, cut by the plane between them."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse  # noqa: PLC0415  an extra
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace  # noqa: PLC0415  an extra
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeHalfSpace  # noqa: PLC0415  an extra
    from OCP.gp import gp_Dir, gp_Pln, gp_Pnt  # noqa: PLC0415  an extra

    halves, cut = [], mitre.cut
    plane = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(*mitre.corner.tolist()), gp_Dir(*cut.tolist()))).Face()
    for begin, sign in ((mitre.start, 1.0), (mitre.end, -1.0)):
        away = mitre.corner - begin
        length = float(np.linalg.norm(away))
        along = away / length
        beyond = mitre.radius * float(np.linalg.norm(along - (along @ cut) * cut)) / abs(float(along @ cut))
        rod = BRepPrimAPI_MakeCylinder(_place(begin, along), mitre.radius, length + 1.1 * beyond).Shape()
        side = gp_Pnt(*(mitre.corner + sign * mitre.radius * cut).tolist())
        halves.append(BRepAlgoAPI_Cut(rod, BRepPrimAPI_MakeHalfSpace(plane, side).Solid()).Shape())
    return BRepAlgoAPI_Fuse(*halves).Shape()
