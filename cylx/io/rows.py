"""Rows of numbers in text, as in XYZ files, ascii PLY and ascii PCD."""

from __future__ import annotations

import io
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import Input, excerpt

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

COMMENTS = ("#", "//")


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
    """

    dtype: np.dtype[np.void]
    offset: int = 0
    line: int = 1
    skip: int = 0
    count: int | None = None
    delimiter: str | None = None
    commented: bool = False


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
    try:
        with text_lines(source, rows.offset) as lines:
            table = _load(lines, rows, rows.delimiter, most)
    except (ValueError, DeprecationWarning):
        # The fast reader failed. The slower one finds the line that is wrong; if none is, it returns the rows.
        with text_lines(source, rows.offset) as lines:
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
def text_lines(source: Input, offset: int = 0) -> Iterator[io.TextIOWrapper]:
    """Yield the lines of a text from a byte on, with any line ends; bytes that are not UTF-8 are escaped."""
    source.file.seek(offset)
    lines = io.TextIOWrapper(source.file, encoding="utf-8-sig", errors="backslashreplace")
    try:
        yield lines
    finally:
        lines.detach()


def uncommented(line: str) -> str:
    """Remove a comment from a line, and white space from both ends.

    Examples
    --------
    >>> uncommented(" 1 2 3  // the corner")
    '1 2 3'
    """
    for mark in COMMENTS:
        line = line.partition(mark)[0]
    return line.strip()


def split_row(line: str, delimiter: str | None) -> list[str]:
    """Split a row into its columns; a delimiter at the end adds no column.

    Examples
    --------
    >>> split_row("1; 2;3;", ";")
    ['1', '2', '3']
    """
    if delimiter is None:
        return line.split()
    columns = [column.strip() for column in line.split(delimiter)]
    return columns[:-1] if columns[-1] == "" else columns


def is_number(text: str, dtype: np.dtype[Any] | None = None) -> bool:
    """Return whether a text is a number that fits a type.

    Examples
    --------
    >>> is_number("-1.5e3"), is_number("1_000"), is_number("256", np.dtype("u1"))
    (True, False, False)
    """
    if "_" in text or not text.isascii():
        return False
    try:
        if dtype is None or dtype.kind == "f":
            float(text)
            return True
        limits = np.iinfo(dtype)
        return limits.min <= int(text) <= limits.max
    except ValueError:
        return False


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
    names = rows.dtype.names or ()
    yield from ("\n" for _ in range(rows.skip))
    for number, line in enumerate(islice(lines, rows.skip, None), rows.line + rows.skip):
        columns = split_row(uncommented(line) if rows.commented else line.strip(), rows.delimiter)
        if not columns:
            continue
        if len(columns) != len(names):
            fault = f"expected {len(names)} columns, found {len(columns)}"
            raise InputError(f"{place}:{number}", fault, "give every row the same columns")
        for name, column in zip(names, columns, strict=True):
            check_number(f"{place}:{number}", name, column, rows.dtype[name])
        yield " ".join(columns)


def check_number(where: str, name: str, column: str, dtype: np.dtype[Any] | None = None) -> None:
    """Refuse a column that is not a number.

    Raises
    ------
    InputError
        If it is not a number.
    """
    if not is_number(column, dtype):
        kind = "a number" if dtype is None or dtype.kind == "f" else f"a number of type {dtype.name}"
        fault = f"{name} is {excerpt(column)}, not {kind}" if column else f"{name} is empty"
        raise InputError(where, fault, "write numbers like -1.5 or 2e-3")


def _most_rows(source: Input, rows: RowFormat) -> int | None:
    """Return the number of rows to allocate, or None if the file is too small for it: two bytes per column."""
    room = (source.size - rows.offset + 1) // (2 * len(rows.dtype.names or ()))
    return rows.count if rows.count is not None and rows.count <= room else None
