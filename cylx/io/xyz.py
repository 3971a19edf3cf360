"""XYZ text: rows of numbers with spaces, tabs, commas or semicolons between them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from cylx.errors import InputError
from cylx.io.names import coordinate_names, mended_names
from cylx.io.rows import (
    COMMENTS,
    RowFormat,
    check_number,
    is_number,
    read_rows,
    split_row,
    text_lines,
    uncommented,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_BLOCK = 1 << 16
_MOST_COLUMNS = 1000


def read_xyz(source: Input) -> NDArray[np.void]:
    """Read rows of x, y, z and further columns, as float64.

    Comments begin with `#` or `//`. A line of names, or the last comment before the data, names the columns. A single
    number in the first line, as in .pts files, is the number of rows.

    Parameters
    ----------
    source : Input

    Returns
    -------
    ndarray of shape (rows,), structured
        `x`, `y`, `z`, and the other columns by name, or as `column_4` and so on.

    Raises
    ------
    InputError
        If this is not text, or a row has non-numbers, fewer than three columns, or not as many as the first row.
    """
    _check_text(source)
    with text_lines(source) as lines:
        top = _read_top(lines, source.place)
    dtype = np.dtype([(name, "f8") for name in top.names()])
    table = read_rows(source, RowFormat(dtype, skip=top.lines, delimiter=top.delimiter, commented=True))
    if top.count is not None and top.count != len(table):
        fault = f"the count in the first line is {top.count}, the file holds {len(table)} points"
        raise InputError(source.place, fault, "get a complete copy of the file, or correct the count")
    return table


def write_xyz(file: BinaryIO, suffix: str, table: NDArray[np.void]) -> None:
    """Write rows of numbers, with the fewest digits that preserve the values.

    Parameters
    ----------
    file : binary file
    suffix : str
        `.csv` adds commas and a line of names, `.pts` the number of rows.
    table : ndarray of shape (rows,), structured
    """
    names = list(table.dtype.names or ())
    delimiter = "," if suffix == ".csv" else " "
    if suffix == ".csv":
        file.write((",".join(names) + "\n").encode())
    elif len(names) > 3:
        file.write(("# " + " ".join(names) + "\n").encode())
    if suffix == ".pts":
        file.write(f"{len(table)}\n".encode())
    for start in range(0, len(table), _BLOCK):
        block = table[start : start + _BLOCK]
        rows = zip(*(block[name].astype(str) for name in names), strict=True)
        file.write("".join(delimiter.join(row) + "\n" for row in rows).encode())


@dataclass(frozen=True, slots=True)
class _Top:
    """The contents of the lines up to the first row.

    Parameters
    ----------
    lines : int
        Number of lines before the first row.
    columns : int
        Number of columns of the first row.
    delimiter : str or None
        Separator of the columns; None for white space.
    remark : str
        The line that may hold names.
    count : int or None
        The number of rows promised by the first line.
    """

    lines: int
    columns: int
    delimiter: str | None
    remark: str
    count: int | None

    def names(self) -> list[str]:
        """Return the names of the columns."""
        said = [name.strip("\"' ") for name in split_row(self.remark, self.delimiter)]
        if len(said) != self.columns:
            said = _words(self.remark)
        if len(said) != self.columns:
            return _named_by_place(["x", "y", "z"], self.columns)
        coordinates = coordinate_names(said)
        if len(coordinates) == 3:
            said = [name.lower() if name in coordinates else name for name in said]
        else:
            said[:3] = ["x", "y", "z"]
        return _with_coordinates_first(said)


def _named_by_place(names: Sequence[str], columns: int) -> list[str]:
    return [*names, *(f"column_{place}" for place in range(len(names) + 1, columns + 1))]


def _with_coordinates_first(names: list[str]) -> list[str]:
    """Replace invalid names; if a name is needed twice, the coordinate keeps it."""
    order = sorted(range(len(names)), key=lambda place: names[place] not in ("x", "y", "z"))
    mended = dict(zip(order, mended_names([names[place] for place in order]), strict=True))
    return [mended[place] for place in range(len(names))]


def _read_top(lines: Iterable[str], place: str) -> _Top:
    remark, count, named = "", None, False
    for number, line in enumerate(lines, 1):
        row = uncommented(line)
        if not row:
            remark = remark if named else _named_in_comment(line) or remark
            continue
        delimiter = next((mark for mark in ";," if mark in row), None)
        columns = split_row(row, delimiter)
        if not (named or any(is_number(word) for word in _words(row))):
            remark, named = row, True
        elif count is None and len(columns) == 1 and columns[0].isdecimal():
            count = int(columns[0])
        else:
            _check_first_row(f"{place}:{number}", columns)
            return _Top(number - 1, len(columns), delimiter, remark, count)
    raise InputError(place, "holds no row of numbers", "give rows of x y z")


def _check_first_row(where: str, columns: Sequence[str]) -> None:
    for name, column in zip(_named_by_place(["x", "y", "z"], len(columns)), columns, strict=False):
        check_number(where, name, column)
    if len(columns) < 3:
        raise InputError(where, f"expected at least 3 columns, found {len(columns)}", "give rows of x y z")
    if len(columns) > _MOST_COLUMNS:
        raise InputError(where, f"expected at most {_MOST_COLUMNS} columns, found {len(columns)}", "give rows of x y z")


def _named_in_comment(line: str) -> str:
    """Return the text of a comment that names x, y and z, or an empty text."""
    text = line.strip().lstrip("".join(COMMENTS)).strip()
    return text if len(coordinate_names(_words(text))) == 3 else ""


def _words(text: str) -> list[str]:
    return [word.strip("\"'") for word in re.split(r"[\s,;]+", text.strip())]


def _check_text(source: Input) -> None:
    head = source.head(_BLOCK)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(source.place, "is UTF-16 text", "save it as UTF-8")
    if b"\0" in head:
        raise InputError(source.place, "is not text", "give a PLY, a PCD, or rows of x y z as text")
