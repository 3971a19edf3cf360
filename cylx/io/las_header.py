"""The header of a LAS file, checked for consistency and against the size of the file before laspy reads it."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylx.errors import InputError
from cylx.io.row_format import short_of_points

if TYPE_CHECKING:
    from cylx.io.inputs import Input

_LEAST = 227  # bytes of a header before version 1.3
_WITH_COUNT = 375  # bytes of a header of version 1.4, with counts of eight bytes
_LAST_FORMAT = 10
_VLR, _EVLR = 54, 60  # bytes in front of the data of each record
_LARGEST_EVLR = 1 << 20
_MOST_STEPS = 2.0**31  # from the offset, in steps of the scale
_REMEDY = "get a complete copy of the file"


@dataclass(frozen=True, slots=True)
class LasFacts:
    """The contents of a header.

    Parameters
    ----------
    points : int
        Number of points.
    compressed : bool
        Whether they are compressed, as in LAZ.
    start : int
        Byte at which the points begin.
    evlrs : tuple of int
        Byte at which the records after the points begin, and their number.
    uncounted : bool
        Whether the header says 0 points, and the size of the file says how many there are.
    """

    points: int
    compressed: bool
    start: int
    evlrs: tuple[int, int]
    uncounted: bool = False

    @property
    def doubts(self) -> tuple[tuple[str, str], ...]:
        """What may have been read wrongly, and the remedy."""
        if not self.uncounted:
            return ()
        return ((f"the header counts 0 points; {self.points} fit into the file and were read", "export it again"),)


def las_header(source: Input) -> LasFacts:
    """Read the header of a LAS and check it.

    Raises
    ------
    InputError
        If this is not LAS, holds no points, contradicts itself, or is shorter than its header says.
    """
    place, head = source.place, source.head(_WITH_COUNT)
    if head[:4] != b"LASF":
        raise InputError(place, "is not LAS: it does not begin with LASF", "give it its right suffix")
    if len(head) < _LEAST:
        raise InputError(place, "the file ends within the LAS header", _REMEDY)
    minor = head[25]
    size, start, vlrs = struct.unpack_from("<HII", head, 94)
    kind, width, points = struct.unpack_from("<BHI", head, 104)
    evlrs = (0, 0)
    if minor >= 4:
        if len(head) < _WITH_COUNT:
            raise InputError(place, "the file ends within the LAS header", _REMEDY)
        evlrs = struct.unpack_from("<QI", head, 235)
        points = struct.unpack_from("<Q", head, 247)[0] or points
    if head[24] != 1 or kind & 0x3F > _LAST_FORMAT:
        fault = f"LAS {head[24]}.{minor} with point format {kind & 0x3F} is not known"
        raise InputError(place, fault, "export the file again as LAS 1.2 or 1.4")
    if start > source.size:
        raise InputError(place, "the file ends within the LAS header", _REMEDY)
    if size < (_WITH_COUNT if minor >= 4 else _LEAST):
        raise InputError(place, f"the LAS header of {size} bytes is too short for LAS 1.{minor}", _REMEDY)
    if size + _VLR * vlrs > start:
        raise InputError(place, f"the LAS header has no room for its {vlrs} records", _REMEDY)
    compressed = kind & 0xC0 == 0x80
    end = evlrs[0] if evlrs[1] and start <= evlrs[0] <= source.size else source.size
    uncounted = points == 0
    if uncounted and not compressed and width and (end - start) % width == 0:  # its writer was stopped
        points = (end - start) // width
    if points == 0:
        raise InputError(place, "holds no points", "give a file with points")
    _check_scales(head, place)
    if not compressed and (held := (source.size - start) // max(width, 1)) < points:
        raise short_of_points(place, points, held)
    return LasFacts(points, compressed, start, evlrs, uncounted)


def kept_header(source: Input, facts: LasFacts) -> bytes:
    """Return the parts of a LAS file that are kept when it is written again with other points.

    These are the header, all records before the points, and the small records after them. Waveforms and the index of a
    COPC file are left out, as they would be wrong afterwards.
    """
    source.file.seek(0)
    head = bytearray(source.file.read(facts.start))
    kept, tail = 0, bytearray()
    place, count = facts.evlrs
    for _ in range(count):
        if place + _EVLR > source.size:
            break
        source.file.seek(place)
        record = source.file.read(_EVLR)
        length = struct.unpack_from("<Q", record, 20)[0]
        if length <= _LARGEST_EVLR and place + _EVLR + length <= source.size and record[2:6] != b"copc":
            kept += 1
            tail += record + source.file.read(length)
        place += _EVLR + length
    if head[25] >= 4:
        struct.pack_into("<QI", head, 235, facts.start if kept else 0, kept)
    return bytes(head + tail)


def _check_scales(head: bytes, place: str) -> None:
    scales, offsets = struct.unpack_from("<3d", head, 131), struct.unpack_from("<3d", head, 155)
    for axis, scale, offset in zip("xyz", scales, offsets, strict=True):
        if scale == 0.0 or not math.isfinite(scale * _MOST_STEPS):
            raise InputError(place, f"the scale of {axis} is {scale:g}", "export the file again")
        if not math.isfinite(abs(offset) + abs(scale) * _MOST_STEPS):
            raise InputError(place, f"the offset of {axis} is {offset:g}", "export the file again")
