"""PCD: all fields of all points, in the order of the file.

The header and the bodies `ascii` and `binary` are read here and not by open3d, which reads words as zeros, invents
points that a short body lacks, and drops fields that it does not use. open3d unpacks
`binary_compressed`, in a process of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import Input
from cylx.io.names import coordinate_names
from cylx.io.pcd_header import Header, read_pcd_header
from cylx.io.row_format import RowFormat, short_of_points
from cylx.io.rows import read_rows
from cylx.optional.extras import is_found
from cylx.optional.open3d import unpack_columns

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Allocate = Callable[[int, np.dtype[np.void]], NDArray[np.void]]

_MOST_EXPANSION = 100  # LZF makes at most 264 bytes of 3


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
    header = read_pcd_header(source)
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


def _read_mapped(header: Header, source: Input) -> NDArray[np.void]:
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


def _read_text(header: Header, source: Input) -> NDArray[np.void]:
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


def _read_packed(header: Header, source: Input) -> NDArray[np.void]:
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
