"""Rows of numbers in text, as in XYZ files, ascii PLY and ascii PCD."""

from __future__ import annotations

import io
import warnings
from contextlib import contextmanager
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from cylx.io.cells import COMMENTS, SHARP
from cylx.io.inputs import Input
from cylx.io.row_checks import checked_lines
from cylx.io.row_format import LONGEST_LINE, RowFormat, short_of_points, wrong_count

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

_BLOCK = 1 << 20


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
            table = load_lines(checked_lines(lines, rows, source.place), rows, None, most)
    if rows.count is not None and len(table) < rows.count:
        raise short_of_points(source.place, rows.count, len(table))
    return table


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
    plain = is_plain(source, rows)
    for helped in (False, True):
        if not (rows.loose if helped else plain):
            continue
        try:
            with text_lines(source, rows.offset, rows.encoding) as lines:
                if helped:
                    table = load_lines(picked_lines(lines, rows), rows, None, most)
                else:
                    table = load_lines(short_lines(lines, rows), rows, rows.delimiter, most)
        except (ValueError, DeprecationWarning):
            continue
        if rows.promised is not None and rows.promised != len(table):
            raise wrong_count(source.place, rows.promised, len(table))
        return table
    return None


def picked_lines(lines: Iterable[str], rows: RowFormat) -> Iterator[str]:
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


def short_lines(lines: Iterable[str], _: RowFormat) -> Iterator[str]:
    """Yield the lines up to one that is too long: numpy would take many times its size.

    Raises
    ------
    ValueError
        At that line.
    """
    for line in lines:
        if len(line) > LONGEST_LINE:
            raise ValueError("the line is too long")
        yield line


def is_plain(source: Input, rows: RowFormat) -> bool:
    """Return whether numpy alone may be able to read the rows."""
    return rows.kept is None and not (rows.commented and _is_sharp(source, rows))


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


def load_lines(lines: Iterable[str], rows: RowFormat, delimiter: str | None, most: int | None) -> NDArray[np.void]:
    """Return at most so many rows of lines, by numpy."""
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


def _most_rows(source: Input, rows: RowFormat) -> int | None:
    """Return the number of rows to allocate, or None if the file is too small for it: two bytes per column."""
    room = (source.size - rows.offset + 1) // (2 * max(len(rows.dtype.names or ()), 1))
    return rows.count if rows.count is not None and rows.count <= room else None
