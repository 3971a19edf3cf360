"""PCD: all fields of all points, in the order of the file.

The header and the bodies `ascii` and `binary` are read here and not by open3d, which reads words as zeros, invents
points that a short body lacks, and drops fields that it does not use. open3d unpacks
`binary_compressed`, in a process of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import Input, excerpt
from cylx.io.names import coordinate_names, mended_names, missing_coordinates
from cylx.io.row_format import RowFormat, short_of_points
from cylx.io.rows import read_rows
from cylx.optional.extras import is_found
from cylx.optional.open3d import unpack_columns

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Allocate = Callable[[int, np.dtype[np.void]], NDArray[np.void]]

_TYPES = {
    **{("F", size): f"<f{size}" for size in (4, 8)},
    **{(kind, size): f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)},
}
_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_ALIASES = {"COLUMNS": "FIELDS"}
_BOM = b"\xef\xbb\xbf"
_BODIES = ("ascii", "binary", "binary_compressed")
_MOST_HEADER = 1 << 20
_MOST_EXPANSION = 100  # LZF makes at most 264 bytes of 3
_MOST_COLUMNS = 1 << 12
_REMEDY = "export the file again as PCD 0.7"
_SUFFIX_REMEDY = "give it its right suffix"


@dataclass(frozen=True, slots=True)
class _Field:
    """A field of a point: `count` values of one type, starting at byte `offset`."""

    name: str
    type: str
    count: int
    offset: int

    @property
    def width(self) -> int:
        return self.count * int(self.type[2:])

    @property
    def padding(self) -> bool:
        return self.name == "_"

    def names(self) -> list[str]:
        """Return the names of the values."""
        return [self.name] if self.count == 1 else [f"{self.name}_{place}" for place in range(self.count)]


@dataclass(frozen=True, slots=True)
class _Header:
    """The contents of a header, and where it ends, in bytes and lines."""

    fields: list[_Field]
    points: int
    body: str
    size: int
    lines: int

    @property
    def width(self) -> int:
        """Bytes per point."""
        return sum(field.width for field in self.fields)

    def columns(self) -> list[tuple[str, str, _Field, int]]:
        """Return the name, type and field of each value of a point, and its index in the field, without padding."""
        kept = [
            (name, field, place)
            for field in self.fields
            if not field.padding
            for place, name in enumerate(field.names())
        ]
        names = mended_names([name for name, _, _ in kept])
        return [(name, field.type, field, place) for name, (_, field, place) in zip(names, kept, strict=True)]


def read_pcd(source: Input) -> NDArray[np.void]:
    """Read all points of a PCD file, including the NaN points of organised clouds.

    Parameters
    ----------
    source : Input

    Returns
    -------
    ndarray of shape (points,), structured
        All fields but padding (`_`), a field `f` of several values as `f_0`, `f_1` and so on; those of `DATA binary`
        are mapped from the file. Coordinates in ascii are always float64, as the text may hold more digits than the
        type.

    Raises
    ------
    InputError
        If this is not PCD, has no x, y and z, is shorter than its header says, or is damaged.
    """
    header = _read_header(source)
    if header.body == "ascii":
        return _read_text(header, source)
    if header.body == "binary":
        return _read_mapped(header, source)
    return _read_packed(header, source)


def write_pcd(file: BinaryIO, table: NDArray[np.void]) -> None:
    """Write points as PCD 0.7 with a binary body.

    Parameters
    ----------
    file : binary file
    table : ndarray of shape (points,), structured
        Integers and floats of 4 and 8 bytes.
    """
    packed = np.dtype([(name, table.dtype[name].newbyteorder("<")) for name in table.dtype.names or ()])
    kinds = [packed[name] for name in packed.names or ()]
    header = {
        "VERSION": ["0.7"],
        "FIELDS": packed.names or (),
        "SIZE": [kind.itemsize for kind in kinds],
        "TYPE": [kind.kind.upper() for kind in kinds],
        "COUNT": [1] * len(kinds),
        "WIDTH": [len(table)],
        "HEIGHT": [1],
        "VIEWPOINT": [0, 0, 0, 1, 0, 0, 0],
        "POINTS": [len(table)],
        "DATA": ["binary"],
    }
    lines = [f"{key} {' '.join(map(str, values))}\n" for key, values in header.items()]
    file.write("".join(["# .PCD v0.7 - Point Cloud Data file format\n", *lines]).encode())
    file.write(table.astype(packed).tobytes())


def _read_mapped(header: _Header, source: Input) -> NDArray[np.void]:
    held = (source.size - header.size) // header.width
    if held < header.points:
        raise short_of_points(source.place, header.points, held)
    columns = header.columns()
    dtype = np.dtype(
        {
            "names": [name for name, _, _, _ in columns],
            "formats": [kind for _, kind, _, _ in columns],
            "offsets": [field.offset + place * int(kind[2:]) for _, kind, field, place in columns],
            "itemsize": header.width,
        }
    )
    return np.asarray(np.memmap(source.file, dtype, "c", header.size, (header.points,)))


def _read_text(header: _Header, source: Input) -> NDArray[np.void]:
    """Read rows of text; padding is read like any other value, and dropped."""
    kept = [(name, kind) for name, kind, _, _ in header.columns()]
    exact = coordinate_names([name for name, _ in kept])
    wanted = iter([(name, "f8" if kind == "<f4" and name in exact else kind) for name, kind in kept])
    every = [
        (f" {field.offset + place}", "f8") if field.padding else next(wanted)
        for field in header.fields
        for place in range(field.count)
    ]
    rows = RowFormat(np.dtype(every), header.size, header.lines + 1, count=header.points, commented=True)
    return read_rows(source, rows)[[name for name, _ in kept]]


def _read_packed(header: _Header, source: Input) -> NDArray[np.void]:
    source.file.seek(header.size)
    held = source.size - header.size - 8
    sizes = np.frombuffer(source.file.read(8).ljust(8, b"\0"), "<u4").tolist()
    if held < 0 or sizes[0] > held:
        raise InputError(source.place, "the file ends within the compressed body", "get a complete copy of the file")
    if sizes[1] != header.points * header.width or sizes[1] > _MOST_EXPANSION * sizes[0]:
        fault = f"the body does not hold the {header.points} points that the header promises"
        raise InputError(source.place, fault, "get a complete copy of the file")
    from cylx.io.isolated import read_isolated  # noqa: PLC0415  starts processes

    if not is_found("open3d"):
        raise _without_open3d(source)
    flat = read_isolated(source, "pcd", start=header.size, points=header.points, width=header.width)["byte"]
    columns = header.columns()
    table = np.empty(header.points, np.dtype([(name, kind) for name, kind, _, _ in columns]))
    for name, kind, field, place in columns:
        start, width = header.points * field.offset, header.points * field.width
        table[name] = flat[start : start + width].view(kind).reshape(header.points, field.count)[:, place]
    return table


def unpack_body(source: Input, start: int, points: int, width: int, *, allocate: Allocate) -> NDArray[np.void]:
    """Unpack a compressed body, whose sizes were checked; open3d does it, in the process that is made for it.

    Parameters
    ----------
    source : Input
    start : int
        Byte at which the body begins.
    points : int
        Number of points.
    width : int
        Bytes per point.
    allocate : callable
        Makes the table of a number of bytes and a type.

    Returns
    -------
    ndarray of shape (points * width,), structured
        The field `byte`, see `unpack_columns`.

    Raises
    ------
    InputError
        If the body is damaged, or open3d does not run here.
    """
    source.file.seek(start)
    try:
        flat = unpack_columns(source.file.read(), points, width)
    except ImportError:
        raise _without_open3d(source) from None
    if flat is None:
        raise InputError(source.place, "the compressed body is damaged", "get a complete copy of the file")
    table = allocate(len(flat), np.dtype([("byte", "u1")]))
    table["byte"] = flat
    return table


def _without_open3d(source: Input) -> InputError:
    remedy = "install open3d, or save the file as DATA binary"
    return InputError(source.place, "DATA binary_compressed needs open3d", remedy)


def _read_header(source: Input) -> _Header:
    """Read the lines up to DATA and check them against each other; keys in small letters and unknown ones are fine."""
    head = source.head(_MOST_HEADER)
    said: dict[str, list[str]] = {}
    start = len(_BOM) if head.startswith(_BOM) else 0
    number = 0
    while "DATA" not in said:
        stop = head.find(b"\n", start)
        if stop < 0:
            raise _unfinished(source, said)
        number += 1
        line = head[start:stop].decode("utf-8", "backslashreplace").strip()
        start = stop + 1
        words = line.split()
        if not words or line.startswith("#"):
            continue
        key = _ALIASES.get(words[0].upper(), words[0].upper())
        if key in _KEYS:
            said[key] = words[1:] if key == "FIELDS" else line.partition("#")[0].split()[1:]
        elif not said:
            raise InputError(source.place, "is not PCD: it does not begin with its header", _SUFFIX_REMEDY)
        elif not words[0].isidentifier() or (len(words) < 2 and not words[0].isupper()):
            fault = f"{excerpt(' '.join(words))} is not a line of a PCD header"
            raise InputError(f"{source.place}:{number}", fault, _REMEDY)
    body = " ".join(said["DATA"]).lower()
    if body not in _BODIES:
        raise InputError(
            f"{source.place}:{number}", f"unknown DATA {excerpt(body)}", f"use one of {', '.join(_BODIES)}"
        )
    return _Header(_fields(said, source.place), _points(said, source.place), body, start, number)


def _unfinished(source: Input, said: dict[str, list[str]]) -> InputError:
    if not said:
        return InputError(source.place, "is not PCD: it does not begin with its header", _SUFFIX_REMEDY)
    if source.size > _MOST_HEADER:
        return InputError(source.place, "the PCD header has no end", _REMEDY)
    return InputError(source.place, "the file ends within the PCD header", "get a complete copy of the file")


def _fields(said: dict[str, list[str]], place: str) -> list[_Field]:
    names = said.get("FIELDS", [])
    if len(names) != len(said.get("SIZE", names)):  # a `#` may begin a comment, or belong to a name
        names = list(takewhile(lambda name: not name.startswith("#"), names))
    missing = missing_coordinates(names)
    if missing:
        raise InputError(place, f"FIELDS has no {missing}", "give a PCD with x, y and z")
    kinds = said.get("TYPE", [])
    sizes = _numbers(said, "SIZE", place)
    counts = _numbers(said, "COUNT", place) if "COUNT" in said else [1] * len(names)
    for key, values in (("SIZE", sizes), ("TYPE", kinds), ("COUNT", counts)):
        if len(values) != len(names):
            raise InputError(place, f"{len(names)} FIELDS, but {key} has {len(values)}", _REMEDY)
    most = max(sum(counts), len(names))
    if most > _MOST_COLUMNS:
        raise InputError(place, f"expected at most {_MOST_COLUMNS} values per point, found {most}", _REMEDY)
    coordinates = coordinate_names(names)
    fields: list[_Field] = []
    offset = 0
    for name, kind, size, count in zip(names, kinds, sizes, counts, strict=True):
        if (kind.upper(), size) not in _TYPES:
            raise InputError(
                place, f"field {excerpt(name)} has the unknown type {excerpt(kind)} of size {size}", _REMEDY
            )
        if name in coordinates and count != 1:
            raise InputError(place, f"field {name} has {count} values", "give a PCD with one x, y and z per point")
        fields.append(_Field(name, _TYPES[kind.upper(), size], count, offset))
        offset += fields[-1].width
    return fields


def _points(said: dict[str, list[str]], place: str) -> int:
    counts = [_numbers(said, key, place) for key in ("WIDTH", "HEIGHT", "POINTS") if key in said]
    if any(len(count) != 1 for count in counts) or not ("POINTS" in said or len(counts) == 2):
        raise InputError(place, "the PCD header does not say how many POINTS there are", _REMEDY)
    *grid, last = (count[0] for count in counts)
    points = last if "POINTS" in said else grid[0] * last
    if len(grid) == 2 and grid[0] * grid[1] != points:
        raise InputError(place, f"WIDTH x HEIGHT is {grid[0] * grid[1]}, but POINTS is {points}", _REMEDY)
    if points == 0:
        raise InputError(place, "holds no points", "give a file with points")
    return points


def _numbers(said: dict[str, list[str]], key: str, place: str) -> list[int]:
    words = said.get(key, [])
    for word in words:
        if not (word.isascii() and word.isdecimal() and len(word) < 19):
            raise InputError(place, f"{key} is {excerpt(' '.join(words))}, not made of counts", _REMEDY)
    return [int(word) for word in words]
