"""The formats whose points are read piece by piece from their own file: LAS, LAZ, NPY, PTX and binary PLY."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.crs import las_source
from cylx.io.inputs import Input
from cylx.io.las import las_parts, las_parts_of, libraries_for
from cylx.io.las_blocks import blocks_hold, blocks_within, las_blocks
from cylx.io.las_header import kept_header, las_header
from cylx.io.npy import columns_of, map_npy
from cylx.io.ply import ply_layout
from cylx.io.ply_header import read_header
from cylx.io.ptx import ptx_columns, ptx_facts, ptx_parts, ptx_scans
from cylx.io.streamed_cloud import ROWS, StreamedCloud, opened, parts_of_raw
from cylx.optional.extras import require
from cylx.records import Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.records import Crop


def source_of(source: Input, path: Path, kind: str, **facts: Any) -> Source:  # noqa: ANN401  (of Source)
    """Say where a cloud comes from."""
    return Source(str(path).encode("utf-8", "replace").decode(), kind, source.sha256, **facts)


def _stream_las(source: Input, path: Path) -> StreamedCloud:
    facts = las_header(source)
    require(*libraries_for(facts), place=source.place, needed_by="", error=InputError)
    about = source_of(source, path, "las", **las_source(kept_header(source, facts), facts))

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

    return StreamedCloud(source_of(source, path, "npy"), count, dtype, parts)


def _stream_ply(source: Input, path: Path) -> StreamedCloud | None:
    layout = ply_layout(read_header(source))
    if layout is None:
        return None
    count, dtype, start = layout
    return StreamedCloud(source_of(source, path, "ply"), count, dtype, parts_of_raw(path, dtype, count, start))


def _stream_ptx(source: Input, path: Path) -> StreamedCloud:
    scans = ptx_scans(source)

    def parts() -> Iterator[NDArray[np.void]]:
        with opened(path, source.sha256) as file:
            yield from _of_size(ptx_parts(file, scans))

    about = source_of(source, path, "ptx", **ptx_facts(scans))
    return StreamedCloud(about, sum(one.count for one in scans), ptx_columns(scans), parts)


STREAMED: dict[str, Callable[[Input, Path], StreamedCloud | None]] = {
    "las": _stream_las,
    "npy": _stream_npy,
    "ply": _stream_ply,
    "ptx": _stream_ptx,
}
