"""Rows of numbers in text, looked at line by line: which is wrong, and why."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

from cylx.errors import InputError
from cylx.io.cells import (
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
from cylx.io.row_format import LONGEST_LINE, RowFormat, wrong_count

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_END = "\x1a"
"""What ends a text of DOS."""


def checked_lines(lines: Iterable[str], rows: RowFormat, place: str) -> Iterator[str]:
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
