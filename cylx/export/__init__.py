"""Export of cylinders to other programs: meshes, tables and CAD files, one file per family of formats.

Each `write` takes a `Drawing` and returns the bytes of a file; the same drawing gives the same bytes. The libraries
for the formats are extras, imported on demand.
"""

from __future__ import annotations

from cylx.export.drawing import Drawing, Exported, draw
from cylx.export.formats import METRES, Format, format_of, render

__all__ = ["METRES", "Drawing", "Exported", "Format", "draw", "format_of", "render"]
