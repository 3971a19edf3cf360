"""Clouds that are read piece by piece, as often as needed, so that they need not fit into memory."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numpy as np

from cylx.errors import InputError, OutputError
from cylx.io.clouds import check_scan
from cylx.io.crs import las_source
from cylx.io.formats import cloud_name, cloud_suffix, recognise
from cylx.io.inputs import Input, check_unchanged, open_input, printable, sha256_of, stamp_of
from cylx.io.las import las_parts, las_parts_of, libraries_for
from cylx.io.las_blocks import blocks_hold, blocks_within, las_blocks
from cylx.io.las_header import kept_header, las_header
from cylx.io.names import coordinate_names
from cylx.io.npy import columns_of, map_npy
from cylx.io.packed import unpacked
from cylx.io.ply import ply_layout
from cylx.io.ply_header import read_header
from cylx.io.ptx import ptx_columns, ptx_facts, ptx_parts, ptx_scans
from cylx.io.spooled import spool_cloud
from cylx.io.withheld import withheld_rows
from cylx.optional.extras import require
from cylx.records import PointCloud, Selection, Source

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from cylx.records import Crop

    Parts = Callable[[], Iterator[NDArray[np.void]]]

Piece = TypeVar("Piece")

ROWS = 1 << 18
"""Rows of a piece, at the most."""
_BARE = np.dtype([(axis, "f8") for axis in "xyz"])


@dataclass(frozen=True, slots=True, eq=False)
class StreamedCloud:
    """A cloud whose table is read piece by piece.

    Parameters
    ----------
    source : Source
        Where it comes from.
    rows : int
        Number of its rows.
    dtype : dtype
        Structured: its columns.
    parts : callable
        Yields the table from its beginning, in pieces of `ROWS` rows; the last one may be shorter.
    within : callable, optional
        Yields what a box reaches of the table, as far as the file says where its points are: for each piece its first
        row and its rows. Points beside the box may be among them.
    """

    source: Source
    rows: int
    dtype: np.dtype[np.void]
    parts: Parts
    within: Callable[[Crop], Iterator[tuple[int, NDArray[np.void]]]] | None = None

    def reached(self, crop: Crop | None) -> Iterator[tuple[int, NDArray[np.void]]]:
        """Yield pieces of the table, each with the number of its first row, so that all points in a box are there."""
        if crop is not None and self.within is not None:
            yield from self.within(crop)
            return
        start = 0
        for table in self.parts():
            yield start, table
            start += len(table)

    @property
    def bare(self) -> bool:
        """Whether it has nothing but coordinates, in double precision."""
        return self.dtype == _BARE

    def coordinates(self, table: NDArray[np.void]) -> NDArray[np.float64]:
        """Return the coordinates of rows, shape (n, 3), finite or not; NaN where the file marks them as withheld."""
        points = np.empty((len(table), 3))
        with np.errstate(all="ignore"):  # a signalling NaN is a NaN
            for axis, name in enumerate(coordinate_names(self.dtype.names or ())):
                points[:, axis] = table[name]
        points[withheld_rows(table, self.source.format)] = np.nan
        return points

    def few(self, count: int) -> PointCloud:
        """Return a cloud of the first rows that have coordinates, to try what can be written."""
        for table in self.parts():
            points = self.coordinates(table)
            on = np.flatnonzero(np.isfinite(points).all(axis=1))[:count]
            if len(on):
                return PointCloud(points[on], None if self.bare else table[on], None, self.source)
        raise InputError(printable(self.source.file), "no point has finite coordinates", "export the file again")


def stream_cloud(path: str | Path, spool: Path, *, scan: int | None = None, units: str | None = None) -> StreamedCloud:
    """Open a cloud to be read piece by piece.

    LAS, LAZ, NPY, PTX and binary PLY are read from their file. Other formats and packed files are read once, and from
    then on from a copy on the disk; see `cylx.io.spooled`.

    Parameters
    ----------
    path : str or Path
    spool : Path
        Where the copy may be put.
    scan : int, optional
        Number of the scan of an E57 or PTX file to read.
    units : str, optional
        Unit of its coordinates; by default what the file says.

    Returns
    -------
    StreamedCloud

    Raises
    ------
    InputError
        If it cannot be read.
    OutputError
        If the disk has no room for the copy.
    """
    packed = cloud_name(path) != str(path)
    if str(path) == "-":
        with open_input(path) as file, unpacked(file, packed=False) as source:
            return _stated(_spooled(source, path, scan, spool), units)
    stamp, digest = stamp_of(path), sha256_of(path)
    with opened(path, digest) as file, unpacked(file, packed=packed) as source:
        kind = recognise(source, cloud_suffix(path))
        direct = source is file and scan is None and kind in _STREAMED
        streamed = _STREAMED[kind](source, Path(path)) if direct else None
        if streamed is not None:
            return _stated(_guarded(streamed, path, stamp, digest), units)
        cloud = _spooled(source, path, scan, spool)
    check_unchanged(path, stamp, digest)
    return _stated(cloud, units)


def _stated(cloud: StreamedCloud, units: str | None) -> StreamedCloud:
    """Return a cloud in units that are given."""
    return cloud if units is None else replace(cloud, source=replace(cloud.source, units=units))


def stream_arrays(pieces: Iterable[ArrayLike], spool: Path) -> StreamedCloud:
    """Copy arrays of points to the disk, to be read from there piece by piece.

    Parameters
    ----------
    pieces : iterable of array_like of shape (n, 3)
    spool : Path
        Where the copy is put.

    Raises
    ------
    ValueError
        If the shape of a piece is not (n, 3).
    InputError
        If there is no point.
    """
    rows = 0
    with spool.open("wb") as file:
        for piece in pieces:
            points = np.ascontiguousarray(piece, dtype=np.float64)
            if points.ndim != 2 or points.shape[1] != 3:
                raise ValueError(f"points must have shape (n, 3), not {points.shape}")
            file.write(points.tobytes())
            rows += len(points)
    if rows == 0:
        raise InputError("<array>", "holds no points", "give some")
    return StreamedCloud(Source("<array>", "array"), rows, _BARE, _from_raw(spool, _BARE, rows))


def _guarded(cloud: StreamedCloud, path: str | Path, stamp: tuple[int, ...] | None, digest: str) -> StreamedCloud:
    """Return a cloud that checks at the end of each reading that its file is as it was."""

    def guarded(pieces: Iterator[Piece]) -> Iterator[Piece]:
        try:
            yield from pieces
        except OSError as error:
            _refuse(path, error)
        check_unchanged(path, stamp, digest)

    within = cloud.within
    return replace(
        cloud,
        parts=lambda: guarded(cloud.parts()),
        within=None if within is None else lambda crop: guarded(within(crop)),
    )


def _refuse(path: str | Path, error: OSError) -> NoReturn:
    fault = error.strerror or str(error)
    raise InputError(printable(path), f"cannot be read: {fault.lower()}", "check the path and the disk") from None


@contextmanager
def opened(path: str | Path, digest: str) -> Iterator[Input]:
    """Open a file as an input without copying it."""
    with Path(path).open("rb") as file:
        yield Input(printable(path), file, os.fstat(file.fileno()).st_size, digest, Path(path))


def _source(source: Input, path: Path, kind: str, **facts: Any) -> Source:  # noqa: ANN401  (of Source)
    return Source(str(path).encode("utf-8", "replace").decode(), kind, source.sha256, **facts)


def _stream_las(source: Input, path: Path) -> StreamedCloud:
    facts = las_header(source)
    require(*libraries_for(facts), place=source.place, needed_by="", error=InputError)
    about = _source(source, path, "las", **las_source(kept_header(source, facts), facts))

    def parts() -> Iterator[NDArray[np.void]]:
        with opened(path, source.sha256) as file:
            yield from _of_size(las_parts(file))

    def within(crop: Crop) -> Iterator[tuple[int, NDArray[np.void]]]:
        with opened(path, source.sha256) as file:
            yield from las_parts_of(file, blocks_within(blocks, crop))

    blocks, first = las_blocks(source, facts), next(las_parts(source))
    if not blocks_hold(blocks, first):
        blocks = ()
    return StreamedCloud(about, facts.points, first.dtype, parts, within if blocks else None)


def _of_size(parts: Iterator[NDArray[np.void]]) -> Iterator[NDArray[np.void]]:
    """Yield the same rows in pieces of the usual size, whatever the size of those given."""
    left: list[NDArray[np.void]] = []
    for part in parts:
        left.append(part)
        while sum(map(len, left)) >= ROWS:
            whole = left[0] if len(left) == 1 else np.concatenate(left)
            yield whole[:ROWS]
            left = [whole[ROWS:]]
    rest = np.concatenate(left)
    if len(rest):
        yield rest


def _stream_npy(source: Input, path: Path) -> StreamedCloud | None:
    if source.head(6) != b"\x93NUMPY":
        return None
    array = map_npy(source)
    count, dtype = len(array), columns_of(array[:1], source.place).dtype

    def parts() -> Iterator[NDArray[np.void]]:
        for start in range(0, count, ROWS):
            with opened(path, source.sha256) as file:  # mapped anew: what was read before need not stay in memory
                yield columns_of(np.array(map_npy(file)[start : start + ROWS]), file.place)

    return StreamedCloud(_source(source, path, "npy"), count, dtype, parts)


def _stream_ply(source: Input, path: Path) -> StreamedCloud | None:
    layout = ply_layout(read_header(source))
    if layout is None:
        return None
    count, dtype, start = layout
    return StreamedCloud(_source(source, path, "ply"), count, dtype, _from_raw(path, dtype, count, start))


def _stream_ptx(source: Input, path: Path) -> StreamedCloud:
    scans = ptx_scans(source)

    def parts() -> Iterator[NDArray[np.void]]:
        with opened(path, source.sha256) as file:
            yield from _of_size(ptx_parts(file, scans))

    about = _source(source, path, "ptx", **ptx_facts(scans))
    return StreamedCloud(about, sum(one.count for one in scans), ptx_columns(scans), parts)


_STREAMED: dict[str, Callable[[Input, Path], StreamedCloud | None]] = {
    "las": _stream_las,
    "npy": _stream_npy,
    "ply": _stream_ply,
    "ptx": _stream_ptx,
}


def _spooled(source: Input, path: str | Path, scan: int | None, spool: Path) -> StreamedCloud:
    """Write the table of a cloud to the disk."""
    kind = recognise(source, cloud_suffix(path))
    check_scan(source, kind, scan)
    try:
        rows, dtype, facts = spool_cloud(source, kind, scan, spool, ROWS)
    except MemoryError:
        raise InputError(source.place, "does not fit into memory", "thin it out, or use a larger machine") from None
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            _refuse(path, error)
        fault, remedy = "cannot be written: no space left", "free some space, or choose another folder by --scratch"
        raise OutputError(printable(spool.parent), fault, remedy) from None
    about = _source(source, Path(path), kind, selection=Selection(scan=scan), **facts)
    return StreamedCloud(about, rows, dtype, _from_raw(spool, dtype, rows))


def _from_raw(path: Path, dtype: np.dtype[np.void], rows: int, offset: int = 0) -> Parts:
    """Return what reads rows of a type from a place in a file on."""

    def parts() -> Iterator[NDArray[np.void]]:
        with path.open("rb") as file:
            file.seek(offset)
            for start in range(0, rows, ROWS):
                count = min(ROWS, rows - start)
                data = file.read(count * dtype.itemsize)
                if len(data) < count * dtype.itemsize:
                    raise InputError(printable(path), "was cut short meanwhile", "get a complete copy of the file")
                yield np.frombuffer(data, dtype)

    return parts
