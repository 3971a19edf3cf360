"""The lines above the first row of a text: titles, names of columns, counts, and what the first rows look like."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from cylx.errors import InputError
from cylx.io.cells import (
    COMMENTS,
    all_cells,
    check_number,
    is_count,
    is_missing,
    is_number,
    plain_number,
    split_row,
    uncommented,
)
from cylx.io.columns import named_coordinates
from cylx.io.row_format import LONGEST_LINE

if TYPE_CHECKING:
    import io
    from collections.abc import Iterator, Sequence

_SAMPLE = 100
"""Lines that are looked at, besides comments."""
_MOST_COLUMNS = 1000
_AROUND = "\"',; "
"""What may stand around a name."""
_COUNTED: tuple[list[str], ...] = ([], ["points"], ["pts"], ["rows"])
"""What may stand behind a count."""
_PTX = [3, 3, 3, 3, 4, 4, 4, 4]
"""Numbers in the lines below the two counts of a PTX file: the scanner's place and axes, and a matrix."""


@dataclass(frozen=True, slots=True)
class Top:
    """The lines up to the first row, and the rows below that were looked at.

    Parameters
    ----------
    lines : int
        Number of lines before the first row.
    delimiter : str or None
        Separator of the columns; None for white space.
    header : str
        The line that may hold names, as it is in the file.
    commented : bool
        Whether that line is a comment.
    count : int or None
        The number of rows promised above the first row.
    rows : list of list of str
        Columns of the first rows.
    """

    lines: int
    delimiter: str | None
    header: str
    commented: bool
    count: int | None
    rows: list[list[str]]


@dataclass(frozen=True, slots=True)
class _Line:
    """A line: its number, its text, and its text without comments."""

    number: int
    text: str
    row: str


def read_top(lines: io.TextIOBase, place: str) -> Top:
    """Read the lines up to the first row, and some more.

    Raises
    ------
    InputError
        If there is no row of at least three numbers, or the first one is damaged.
    """
    sample = list(_sample(lines, place))
    header, commented, count = "", True, None
    wrong = words = None
    for index, line in enumerate(sample):
        if not line.row or _names_coordinates(line.text):
            if _names_coordinates(line.text) and (commented or line.row):
                header, commented = line.text, line.text.startswith(COMMENTS)
            continue
        delimiter = delimiter_of(line.row)
        columns = _cells(line.row, delimiter, header)
        numbers = sum(_is_value(column) for column in columns)
        counted = is_count(columns[0]) and [word.lower() for word in columns[1:] if word] in _COUNTED
        if counted and not _is_row_with_gaps(header, columns, delimiter):
            if count is not None:
                _refuse_ptx(sample[index + 1 :], place)
            if count:
                wrong = line
                break
            count = int(columns[0])
            continue
        if numbers < 3 and _is_row_with_gaps(header, columns, delimiter):
            rows = [_cells(one.row, delimiter, header) for one in sample[index:] if one.row]
            return Top(line.number - 1, delimiter, header, commented, count, rows)
        if numbers == 0:
            if commented or delimiter:
                header, commented = (line.text, False) if not _is_named(header) else (header, commented)
            wrong = wrong or (line if words else None)
            words = line
            continue
        if _is_title(columns, numbers, sample[index + 1 :], header):
            wrong = wrong or line
            if commented and not _is_named(header):
                header, commented = line.text, False
            continue
        rows = [_cells(one.row, delimiter, header) for one in sample[index:] if one.row]
        _check_first_row(f"{place}:{line.number}", columns)
        return Top(line.number - 1, delimiter, header, commented, count, rows)
    if wrong is not None:
        _check_first_row(f"{place}:{wrong.number}", split_row(wrong.row, delimiter_of(wrong.row)))
    raise InputError(place, "holds no row of numbers", "give rows of x y z")


def delimiter_of(row: str) -> str | None:
    """Return the separator of the columns of a row; None for white space.

    Examples
    --------
    >>> delimiter_of("1,2,3"), delimiter_of("1,5 2,5 3,5"), delimiter_of("1,5;2,5;3,5")
    (',', None, ';')
    """
    bare = re.sub(r'"[^"]*"', "0", row)
    if ";" in bare:
        return ";"
    if "\t" in bare:
        cells = split_row(row, "\t")
        if sum(_is_value(cell) for cell in cells) >= 3 and any(not cell or " " in cell for cell in cells):
            return "\t"
    words = bare.split()
    if "," in bare and not (len(words) >= 3 and sum(_is_value(word) for word in words) >= 3):
        return ","
    return "|" if "|" in bare else None


def names_of(header: str, columns: int, delimiter: str | None) -> list[str]:
    """Return the names of a number of columns in a line; none if it has not that many.

    Examples
    --------
    >>> names_of('// X, Y, "Scan angle"', 3, None)
    ['X', 'Y', 'Scan angle']
    """
    bare = uncommented_header(header)
    for text in dict.fromkeys((bare, header)):
        for mark in dict.fromkeys((delimiter, "\t", ";", ",", "|", None)):
            names = split_row(text, mark)
            if len(names) == columns:
                return [name.strip(_AROUND) for name in names]
        for pattern in (r"\s{2,}|\t", r"[\s,;]+"):
            names = re.split(pattern, text.strip())
            if len(names) == columns:
                return [name.strip(_AROUND) for name in names]
    return []


def words_of(header: str, delimiter: str | None) -> list[str]:
    """Return the names in a line, whatever their number."""
    bare = uncommented_header(header)
    mark = delimiter if delimiter is not None and delimiter in bare else None
    for other in (mark, *"\t;,|"):
        if other is not None and other in bare:
            return [name.strip(_AROUND) for name in split_row(bare, other)]
    return [word.strip(_AROUND) for word in split_row(bare, None)]


def uncommented_header(header: str) -> str:
    """Return a line of names without the mark of a comment, and without a word such as `Fields:` in front."""
    text = header.strip()
    for mark in COMMENTS:
        if text.startswith(mark):
            text = text.lstrip(mark[0])
            break
    text = text.strip()
    first, _, rest = text.partition(":")
    return rest.strip() if rest[:1] in (" ", "\t") and first.isalpha() else text


def _sample(lines: io.TextIOBase, place: str) -> Iterator[_Line]:
    number = seen = 0
    while seen < _SAMPLE and (line := lines.readline(LONGEST_LINE + 1)):
        number += 1
        if len(line) > LONGEST_LINE:
            raise InputError(f"{place}:{number}", "the line is too long for a row", "give every point a line")
        text = line.strip()
        row = uncommented(text)
        if row or _names_coordinates(text):
            yield _Line(number, text, row)
        seen += bool(row)


@lru_cache(64)
def _names_coordinates(text: str) -> bool:
    """Return whether a line names x, y and z."""
    if not text or not any(c.isalpha() for c in text):
        return False
    bare = uncommented_header(text)
    return any(_is_named_by(bare, mark) for mark in (";", ",", "\t", "|", None) if mark is None or mark in bare)


def _is_named(header: str) -> bool:
    return bool(header) and _names_coordinates(header)


def _is_named_by(text: str, mark: str | None) -> bool:
    names = [name.strip(_AROUND) for name in split_row(text, mark)]
    return len(names) <= _MOST_COLUMNS and named_coordinates(names) is not None


def _is_value(text: str) -> bool:
    return is_number(plain_number(text))


def _is_title(columns: Sequence[str], numbers: int, below: Sequence[_Line], header: str) -> bool:
    """Return whether a line with words and numbers is a title rather than a row, perhaps a damaged one."""
    if numbers == len(columns) or _is_value(columns[0]):
        return False
    following = next((line.row for line in below if line.row), None)
    if following is None:
        return numbers < 3
    delimiter = delimiter_of(following)
    cells = _cells(following, delimiter, header)
    found = sum(map(_is_value, cells))
    if len(cells) == len(columns):
        return numbers < 3 and (found < 3 or _is_value(cells[0]))  # or else it is a row like the next, but damaged
    return numbers < 3 or found in (0, len(cells))


def _cells(row: str, delimiter: str | None, header: str) -> list[str]:
    """Return the columns of a row; an empty one at the end counts if it has a name."""
    cells = all_cells(row, delimiter)
    if cells and cells[-1] == "" and not (header and len(words_of(header, delimiter)) == len(cells)):
        cells.pop()
    return cells


def _is_row_with_gaps(header: str, columns: Sequence[str], delimiter: str | None) -> bool:
    """Return whether a line is a row some of whose values are missing: the names of the columns stand above it."""
    gaps = any(is_missing(column) for column in columns)
    return gaps and _is_named(header) and bool(names_of(header, len(columns), delimiter))


def _check_first_row(where: str, columns: Sequence[str]) -> None:
    """Refuse a row that has not three numbers, by its first fault."""
    if sum(_is_value(column) for column in columns) < 3:
        for name, column in zip(("x", "y", "z"), columns, strict=False):
            check_number(where, name, plain_number(column))
        if len(columns) < 3:
            raise InputError(where, f"expected at least 3 columns, found {len(columns)}", "give rows of x y z")
        raise InputError(where, "the row has fewer than three numbers", "give rows of x y z")
    if len(columns) > _MOST_COLUMNS:
        raise InputError(where, f"expected at most {_MOST_COLUMNS} columns, found {len(columns)}", "give rows of x y z")


def _refuse_ptx(below: Sequence[_Line], place: str) -> None:
    """Refuse a PTX file that was not recognised: its rows are seen from the scanner, whose pose is above them."""
    found = [[is_number(word) for word in line.row.split()] for line in below[: len(_PTX)]]
    if [len(words) for words in found] == _PTX and all(all(words) for words in found):
        raise InputError(place, "is PTX with something above it", "remove what is above the first count")
