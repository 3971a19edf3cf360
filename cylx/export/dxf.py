"""DXF: the centre lines of the cylinders on one layer, those of the fittings on another, by ezdxf."""

from __future__ import annotations

import io
import uuid
from itertools import pairwise
from math import atan2, degrees
from typing import Any

from cylx.export.drawing import Drawing, Exported
from cylx.export.parts import Part
from cylx.export.solids import Bend, radius_of

LAYER = "cylx_centre_lines"
FITTINGS = "cylx_fittings"
APPLICATION = "CYLX"
_UNITS = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6, "us-ft": 21}  # $INSUNITS


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write a DXF file (R2010) with a line from end to end of each cylinder, in its colour.

    Fittings, if there are any, have lines from port to port on a layer of their own, bends an arc. Extended data of the
    application `CYLX` hold the name (1000), the number (1071) and the radius (1041, a distance) of each.

    Parameters
    ----------
    drawing : Drawing
        With a unit.
    suffix : str
        `.dxf`.
    """
    import ezdxf  # noqa: PLC0415  an extra

    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # no times and no random numbers
    try:
        document = ezdxf.new("R2010")
        document.header["$INSUNITS"] = _UNITS[drawing.unit or "m"]
        document.header["$MEASUREMENT"] = int(drawing.unit not in {"in", "ft", "us-ft"})
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = dict(sorted(classes.classes.items()))  # ezdxf takes them from a set, in random order
        document.layers.add(LAYER)
        document.appids.add(APPLICATION)
        space = document.modelspace()
        if drawing.piping is not None:
            document.layers.add(FITTINGS)
            for part in drawing.piping.parts:
                _add(space, part)
        for piece in drawing.pieces if drawing.piping is None else ():
            ends = piece.shape.start.tolist(), piece.shape.end.tolist()
            line = space.add_line(*ends, dxfattribs={"layer": LAYER, "true_color": _color(piece.color)})
            line.set_xdata(APPLICATION, [(1000, piece.name), (1071, piece.id), (1041, piece.shape.radius)])
        text = io.StringIO()
        document.write(text)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before
    return Exported(_named(text.getvalue()).encode(document.output_encoding, "dxfreplace"))


def _color(color: tuple[int, int, int]) -> int:
    red, green, blue = color
    return red << 16 | green << 8 | blue


def _add(space: Any, part: Part) -> None:  # noqa: ANN401  has no types
    """Add the centre lines of a part."""
    from ezdxf.math import OCS  # noqa: PLC0415  an extra

    layer = LAYER if part.fitting is None else FITTINGS
    look = {"layer": layer, "true_color": _color(part.color)}
    bends = [solid for solid in part.solids if isinstance(solid, Bend)]
    lines = []
    for bend in bends:
        # ezdxf has the centre and the angles of an arc in the coordinates of its plane
        plane = OCS(bend.normal.tolist())
        center, (x, y, _) = plane.from_wcs(bend.center.tolist()), plane.from_wcs(bend.radial.tolist())
        begin = degrees(atan2(y, x))
        placed = {**look, "extrusion": tuple(bend.normal.tolist())}
        end = begin + degrees(bend.angle)
        lines.append(space.add_arc(center, bend.bend_radius, begin, end, dxfattribs=placed))
    for path in () if bends else part.lines:
        for first, second in pairwise(path):
            if (first != second).any():
                lines.append(space.add_line(first.tolist(), second.tolist(), dxfattribs=look))
    number = part.cylinder.id if part.cylinder is not None else part.fitting.id if part.fitting is not None else -1
    radius = max(map(radius_of, part.solids), default=max(port.radius for port in part.ports))
    for line in lines:
        line.set_xdata(APPLICATION, [(1000, part.name), (1071, number), (1041, radius)])


def _named(text: str) -> str:
    """Insert names made of the content where they would be the same for all files."""
    content = uuid.uuid5(uuid.NAMESPACE_OID, text)
    for key in ("$FINGERPRINTGUID", "$VERSIONGUID"):
        before, found, rest = text.partition(f"  9\n{key}\n  2\n")
        _, _, rest = rest.partition("\n")
        text = f"{before}{found}{{{str(content).upper()}}}\n{rest}" if found else text
    return text
