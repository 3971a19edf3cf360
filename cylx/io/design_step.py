"""The cylinders of a STEP file: cylindrical faces of its solids, those of one cylinder together, by Open CASCADE."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from cylx.errors import InputError
from cylx.io.design_parts import design_cylinder
from cylx.io.inputs import Input
from cylx.records.designs import Design

_MILLIMETRE = 0.001
"""Open CASCADE converts all lengths to millimetres."""
_SAME = 1e-4
"""Faces are of one cylinder if axis and radius agree to this share of the radius."""
_LEAST_ARC = math.pi / 2
"""Faces with less of a turn together are rounds and fillets."""
_DEEPEST = 32


@dataclass
class _Face:
    """A cylindrical face: its ends along the axis, its radius, the angle it covers, and whether it is a bore."""

    start: Any
    end: Any
    radius: float
    angle: float
    bore: bool


def read_step(source: Input) -> Design:
    """Read the cylinders of the solids of a STEP file.

    Faces about one axis with one radius are one cylinder if they touch along it. Bores are left out where a pin about
    the same axis is around them: of a pipe the outer surface counts.

    Parameters
    ----------
    source : Input
        A file that has a name in this process, which Open CASCADE may end: see `cylx.io.isolated`.

    Raises
    ------
    InputError
        If it is no STEP, or Open CASCADE cannot read it.
    """
    from OCP.IFSelect import IFSelect_ReturnStatus  # noqa: PLC0415  an extra
    from OCP.Message import Message, Message_Gravity  # noqa: PLC0415  an extra
    from OCP.STEPCAFControl import STEPCAFControl_Reader  # noqa: PLC0415  an extra
    from OCP.TCollection import TCollection_ExtendedString  # noqa: PLC0415  an extra
    from OCP.TDocStd import TDocStd_Document  # noqa: PLC0415  an extra

    place = source.place
    head = source.head(4096)
    if not head.lstrip().startswith(b"ISO-10303-21"):
        raise InputError(place, "is not STEP: it does not begin with ISO-10303-21", "give it its right suffix")
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)  # otherwise it writes statistics to standard output
    document = TDocStd_Document(TCollection_ExtendedString("cylx"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    try:
        done = reader.ReadFile(str(source.path)) == IFSelect_ReturnStatus.IFSelect_RetDone and reader.Transfer(document)
        bodies = list(_bodies(document)) if done else []
    except (ImportError, AttributeError, TypeError):  # this program and Open CASCADE do not fit
        raise
    except Exception as error:  # noqa: BLE001  what Open CASCADE raises depends on what it finds in the file
        fault = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(place, f"broken STEP: {fault}", "export the file again") from None
    if not done:
        raise InputError(place, "broken STEP: Open CASCADE cannot read it", "export the file again")
    found = []
    for name, shape in bodies:
        rods = _merged(list(_faces(shape)))
        for number, rod in enumerate(rods):
            called = name if len(rods) == 1 else f"{name} {number}"
            found.append(design_cylinder(called, rod.start, rod.end, rod.radius, f"{place}: {called}"))
    return Design("step", "mm", _MILLIMETRE, tuple(found))


def _bodies(document: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401  OCP has no types
    """Yield name and shape of each part, where its assembly puts it."""
    from OCP.TopLoc import TopLoc_Location  # noqa: PLC0415  an extra
    from OCP.XCAFDoc import XCAFDoc_DocumentTool  # noqa: PLC0415  an extra

    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    labels = _labels()
    tool.GetFreeShapes(labels)
    for number in range(1, labels.Length() + 1):
        yield from _parts(tool, labels.Value(number), TopLoc_Location(), "", 0)


def _parts(tool: Any, label: Any, location: Any, name: str, depth: int) -> Iterator[tuple[str, Any]]:  # noqa: ANN401  OCP has no types
    """Yield name and shape of the parts of a label."""
    from OCP.TDF import TDF_Label  # noqa: PLC0415  an extra

    own = _name(label) or name
    if tool.IsReference_s(label):
        referred = TDF_Label()
        tool.GetReferredShape_s(label, referred)
        location = location.Multiplied(tool.GetLocation_s(label))
        own = _name(referred) or own
        label = referred
    if depth < _DEEPEST and tool.IsAssembly_s(label):
        inner = _labels()
        tool.GetComponents_s(label, inner, False)
        for number in range(1, inner.Length() + 1):
            yield from _parts(tool, inner.Value(number), location, own, depth + 1)
        return
    yield own or "solid", tool.GetShape_s(label).Moved(location)


def _labels() -> Any:  # noqa: ANN401  OCP has no types
    """Return an empty list of labels, which has another name from version 8 on."""
    try:
        from OCP.collections import Sequence_TDF_Label  # noqa: PLC0415  an extra
    except ImportError:
        from OCP.TDF import TDF_LabelSequence  # noqa: PLC0415  an extra

        return TDF_LabelSequence()
    return Sequence_TDF_Label()


def _name(label: Any) -> str:  # noqa: ANN401  OCP has no types
    from OCP.TDataStd import TDataStd_Name  # noqa: PLC0415  an extra

    found = TDataStd_Name()
    return str(found.Get().ToExtString()) if label.FindAttribute(TDataStd_Name.GetID_s(), found) else ""


def _faces(shape: Any) -> Iterator[_Face]:  # noqa: ANN401  OCP has no types
    """Yield the cylindrical faces of a shape."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface  # noqa: PLC0415  an extra
    from OCP.GeomAbs import GeomAbs_SurfaceType  # noqa: PLC0415  an extra
    from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum  # noqa: PLC0415  an extra
    from OCP.TopExp import TopExp_Explorer  # noqa: PLC0415  an extra
    from OCP.TopoDS import TopoDS  # noqa: PLC0415  an extra

    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    to_face = getattr(TopoDS, "Face_s", None) or TopoDS.Face
    while explorer.More():
        face = to_face(explorer.Current())
        explorer.Next()
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() != GeomAbs_SurfaceType.GeomAbs_Cylinder:
            continue
        cylinder = surface.Cylinder()
        axis, system = cylinder.Axis(), cylinder.Position()
        point = np.array([axis.Location().X(), axis.Location().Y(), axis.Location().Z()])
        along = np.array([axis.Direction().X(), axis.Direction().Y(), axis.Direction().Z()])
        low, high = surface.FirstVParameter(), surface.LastVParameter()
        if not (math.isfinite(low) and math.isfinite(high) and abs(high - low) < 1e15):
            continue
        turned = face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED
        bore = turned == bool(system.Direct())
        angle = abs(surface.LastUParameter() - surface.FirstUParameter())
        yield _Face(point + low * along, point + high * along, float(cylinder.Radius()), angle, bore)


def _merged(faces: list[_Face]) -> list[_Face]:
    """Return the cylinders of faces: those of one cylinder joined, fillets and bores of pipes left out."""
    joined: list[_Face] = []
    for face in faces:
        along = (face.end - face.start) / np.linalg.norm(face.end - face.start)
        for one in joined:
            low, high = sorted(float((end - one.start) @ _along(one)) for end in (face.start, face.end))
            long = float(np.linalg.norm(one.end - one.start))
            tiny = _SAME * face.radius
            if not _coaxial(one, face) or abs(one.radius - face.radius) > tiny or one.bore != face.bore:
                continue
            if low > long + tiny or high < -tiny:
                continue
            shared = min(high, long) - max(low, 0.0)
            if shared > 0.5 * min(high - low, long):
                one.angle = min(one.angle + face.angle, 2.0 * math.pi)
            way = _along(one)
            one.end, one.start = one.start + max(high, long) * way, one.start + min(low, 0.0) * way
            break
        else:
            joined.append(_Face(face.start, face.end, face.radius, face.angle, bool(face.bore)))
            joined[-1].end = face.start + along * np.linalg.norm(face.end - face.start)
    whole = [one for one in joined if one.angle >= _LEAST_ARC]
    return [
        one
        for one in whole
        if not (
            one.bore and any(not other.bore and other.radius > one.radius and _coaxial(other, one) for other in whole)
        )
    ]


def _along(face: _Face) -> Any:  # noqa: ANN401  an array
    return (face.end - face.start) / np.linalg.norm(face.end - face.start)


def _coaxial(one: _Face, other: _Face) -> bool:
    """Return whether two faces have one axis."""
    way = _along(one)
    tiny = _SAME * one.radius
    off = [np.linalg.norm((end - one.start) - ((end - one.start) @ way) * way) for end in (other.start, other.end)]
    return bool(max(off) <= tiny)
