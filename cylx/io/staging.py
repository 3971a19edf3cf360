"""Unfinished outputs: temporary files in the folder of the output, which take its name when they are complete.

Their names contain the machine and the process, and the process holds a lock on each. So a later run can remove what a
killed one has left, and never what a running one is writing.
"""

from __future__ import annotations

import contextlib
import errno
import os
import platform
import re
import secrets
import zlib
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.errors import ExistsError
from cylx.io.inputs import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

_NAME = re.compile(r"\.cylx-([0-9a-f]{8})-(\d+)-[0-9a-f]{16}(\..*)?", re.DOTALL)
_NO_LINKS = {errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV, errno.EACCES, errno.EINVAL}
"""What file systems without hard links answer."""

_open: dict[str, str] = {}
"""The unfinished outputs of this process, and the names that the user knows."""
_tidied: set[tuple[int, str]] = set()


@contextmanager
def staged(target: Path, name: str, suffix: str, *, overwrite: bool, group: Group | None = None) -> Iterator[Path]:
    """Yield an empty temporary file beside an output; it takes the name of the output if all goes well.

    Parameters
    ----------
    target : Path
        The output, with symbolic links resolved.
    name : str
        The output as the user calls it.
    suffix : str
        Suffix of the temporary file.
    overwrite : bool
        Whether a file may be replaced that is there at the end.
    group : Group, optional
        The outputs that are written together with this one.

    Raises
    ------
    ExistsError
        If the output has appeared meanwhile and may not be replaced.
    """
    _tidy(target.parent)
    temporary = temporary_beside(target, suffix)
    _open[str(temporary)] = name
    try:
        with temporary.open("xb") as owned:
            _lock(owned.fileno())
            yield temporary
            os.fsync(owned.fileno())
            _publish(temporary, target, name, overwrite=overwrite, group=group)
    finally:
        temporary.unlink(missing_ok=True)
        _open.pop(str(temporary), None)


class Group:
    """Outputs that are written together: if one fails, those before it are taken back."""

    def __init__(self) -> None:
        self._done: list[tuple[Path, Path | None]] = []

    def replace(self, temporary: Path, target: Path) -> None:
        """Give a file its name, and keep the file that it replaces for a while."""
        old: Path | None = temporary_beside(target, ".old")
        try:
            os.link(target, old, follow_symlinks=False)  # type: ignore[arg-type]
        except FileNotFoundError:
            old = None
        except OSError:  # the file system has no links: what is replaced cannot be put back
            temporary.replace(target)
            return
        try:
            temporary.replace(target)
        except BaseException:
            if old is not None:
                old.unlink(missing_ok=True)
            raise
        self._done.append((target, old))

    def made(self, target: Path) -> None:
        """Remember an output that replaced nothing."""
        self._done.append((target, None))

    def remove(self, target: Path) -> None:
        """Remove a file, and keep it for a while."""
        old = temporary_beside(target, ".old")
        with contextlib.suppress(OSError):  # it is not there, or may not be moved
            target.replace(old)
            self._done.append((target, old))

    def take_back(self) -> None:
        """Put the files back that were there before."""
        for target, old in reversed(self._done):
            with contextlib.suppress(OSError):
                if old is not None:
                    old.replace(target)
                else:
                    target.unlink(missing_ok=True)
        self._done = []

    def finish(self) -> None:
        """Forget the files that were there before."""
        for _, old in self._done:
            if old is not None:
                with contextlib.suppress(OSError):
                    old.unlink(missing_ok=True)
        self._done = []


def known_name(path: str | Path) -> str:
    """Return the printable name of an output as the user knows it, also for its temporary file."""
    return printable(_open.get(str(path), path))


def is_staged(path: str | Path) -> bool:
    """Return whether a path is a temporary file of this process."""
    return str(path) in _open


def remove_unfinished() -> None:
    """Remove what this process has not finished; for the moment before it ends."""
    for path in list(_open):
        with contextlib.suppress(OSError):
            Path(path).unlink(missing_ok=True)


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
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = _NAME.fullmatch(entry.name)
            if found is None or found[1] != _machine():
                continue
            owner = int(found[2])
            if (owner == process if process is not None else _has_ended(owner)) and _is_free(entry.path):
                with contextlib.suppress(OSError):
                    Path(entry.path).unlink()


def _publish(temporary: Path, target: Path, name: str, *, overwrite: bool, group: Group | None) -> None:
    """Give a complete file its name."""
    if overwrite:
        if group is not None:
            group.replace(temporary, target)
        else:
            temporary.replace(target)
        return
    try:
        _link(temporary, target)
    except FileExistsError:
        fault = "exists already, written by another program in the meantime"
        raise ExistsError(printable(name), fault, "choose another name, or give --overwrite") from None
    if group is not None:
        group.made(target)


def _link(temporary: Path, target: Path) -> None:
    """Give a file a second name that must be new; where the file system has no links, the name is taken first."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        os.close(os.open(target, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        temporary.replace(target)


def _tidy(folder: Path) -> None:
    """Remove leftovers of killed processes from a folder, once in a process."""
    key = (os.getpid(), str(folder))
    if key not in _tidied:
        _tidied.add(key)
        remove_leftovers(folder)


@cache
def _machine() -> str:
    return f"{zlib.crc32(platform.node().encode('utf-8', 'replace')):08x}"


def _has_ended(process: int) -> bool:
    """Return whether no process has this id; on Windows there is no safe way to ask.

    In a container with the same name it may be another process: the lock on the file decides.
    """
    if os.name == "nt":
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


def _lock(file: int) -> None:
    """Lock an open file, where the file system can; the lock ends with the process at the latest."""
    with contextlib.suppress(ImportError, OSError):
        import fcntl  # noqa: PLC0415  not on Windows

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_free(path: str) -> bool:
    """Return whether nobody has locked a file, as far as the file system can tell."""
    try:
        import fcntl  # noqa: PLC0415  not on Windows

        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except (ImportError, OSError):
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(file)
    return True
