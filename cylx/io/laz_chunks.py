"""The compressed chunks of a LAZ file, checked before lazrs allocates memory for whatever their sizes say."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from cylx.errors import InputError

if TYPE_CHECKING:
    from cylx.io.inputs import Input
    from cylx.io.las_header import LasFacts

_LAYERED = 3  # the compressor of point formats from 6 on
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}  # of each item: point, colours, colours with infrared, waveform
_EXTRA_BYTES = 14  # an item that has a layer for each byte
_ITEMS = 34  # byte of the record at which its items begin
_MOST_EXPANSION = 1 << 12  # equal points take 1/2800 of their size
_ALWAYS_ALLOWED = 1 << 24  # bytes
_LARGEST_CHUNK = 1 << 26  # bytes of points; lazrs makes room for whole chunks if it unpacks several at a time
_REMEDY = "get a complete copy of the file"


def check_chunks(source: Input, facts: LasFacts, header: Any) -> bool:  # noqa: ANN401  (of laspy)
    """Check the table of the chunks, and the sizes within them, against the file.

    Parameters
    ----------
    source : Input
    facts : LasFacts
    header : laspy.LasHeader

    Returns
    -------
    bool
        Whether the chunks are small enough to unpack several at a time.

    Raises
    ------
    InputError
        If they contradict each other or the header, or promise more points than the file can hold.
    """
    import lazrs  # noqa: PLC0415  an extra

    data = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
    record = lazrs.LazVlr(data)
    damaged = InputError(source.place, "the table of its compressed chunks is damaged", _REMEDY)
    width = header.point_format.size
    if record.item_size() != width:
        raise damaged
    if facts.points * width > max(_MOST_EXPANSION * source.size, _ALWAYS_ALLOWED):
        fault = f"the header promises {facts.points} points, more than a file of {source.size} bytes can hold"
        raise InputError(source.place, fault, _REMEDY)
    table = _position(source, facts)
    if not facts.start + 8 <= table <= source.size - 8:
        raise damaged
    source.file.seek(table + 4)
    count, size, variable = _whole(source, 4), record.chunk_size(), record.uses_variable_size_chunks()
    fewest = -(-facts.points // max(size, 1))
    if not (0 < count <= facts.points if variable else fewest <= count <= fewest + 1):
        raise damaged
    source.file.seek(facts.start)
    chunks = lazrs.read_chunk_table(source.file, record)
    lengths = [length for _, length in chunks]
    if any(length < 0 for length in lengths) or sum(lengths) > table - facts.start - 8:
        raise damaged
    if variable and (any(points < 0 for points, _ in chunks) or sum(points for points, _ in chunks) != facts.points):
        raise damaged
    _check_layers(source, facts, data, lengths)
    largest = max(points for points, _ in chunks) if variable else size
    return bool(largest * width <= _LARGEST_CHUNK)


def _check_layers(source: Input, facts: LasFacts, record: bytes, lengths: list[int]) -> None:
    """Check that the layers of each chunk are not larger than the chunk."""
    compressor = struct.unpack_from("<H", record)[0]
    items = [struct.unpack_from("<2H", record, place) for place in range(_ITEMS, len(record) - 5, 6)]
    if compressor != _LAYERED:
        return
    layers = sum(size if kind == _EXTRA_BYTES else _LAYERS.get(kind, 0) for kind, size in items)
    first = sum(size for _, size in items) + 4  # a point as it is, and the number of points
    place = facts.start + 8
    for length in lengths:
        if length:
            source.file.seek(place + first)
            sizes = struct.unpack(f"<{layers}I", source.file.read(4 * layers).ljust(4 * layers, b"\xff"))
            if first + 4 * layers + sum(sizes) > length:
                raise InputError(source.place, "a compressed chunk is damaged", _REMEDY)
        place += length


def _position(source: Input, facts: LasFacts) -> int:
    """Return the byte at which the table begins."""
    source.file.seek(facts.start)
    table = _whole(source, 8)
    if table == -1:  # unknown when the points were written
        source.file.seek(source.size - 8)
        table = _whole(source, 8)
    return table


def _whole(source: Input, size: int) -> int:
    return int.from_bytes(source.file.read(size), "little", signed=size == 8)
