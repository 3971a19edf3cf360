"""CSV: one line per cylinder, one column per number; needs no extra."""

from __future__ import annotations

import csv
import io

from cylx.export.drawing import Drawing, Exported
from cylx.harmless import cell
from cylx.results.table import table_of


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write the table of the cylinders, comma-separated, with a header line; unknown values are empty.

    Parameters
    ----------
    drawing : Drawing
    suffix : str
        `.csv`.
    """
    table = table_of([cylinder.to_object() for cylinder in drawing.cylinders])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(cell, table))
    writer.writerows(map(cell, row) for row in zip(*table.values(), strict=True))
    return Exported(text.getvalue().encode())
