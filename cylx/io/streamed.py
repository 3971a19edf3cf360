"""Clouds that are read piece by piece, as often as needed, so that they need not fit into memory."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

import numpy as np

from cylx.errors import InputError, OutputError
from cylx.io.clouds import check_scan
from cylx.io.formats import cloud_name, cloud_suffix, recognise
from cylx.io.inputs import Input, check_unchanged, open_input, printable, sha256_of, stamp_of
from cylx.io.packed import unpacked
from cylx.io.spooled import spool_cloud
from cylx.io.streamed_cloud import BARE, ROWS, StreamedCloud, opened, parts_of_raw
from cylx.io.streamed_formats import STREAMED, source_of
from cylx.records import Selection, Source

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Piece = TypeVar("Piece")


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
        direct = source is file and scan is None and kind in STREAMED
        streamed = STREAMED[kind](source, Path(path)) if direct else None
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
    return StreamedCloud(Source("<array>", "array"), rows, BARE, parts_of_raw(spool, BARE, rows))


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
    about = source_of(source, Path(path), kind, selection=Selection(scan=scan), **facts)
    return StreamedCloud(about, rows, dtype, parts_of_raw(spool, dtype, rows))
