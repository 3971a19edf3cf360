"""A catalogue of nominal radii, read from a table in a CSV text file or from a list in a YAML file."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from pydantic import ValidationError

from cylx.config.faults import describe_fault
from cylx.config.sections import CatalogueEntry
from cylx.config.yaml_reader import entry_lines, parse_yaml
from cylx.errors import ConfigError

_MOST_BYTES = 100_000
_SEPARATORS = "\t;,"
_COLUMNS = ("name", "radius", "diameter", "tolerance")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_LONGEST_NUMBER = 100
_EXAMPLE = "such as 'name,radius,tolerance'"

Given = Sequence[Mapping[str, object] | CatalogueEntry | float]


class _Table(NamedTuple):
    """The contents of the header line of a table.

    Parameters
    ----------
    columns : list of str
    separator : str
    """

    columns: list[str]
    separator: str


def read_catalogue(path: str | PathLike[str]) -> list[dict[str, object]]:
    """Read the nominal radii of a file.

    A table has a header line that names its columns: `radius` or `diameter`, and optionally `tolerance` (of the
    diameter, if that is given) and `name`. Columns are separated by commas, semicolons or tabs. A file whose name ends
    in `.yaml` or `.yml` has a list of entries, as `scene.catalogue` has.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    list of dict
        With the keys `name`, `radius` and `tolerance`, as in the configuration.

    Raises
    ------
    ConfigError
        If the file cannot be read or has an invalid entry; the message is one line and names the line of the file.
    """
    place = str(path)
    text = _text_of(Path(path), place)
    is_yaml = Path(path).suffix.lower() in {".yaml", ".yml"}
    entries: list[dict[str, object]] = []
    lines: dict[object, int] = {}
    for line, entry in (_entries_of_yaml if is_yaml else _entries_of_table)(text, place):
        _validate(entry, f"{place}:{line}")
        before = lines.setdefault(entry["radius"], line)
        if before != line:
            raise ConfigError(f"{place}:{line}", f"has the radius of line {before} again", "leave one of them out")
        entries.append(entry)
    if not entries:
        raise ConfigError(place, "has no entries", "give each nominal radius a line")
    return entries


def entries_of(given: Given | str | PathLike[str]) -> object:
    """Return a catalogue in the form of the configuration, from a file, from entries, or from radii.

    Any other value is returned as it is, and the validation reports it.
    """
    if isinstance(given, str | PathLike):
        return read_catalogue(given)
    return [_plain_entry(entry) for entry in given]


def _plain_entry(entry: object) -> object:
    """Return one entry as a mapping; numpy numbers become Python numbers."""
    if isinstance(entry, CatalogueEntry):
        return entry.model_dump()
    if isinstance(entry, Mapping):
        return {key: value.item() if hasattr(value, "item") else value for key, value in entry.items()}
    return {"radius": entry.item() if hasattr(entry, "item") else entry}


def _text_of(path: Path, place: str) -> str:
    """Read a small text file."""
    remedy = "give a CSV file with a column 'radius' or 'diameter'"
    try:
        with path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(place, "no such file", remedy) from None
    except UnicodeDecodeError:
        raise ConfigError(place, "is not UTF-8 text", remedy) from None
    except (OSError, ValueError) as error:
        fault = getattr(error, "strerror", None) or str(error)
        raise ConfigError(place, f"cannot be read: {fault}", remedy) from None
    if len(content) > _MOST_BYTES:
        raise ConfigError(place, "is larger than 100 kB", remedy)
    if "\0" in text:
        raise ConfigError(place, "is not text", remedy)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _entries_of_yaml(text: str, place: str) -> Iterator[tuple[int, dict[str, object]]]:
    """Yield each entry of a YAML list with its line."""
    entries = parse_yaml(text, place)
    if entries is None:
        return
    if not isinstance(entries, list):
        raise ConfigError(place, "is not a list of entries", "write '- {name: DN50, radius: 0.03015}' for each of them")
    for line, entry in zip(entry_lines(text), entries, strict=True):
        if not isinstance(entry, dict):
            raise ConfigError(f"{place}:{line}", "is not an entry", "write '- {name: DN50, radius: 0.03015}'")
        yield line, entry


def _entries_of_table(text: str, place: str) -> Iterator[tuple[int, dict[str, object]]]:
    """Yield each entry of a table with its line number; lines that begin with `#` are comments."""
    table = None
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if table is None:
            table = _header_of(line, f"{place}:{number}")
        else:
            yield number, _entry_of(line, table, f"{place}:{number}")
    if table is None:
        raise ConfigError(place, "is empty", f"begin with a line that names the columns, {_EXAMPLE}")


def _header_of(line: str, place: str) -> _Table:
    """Read the header line."""
    separator = next((mark for mark in _SEPARATORS if mark in line), ",")
    columns = [cell.lower() for cell in _cells_of(line, separator, place)]
    if any(_is_number(column) for column in columns):
        raise ConfigError(place, "is not a header line", f"begin with a line that names the columns, {_EXAMPLE}")
    for column in columns:
        if column not in _COLUMNS:
            close = get_close_matches(column, _COLUMNS, n=1)
            remedy = f"did you mean '{close[0]}'?" if close else f"the columns are {', '.join(_COLUMNS)}"
            raise ConfigError(place, f"unknown column {_shown(column)}", remedy)
        if columns.count(column) > 1:
            raise ConfigError(place, f"names the column '{column}' twice", "leave one of them out")
    if ("radius" in columns) == ("diameter" in columns):
        fault = "names both 'radius' and 'diameter'" if "radius" in columns else "names neither 'radius' nor 'diameter'"
        raise ConfigError(place, fault, "give one of these columns")
    return _Table(columns, separator)


def _entry_of(line: str, table: _Table, place: str) -> dict[str, object]:
    """Read a line of a table."""
    cells = _cells_of(line, table.separator, place)
    if len(cells) != len(table.columns):
        raise ConfigError(
            place, f"expected {len(table.columns)} columns, found {len(cells)}", "write one cell for each"
        )
    values = dict(zip(table.columns, cells, strict=True))
    what = "diameter" if "diameter" in values else "radius"
    halves = 0.5 if what == "diameter" else 1.0
    if not values[what]:
        raise ConfigError(place, f"has no {what}", "write one, or leave the line out")
    radius, tolerance = (
        halves * _number(values[key], key, place) if values.get(key) else None for key in (what, "tolerance")
    )
    return {"name": values.get("name") or None, "radius": radius, "tolerance": tolerance}


def _cells_of(line: str, separator: str, place: str) -> list[str]:
    """Split a line into its cells, which may be quoted."""
    try:
        (row,) = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
    except csv.Error as error:
        raise ConfigError(place, f"is not CSV ({error})", "close the quotes, and put nothing behind them") from None
    return [cell.strip() for cell in row]


def _number(cell: str, column: str, place: str) -> float:
    """Read a number > 0."""
    if not _is_number(cell):
        remedy = f"write {cell.replace(',', '.')}" if _is_number(cell.replace(",", ".")) else "write digits"
        raise ConfigError(place, f"the {column} {_shown(cell)} is not a number", remedy)
    number = float(cell)
    if not 0.0 < 0.5 * number < math.inf:
        raise ConfigError(place, f"the {column} {_shown(cell)} is out of range", "it must be > 0 and finite")
    return number


def _is_number(cell: str) -> bool:
    """Return whether a cell is a number; one of thousands of digits is none, and would take long to match."""
    return len(cell) <= _LONGEST_NUMBER and _NUMBER.fullmatch(cell) is not None


def _shown(cell: str) -> str:
    """Return a cell shortened, and without control characters for the terminal."""
    text = repr(cell)
    return text if len(text) <= 40 else f"{text[:36]} ..."


def _validate(entry: dict[str, object], place: str) -> None:
    """Check an entry against the configuration model while its line number is known."""
    try:
        CatalogueEntry.model_validate(entry)
    except ValidationError as error:
        path, fault, remedy = describe_fault(error, CatalogueEntry)
        raise ConfigError(": ".join([place, *path]), fault, remedy) from None
