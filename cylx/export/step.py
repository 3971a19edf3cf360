"""STEP: exact cylinders as solids, by Open CASCADE."""

from __future__ import annotations

import io
import re
from typing import Any

from cylx.export.drawing import Drawing, Exported, Piece
from cylx.export.formats import METRES

_NO_TIME = "1970-01-01T00:00:00"
_STAMP = re.compile(rb"(FILE_NAME\('[^']*',')\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write a STEP file (AP214) with a named, coloured solid for each cylinder, in the unit of the scan.

    Parameters
    ----------
    drawing : Drawing
        With one cylinder or more, and a unit.
    suffix : str
        `.step` or `.stp`.
    """
    from OCP.Interface import Interface_Static  # noqa: PLC0415  an extra
    from OCP.Message import Message, Message_Gravity  # noqa: PLC0415  an extra
    from OCP.STEPCAFControl import STEPCAFControl_Writer  # noqa: PLC0415  an extra
    from OCP.STEPControl import STEPControl_Controller, STEPControl_StepModelType  # noqa: PLC0415  an extra
    from OCP.TCollection import TCollection_ExtendedString  # noqa: PLC0415  an extra
    from OCP.TDocStd import TDocStd_Document  # noqa: PLC0415  an extra
    from OCP.XCAFDoc import XCAFDoc_DocumentTool  # noqa: PLC0415  an extra

    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)  # otherwise it writes statistics to standard output
    unit = drawing.unit or "m"
    document = TDocStd_Document(TCollection_ExtendedString("cylx"))
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, METRES[unit])
    labels = [_add(document, piece) for piece in drawing.pieces]
    STEPControl_Controller.Init_s()  # the unit can only be set after this
    before = Interface_Static.CVal_s("write.step.unit")
    if not Interface_Static.SetCVal_s("write.step.unit", unit.upper()):
        raise RuntimeError(f"Open CASCADE does not know the unit {unit}")
    try:
        writer = STEPCAFControl_Writer()
        writer.SetColorMode(True)
        writer.SetNameMode(True)
        for label in labels:  # one by one: all at once their colours come in any order
            writer.Transfer(label, STEPControl_StepModelType.STEPControl_AsIs)
        stream = io.BytesIO()
        writer.WriteStream(stream)
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)
    text, stamps = _STAMP.subn(rb"\g<1>" + _NO_TIME.encode(), stream.getvalue(), count=1)
    if stamps != 1:
        raise RuntimeError("Open CASCADE wrote no header that we know")
    return Exported(text)


def _add(document: Any, piece: Piece) -> Any:  # noqa: ANN401  OCP has no types
    """Add a cylinder to a document and return its label."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder  # noqa: PLC0415  an extra
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt  # noqa: PLC0415  an extra
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor  # noqa: PLC0415  an extra
    from OCP.TCollection import TCollection_ExtendedString  # noqa: PLC0415  an extra
    from OCP.TDataStd import TDataStd_Name  # noqa: PLC0415  an extra
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool  # noqa: PLC0415  an extra

    shape = piece.shape
    place = gp_Ax2(gp_Pnt(*shape.start.tolist()), gp_Dir(*shape.direction.tolist()))
    solid = BRepPrimAPI_MakeCylinder(place, shape.radius, shape.height).Shape()
    label = XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(solid, False)
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(piece.name))
    color = Quantity_Color(*(part / 255 for part in piece.color), Quantity_TypeOfColor.Quantity_TOC_sRGB)
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    colors.SetColor(label, color, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    return label
