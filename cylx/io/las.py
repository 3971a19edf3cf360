"""LAS and LAZ: all dimensions of all points, read by laspy in pieces."""

from __future__ import annotations

import io
import logging
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import numpy as np

from cylx.errors import InputError
from cylx.io.las_header import LasFacts, las_header
from cylx.io.las_mend import Spliced, mended
from cylx.io.laz_chunks import check_chunks
from cylx.io.names import mended_names
from cylx.io.row_format import short_of_points
from cylx.optional.extras import require

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from cylx.io.inputs import Input
    from cylx.io.las_blocks import Block

    Allocate = Callable[[int, np.dtype[np.void]], NDArray[np.void]]

_CHUNK = 1 << 19  # points read at a time, at the most, ...
_BUFFER = 1 << 25  # ... and bytes
_MOST_EXPANSION = 1 << 12  # equal points take 1/2800 of their size
_REMEDY = "get a complete copy of the file"


@dataclass(frozen=True, slots=True)
class Dimension:
    """A column of the table: its name, its type, and the dimension, and element of it, that it comes from."""

    name: str
    type: np.dtype[Any]
    dimension: str
    element: int | None = None

    def of(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the column from the values of its dimension."""
        return values if self.element is None else values[:, self.element]


def read_las(source: Input, *, allocate: Allocate = np.empty) -> NDArray[np.void]:
    """Read all points of a LAS or LAZ file.

    Parameters
    ----------
    source : Input
    allocate : callable
        Makes the table of a number of points and a type.

    Returns
    -------
    ndarray of shape (points,), structured
        `x`, `y` and `z` in float64 with scale and offset applied, and all other dimensions including extra bytes; a
        dimension `d` of several values as `d_0`, `d_1` and so on.

    Raises
    ------
    InputError
        If this is not LAS, is damaged or shorter than its header says, or laspy or lazrs is not installed.
    """
    facts = las_header(source)
    require(*libraries_for(facts), place=source.place, needed_by="", error=InputError)
    with quiet_laspy(), _told_apart(source.place):
        return _read(source, facts, allocate)


def las_dimensions(point_format: Any) -> list[Dimension]:  # noqa: ANN401  (of laspy)
    """Return the columns of a point format besides x, y and z, in the order of the file."""
    found = []
    for one in point_format.dimensions:
        if one.name in ("X", "Y", "Z"):
            continue
        kind = np.dtype("f8") if one.is_scaled else (one.dtype or np.dtype("u1")).base  # bits have no type
        elements = range(one.num_elements) if one.num_elements > 1 and one.dtype is not None else [None]
        found += [(one.name if e is None else f"{one.name}_{e}", kind, one.name, e) for e in elements]
    names = mended_names(["x", "y", "z", *(name for name, *_ in found)])[3:]
    return [Dimension(name, *rest) for name, (_, *rest) in zip(names, found, strict=True)]


@contextmanager
def quiet_laspy() -> Iterator[None]:
    """Suppress messages of laspy on standard error that repeat its exceptions or our own checks."""
    logger = logging.getLogger("laspy")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)


def _read(source: Input, facts: LasFacts, allocate: Allocate) -> NDArray[np.void]:
    table, done = None, 0
    for part in _parts(source, facts):
        if table is None:
            table = allocate(facts.points, part.dtype)
        table[done : done + len(part)] = part
        done += len(part)
    if table is None or done < facts.points:
        raise short_of_points(source.place, facts.points, done)
    return table


def las_parts(source: Input) -> Iterator[NDArray[np.void]]:
    """Yield the table of `read_las` piece by piece, so that no more than a piece is in memory.

    Parameters
    ----------
    source : Input

    Raises
    ------
    InputError
        If this is not LAS, is damaged or shorter than its header says, or laspy or lazrs is not installed.
    """
    facts, done = las_header(source), 0
    require(*libraries_for(facts), place=source.place, needed_by="", error=InputError)
    with quiet_laspy(), _told_apart(source.place):
        for part in _parts(source, facts):
            done += len(part)
            yield part
    if done < facts.points:
        raise short_of_points(source.place, facts.points, done)


def las_parts_of(source: Input, blocks: Iterable[Block]) -> Iterator[tuple[int, NDArray[np.void]]]:
    """Yield some blocks of the table of `read_las` piece by piece; of a COPC file nothing else is read.

    Parameters
    ----------
    source : Input
    blocks : iterable of Block
        From `las_blocks`.

    Yields
    ------
    int
        The first row of a piece.
    ndarray, structured

    Raises
    ------
    InputError
        As `las_parts`.
    """
    facts = las_header(source)
    for block in blocks:
        if block.size == 0:
            start = block.start
            for part in las_parts(source):
                yield start, part
                start += len(part)
            continue
        with quiet_laspy(), _told_apart(source.place):
            part = _node(source, facts, block)
        yield block.start, part


def las_pieces(source: Input, pieces: Iterable[tuple[int, int]]) -> list[NDArray[np.void]]:
    """Return some rows of a LAS file, or of a LAZ file whose chunks have one size.

    Parameters
    ----------
    source : Input
    pieces : iterable of (int, int)
        First row of each, and the one behind its last.

    Raises
    ------
    InputError
        As `las_parts`.
    """
    facts = las_header(source)
    with quiet_laspy(), _told_apart(source.place), _reader(source, facts) as reader:
        found = []
        for first, last in pieces:
            reader.seek(first)
            found.append(_table_of(reader.read_points(last - first), reader.header))
        return found


def _node(source: Input, facts: LasFacts, block: Block) -> NDArray[np.void]:
    """Return the points of a chunk of its own; lazrs cannot jump to it, as chunks of COPC differ in size."""
    import laspy  # noqa: PLC0415  an extra
    import lazrs  # noqa: PLC0415  an extra

    header = laspy.LasHeader.read_from(_mended_file(source, facts))
    if block.rows * header.point_format.size > max(_MOST_EXPANSION * block.size, _BUFFER):
        raise InputError(source.place, "a compressed chunk is damaged", _REMEDY)
    record = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
    out = np.zeros(block.rows * header.point_format.size, np.uint8)
    source.file.seek(block.place)
    data = np.frombuffer(source.file.read(block.size), np.uint8)
    vlr = np.frombuffer(record, np.uint8)
    lazrs.decompress_points_with_chunk_table(data, vlr, out, [(block.rows, block.size)])
    points = out.view(header.point_format.dtype())
    chunk = laspy.ScaleAwarePointRecord(points, header.point_format, header.scales, header.offsets)
    return _table_of(chunk, header)


def libraries_for(facts: LasFacts) -> tuple[str, ...]:
    """Return the libraries that a file needs."""
    return ("laspy", "lazrs") if facts.compressed else ("laspy",)


def _parts(source: Input, facts: LasFacts) -> Iterator[NDArray[np.void]]:
    """Yield the points in pieces."""
    with _reader(source, facts) as reader:
        for chunk in reader.chunk_iterator(_piece(reader.header)):
            yield _table_of(chunk, reader.header)


def _piece(header: Any) -> int:  # noqa: ANN401  (of laspy)
    """Return how many points are read at a time."""
    return int(min(_CHUNK, max(_BUFFER // header.point_format.size, 1)))


@contextmanager
def _reader(source: Input, facts: LasFacts) -> Iterator[Any]:
    """Open a file by laspy, after its chunks have been checked."""
    import laspy  # noqa: PLC0415  an extra

    file = _mended_file(source, facts)
    backend = None
    if facts.compressed:
        parallel = check_chunks(source, facts, laspy.LasHeader.read_from(file))
        backend = laspy.LazBackend.LazrsParallel if parallel else laspy.LazBackend.Lazrs
        file.seek(0)
    with laspy.open(file, closefd=False, read_evlrs=False, laz_backend=backend) as reader:
        yield reader


def _table_of(chunk: Any, header: Any) -> NDArray[np.void]:  # noqa: ANN401  (of laspy)
    """Return the table of some points."""
    columns = las_dimensions(header.point_format)
    types = [*((axis, np.dtype("f8")) for axis in "xyz"), *((one.name, one.type) for one in columns)]
    part = np.empty(len(chunk), np.dtype(types))
    for axis, scale, offset in zip("xyz", header.scales, header.offsets, strict=True):
        part[axis] = chunk[axis.upper()] * np.float64(scale) + np.float64(offset)
    for one in columns:
        part[one.name] = one.of(np.asarray(chunk[one.dimension]))
    return part


def _mended_file(source: Input, facts: LasFacts) -> BinaryIO:
    """Return the file at its beginning, or one with a mended header if laspy needs one."""
    head = source.head(facts.start)
    better = mended(head, facts.points)
    source.file.seek(0)
    return source.file if better == head else cast("BinaryIO", io.BufferedReader(Spliced(better, source.file)))


@contextmanager
def _told_apart(place: str) -> Iterator[None]:
    """Turn exceptions of laspy and lazrs on a damaged file into an `InputError`."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":  # of Rust
            raise
        fault = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(place, f"broken LAS: {fault}", _REMEDY) from None
