"""PTX: the scans of a project as text, each a grid of points as its scanner sees them, with the pose of the scanner.

Each scan begins with its numbers of columns and rows, the place and the axes of the scanner, and a matrix that takes
rows x y z 1 to the coordinates of the project. Then come the points: x y z in metres, an intensity, and perhaps a
colour. Where nothing was measured, x y z are 0 0 0.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.formats import PTX_HEADER, PTX_NUMBER
from cylx.io.inputs import excerpt

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_ROWS = 1 << 18
"""Rows read at a time."""
_WIDTHS = {3: (), 4: ("intensity",), 6: ("red", "green", "blue"), 7: ("intensity", "red", "green", "blue")}
"""What follows x y z, by the number of columns."""
_LEAST_ROW = 6  # bytes of `0 0 0` and a line end
_LONGEST_LINE = 1 << 12
_MOST_SCANS = 1 << 16
_ORTHOGONAL = 1e-3
_REMEDY = "get a complete copy of the file"
_AGAIN = "export the file again"


@dataclass(frozen=True, slots=True)
class PtxScan:
    """A scan of a file.

    Parameters
    ----------
    number : int
        From 0.
    count : int
        Number of its rows.
    width : int
        Columns of a row, a key of the table of columns.
    start : int
        Byte at which its rows begin.
    line : int
        Number of that line in the file, from 1.
    matrix : ndarray of shape (4, 4)
        What a row x y z 1 is multiplied by.
    skewed : bool
        Whether the matrix is more than a rotation and a move.
    gridded : bool
        Whether it has columns and rows, as a scanner sees them. Programs that write points of several scans as one
        write one column, and no pose.
    """

    number: int
    count: int
    width: int
    start: int
    line: int
    matrix: NDArray[np.float64]
    skewed: bool
    gridded: bool


def read_ptx(source: Input, scan: int | None = None) -> tuple[NDArray[np.void], dict[str, Any]]:
    """Read the points of a PTX file, scan by scan.

    Parameters
    ----------
    source : Input
    scan : int, optional
        The only scan to read, from 0; by default all.

    Returns
    -------
    table : ndarray of shape (rows,), structured
        `x`, `y`, `z` in float64, in the coordinates of the project, NaN where nothing was measured; `scan`, the number
        of the scan; and `intensity`, `red`, `green` and `blue` if a scan has them, 0 in scans that lack them.
    facts : dict
        Keys of a `Source`: the unit, which is the metre, the places of the scanners, and what is in doubt.

    Raises
    ------
    InputError
        If this is not PTX, is damaged or cut short, or lacks the scan.
    """
    scans = ptx_scans(source, scan)
    table = np.empty(sum(one.count for one in scans), ptx_columns(scans))
    done = 0
    for part in ptx_parts(source, scans):
        table[done : done + len(part)] = part
        done += len(part)
    return table, ptx_facts(scans)


def ptx_facts(scans: list[PtxScan]) -> dict[str, Any]:
    """Return the keys of a `Source` for scans."""
    skewed = [str(one.number) for one in scans if one.skewed]
    which = f"scan {', '.join(skewed[:5])}{' and others' if len(skewed) > 5 else ''}"
    fault = f"the matrix of {which} is more than a rotation and a move: nothing is as large and as round as it was"
    places: list[tuple[float, float, float] | None] = [None] * (max(one.number for one in scans) + 1)
    for one in scans:
        if one.gridded or not np.array_equal(one.matrix, np.eye(4)):
            x, y, z = (float(side) for side in one.matrix[3, :3])
            places[one.number] = (x, y, z)
    return {"units": "m", "stations": tuple(places), "doubts": ((fault, _AGAIN),) if skewed else ()}


def ptx_columns(scans: list[PtxScan]) -> np.dtype[np.void]:
    """Return the columns of the table of scans."""
    held = {name for one in scans for name in _WIDTHS[one.width]}
    kinds = {"intensity": "f4", "red": "u1", "green": "u1", "blue": "u1"}
    others = [(name, kind) for name, kind in kinds.items() if name in held]
    return np.dtype([*((axis, "f8") for axis in "xyz"), ("scan", "u2"), *others])


def ptx_scans(source: Input, scan: int | None = None) -> list[PtxScan]:
    """Read the headers of all scans, and find where their rows begin.

    Parameters
    ----------
    source : Input
    scan : int, optional
        The only one to return.

    Raises
    ------
    InputError
        If one is damaged, or the file is cut short.
    """
    file, line = source.file, 1
    found: list[PtxScan] = []
    file.seek(len(b"\xef\xbb\xbf") if source.head(3) == b"\xef\xbb\xbf" else 0)
    while True:
        header, line = _header(source, line, len(found))
        if header is None:
            break
        if len(found) == _MOST_SCANS:
            raise InputError(source.place, f"has more than {_MOST_SCANS} scans", "give a file of fewer")
        one = _scan(source, header, line, len(found))
        found.append(one)
        _skip(source, one)
        line += one.count
    total = sum(one.count for one in found)
    if total == 0:
        raise InputError(source.place, "holds no points", "give a file with points")
    if scan is not None and scan >= len(found):
        held = f"has {len(found)} scans, from 0 to {len(found) - 1}" if len(found) > 1 else "has 1 scan"
        raise InputError(source.place, f"{held}, and none of number {scan}", "choose another, or leave --scan out")
    return found if scan is None else [found[scan]]


def ptx_parts(source: Input, scans: list[PtxScan]) -> Iterator[NDArray[np.void]]:
    """Yield the table of scans piece by piece.

    Raises
    ------
    InputError
        If a row is damaged.
    """
    dtype = ptx_columns(scans)
    for one in scans:
        source.file.seek(one.start)
        for done in range(0, one.count, _ROWS):
            count = min(_ROWS, one.count - done)
            lines = list(islice(source.file, count))
            yield _table(_numbers(lines, one, one.line + done, source.place), one, dtype, source.place)


def _header(source: Input, line: int, number: int) -> tuple[list[list[float]] | None, int]:
    """Return the numbers above the points of the next scan, None at the end, and the number of the line below."""
    rows: list[list[float]] = []
    while len(rows) < len(PTX_HEADER):
        text = source.file.readline(_LONGEST_LINE)
        if not text and not rows and number:
            return None, line
        where = f"{source.place}:{line}"
        if not text:
            fault = f"the file ends within the header of scan {number}"
            raise InputError(source.place, fault, _REMEDY)
        words = text.strip(b" \t\r\n\x1a\0").split()
        line += 1
        if not words and not rows:
            continue
        want = PTX_HEADER[len(rows)]
        if len(words) != want or not all(map(PTX_NUMBER.fullmatch, words)):
            held = excerpt(text.decode("latin-1").strip())
            fault = f"the header of scan {number} has {held} where {want} number{'s' * (want > 1)} must be"
            raise InputError(where, fault, "give a PTX file as scanners write it")
        rows.append([float(word) for word in words])
    return rows, line


def _scan(source: Input, header: list[list[float]], line: int, number: int) -> PtxScan:
    (columns,), (rows,) = header[:2]
    place = source.place
    if min(columns, rows) < 0 or columns % 1 or rows % 1:
        fault = f"scan {number} has {columns:g} x {rows:g} points"
        raise InputError(f"{place}:{line - len(PTX_HEADER)}", fault, _REMEDY)
    if columns * rows > source.size:
        fault = (
            f"scan {number} promises {columns:g} x {rows:g} points, more than a file of {source.size} bytes can hold"
        )
        raise InputError(f"{place}:{line - len(PTX_HEADER)}", fault, _REMEDY)
    matrix = np.array(header[6:])
    if not np.isfinite(matrix).all():
        raise InputError(f"{place}:{line - 4}", f"the matrix of scan {number} is not finite", _AGAIN)
    if matrix[:3, 3].any() and not matrix[3, :3].any() and matrix[3, 3] == 1.0:
        matrix = matrix.T  # written for columns instead of rows
    if matrix[:3, 3].any() or matrix[3, 3] != 1.0:
        raise InputError(f"{place}:{line - 4}", f"the matrix of scan {number} is no pose", _AGAIN)
    with np.errstate(all="ignore"):
        off = np.abs(matrix[:3, :3] @ matrix[:3, :3].T - np.eye(3)).max()
    start, count = source.file.tell(), int(columns) * int(rows)
    if count * _LEAST_ROW > source.size - start + 1:
        raise InputError(place, f"scan {number} promises {count} points, more than the file holds", _REMEDY)
    width = 3
    if count:
        first = source.file.readline(_LONGEST_LINE)
        width = len(first.split())
        source.file.seek(start)
        if width not in _WIDTHS:
            fault = f"expected x y z, an intensity and perhaps a colour, found {width} columns"
            raise InputError(f"{place}:{line}", fault, "give a PTX file as scanners write it")
    return PtxScan(number, count, width, start, line, matrix, not off < _ORTHOGONAL, min(columns, rows) > 1)


def _skip(source: Input, one: PtxScan) -> None:
    """Move behind the rows of a scan."""
    left, file = one.count, source.file
    while left:
        here = file.tell()
        block = file.read(1 << 20)
        ends = block.count(b"\n")
        if not block:
            break
        if ends >= left:
            place = -1
            marks = np.flatnonzero(np.frombuffer(block, "u1") == ord("\n"))
            place = int(marks[left - 1])
            file.seek(here + place + 1)
            return
        left -= ends
        if file.tell() >= source.size and not block.endswith(b"\n"):
            left -= 1  # the last line has no end
    if left:
        fault = f"scan {one.number} promises {one.count} points, the file holds {one.count - left}"
        raise InputError(source.place, fault, _REMEDY)


def _numbers(lines: list[bytes], one: PtxScan, first: int, place: str) -> NDArray[np.float64]:
    """Return the numbers of rows, shape (n, width)."""
    try:
        if max(map(len, lines)) <= _LONGEST_LINE:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                out = np.loadtxt(lines, dtype=np.float64, comments=None, ndmin=2, encoding="latin-1")
            if out.shape == (len(lines), one.width):
                return np.asarray(out)
    except (ValueError, UserWarning, DeprecationWarning):
        pass
    for line, text in enumerate(lines, first):
        words = text.split()
        if len(words) != one.width:
            fault = f"expected {one.width} columns, found {len(words)}"
            raise InputError(f"{place}:{line}", fault, _REMEDY)
        for word in words:
            if len(text) > _LONGEST_LINE or not _is_number(word):
                raise InputError(f"{place}:{line}", f"{excerpt(word.decode('latin-1'))} is not a number", _AGAIN)
    return np.array([[float(word) for word in text.split()] for text in lines])


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def _table(numbers: NDArray[np.float64], one: PtxScan, dtype: np.dtype[np.void], place: str) -> NDArray[np.void]:
    """Return rows of the table: points moved by the pose, NaN where nothing was measured."""
    out = np.zeros(len(numbers), dtype)
    points = numbers[:, :3]
    with np.errstate(all="ignore"):
        moved = points @ one.matrix[:3, :3] + one.matrix[3, :3]
    moved[~points.any(axis=1) | ~np.isfinite(points).all(axis=1)] = np.nan
    for axis, values in zip("xyz", moved.T, strict=True):
        out[axis] = values
    out["scan"] = one.number
    for name, values in zip(_WIDTHS[one.width], numbers[:, 3:].T, strict=True):
        if name != "intensity" and not ((values >= 0) & (values <= 255)).all():
            raise InputError(place, f"scan {one.number} has a {name} that is not from 0 to 255", _AGAIN)
        with np.errstate(over="ignore"):
            out[name] = values
    return out
