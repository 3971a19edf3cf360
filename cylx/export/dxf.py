"""DXF: the centre lines of the cylinders on one layer, by ezdxf."""

from __future__ import annotations

import io
import uuid

from cylx.export.drawing import Drawing, Exported

LAYER = "cylx_centre_lines"
APPLICATION = "CYLX"
_UNITS = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6}  # $INSUNITS


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write a DXF file (R2010) with a line from end to end of each cylinder, in its colour.

    Extended data of the application `CYLX` hold the number (1071) and the radius (1041, a distance) of each.

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
        document.header["$MEASUREMENT"] = int(drawing.unit not in {"in", "ft"})
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = dict(sorted(classes.classes.items()))  # ezdxf takes them from a set, in random order
        document.layers.add(LAYER)
        document.appids.add(APPLICATION)
        space = document.modelspace()
        for piece in drawing.pieces:
            red, green, blue = piece.color
            color = red << 16 | green << 8 | blue
            ends = piece.shape.start.tolist(), piece.shape.end.tolist()
            line = space.add_line(*ends, dxfattribs={"layer": LAYER, "true_color": color})
            line.set_xdata(APPLICATION, [(1000, piece.name), (1071, piece.id), (1041, piece.shape.radius)])
        text = io.StringIO()
        document.write(text)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before
    return Exported(_named(text.getvalue()).encode(document.output_encoding, "dxfreplace"))


def _named(text: str) -> str:
    """Insert names made of the content where they would be the same for all files."""
    content = uuid.uuid5(uuid.NAMESPACE_OID, text)
    for key in ("$FINGERPRINTGUID", "$VERSIONGUID"):
        before, found, rest = text.partition(f"  9\n{key}\n  2\n")
        _, _, rest = rest.partition("\n")
        text = f"{before}{found}{{{str(content).upper()}}}\n{rest}" if found else text
    return text
