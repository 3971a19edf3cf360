"""Outputs that are written completely or not at all, one or several together."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NoReturn

from cylx.errors import ExistsError, OutputError
from cylx.io.existing import has_anything, has_file, has_folder
from cylx.io.inputs import printable
from cylx.io.staging import Group, is_staged, known_name, staged

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    Writer = Callable[[str | Path], None]

STREAM = "-"
STANDARD_OUTPUT = (STREAM, "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


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
    if str(path) in STANDARD_OUTPUT:
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
            raise ExistsError(place, "exists already", "choose another name, or give --overwrite")
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
    if not is_staged(path):
        check_writable(path, overwrite=overwrite)
    try:
        if str(path) in STANDARD_OUTPUT:
            sys.stdout.flush()  # earlier output comes first
            yield sys.stdout.buffer
            sys.stdout.buffer.flush()
        elif stat.S_ISREG(_mode(path) or stat.S_IFREG) and not is_staged(path):
            target = _target(path)
            with staged(target, str(path), ".tmp", overwrite=overwrite) as temporary, temporary.open("wb") as file:
                yield file
        else:
            with Path(path).open("wb") as file:
                yield file
    except BrokenPipeError:
        raise
    except OSError as error:
        _refuse_os_error("standard output" if str(path) in STANDARD_OUTPUT else known_name(path), error)


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
def all_or_none(*, overwrite: bool) -> Iterator[Callable[[str], str | Path]]:
    """Yield a function that names the temporary file to write an output to; streams and devices keep their name.

    At the end the files take the names of the outputs, the first one last. If anything fails, none does.

    Parameters
    ----------
    overwrite : bool
        Whether existing files may be replaced.
    """
    group = Group()
    try:
        with contextlib.ExitStack() as stack:
            yield lambda name: stack.enter_context(_moved_at_the_end(name, group, overwrite=overwrite))
    except BaseException:
        group.take_back()
        raise
    group.finish()


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
    with all_or_none(overwrite=overwrite) as temporary:
        for name, data in contents.items():
            write_bytes(temporary(name), data, overwrite=overwrite)


def write_beside(main: tuple[str, Writer], others: Mapping[str, Writer], *, overwrite: bool) -> dict[str, Exception]:
    """Write a file and others beside it; it is kept, and so are they, if one of the others fails.

    The main file is written first, so that the others cannot take its place on the disk, and takes its name last: once
    it is there, so are they. An old file in the place of one that failed is removed, as it belongs to an older main
    file.

    Parameters
    ----------
    main : (str, callable)
        Its name, and what writes it to a path.
    others : mapping of str to callable
        The same for the others.
    overwrite : bool
        Whether existing files may be replaced.

    Returns
    -------
    dict of str to Exception
        What went wrong with the others, by name.

    Raises
    ------
    OutputError
        If the main file cannot be written, or another program has written one of the files meanwhile: then there is
        none.
    """
    group, failed = Group(), dict[str, Exception]()
    name, write = main
    try:
        with _moved_at_the_end(name, group, overwrite=overwrite) as path:
            write(path)
            for other, write_other in others.items():
                failure = _write_other(other, write_other, group, overwrite=overwrite)
                if failure is not None:
                    failed[other] = failure
    except BaseException:
        group.take_back()
        raise
    group.finish()
    return failed


def _write_other(name: str, write: Writer, group: Group, *, overwrite: bool) -> Exception | None:
    """Write a file of a group; return what went wrong."""
    try:
        with _moved_at_the_end(name, group, overwrite=overwrite) as path:
            write(path)
    except ExistsError:
        raise
    except Exception as failure:  # noqa: BLE001  returned, so that the other files are kept
        if overwrite and _may_be_replaced(name):
            group.remove(_target(name))
        return failure
    return None


@contextmanager
def _moved_at_the_end(name: str, group: Group, *, overwrite: bool) -> Iterator[str | Path]:
    """Yield a temporary name beside an output, which takes its name if all goes well."""
    if not _may_be_replaced(name):
        yield name
        return
    check_writable(name, overwrite=overwrite)
    target = _target(name)
    try:
        with staged(target, name, target.suffix, overwrite=overwrite, group=group) as temporary:
            yield temporary
    except BrokenPipeError:
        raise
    except OSError as error:
        _refuse_os_error(printable(name), error)


def _may_be_replaced(name: str) -> bool:
    """Return whether an output is a file, or is to become one, rather than a stream or a device."""
    return name != STREAM and (has_file(name) or not has_anything(name) or _is_plain_link(name))


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
    if _is_plain_link(path) and not has_folder(path):
        return stat.S_IFREG | 0o600
    try:
        return Path(path).stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        _refuse_os_error(printable(path), error)


def _check_folder(folder: Path, place: str) -> None:
    if not has_anything(folder):
        raise OutputError(place, f"the folder {str(folder)!r} does not exist", "create it first")
    if not has_folder(folder):
        raise OutputError(place, f"{str(folder)!r} is not a folder", "choose another folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(place, f"the folder {str(folder)!r} is read-only", "choose another folder")


def _refuse_os_error(place: str, error: OSError | ValueError) -> NoReturn:
    fault = "embedded null byte" if isinstance(error, ValueError) else error.strerror or str(error)
    full = getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT)
    remedy = "free some space, or choose another folder" if full else "choose another path"
    raise OutputError(place, f"cannot be written: {fault[:1].lower() + fault[1:]}", remedy) from error
