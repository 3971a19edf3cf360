"""Clouds of formats that can only be read from their beginning, or slowly: once, and into a file of rows.

Text is read by blocks of lines. An E57 file is read scan by scan and block by block, by a process of its own under
limits. Of the others what is mapped from its file is copied piece by piece; only what is packed as a whole, such as a
compressed PCD, has to fit into memory.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cylx.errors import InputError
from cylx.io.clouds import read_table
from cylx.io.ply import text_rows
from cylx.io.ply_header import read_header
from cylx.io.row_blocks import spool_rows
from cylx.io.xyz import xyz_rows
from cylx.optional.extras import require

if TYPE_CHECKING:
    import numpy as np

    from cylx.io.inputs import Input


class Spooled(NamedTuple):
    """The rows of a cloud in a file without a header: their number, their type, and the keys of its `Source`."""

    rows: int
    dtype: np.dtype[np.void]
    facts: dict[str, Any]


def spool_cloud(source: Input, kind: str, scan: int | None, spool: Path, size: int) -> Spooled:
    """Read a cloud once, and write its table to a file.

    Parameters
    ----------
    source : Input
    kind : str
        Its format, one of `FORMATS`.
    scan : int, optional
        Number of the scan of an E57 or PTX file to read; by default all.
    spool : Path
        The file.
    size : int
        Rows that are written at a time.

    Raises
    ------
    InputError
        If it cannot be read, is damaged, or has columns that are lists.
    """
    if kind == "xyz":
        rows, columns = xyz_rows(source)
        with spool.open("wb") as file:
            count = spool_rows(source, rows, file, size)
        return Spooled(count, rows.dtype, {"notes": columns.notes, "doubts": columns.doubts})
    if kind == "e57":
        return _spool_e57(source, scan, spool)
    if kind == "ply" and (header := read_header(source)).text and not header.vertex.has_lists:
        rows = text_rows(header)
        with spool.open("wb") as file:
            return Spooled(spool_rows(source, rows, file, size), rows.dtype, {})
    table, facts = read_table(source, kind, scan)
    if table.dtype.hasobject:
        raise InputError(source.place, "has list properties, and cannot be cut into tiles", "write it without them")
    with spool.open("wb") as file:
        for start in range(0, len(table), size):
            file.write(table[start : start + size].tobytes())
    return Spooled(len(table), table.dtype, facts)


def _spool_e57(source: Input, scan: int | None, spool: Path) -> Spooled:
    from cylx.io.crs import e57_source  # noqa: PLC0415  for this alone
    from cylx.io.isolated import spool_isolated  # noqa: PLC0415  starts processes

    require("pye57", place=source.place, needed_by="", error=InputError, imported=False)
    with spool.open("w+b") as file:
        count, dtype = spool_isolated(source, "e57", file, scan=scan)
    return Spooled(count, dtype, e57_source(source))
