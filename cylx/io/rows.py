"""Rows of numbers in text, as in XYZ files, ascii PLY and ascii PCD."""

from __future__ import annotations

import io
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from cylx.errors import InputError
from cylx.io.cells import (
    COMMENTS,
    DECIMAL_COMMA,
    SHARP,
    all_cells,
    check_number,
    is_count,
    is_missing,
    plain_number,
    split_row,
    uncommented,
)
from cylx.io.inputs import Input

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

LONGEST_LINE = 1 << 20
"""Letters of a line: more than any table of points has."""
_BLOCK = 1 << 20
_END = "\x1a"
"""What ends a text of DOS."""


@dataclass(frozen=True, slots=True)
class RowFormat:
    """The format and position of the rows.

    Parameters
    ----------
    dtype : dtype
        Structured: one scalar field per column.
    offset : int
        Byte at which the text begins.
    line : int
        Number of that line in the file, from 1.
    skip : int
        Lines to skip from there.
    count : int or None
        Number of rows to read; None for all.
    delimiter : str or None
        Separator of the columns; None for white space.
    commented : bool
        Whether `#` and `//` begin a comment.
    encoding : str
        Of the text.
    kept : tuple of int, optional
        Which columns are read, ascending, if not all of them.
    columns : int, optional
        Number of columns of the text, if it is not that of the fields.
    promised : int, optional
        Number of rows that a line above the first row promised. Lines of a count between the rows add to it.
    header : str
        The line of names, which may come again.
    loose : bool
        Whether an empty value is missing (NaN), and a comma may be the decimal mark.
    """

    dtype: np.dtype[np.void]
    offset: int = 0
    line: int = 1
    skip: int = 0
    count: int | None = None
    delimiter: str | None = None
    commented: bool = False
    encoding: str = "utf-8-sig"
    kept: tuple[int, ...] | None = None
    columns: int | None = None
    promised: int | None = None
    header: str = ""
    loose: bool = False

    @property
    def width(self) -> int:
        """Number of columns of the text."""
        return len(self.dtype.names or ()) if self.columns is None else self.columns


def read_rows(source: Input, rows: RowFormat) -> NDArray[np.void]:
    """Read rows of numbers.

    Parameters
    ----------
    source : Input
    rows : RowFormat

    Returns
    -------
    ndarray of shape (rows,), structured

    Raises
    ------
    InputError
        If a row has too few or too many columns, or a value that is not a number of the column's type, or if there are
        fewer rows than `rows.count`.
    """
    most = _most_rows(source, rows)
    table = _read_fast(source, rows, most)
    if table is None:
        # The fast reader failed. The slower one finds the line that is wrong; if none is, it returns the rows.
        with text_lines(source, rows.offset, rows.encoding) as lines:
            table = _load(_checked(lines, rows, source.place), rows, None, most)
    if rows.count is not None and len(table) < rows.count:
        raise short_of_points(source.place, rows.count, len(table))
    return table


def short_of_points(place: str, promised: int, found: int, *, at_most: bool = False) -> InputError:
    """Return the error for a file whose body is shorter than its header says."""
    held = f"at most {found}" if at_most else f"{found}"
    return InputError(
        place, f"the header promises {promised} points, the file holds {held}", "get a complete copy of the file"
    )


@contextmanager
def text_lines(source: Input, offset: int = 0, encoding: str = "utf-8-sig") -> Iterator[io.TextIOWrapper]:
    """Yield the lines of a text from a byte on, with any line ends; bytes that are no text are escaped."""
    source.file.seek(offset)
    lines = io.TextIOWrapper(source.file, encoding=encoding, errors="backslashreplace")
    try:
        yield lines
    finally:
        lines.detach()


def _read_fast(source: Input, rows: RowFormat, most: int | None) -> NDArray[np.void] | None:
    """Read rows by numpy alone, or with a little help; None if they need a closer look."""
    plain = rows.kept is None and not (rows.commented and _is_sharp(source, rows))
    for helped in (False, True):
        if not (rows.loose if helped else plain):
            continue
        try:
            with text_lines(source, rows.offset, rows.encoding) as lines:
                if helped:
                    table = _load(_picked(lines, rows), rows, None, most)
                else:
                    table = _load(_short(lines), rows, rows.delimiter, most)
        except (ValueError, DeprecationWarning):
            continue
        if rows.promised is not None and rows.promised != len(table):
            raise wrong_count(source.place, rows.promised, len(table))
        return table
    return None


def _picked(lines: Iterable[str], rows: RowFormat) -> Iterator[str]:
    """Yield the columns of numbers with decimal points, up to the first line that needs a closer look.

    Raises
    ------
    ValueError
        At that line.
    """
    pick = None if rows.kept is None else itemgetter(*rows.kept)
    yield from ("\n" for _ in range(rows.skip))
    commas = points = False
    for line in islice(lines, rows.skip, None):
        if len(line) > LONGEST_LINE or '"' in line or "#" in line or "//" in line:
            raise ValueError("a closer look is needed")
        cells = line.split(rows.delimiter)
        if len(cells) != rows.width:
            if line.strip():
                raise ValueError("a closer look is needed")
            continue
        text = " ".join(cells if pick is None else pick(cells))
        commas, points = commas or "," in text, points or "." in text
        if commas and (points or rows.delimiter == ","):
            raise ValueError("a closer look is needed")
        yield text.replace(",", ".")


def _short(lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines up to one that is too long: numpy would take many times its size."""
    for line in lines:
        if len(line) > LONGEST_LINE:
            raise ValueError("the line is too long")
        yield line


def _is_sharp(source: Input, rows: RowFormat) -> bool:
    """Return whether a `#` of the text belongs to a number."""
    width = rows.encoding.removeprefix("utf-")
    codes = [rows.encoding] if width not in ("16", "32") else [f"{rows.encoding}-le", f"{rows.encoding}-be"]
    marks = [SHARP.encode("utf-8" if width == "8-sig" else code) for code in codes]
    source.file.seek(rows.offset)
    before = b""
    while block := source.file.read(_BLOCK):
        if any(mark in before + block for mark in marks):
            return True
        before = block[1 - len(marks[0]) :]
    return False


def wrong_count(place: str, promised: int, found: int) -> InputError:
    """Return the error for a count of rows that is not theirs."""
    fault = f"the count in the first line is {promised}, the file holds {found} points"
    return InputError(place, fault, "get a complete copy of the file, or correct the count")


def _load(lines: Iterable[str], rows: RowFormat, delimiter: str | None, most: int | None) -> NDArray[np.void]:
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # about empty lines and an empty file, which are handled here
        warnings.simplefilter("error", DeprecationWarning)  # numpy 1 reads 300 as the uchar 44
        return np.loadtxt(
            lines,
            dtype=rows.dtype,
            comments=COMMENTS if rows.commented else None,
            delimiter=delimiter,
            skiprows=rows.skip,
            max_rows=most,
            ndmin=1,
        )


def _checked(lines: Iterable[str], rows: RowFormat, place: str) -> Iterator[str]:
    """Yield the lines with one space between columns, up to the first wrong line, which raises."""
    yield from ("\n" for _ in range(rows.skip))
    counts, found, marks = _Counts(rows.promised), 0, ""
    for number, line in enumerate(islice(lines, rows.skip, None), rows.line + rows.skip):
        where = f"{place}:{number}"
        if len(line) > LONGEST_LINE:
            raise InputError(where, "the line is too long for a row", "give every point a line")
        columns = _row_of(line, rows)
        if not columns or (rows.header and line.strip() == rows.header):
            continue
        bare = len(columns) == 1 < rows.width or (counts.expects(found) and not any(columns[1:]))
        if rows.loose and bare and is_count(columns[0]) and counts.take(int(columns[0]), found, where):
            continue
        if len(columns) != rows.width:
            fault = f"expected {rows.width} columns, found {len(columns)}"
            raise InputError(where, fault, "give every row the same columns")
        values = columns if rows.kept is None else [columns[place] for place in rows.kept]
        if rows.loose:
            values = ["" if is_missing(value) else value for value in values]
        marks = _one_mark(marks, values, where)
        values = [plain_number(value) for value in values]
        yield " ".join(_filled(values, rows, where))
        found += 1
    counts.check(found, rows.width, place)


class _Counts:
    """The numbers of rows that lines of their own promise: above the rows, between blocks of them, or below.

    Parameters
    ----------
    promised : int or None
        The number in a line above the first row.
    """

    def __init__(self, promised: int | None) -> None:
        self.promised = promised
        self.below: int | None = None
        self.doubtful = ""

    def expects(self, found: int) -> bool:
        """Return whether a block ends after this number of rows, so that another number may follow."""
        return self.promised is not None and found in (self.promised, self.below)

    def take(self, count: int, found: int, where: str) -> bool:
        """Note a number that stands below `found` rows; return whether it may be a count."""
        if self.promised is not None and not self.expects(found):
            return False
        if self.promised is None and found:  # the first number: of the rows above, or of those below
            self.below = found if count == found else None
            self.doubtful = where
        self.promised = found + count
        return True

    def check(self, found: int, width: int, place: str) -> None:
        """Refuse another number of rows than was promised; where that is doubtful, the line is what is wrong."""
        if self.promised is None or self.expects(found):
            return
        if self.doubtful:
            fault = f"expected {width} columns, found 1"
            raise InputError(self.doubtful, fault, "give every row the same columns")
        raise wrong_count(place, self.promised, found)


def _row_of(line: str, rows: RowFormat) -> list[str]:
    """Return the columns of a line, without its comment; a mark within a name begins none."""
    row = uncommented(line) if rows.commented else line.strip()
    if row == _END:
        return []
    for text in (row,) if rows.kept is None else dict.fromkeys((row, line.strip())):
        columns = all_cells(text, rows.delimiter)
        if columns and columns[-1] == "" and len(columns) != rows.width:
            columns.pop()
        if len(columns) == rows.width and row:
            return columns
    return split_row(row, rows.delimiter) if row else []


def _one_mark(before: str, values: Iterable[str], where: str) -> str:
    """Return the decimal mark of a file so far; refuse a second one.

    Raises
    ------
    InputError
        If a row has a comma for a decimal mark, and another row or value a point.
    """
    numbers = (value for value in values if SHARP not in value)
    marks = {"," if "," in value else "." for value in numbers if DECIMAL_COMMA.fullmatch(value) or "." in value}
    if len(marks | set(before)) > 1:
        raise InputError(where, "some numbers have a decimal comma, others a point", "write all of them with a point")
    return before or "".join(marks)


def _filled(values: list[str], rows: RowFormat, where: str) -> list[str]:
    """Return the values of a row, checked; where values may be missing, NaN for those that are."""
    names = rows.dtype.names or ()
    nowhere = not any(value for name, value in zip(names, values, strict=True) if name in ("x", "y", "z"))
    out = []
    for name, value in zip(names, values, strict=True):
        if not value and rows.loose and (nowhere or name not in ("x", "y", "z")):  # a point has all three, or none
            out.append("nan")
            continue
        kind = rows.dtype[name]
        check_number(where, name, value, kind)
        out.append(str(int(value)) if kind.kind in "iu" else value)  # numpy refuses -0 and +1
    return out


def _most_rows(source: Input, rows: RowFormat) -> int | None:
    """Return the number of rows to allocate, or None if the file is too small for it: two bytes per column."""
    room = (source.size - rows.offset + 1) // (2 * max(len(rows.dtype.names or ()), 1))
    return rows.count if rows.count is not None and rows.count <= room else None
