"""Read the cylinders of a design: a result or a truth in JSON, a table in CSV, solids in STEP or IFC."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cylx.errors import InputError, UsageError
from cylx.io import isolated
from cylx.io.design_parts import KEYS, design_cylinder, triple
from cylx.io.inputs import excerpt, open_input, printable, read_json
from cylx.optional.extras import require
from cylx.records.designs import Design, DesignCylinder
from cylx.units import METRES

SUFFIXES = (".json", ".csv", ".step", ".stp", ".ifc")
_MOST_ROWS = 1 << 20


def read_design(path: str | Path) -> Design:
    """Read the cylinders of a design.

    Parameters
    ----------
    path : str or Path
        Its suffix says the format: .json, .csv, .step, .stp or .ifc.

    Returns
    -------
    Design
        In the unit of the file.

    Raises
    ------
    InputError
        If the file cannot be read, has no cylinder, or one has no size.
    UsageError
        If the suffix is unknown, or a library is not installed.
    """
    suffix, place = Path(path).suffix.lower(), printable(path)
    if suffix == ".json":
        design = _from_json(read_json(path), place)
    elif suffix == ".csv":
        design = _from_csv(path, place)
    elif suffix in {".step", ".stp"}:
        require("OCP", place=place, needed_by="a design in STEP", imported=False)
        design = _isolated(path, "step")
    elif suffix == ".ifc":
        require("ifcopenshell", place=place, needed_by="a design in IFC", imported=False)
        design = _isolated(path, "ifc")
    else:
        raise UsageError(place, "is no format of a design", f"use one of {', '.join(SUFFIXES)}")
    if not design.cylinders:
        raise InputError(place, "has no cylinder", "give a design with straight pipes or other cylinders")
    return design


def _isolated(path: str | Path, kind: str) -> Design:
    """Read a design by a library in native code, in a process of its own."""
    with open_input(path) as source:
        answer = isolated.ask_isolated(source, kind)
    found = (
        DesignCylinder(str(name), triple(start), triple(end), float(radius))
        for name, start, end, radius in answer["cylinders"]
    )
    return Design(kind, answer["units"], answer["metres"], tuple(found))


def _from_json(document: Mapping[str, Any], place: str) -> Design:
    entries = document.get("cylinders")
    if not isinstance(entries, list):
        raise InputError(place, "has no list 'cylinders'", "give a result of 'cylx extract', or a truth in its form")
    about = document.get("input")
    units = about.get("units") if isinstance(about, dict) else None
    found = []
    for i, entry in enumerate(entries):
        here = f"{place}.cylinders[{i}]"
        if not isinstance(entry, dict):
            raise InputError(here, "is not an object", "give each cylinder as an object with its keys")
        name = str(entry.get("name", entry.get("id", i)))
        found.append(_of_keys(name, entry, here))
    known = units if isinstance(units, str) and units in METRES else None
    return Design("json", known, None if known is None else METRES[known], tuple(found))


def _of_keys(name: str, entry: Mapping[str, Any], place: str) -> DesignCylinder:
    """Return the cylinder with the ends, or else with the axis and the height, that a mapping has."""
    radius, diameter = entry.get("radius"), entry.get("diameter")
    if radius is None and isinstance(diameter, int | float) and abs(diameter) < 1e100:
        radius = 0.5 * diameter
    if entry.get("start") is not None and entry.get("end") is not None:
        return design_cylinder(name, entry["start"], entry["end"], radius, place)
    point, way, height = (entry.get(key) for key in ("axis_point", "axis_direction", "height"))
    try:
        middle, along, half = triple(point or ()), triple(way or ()), 0.5 * float(height)  # type: ignore[arg-type]
        length = math.hypot(*along)
        start, end = (
            tuple(m + side * half * a / length for m, a in zip(middle, along, strict=True)) for side in (-1.0, 1.0)
        )
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise InputError(place, "has neither ends nor an axis with a height", KEYS) from None
    return design_cylinder(name, start, end, radius, place)


def _from_csv(path: str | Path, place: str) -> Design:
    with open_input(path) as source:
        data = source.head(source.size)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    head = text.partition("\n")[0]
    delimiter = max(",;\t", key=head.count)
    try:
        rows = list(csv.reader(io.StringIO(text), delimiter=delimiter, strict=True))
    except csv.Error as error:
        raise InputError(place, f"is no table: {error}", KEYS) from None
    names = [name.strip().lower() for name in rows[0]] if rows else []
    if "radius" not in names and "diameter" not in names:
        raise InputError(f"{place}:1", f"has no column radius in {excerpt(head)}", KEYS)
    if len(rows) > _MOST_ROWS:
        raise InputError(place, f"has {len(rows)} rows", f"give at most {_MOST_ROWS}")
    found = []
    for line, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        here = f"{place}:{line}"
        if len(row) != len(names):
            raise InputError(here, f"expected {len(names)} columns, found {len(row)}", KEYS)
        cells = dict(zip(names, (cell.strip() for cell in row), strict=True))
        entry: dict[str, Any] = {}
        for key in ("start", "end", "axis_point", "axis_direction"):
            parts = [cells.get(f"{key}_{axis}", "") for axis in "xyz"]
            entry[key] = [_number(part, delimiter, here) for part in parts] if all(parts) else None
        for key in ("radius", "diameter", "height"):
            entry[key] = _number(cells[key], delimiter, here) if cells.get(key) else None
        found.append(_of_keys(cells.get("name") or cells.get("id") or str(line - 2), entry, here))
    return Design("csv", None, None, tuple(found))


def _number(cell: str, delimiter: str, place: str) -> float:
    text = cell if delimiter == "," else cell.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        raise InputError(place, f"{excerpt(cell)} is not a number", "write numbers like -1.5 or 2e-3") from None
