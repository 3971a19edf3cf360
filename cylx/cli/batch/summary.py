"""The summary of many scans: one table of cylinders and one list of files, `summary.csv` and `summary.json`.

They hold neither times nor which run processed a scan: the same scans and settings give the same bytes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from cylx.harmless import cell

TABLE, LIST = "summary.csv", "summary.json"
SCHEMA = "cylx.summary/1"

_VECTORS = ("axis_point", "axis_direction", "start", "end")
_SCALARS = ("inliers", "rmse", "coverage_deg", "support", "payoff", "confidence")
_DEVIATIONS = ("radius", "axis_angle_deg", "axis_offset")
_CATALOGUE = ("decision", "name", "nominal_radius", "likelihood_ratio", "free_radius", "free_radius_sd")
COLUMNS = (
    *("file", "id", "radius", "height"),
    *(f"{name}_{axis}" for name in _VECTORS for axis in "xyz"),
    *_SCALARS,
    *(f"uncertainty_{name}" for name in _DEVIATIONS),
    *(f"catalogue_{name}" for name in _CATALOGUE),
)
_PLAIN = re.compile(r"[A-Za-z0-9_./\\:+-][A-Za-z0-9_./\\: +-]*")


def table_text(results: Sequence[tuple[str, Mapping[str, Any]]]) -> str:
    r"""Format the table: a header line, and one line per cylinder.

    Lines end in LF. Texts are quoted, with quotes doubled, if they hold anything but letters, digits and `_./\:+-`. A
    text that a spreadsheet would run begins with an apostrophe.
    Values that a cylinder does not have are empty.

    Parameters
    ----------
    results : sequence of (str, mapping)
        Files, and their parsed JSON.
    """
    header = ",".join(COLUMNS) + "\n"
    return header + "".join(line for file, result in results for line in _lines(file, result))


def list_text(files: Sequence[Mapping[str, object]]) -> str:
    """Format the list of files, each as a JSON object."""
    from cylx.results.parts import text_of
    from cylx.version import __version__

    return text_of({"schema": SCHEMA, "cylx_version": __version__, "files": list(files)})


def legible(name: str) -> str:
    r"""Return a file name in valid UTF-8; an undecodable byte becomes `\xff`."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def is_own_table(path: str) -> bool:
    """Return whether a file begins with the header of the table."""
    start = ",".join(COLUMNS[:4]).encode()
    try:
        with Path(path).open("rb") as file:
            return file.read(len(start)) == start
    except OSError:
        return False


def _lines(file: str, result: Mapping[str, Any]) -> Iterator[str]:
    for cylinder in result["cylinders"]:
        uncertainty, match = cylinder.get("uncertainty", {}), cylinder.get("catalogue", {})
        cells = chain(
            [legible(file), cylinder["id"], cylinder["radius"], cylinder["height"]],
            chain.from_iterable(cylinder[name] for name in _VECTORS),
            (cylinder.get(name) for name in _SCALARS),
            (uncertainty.get(name) for name in _DEVIATIONS),
            (match.get(name) for name in _CATALOGUE),
        )
        yield ",".join(map(_cell, cells)) + "\n"


def _cell(value: object) -> str:
    if value is None:
        return ""
    text = cell(value) if isinstance(value, str) else repr(value)
    return text if _PLAIN.fullmatch(text) else '"' + text.replace('"', '""') + '"'
