"""Outputs that are written completely or not at all, one or several together.

Unfinished outputs are temporary files in the same folder. Their names contain the machine and the process, so that
files left by a dead process can be removed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import platform
import re
import secrets
import stat
import sys
import zlib
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NoReturn

from cylx.errors import OutputError
from cylx.io.inputs import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

STREAM = "-"
_STDOUT = (STREAM, "/dev/stdout")
_NAME = re.compile(r"\.cylx-([0-9a-f]{8})-(\d+)-[0-9a-f]{16}(\..*)?", re.DOTALL)


def check_writable(path: str | Path, *, overwrite: bool) -> None:
    """Refuse an output that cannot be written, before anything is computed for it.

    Parameters
    ----------
    path : str or Path
        A file, or `-` for standard output.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the output exists, is a folder, or its folder is missing or cannot be written to.
    """
    if str(path) in _STDOUT:
        if sys.stdout is None:
            raise OutputError("standard output", "is closed", "give a file name")
        return
    place = printable(path)
    mode = _mode(path)
    if mode is None:
        _check_folder(_target(path).parent, place)
    elif stat.S_ISDIR(mode):
        raise OutputError(place, "is a folder", "give a file name")
    elif not _is_plain_link(path) and not os.access(path, os.W_OK):
        raise OutputError(place, "is read-only", "choose another name, or change its permissions")
    elif stat.S_ISREG(mode):
        if not overwrite:
            raise OutputError(place, "exists already", "choose another name, or give --overwrite")
        _check_folder(_target(path).parent, place)


@contextmanager
def open_output(path: str | Path, *, overwrite: bool) -> Iterator[BinaryIO]:
    """Open an output under a temporary name and rename it at the end if all went well.

    A symbolic link is replaced, and the file that it leads to is left alone. Standard output, devices and pipes are
    written directly. A closed pipe raises `BrokenPipeError`, which is not reported as an error.

    Parameters
    ----------
    path : str or Path
        A file, or `-` for standard output.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If `check_writable` refuses the output, or writing fails.
    """
    check_writable(path, overwrite=overwrite)
    try:
        if str(path) in _STDOUT:
            sys.stdout.flush()  # earlier output comes first
            yield sys.stdout.buffer
            sys.stdout.buffer.flush()
        elif stat.S_ISREG(_mode(path) or stat.S_IFREG):
            with _staged(_target(path), ".tmp") as temporary, temporary.open("xb") as file:
                yield file
        else:
            with Path(path).open("wb") as file:
                yield file
    except BrokenPipeError:
        raise
    except OSError as error:
        _refuse_os_error("standard output" if str(path) in _STDOUT else printable(path), error)


def write_bytes(path: str | Path, data: bytes, *, overwrite: bool = False) -> None:
    """Write bytes to a file, or to standard output for `-`; completely or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with open_output(path, overwrite=overwrite) as file:
        file.write(data)


def write_text(path: str | Path, text: str, *, overwrite: bool = False) -> None:
    """Write text as UTF-8, with line ends as given, to a file or to standard output for `-`; completely or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    write_bytes(path, text.encode("utf-8"), overwrite=overwrite)


@contextmanager
def moved_at_the_end(name: str, *, overwrite: bool) -> Iterator[str | Path]:
    """Yield a temporary name beside `name`; it is renamed to `name` if all goes well, and removed otherwise.

    Streams and devices are yielded as they are.
    """
    if name == STREAM or not (Path(name).is_file() or not Path(name).exists() or _is_plain_link(name)):
        yield name
        return
    check_writable(name, overwrite=overwrite)
    target = _target(name)
    with _staged(target, target.suffix) as temporary:
        yield temporary


def write_together(contents: Mapping[str, bytes], *, overwrite: bool) -> None:
    """Write several files, all or nothing.

    Parameters
    ----------
    contents : mapping of str to bytes
        Contents by file name; streams are not allowed.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    with contextlib.ExitStack() as stack:
        for name, data in contents.items():
            write_bytes(stack.enter_context(moved_at_the_end(name, overwrite=overwrite)), data, overwrite=overwrite)


def temporary_beside(target: Path, suffix: str) -> Path:
    """Return a hidden temporary name in the folder of `target`, with the machine and the process in it."""
    return target.with_name(f".cylx-{_machine()}-{os.getpid()}-{secrets.token_hex(8)}{suffix}")


def remove_leftovers(folder: str | Path, process: int | None = None) -> None:
    """Remove the temporary files left in a folder by a process of this machine.

    Parameters
    ----------
    folder : str or Path
        Files in it that cannot be removed are kept.
    process : int, optional
        The id of a process that has ended; by default all processes that have ended.
    """
    with contextlib.suppress(OSError):
        for path in Path(folder).iterdir():
            found = _NAME.fullmatch(path.name)
            if found is None or found[1] != _machine():
                continue
            owner = int(found[2])
            if owner == process if process is not None else _has_ended(owner):
                with contextlib.suppress(OSError):
                    path.unlink()


@cache
def _machine() -> str:
    return f"{zlib.crc32(platform.node().encode('utf-8', 'replace')):08x}"


def _has_ended(process: int) -> bool:
    """Return whether a process has certainly ended; on Windows there is no safe way to ask."""
    if os.name == "nt":
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


@contextmanager
def _staged(target: Path, suffix: str) -> Iterator[Path]:
    """Return a temporary name, which becomes that of `target` if all goes well."""
    temporary = temporary_beside(target, suffix)
    try:
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _target(path: str | Path) -> Path:
    """Return the name that an output takes: a link gives way to it, and is not followed."""
    if _is_plain_link(path):
        return Path(os.path.realpath(Path(path).parent)) / Path(path).name
    return Path(os.path.realpath(path))


def _is_plain_link(path: str | Path) -> bool:
    """Return whether a path is a symbolic link; those of the system, such as `/dev/fd/3`, stand for open files."""
    try:
        return Path(path).is_symlink() and Path(path).absolute().parts[1:2] not in (("dev",), ("proc",))
    except (OSError, ValueError):
        return False


def _mode(path: str | Path) -> int | None:
    """Return the type and permissions of the file at a path, None if there is no file.

    A link counts as a file, whatever it leads to, unless that is a folder.
    """
    if _is_plain_link(path) and not Path(path).is_dir():
        return stat.S_IFREG | 0o600
    try:
        return Path(path).stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        _refuse_os_error(printable(path), error)


def _check_folder(folder: Path, place: str) -> None:
    if not folder.exists():
        raise OutputError(place, f"the folder {str(folder)!r} does not exist", "create it first")
    if not folder.is_dir():
        raise OutputError(place, f"{str(folder)!r} is not a folder", "choose another folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(place, f"the folder {str(folder)!r} is read-only", "choose another folder")


def _refuse_os_error(place: str, error: OSError | ValueError) -> NoReturn:
    fault = getattr(error, "strerror", None) or str(error)
    full = getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT)
    remedy = "free some space, or choose another folder" if full else "choose another path"
    raise OutputError(place, f"cannot be written: {fault[:1].lower() + fault[1:]}", remedy) from error
