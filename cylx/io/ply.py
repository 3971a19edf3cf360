"""PLY: read the vertices with all their properties by plyfile, and rows of text by numpy, which is faster."""

from __future__ import annotations

import io
import warnings
from itertools import chain
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from cylx.errors import InputError
from cylx.io.names import coordinate_names, mended_names
from cylx.io.ply_header import TYPES, Header, read_header
from cylx.io.row_format import RowFormat
from cylx.io.rows import read_rows

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from cylx.io.inputs import Input

ROWS_AT_A_TIME = 1 << 16  # rows written at a time


def read_ply(source: Input) -> NDArray[np.void]:
    """Read the vertices of a PLY file; later elements are ignored.

    Parameters
    ----------
    source : Input

    Returns
    -------
    ndarray of shape (vertices,), structured
        All properties, mapped from the file if it is binary. Coordinates in ascii are always float64, as the text may
        hold more digits than the type. List properties are columns of objects.

    Raises
    ------
    InputError
        If this is not PLY, has no vertices with scalar x, y and z, or is shorter than its header says.
    """
    header = read_header(source)
    if header.text and not header.vertex.has_lists:
        return read_rows(source, text_rows(header))
    return _read_with_plyfile(header, source)


def write_ply(file: BinaryIO, dtype: np.dtype[np.void], count: int, blocks: Iterable[NDArray[np.void]]) -> None:
    """Write vertices as a binary little endian PLY.

    Parameters
    ----------
    file : binary file
    dtype : dtype
        Structured, with types that PLY has.
    count : int
        Number of vertices.
    blocks : iterable of ndarray, structured
        The vertices, piece by piece.
    """
    from plyfile import PlyData, PlyElement  # noqa: PLC0415  slow to import

    def document(rows: NDArray[np.void]) -> PlyData:
        lists = [name for name in rows.dtype.names or () if rows.dtype[name].kind == "O"]
        types = {name: np.asarray(rows[name][0]).dtype.str[1:] for name in lists if len(rows)}
        element = PlyElement.describe(rows, "vertex", len_types=dict.fromkeys(lists, "u4"), val_types=types)
        return PlyData([element], byte_order="<")

    pieces = iter(blocks)
    first = next(pieces, np.empty(0, dtype))
    file.write(document(np.broadcast_to(first[:1], count)).header.encode() + b"\n")
    for block in chain([first], pieces):
        if not any(dtype[name].kind == "O" for name in dtype.names or ()):
            file.write(block.tobytes())
            continue
        part, body = document(_renamed(block)), io.BytesIO()
        part.write(body)
        file.write(body.getvalue()[len(part.header) + 1 :])


def _renamed(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Return rows with other names: plyfile cannot write the values of one that has a colon."""
    names = rows.dtype.names or ()
    out = np.empty(len(rows), np.dtype([(f"p{place}", rows.dtype[name]) for place, name in enumerate(names)]))
    for place, name in enumerate(names):
        out[f"p{place}"] = rows[name]
    return out


def ply_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the little-endian type that PLY has for a number type; integers of 8 bytes become double."""
    return np.dtype("<f8") if dtype.kind in "iu" and dtype.itemsize > 4 else dtype.newbyteorder("<")


def ply_layout(header: Header) -> tuple[int, np.dtype[np.void], int] | None:
    """Return the number and the type of the rows of the vertices, and the byte they begin at.

    None if they are text or have lists, so that they are not of one size.
    """
    if header.text or any(element.has_lists for element in header.elements):
        return None
    order = ">" if header.format == "binary_big_endian" else "<"
    properties = header.vertex.properties
    names = mended_names([item.name for item in properties])
    rows = np.dtype([(name, order + TYPES[item.type]) for name, item in zip(names, properties, strict=True)])
    start = header.size + sum(element.count * element.least_size(False) for element in header.elements[:-1])
    return header.vertex.count, rows, start


def text_rows(header: Header) -> RowFormat:
    """Return what the rows of the vertices are in an ascii file."""
    vertex = header.vertex
    names = [item.name for item in vertex.properties]
    exact = coordinate_names(names)
    types = [
        "f8" if TYPES[item.type] == "f4" and item.name in exact else TYPES[item.type] for item in vertex.properties
    ]
    skip = sum(element.count for element in header.elements[:-1])
    dtype = np.dtype(list(zip(mended_names(names), types, strict=True)))
    return RowFormat(dtype, header.size, header.lines + 1, skip, vertex.count)


def _read_with_plyfile(header: Header, source: Input) -> NDArray[np.void]:
    from plyfile import PlyData, PlyParseError  # noqa: PLC0415  slow to import

    lines = ["ply", f"format {header.format} 1.0", *(line for item in header.elements for line in item.lines())]
    source.file.seek(header.size)
    stream = _Spliced("\n".join([*lines, "end_header\n"]).encode(), source)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # about an empty list
            warnings.simplefilter("error", DeprecationWarning)  # numpy 1 reads 300 as the uchar 44
            return _with_long_integers(np.asarray(PlyData.read(stream)["vertex"].data), header)
    except (PlyParseError, ValueError, OverflowError, DeprecationWarning) as error:
        raise InputError(source.place, f"broken PLY: {error}", "get a complete copy of the file") from None


def _with_long_integers(table: NDArray[np.void], header: Header) -> NDArray[np.void]:
    """Give integers of 8 bytes, which plyfile took for doubles, their type."""
    kinds = [TYPES[item.type] for item in header.vertex.properties]
    long = [name for name, kind in zip(table.dtype.names or (), kinds, strict=True) if kind in ("i8", "u8")]
    if not long:
        return table
    types = dict(zip(table.dtype.names or (), kinds, strict=True))
    fields = [
        (name, table.dtype[name].str[0] + types[name] if name in long else table.dtype[name])
        for name in table.dtype.names or ()
    ]
    out = np.empty(len(table), np.dtype(fields))
    for name in table.dtype.names or ():
        column = table[name]
        if name in long and not header.text:
            column = np.ascontiguousarray(column).view(out.dtype[name])
        with np.errstate(all="ignore"):
            out[name] = column
    return out


class _Spliced:
    """A clean header in front of the body of a file: without comments, and without unused elements.

    After the header, positions are those of the file, so that plyfile can map the body into memory.
    """

    def __init__(self, header: bytes, source: Input) -> None:
        self.header = io.BytesIO(header)
        self.source = source

    def read(self, size: int = -1) -> bytes:
        """Read at most the rest of the file: a broken list may claim to have billions of items."""
        left = self.source.size - self.source.file.tell()
        return self.header.read(size) or self.source.file.read(left if size < 0 else min(size, left))

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  (whatever the file has)
        return getattr(self.source.file, name)
