"""Unpack gzip into an unnamed file, up to a maximum size."""

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
"""Largest allowed ratio of unpacked to packed size …"""
ALWAYS_ALLOWED = 1 << 24
"""… and a number of bytes that is always allowed."""
_GZIP = b"\x1f\x8b"
_BLOCK = 1 << 20
_REMEDY = "get a complete copy of the file"


@contextmanager
def unpacked(source: Input, *, packed: bool) -> Iterator[Input]:
    """Yield the unpacked content of a gzip file, with the digest of the packed file; yield any other file unchanged.

    Parameters
    ----------
    source : Input
    packed : bool
        Whether its name says that it is packed.

    Raises
    ------
    InputError
        If the file is damaged, or its content is larger than `MOST_EXPANSION` times its size.
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
    """Copy the content of a packed input, block by block.

    Parameters
    ----------
    stream : binary file
        The stream that unpacks.
    copy : binary file
        The target file.
    source : Input
        The packed input.

    Returns
    -------
    int
        Number of bytes.

    Raises
    ------
    InputError
        If the input is damaged, or its content is too large.
    """
    most = max(MOST_EXPANSION * source.size, ALWAYS_ALLOWED)
    size = 0
    while block := _next_block(stream, source.place):
        size += len(block)
        if size > most:
            fault = f"is more than {MOST_EXPANSION} times as large when unpacked"
            raise InputError(source.place, fault, "unpack it yourself if you trust it")
        copy.write(block)
    copy.flush()
    return size


def _next_block(stream: IO[bytes], place: str) -> bytes:
    try:
        return stream.read(_BLOCK)
    except EOFError:
        raise InputError(place, "the file ends within the packed data", _REMEDY) from None
    except (gzip.BadGzipFile, zlib.error) as error:
        raise InputError(place, f"the packed data are damaged: {error}", _REMEDY) from None
