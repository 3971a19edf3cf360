"""Quirks of LAS headers that laspy cannot read or write, mended in a copy of the header.

A mended header has the length of the original, so that all positions in the file stay the same.
"""

from __future__ import annotations

import io
import math
import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

if TYPE_CHECKING:
    from typing import Any

_STRINGS = (slice(26, 58), slice(58, 90))
"""The system and the software, in a header."""
_VLR, _EVLR = 54, 60
_EXTRA = (b"LASF_Spec", 4)
"""The record that describes the extra bytes of a point."""
_STRUCT = 192
"""Bytes that describe one dimension of the extra bytes."""
_NAME = slice(4, 36)
_ABOUT = slice(160, 192)
_WIDTHS = (1, 1, 2, 2, 4, 4, 8, 8, 4, 8)
"""Bytes of the types of extra bytes, from 1 on; further ones are two or three of these."""
_POINT = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Bytes of the point formats."""
_SCALED = 8 | 16
"""The bits that say that a dimension has a scale, and an offset."""
_UNUSED = b"cylx_unused"


class Record(NamedTuple):
    """A record of a header: where it begins, where its data are, and what it is."""

    start: int
    data: slice
    user: bytes
    number: int
    extended: bool = False

    @property
    def description(self) -> slice:
        """Where its description is."""
        return slice(self.data.start - 32, self.data.start)

    @property
    def user_id(self) -> slice:
        """Where its user is."""
        return slice(self.start + 2, self.start + 18)


def mended(head: bytes, points: int) -> bytes:
    """Return a header, or all that was kept of a file, that laspy can read.

    Parameters
    ----------
    head : bytes
        From the beginning of the file up to its points, and possibly the records behind them.
    points : int
        Number of points.
    """
    out = bytearray(head)
    start = struct.unpack_from("<I", out, 96)[0]
    for part in _STRINGS:
        out[part] = _ascii(out[part])
    if out[25] < 4:
        struct.pack_into("<I", out, 107, points)
    else:
        struct.pack_into("<Q", out, 247, points)
    described = False
    for record in records(head[:start]):
        out[record.user_id] = _ascii(out[record.user_id])
        out[record.description] = _ascii(out[record.description])
        if (record.user, record.number) == _EXTRA:
            data = None if described else _mended_dimensions(bytes(out[record.data]), bytes(out))
            if data is None:
                out[record.user_id] = _UNUSED.ljust(16, b"\0")
            else:
                out[record.data] = data
                described = True
    for record in extended_records(head):
        out[record.user_id] = _ascii(out[record.user_id])
        out[record.description] = _ascii(out[record.description])
    return bytes(out)


def records(head: bytes) -> Iterator[Record]:
    """Yield the records in front of the points that are whole."""
    place, count = struct.unpack_from("<H", head, 94)[0], struct.unpack_from("<I", head, 100)[0]
    for _ in range(count):
        if place + _VLR > len(head):
            return
        number, length = struct.unpack_from("<HH", head, place + 18)
        data = slice(place + _VLR, place + _VLR + length)
        if data.stop > len(head):
            return
        yield Record(place, data, head[place + 2 : place + 18].split(b"\0")[0], number)
        place = data.stop


def extended_records(head: bytes) -> Iterator[Record]:
    """Yield the records behind the points, if they are in `head`."""
    if head[25] < 4 or len(head) < 247:
        return
    place, count = struct.unpack_from("<QI", head, 235)
    for _ in range(count):
        if place + _EVLR > len(head):
            return
        number, length = struct.unpack_from("<HQ", head, place + 18)
        data = slice(place + _EVLR, place + _EVLR + length)
        if data.stop > len(head):
            return
        yield Record(place, data, head[place + 2 : place + 18].split(b"\0")[0], number, extended=True)
        place = data.stop


_Texts = dict[tuple[bytes, int, bytes], list[tuple[bytes, bytes]]]


def has_letters(kept: bytes) -> bool:
    """Return whether a header has letters that are not ASCII, and so has to be restored."""
    return any(_letters(kept))


def _letters(kept: bytes) -> tuple[list[slice], _Texts]:
    """Return the strings of a header that are not ASCII, and the users and descriptions of records that are not."""
    texts: _Texts = {}
    for record in (*records(kept[: struct.unpack_from("<I", kept, 96)[0]]), *extended_records(kept)):
        user, description = kept[record.user_id], kept[record.description]
        if not (user.isascii() and description.isascii()):
            key = (_ascii(user).split(b"\0")[0], record.number, kept[record.data])
            texts.setdefault(key, []).append((user, description))
    return [part for part in _STRINGS if not kept[part].isascii()], texts


def restore(file: BinaryIO, kept: bytes) -> None:
    """Write the letters of a header that are not ASCII into a file that laspy wrote from the mended header.

    Parameters
    ----------
    file : binary file
        Complete; it can be read and written anywhere.
    kept : bytes
        What was kept of the original.
    """
    strings, texts = _letters(kept)
    if not texts and not strings:
        return
    end = file.tell()
    file.seek(0)
    head = file.read(375)
    for part in strings:
        file.seek(part.start)
        file.write(kept[part])
    file.seek(0)
    start = struct.unpack_from("<I", head, 96)[0]
    for record in records(file.read(start)) if texts else ():
        _restore_record(file, record, texts)
    if texts and head[25] >= 4:
        place, count = struct.unpack_from("<QI", head, 235)
        for record in _written_records(file, place, count, end):
            _restore_record(file, record, texts)
    file.seek(end)


def _restore_record(file: BinaryIO, record: Record, texts: _Texts) -> None:
    file.seek(record.data.start)
    known = texts.get((record.user, record.number, file.read(record.data.stop - record.data.start)))
    if known:
        user, description = known.pop(0)
        file.seek(record.user_id.start)
        file.write(user)
        file.seek(record.description.start)
        file.write(description)


def _written_records(file: BinaryIO, place: int, count: int, end: int) -> Iterator[Record]:
    """Yield the records behind the points of a file."""
    for _ in range(count):
        file.seek(place)
        about = file.read(_EVLR)
        if len(about) < _EVLR:
            return
        number, length = struct.unpack_from("<HQ", about, 18)
        data = slice(place + _EVLR, place + _EVLR + length)
        if data.stop > end:
            return
        yield Record(place, data, about[2:18].split(b"\0")[0], number, extended=True)
        place = data.stop


class Spliced(io.RawIOBase):
    """A file whose first bytes are others.

    Parameters
    ----------
    head : bytes
        Instead of as many bytes of the file.
    file : binary file
    """

    def __init__(self, head: bytes, file: BinaryIO) -> None:
        super().__init__()
        self.head = head
        self.file = file
        self.place = 0

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def tell(self) -> int:
        """Return the position."""
        return self.place

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to a position."""
        self.place = self.file.seek(offset if whence != io.SEEK_CUR else self.place + offset, min(whence, 2) & 2)
        return self.place

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401  (whatever has a buffer)
        """Read bytes."""
        size = len(buffer)
        if self.place < len(self.head):
            data = self.head[self.place : self.place + size]
        else:
            self.file.seek(self.place)
            data = self.file.read(size)
        buffer[: len(data)] = data
        self.place += len(data)
        return len(data)


def _ascii(text: bytes | bytearray) -> bytes:
    return bytes(letter if letter < 128 else ord("?") for letter in text)


def _mended_dimensions(data: bytes, head: bytes) -> bytes | None:
    """Return the description of extra bytes with names that differ; None if it does not fit the points."""
    kind, width = head[104] & 0x3F, struct.unpack_from("<H", head, 105)[0]
    if len(data) % _STRUCT or not data or kind >= len(_POINT):
        return None
    taken = _standard_names(kind)
    room = width - _POINT[kind]
    out = bytearray(data)
    for start in range(0, len(data), _STRUCT):
        about = bytearray(out[start : start + _STRUCT])
        size = _size_of(about[2], about[3])
        room -= size
        if size == 0 or room < 0:
            return None
        name = bytes(about[_NAME]).split(b"\0")[0]
        new = _free_name(_utf8(name) if name.strip() else b"property", taken)
        taken.add(new)
        if new != bytes(about[_NAME]).rstrip(b"\0"):
            about[_NAME] = new.ljust(32, b"\0")
        about[_ABOUT] = _ascii(about[_ABOUT])
        about[3] &= 0xFF if about[2] == 0 or _is_scaled(about) else ~_SCALED & 0xFF
        out[start : start + _STRUCT] = about
    return bytes(out)


def _is_scaled(about: bytearray) -> bool:
    """Return whether the scales and offsets of a dimension can be used, or there are none."""
    scales, offsets = (struct.unpack_from("<3d", about, place) for place in (112, 136))
    count = (about[2] - 1) // 10 + 1
    used = (scales[:count] if about[3] & 8 else ()) + (offsets[:count] if about[3] & 16 else ())
    return all(map(math.isfinite, used)) and not (about[3] & 8 and 0.0 in scales[:count])


def _size_of(kind: int, options: int) -> int:
    """Return the bytes of a dimension, 0 if its type is unknown."""
    if kind == 0:
        return options
    return 0 if kind > 30 else _WIDTHS[(kind - 1) % 10] * ((kind - 1) // 10 + 1)


def _free_name(name: bytes, taken: set[bytes]) -> bytes:
    """Return a name of at most 32 letters that is not taken."""
    candidate, count = _cut(name, 32), 1
    while candidate in taken:
        count += 1
        ending = b"_%d" % count
        candidate = _cut(name, 32 - len(ending)) + ending
    return candidate


def _utf8(name: bytes) -> bytes:
    """Return a name in UTF-8; any other letters are taken for Latin-1."""
    try:
        name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1").encode()
    return name


def _cut(name: bytes, most: int) -> bytes:
    """Return the beginning of a name in UTF-8, in whole letters."""
    return name[:most].decode("utf-8", "ignore").encode()


def _standard_names(kind: int) -> set[bytes]:
    """Return the names of the dimensions of a point format, and those of their parts."""
    import laspy  # noqa: PLC0415  an extra

    found = laspy.PointFormat(kind)
    return {name.encode() for name in (*found.dimension_names, *(found.dtype().names or ()))}
