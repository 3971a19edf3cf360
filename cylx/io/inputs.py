"""Inputs from disk or standard input, copied to an unnamed file and hashed before they are read.

The bytes that are read are those that were hashed, whatever happens to the file in the meantime. A file that is cut off
while it is mapped into memory would kill the process; nobody else can cut off the copy.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import re
import stat
import sys
import tempfile
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, BinaryIO, NoReturn, cast

from cylx.errors import InputError
from cylx.io.existing import has_folder

if TYPE_CHECKING:
    from collections.abc import Iterator

_BLOCK = 1 << 20
_HALF_LETTER = re.compile(rb"\\u[dD][89a-fA-F]")
_CHANGED_REMEDY = "run it again when nothing writes to it"


class _NoRoomError(OSError):
    """There is no room for a copy."""


@dataclass(frozen=True, slots=True, eq=False)
class Input:
    """A file that can be read from any position.

    Parameters
    ----------
    place : str
        Its name in errors.
    file : binary file
        A real file, so that it can be mapped into memory.
    size : int
        Size in bytes.
    sha256 : str
        Digest of the bytes.
    path : Path or None
        Its path; None if it has no path, or the file at the path has other content.
    """

    place: str
    file: BinaryIO
    size: int
    sha256: str
    path: Path | None = None

    def head(self, size: int) -> bytes:
        """Return up to `size` bytes from the beginning."""
        self.file.seek(0)
        return self.file.read(size)


@contextmanager
def open_input(path: str | Path) -> Iterator[Input]:
    """Open a copy of a file, a pipe or standard input (`-`).

    Raises
    ------
    InputError
        If it does not exist, is empty, a device, cannot be read, or is changed meanwhile.
    """
    place = "standard input" if str(path) == "-" else printable(path)
    with _open(path, place) as stream:
        try:
            kind = None if str(path) == "-" else os.fstat(stream.fileno()).st_mode
            if kind is not None and (stat.S_ISCHR(kind) or stat.S_ISBLK(kind)):  # most of them never end
                raise InputError(place, "is a device", "give a file or a pipe")
            if kind is not None and stat.S_ISREG(kind):
                with _copied(stream, place) as (copy, size, digest):
                    yield Input(place, copy, size, digest, path=Path(path))
                return
            with tempfile.TemporaryFile() as copy:
                yield Input(place, copy, *_measure(stream, place, copy))
        except OSError as error:
            _refuse_os_error(place, error)


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a JSON object.

    Parameters
    ----------
    path : str or Path
        A file, or `-` for standard input.

    Raises
    ------
    InputError
        If the file cannot be read, is not JSON, or is not an object.
    """
    with open_input(path) as source:
        data = source.head(source.size)
    place = source.place
    try:
        document = json.loads(data.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        where = f"{place}:{error.lineno}:{error.colno}"
        raise InputError(where, f"not JSON: {_lowered(error.msg)}", "give a JSON file as cylx writes it") from None
    except UnicodeDecodeError:
        raise InputError(place, "not JSON: not UTF-8 text", "give a JSON file as cylx writes it") from None
    except (ValueError, RecursionError) as error:
        fault = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(place, f"not JSON: {fault}", "give a JSON file as cylx writes it") from None
    if not isinstance(document, dict):
        raise InputError(place, "is not a JSON object", "give a JSON file as cylx writes it")
    if _HALF_LETTER.search(data) and not _is_text(document):
        raise InputError(
            place, "not JSON: an escape such as \\ud800 is half a letter", "give the file as it was written"
        )
    return document


def _is_text(document: object) -> bool:
    """Return whether all letters of a document can be written."""
    try:
        json.dumps(document, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return False
    return True


def sha256_of(path: str | Path) -> str:
    """Return the digest of the bytes of a file.

    Raises
    ------
    InputError
        If it cannot be read, or is empty.
    """
    place = "standard input" if str(path) == "-" else printable(path)
    with _open(path, place) as stream:
        try:
            return _measure(stream, place)[1]
        except OSError as error:
            _refuse_os_error(place, error)


def stamp_of(path: str | Path) -> tuple[int, ...] | None:
    """Return what tells whether a file has been changed; None if there is none, or for standard input."""
    try:
        return None if str(path) == "-" else _stamp(Path(path).stat())
    except (OSError, ValueError):
        return None


def check_unchanged(path: str | Path, before: tuple[int, ...] | None, sha256: str | None) -> None:
    """Check that a file still has the bytes that were read; one that has been removed cannot be mistaken.

    Parameters
    ----------
    path : str or Path
    before : tuple of int or None
        What `stamp_of` said before it was read.
    sha256 : str or None
        The digest of the bytes that were read.

    Raises
    ------
    InputError
        If it has other bytes now.
    """
    now = stamp_of(path)
    if before is None or now in (None, before):
        return
    try:
        same = sha256_of(path) == sha256
    except InputError:
        same = False
    if not same:
        raise InputError(printable(path), "was changed while its cylinders were sought", _CHANGED_REMEDY)


def printable(path: str | Path) -> str:
    """Return a path as one printable line, whatever it contains."""
    return text if (text := str(path)).isprintable() else repr(text)


def excerpt(text: str, most: int = 40) -> str:
    """Quote a piece of a file so that it fits on one line of a message."""
    return ascii(text if len(text) <= most else text[: most - 3] + "...")


def _open(path: str | Path, place: str) -> AbstractContextManager[BinaryIO]:
    if str(path) == "-":
        if sys.stdin is None:
            raise InputError(place, "is closed", "give a file, or something to read through a pipe")
        return nullcontext(sys.stdin.buffer)
    try:
        return Path(path).open("rb")
    except FileNotFoundError:
        _refuse_missing(Path(path), place)
    except IsADirectoryError:
        raise InputError(place, "is a folder", "give the files in it") from None
    except PermissionError:
        if has_folder(path):
            raise InputError(place, "is a folder", "give the files in it") from None
        raise InputError(place, "may not be read", "ask its owner for the permission") from None
    except (OSError, ValueError) as error:
        _refuse_os_error(place, error)


@contextmanager
def _copied(stream: BinaryIO, place: str) -> Iterator[tuple[BinaryIO, int, str]]:
    """Yield a copy of a file, its size and its digest; the file itself if there is no room for a copy."""
    before = _stamp(os.fstat(stream.fileno()))
    with _unnamed() as copy:
        try:
            chosen, measured = copy, _measure(stream, place, copy)
        except _NoRoomError:
            with suppress(OSError):  # of what is still in its buffer
                copy.close()
            stream.seek(0)
            chosen, measured = stream, _measure(stream, place)
        if before != _stamp(os.fstat(stream.fileno())):
            raise InputError(place, "was changed while it was read", _CHANGED_REMEDY)
        yield chosen, *measured


def _unnamed() -> BinaryIO:
    """Open an unnamed file in memory, or on disk where the system has none in memory."""
    if sys.platform == "linux":
        with suppress(OSError):
            return os.fdopen(os.memfd_create("cylx"), "w+b")
    return cast("BinaryIO", tempfile.TemporaryFile())


def _stamp(status: os.stat_result) -> tuple[int, ...]:
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _measure(stream: BinaryIO, place: str, copy: IO[bytes] | None = None) -> tuple[int, str]:
    digest, size = hashlib.sha256(), 0
    while block := stream.read(_BLOCK):
        digest.update(block)
        size += len(block)
        if copy is not None:
            _write(copy, block)
    if size == 0:
        raise InputError(place, "is empty", "check how it was made")
    return size, digest.hexdigest()


def _write(copy: IO[bytes], block: bytes) -> None:
    try:
        copy.write(block)
        copy.flush()
    except OSError as error:
        raise _NoRoomError(*error.args) from error


def _refuse_os_error(place: str, error: OSError | ValueError) -> NoReturn:
    fault = getattr(error, "strerror", None) or str(error)
    raise InputError(place, f"cannot be read: {_lowered(fault)}", "check the path and the disk") from None


def _refuse_missing(path: Path, place: str) -> NoReturn:
    """Refuse a path that leads nowhere: a link whose target is gone, or a name that nothing has."""
    remedy = "check the path"
    with suppress(OSError):
        if path.is_symlink():
            target = excerpt(str(path.readlink()), 200)
            raise InputError(place, f"is a link to {target}, which is not there", "check where it leads") from None
        close = difflib.get_close_matches(path.name, [entry.name for entry in path.parent.iterdir()], n=1)
        remedy = f"did you mean {str(path.with_name(close[0]))!r}?" if close else remedy
    raise InputError(place, "no such file", remedy) from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number in JSON")


def _lowered(text: str) -> str:
    return text[:1].lower() + text[1:]
