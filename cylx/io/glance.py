"""What a large file says of itself, and some pieces of it: enough to describe a cloud without reading all of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cylx.errors import InputError
from cylx.io.crs import las_source
from cylx.io.existing import has_file
from cylx.io.formats import cloud_name, cloud_suffix, recognise
from cylx.io.las import las_parts_of, las_pieces, libraries_for
from cylx.io.las_blocks import las_blocks
from cylx.io.las_header import kept_header, las_header
from cylx.io.names import coordinate_names
from cylx.io.npy import columns_of, map_npy
from cylx.io.ply import ply_layout
from cylx.io.ply_header import read_header
from cylx.io.streamed_cloud import opened
from cylx.optional.extras import require
from cylx.records import PointCloud, Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.io.inputs import Input

PIECES, ROWS = 16, 1 << 16
"""Pieces that are read, and rows of each."""


class Glance(NamedTuple):
    """What was seen of a file.

    Parameters
    ----------
    rows : int
        Number of its rows.
    dtype : dtype
        Its columns.
    bounds : ndarray of shape (2, 3) or None
        Least and greatest coordinates, as its header says.
    sample : PointCloud
        The finite points of some pieces, evenly spread over the file.
    """

    rows: int
    dtype: np.dtype[np.void]
    bounds: NDArray[np.float64] | None
    sample: PointCloud


def glance_at(path: str | Path) -> Glance | None:
    """Look at a LAS, LAZ, NPY or binary PLY file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Glance or None
        None if it is of another format, or packed.

    Raises
    ------
    InputError
        If it cannot be read, or has no finite point in the pieces.
    """
    if str(path) == "-" or cloud_name(path) != str(path) or not has_file(path):
        return None
    with opened(path, "") as source:
        kind = recognise(source, cloud_suffix(path))
        found = {"las": _of_las, "npy": _of_npy, "ply": _of_ply}.get(kind, lambda _: None)(source)
        if found is None:
            return None
        rows, bounds, pieces, facts = found
        points = np.concatenate([_coordinates(piece) for piece in pieces])
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            raise InputError(source.place, "no point has finite coordinates", "export the file again")
        name = str(path).encode("utf-8", "replace").decode()
        return Glance(rows, pieces[0].dtype, bounds, PointCloud(points, source=Source(name, kind, "", **facts)))


_Found = tuple[int, "NDArray[np.float64] | None", "list[NDArray[np.void]]", "dict[str, Any]"]


def _starts(rows: int) -> list[tuple[int, int]]:
    """Return first and last row of each piece, evenly spread."""
    count = min(PIECES, -(-rows // ROWS))
    firsts = np.linspace(0, max(rows - ROWS, 0), count).astype(int).tolist()
    return [(first, min(first + ROWS, rows)) for first in firsts]


def _of_las(source: Input) -> _Found | None:
    facts = las_header(source)
    require(*libraries_for(facts), place=source.place, needed_by="", error=InputError)
    blocks = las_blocks(source, facts)
    about = las_source(kept_header(source, facts), facts)
    if not blocks:
        return facts.points, None, las_pieces(source, _starts(facts.points)), about
    bounds = np.array([[block.low for block in blocks], [block.high for block in blocks]])
    corners = np.array([bounds[0].min(axis=0), bounds[1].max(axis=0)])
    if blocks[0].size == 0:
        return facts.points, corners, las_pieces(source, _starts(facts.points)), about
    few = blocks[:: -(-len(blocks) // PIECES)]
    return facts.points, corners, [part for _, part in las_parts_of(source, few)], about


def _of_npy(source: Input) -> _Found | None:
    if source.head(6) != b"\x93NUMPY":
        return None
    array = map_npy(source)
    pieces = [columns_of(np.array(array[first:last]), source.place) for first, last in _starts(len(array))]
    return len(array), None, pieces, {}


def _of_ply(source: Input) -> _Found | None:
    layout = ply_layout(read_header(source))
    if layout is None:
        return None
    count, dtype, start = layout
    table = np.memmap(source.file, dtype, "c", start, (count,))
    return count, None, [np.array(table[first:last]) for first, last in _starts(count)], {}


def _coordinates(table: NDArray[np.void]) -> NDArray[np.float64]:
    names = coordinate_names(table.dtype.names or ())
    with np.errstate(all="ignore"):  # a signalling NaN is a NaN
        return np.column_stack([table[name].astype(np.float64) for name in names])
