"""What is packed by gzip is unpacked into an unnamed file, as long as it does not grow beyond measure."""

from __future__ import annotations

import gzip
import tempfile
import zlib
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, cast

from cylx.errors import InputError
from cylx.io.inputs import Input

if TYPE_CHECKING:
    from collections.abc import Iterator

MOST_EXPANSION = 100
"""What is packed may be so many times as large once it is unpacked …"""
ALWAYS_ALLOWED = 1 << 24
"""… and so many bytes in any case."""
_GZIP = b"\x1f\x8b"
_BLOCK = 1 << 20
_REMEDY = "get a complete copy of the file"


@contextmanager
def unpacked(source: Input, *, packed: bool) -> Iterator[Input]:
    """Yield what a gzip file holds, with the digest of the file as it lies; any other file as it is.

    Parameters
    ----------
    source : Input
    packed : bool
        Whether its name says that it is packed.

    Raises
    ------
    InputError
        If the file is damaged, or larger than `MOST_EXPANSION` times its size once it is unpacked.
    """
    if source.head(2) != _GZIP:
        if packed:
            raise InputError(source.place, "is not packed by gzip", "give it its right suffix")
        yield source
        return
    source.file.seek(0)
    with tempfile.TemporaryFile() as copy:
        with gzip.GzipFile(fileobj=source.file, mode="rb") as stream:
            size = copy_unpacked(cast("IO[bytes]", stream), copy, source)
        if size == 0:
            raise InputError(source.place, "is empty", "check how it was made")
        yield Input(source.place, copy, size, source.sha256)


def copy_unpacked(stream: IO[bytes], copy: IO[bytes], source: Input) -> int:
    """Copy what a packed input holds, block by block.

    Parameters
    ----------
    stream : binary file
        What unpacks.
    copy : binary file
        Where it goes.
    source : Input
        What is packed.

    Returns
    -------
    int
        Number of bytes.

    Raises
    ------
    InputError
        If the input is damaged, or holds too much.
    """
    most = max(MOST_EXPANSION * source.size, ALWAYS_ALLOWED)
    size = 0
    while block := _next_block(stream, source.place):
        size += len(block)
        if size > most:
            fault = f"is more than {MOST_EXPANSION} times as large once it is unpacked"
            raise InputError(source.place, fault, "unpack it yourself if you trust it")
        copy.write(block)
    copy.flush()
    return size


def _next_block(stream: IO[bytes], place: str) -> bytes:
    try:
        return stream.read(_BLOCK)
    except EOFError:
        raise InputError(place, "the file ends within what is packed", _REMEDY) from None
    except (gzip.BadGzipFile, zlib.error) as error:
        raise InputError(place, f"what is packed is damaged: {error}", _REMEDY) from None
