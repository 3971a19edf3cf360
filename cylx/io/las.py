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
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from cylx.io.inputs import Input

    Allocate = Callable[[int, np.dtype[np.void]], NDArray[np.void]]

_CHUNK = 1 << 19  # points read at a time, at the most, ...
_BUFFER = 1 << 25  # ... and bytes
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


def libraries_for(facts: LasFacts) -> tuple[str, ...]:
    """Return the libraries that a file needs."""
    return ("laspy", "lazrs") if facts.compressed else ("laspy",)


def _parts(source: Input, facts: LasFacts) -> Iterator[NDArray[np.void]]:
    """Yield the points in pieces."""
    import laspy  # noqa: PLC0415  an extra

    file = _mended_file(source, facts)
    backend = None
    if facts.compressed:
        parallel = check_chunks(source, facts, laspy.LasHeader.read_from(file))
        backend = laspy.LazBackend.LazrsParallel if parallel else laspy.LazBackend.Lazrs
        file.seek(0)
    with laspy.open(file, closefd=False, read_evlrs=False, laz_backend=backend) as reader:
        header = reader.header
        columns = las_dimensions(header.point_format)
        types = [*((axis, np.dtype("f8")) for axis in "xyz"), *((one.name, one.type) for one in columns)]
        for chunk in reader.chunk_iterator(min(_CHUNK, max(_BUFFER // header.point_format.size, 1))):
            part = np.empty(len(chunk), np.dtype(types))
            for axis, scale, offset in zip("xyz", header.scales, header.offsets, strict=True):
                part[axis] = chunk[axis.upper()] * np.float64(scale) + np.float64(offset)
            for one in columns:
                part[one.name] = one.of(np.asarray(chunk[one.dimension]))
            yield part


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
