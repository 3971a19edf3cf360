"""The cells of a row of text: split at delimiters, without comments, and read as numbers."""

from __future__ import annotations

import csv
import re
from typing import Any

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import excerpt

COMMENTS = ("#", "//")
DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?", re.ASCII)
_NOT_A_NUMBER = re.compile(r"[-+]?(nan\(\w*\)|1\.#(IND|QNAN|SNAN|INF|R)0*)", re.IGNORECASE)
"""How Windows wrote NaN and infinity …"""
SHARP = "1.#"
"""… and what begins no comment therefore."""
_MOST_DIGITS = 18
_MISSING = frozenset(("", "NA", "N/A", "NULL", "NONE"))


def uncommented(line: str) -> str:
    """Remove a comment from a line, and white space from both ends.

    Examples
    --------
    >>> uncommented(" 1 2 3  // the corner")
    '1 2 3'
    """
    if SHARP in line:
        line = _NOT_A_NUMBER.sub("nan", line)
    for mark in COMMENTS:
        line = line.partition(mark)[0]
    return line.strip()


def split_row(line: str, delimiter: str | None) -> list[str]:
    """Split a row into its columns; a delimiter at the end adds no column, and one in quotes separates none.

    Examples
    --------
    >>> split_row("1; 2;3;", ";")
    ['1', '2', '3']
    >>> split_row('1,"wall, outer",3', ",")
    ['1', 'wall, outer', '3']
    """
    columns = all_cells(line, delimiter)
    return columns[:-1] if columns and columns[-1] == "" else columns


def is_count(text: str) -> bool:
    """Return whether a text is a number of rows."""
    return text.isascii() and text.isdecimal() and len(text) <= _MOST_DIGITS


def is_missing(text: str) -> bool:
    """Return whether a cell says that there is no value."""
    return text in _MISSING or text.upper() in _MISSING


def plain_number(text: str) -> str:
    """Return a number with a point for a comma, and with the NaN of Windows as others write it.

    Examples
    --------
    >>> plain_number("1,5"), plain_number("-nan(ind)"), plain_number("1.5")
    ('1.5', 'nan', '1.5')
    """
    if text[:1] == "'" == text[-1:]:
        text = text[1:-1]
    if DECIMAL_COMMA.fullmatch(text):
        return text.replace(",", ".")
    return "nan" if _NOT_A_NUMBER.fullmatch(text) else text


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


def all_cells(line: str, delimiter: str | None) -> list[str]:
    """Split a row into its columns, with an empty one behind a delimiter at the end."""
    if '"' in line:
        if delimiter is None:
            return [quoted or plain for quoted, plain in re.findall(r'"([^"]*)"|(\S+)', line)]
        try:
            (row,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
        except csv.Error:
            row = line.split(delimiter)
        return [column.strip() for column in row]
    return line.split() if delimiter is None else [column.strip() for column in line.split(delimiter)]
