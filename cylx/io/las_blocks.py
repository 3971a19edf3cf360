"""Where the points of a LAS, LAZ or COPC file are, as far as its header and index say, so that not all need be read."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cylx.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from cylx.io.inputs import Input
    from cylx.io.las_header import LasFacts
    from cylx.records import Crop

_BOUNDS = 179  # byte of the header: max x, min x, max y and so on
_COPC, _INFO = 375, 429  # bytes of the first record of a COPC file, and of its data
_PAGE_ENTRY = struct.Struct("<4iQ2i")  # level, x, y, z of a node; byte, bytes and points of its chunk
_MOST_NODES, _DEEPEST = 1 << 24, 64
_REMEDY = "get a complete copy of the file"


class Block(NamedTuple):
    """Some rows that follow each other, and the box that holds their points: two corners of three coordinates.

    If they are a chunk of their own, its first byte and its size come with them.
    """

    start: int
    rows: int
    low: tuple[float, ...]
    high: tuple[float, ...]
    place: int = 0
    size: int = 0


def las_blocks(source: Input, facts: LasFacts) -> tuple[Block, ...]:
    """Return the blocks of a file in the order of its rows: the nodes of a COPC file, or else one for the whole file.

    Parameters
    ----------
    source : Input
    facts : LasFacts

    Returns
    -------
    tuple of Block
        None if the header or the index does not say where all points are.

    Raises
    ------
    InputError
        If the index of a COPC file is damaged.
    """
    head = source.head(_INFO + 160)
    if head[_COPC + 2 : _COPC + 6] == b"copc" and len(head) == _INFO + 160:
        found = _nodes(source, head, _step(head))
        return found if sum(block.rows for block in found) == facts.points else ()
    bounds = struct.unpack_from("<6d", head, _BOUNDS)
    low, high = np.array(bounds[1::2]) - _step(head), np.array(bounds[::2]) + _step(head)
    if not (np.isfinite(bounds).all() and (low <= high).all() and np.any(bounds)):
        return ()
    return (Block(0, facts.points, tuple(low.tolist()), tuple(high.tolist())),)


def blocks_within(blocks: Iterable[Block], crop: Crop) -> list[Block]:
    """Return the blocks that a box reaches.

    Parameters
    ----------
    blocks : iterable of Block
    crop : pair of triples of float or None
        Smallest and largest coordinates; None sets no bound.
    """
    return [
        block
        for block in blocks
        if all(
            (first is None or high >= first) and (last is None or low <= last)
            for low, high, first, last in zip(block.low, block.high, *crop, strict=True)
        )
    ]


def blocks_hold(blocks: tuple[Block, ...], table: NDArray[np.void]) -> bool:
    """Return whether the first points of a file are where it says: some programs do not fill in the bounds."""
    start = 0
    for block in blocks:
        part = table[start : start + block.rows]
        for axis, low, high in zip("xyz", block.low, block.high, strict=True):
            if ((part[axis] < low) | (part[axis] > high)).any():
                return False
        start += block.rows
        if start >= len(table):
            break
    return True


def _step(head: bytes) -> NDArray[np.float64]:
    """Return by how much a stored coordinate may differ from what the bounds were made of, shape (3,)."""
    return np.abs(struct.unpack_from("<3d", head, 131))


def _nodes(source: Input, head: bytes, step: NDArray[np.float64]) -> tuple[Block, ...]:
    """Return the nodes of a COPC file; their chunks follow each other in the file as their rows do."""
    *center, half, _, place, size = struct.unpack_from("<5d2Q", head, _INFO)
    corner = np.array(center) - half
    entries = sorted(_entries(source, place, size))
    blocks, start = [], 0
    for place, size, count, (level, *key) in entries:
        side = 2.0 * half / 2.0**level
        low = corner + side * np.array(key)
        corners = tuple((low - step).tolist()), tuple((low + side + step).tolist())
        blocks.append(Block(start, count, *corners, place, size))
        start += count
    return tuple(blocks)


def _entries(source: Input, place: int, size: int) -> Iterator[tuple[int, int, int, tuple[int, ...]]]:
    """Yield byte, size and points of the chunk of each node that has points, and the level and place of the node."""
    damaged = InputError(source.place, "the index of its COPC nodes is damaged", _REMEDY)
    pages, seen = [(place, size)], 0
    while pages:
        place, size = pages.pop()
        seen += size // _PAGE_ENTRY.size
        if size < 0 or size % _PAGE_ENTRY.size or place + size > source.size or seen > _MOST_NODES:
            raise damaged
        source.file.seek(place)
        for *node, at, length, count in _PAGE_ENTRY.iter_unpack(source.file.read(size)):
            if count == -1:
                pages.append((at, length))
            elif count > 0:
                if not (0 <= node[0] < _DEEPEST and 0 < length <= source.size - at):
                    raise damaged
                yield at, length, count, tuple(node)
