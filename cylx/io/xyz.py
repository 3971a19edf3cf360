"""XYZ text: rows of numbers with spaces, tabs, commas or semicolons between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from cylx.errors import InputError
from cylx.io.row_format import RowFormat
from cylx.io.rows import read_rows, text_lines
from cylx.io.text_columns import Columns, choose_columns
from cylx.io.text_top import read_top

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_BLOCK = 1 << 16
_MARKS = {
    b"\xff\xfe\0\0": "utf-32",
    b"\0\0\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}
"""What a text in Unicode other than UTF-8 begins with."""


def read_xyz(source: Input) -> tuple[NDArray[np.void], Columns]:
    """Read rows of x, y, z and further columns, as float64; see `xyz_rows`.

    Parameters
    ----------
    source : Input

    Returns
    -------
    table : ndarray of shape (rows,), structured
        `x`, `y`, `z`, and the other columns by name, or as `column_4` and so on.
    columns : Columns
        Which columns were taken, and what to say about it.

    Raises
    ------
    InputError
        If this is not text, the names contradict the rows, or a row has non-numbers, fewer than three columns, or not
        as many as the first row.
    """
    rows, columns = xyz_rows(source)
    return read_rows(source, rows), columns


def xyz_rows(source: Input) -> tuple[RowFormat, Columns]:
    """Find out what the rows of a text are.

    Comments begin with `#` or `//`. A line of names, or the last comment before the data that names x, y and z, names
    the columns, wherever the coordinates are among them. Titles above it are skipped. A line of one number, as in .pts
    files, is the number of rows. Columns of words are left out. A comma may be the decimal mark if it separates no
    columns.

    Parameters
    ----------
    source : Input

    Returns
    -------
    rows : RowFormat
    columns : Columns
        Which columns were taken, and what to say about it.

    Raises
    ------
    InputError
        If this is not text, or the names contradict the rows.
    """
    encoding = _encoding(source)
    with text_lines(source, 0, encoding) as lines:
        top = read_top(lines, source.place)
    columns = choose_columns(top, source.place)
    rows = RowFormat(
        np.dtype([(name, "f8") for name in columns.names]),
        skip=top.lines,
        delimiter=top.delimiter,
        commented=True,
        encoding=encoding,
        kept=columns.kept,
        columns=columns.width,
        promised=top.count,
        header=top.header,
        loose=True,
    )
    return rows, columns


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


def _encoding(source: Input) -> str:
    """Return how the letters are coded."""
    head = source.head(_BLOCK)
    for mark, encoding in _MARKS.items():
        if head.startswith(mark):
            return encoding
    if b"\0" not in head:
        return "utf-8-sig"
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        high, low = head[first::2], head[1 - first :: 2]
        if high.count(b"\0") > 0.9 * len(high) and b"\0" not in low:
            return encoding
    raise InputError(source.place, "is not text", "give a PLY, a PCD, or rows of x y z as text")
