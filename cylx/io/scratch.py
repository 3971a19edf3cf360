"""A folder for what does not fit into memory: arrays by name, complete or not there at all.

It belongs to one output, is locked while a run works in it, and outlives a run that was killed, so that the next one
can go on with it or remove it.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import shutil
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from cylx.errors import OutputError
from cylx.io.inputs import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import DTypeLike, NDArray

_PREFIX = ".cylx-tiles-"
_MANIFEST, _LOCK = "manifest.json", "lock"


@dataclass(frozen=True, slots=True)
class Scratch:
    """A folder of arrays and JSON objects.

    Parameters
    ----------
    folder : Path
    """

    folder: Path

    def path(self, name: str) -> Path:
        """Return the path of a file in the folder."""
        return self.folder / name

    def has(self, name: str) -> bool:
        """Return whether something was written completely."""
        return self.path(name).is_file()

    def write(self, name: str, **arrays: NDArray[Any]) -> None:
        """Write arrays together."""
        with self._whole(name) as path, path.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]  # the stubs take a name for allow_pickle

    def read(self, name: str) -> dict[str, NDArray[Any]]:
        """Read arrays that were written together."""
        with np.load(self.path(name), allow_pickle=False) as held:
            return dict(held)

    def write_json(self, name: str, content: object) -> None:
        """Write plain data."""
        with self._whole(name) as path:
            path.write_text(json.dumps(content), encoding="utf-8")

    def read_json(self, name: str) -> Any:  # noqa: ANN401  (plain data)
        """Read plain data."""
        return json.loads(self.path(name).read_text(encoding="utf-8"))

    def append(self, name: str, rows: NDArray[Any]) -> None:
        """Write rows at the end of a file without a header."""
        try:
            with self.path(name).open("ab") as file:
                file.write(np.ascontiguousarray(rows).tobytes())
        except OSError as error:
            _refuse(self.folder, error)

    def rows(self, name: str, dtype: DTypeLike, width: int = 1) -> NDArray[Any]:
        """Read the rows of a file without a header; none if it is not there."""
        values = np.fromfile(self.path(name), dtype) if self.has(name) else np.empty(0, dtype)
        return values.reshape(-1, width) if width > 1 else values

    def size(self, name: str, dtype: DTypeLike) -> int:
        """Return the number of values of a file without a header; none if it is not there."""
        return self.path(name).stat().st_size // np.dtype(dtype).itemsize if self.has(name) else 0

    def mapped(self, name: str, dtype: DTypeLike) -> NDArray[Any]:
        """Map a file without a header into memory."""
        path = self.path(name)
        return np.memmap(path, dtype, "r") if path.stat().st_size else np.empty(0, dtype)

    def part(self, name: str, dtype: DTypeLike, start: int, count: int) -> NDArray[Any]:
        """Read some of the rows of a file without a header."""
        with self.path(name).open("rb") as file:
            file.seek(start * np.dtype(dtype).itemsize)
            return np.fromfile(file, dtype, count)

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""
        self.path(name).unlink(missing_ok=True)

    @contextmanager
    def _whole(self, name: str) -> Iterator[Path]:
        """Yield a name to write to; the file takes its own name when it is complete."""
        unfinished = self.path(f"{name}.{os.getpid()}.tmp")
        try:
            yield unfinished
            unfinished.replace(self.path(name))
        except OSError as error:
            with contextlib.suppress(OSError):
                unfinished.unlink(missing_ok=True)
            _refuse(self.folder, error)


@contextmanager
def open_scratch(parent: Path, output: str, manifest: Mapping[str, Any], *, resume: bool) -> Iterator[Scratch]:
    """Open the scratch folder of an output; it is removed at the end, or kept for the next run that may go on.

    Parameters
    ----------
    parent : Path
        The folder that it is made in.
    output : str
        The output that it belongs to.
    manifest : mapping
        What the work depends on. A folder with another manifest is of no use, and is emptied.
    resume : bool
        Go on with what a run before has left, and keep the folder if this one fails, too. Otherwise it begins empty,
        and goes in any case.

    Raises
    ------
    OutputError
        If it cannot be made, or another run works in it.
    """
    digest = hashlib.sha256(os.path.realpath(output).encode("utf-8", "surrogateescape")).hexdigest()[:16]
    folder = parent / f"{_PREFIX}{digest}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock = (folder / _LOCK).open("ab")
    except OSError as error:
        _refuse(folder, error)
    keep = resume
    with lock:
        _lock(lock.fileno(), folder)
        try:
            _prepare(folder, dict(manifest), resume=resume)
            yield Scratch(folder)
            keep = False
        finally:
            if not keep:
                shutil.rmtree(folder, ignore_errors=True)


def _prepare(folder: Path, manifest: dict[str, Any], *, resume: bool) -> None:
    """Empty a folder unless it can be gone on with."""
    text, known = json.dumps(manifest, sort_keys=True), folder / _MANIFEST
    try:
        if resume and known.is_file() and known.read_text(encoding="utf-8") == text:
            return
        for entry in folder.iterdir():
            if entry.name != _LOCK:
                entry.unlink()
        known.write_text(text, encoding="utf-8")
    except OSError as error:
        _refuse(folder, error)


def _lock(file: int, folder: Path) -> None:
    """Lock a folder, where the file system can; the lock ends with the process at the latest."""
    try:
        import fcntl  # noqa: PLC0415  not on Windows

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except ImportError:
        return
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EACCES):
            fault = "another run is at work there"
            raise OutputError(printable(folder), fault, "wait for it, or choose another output") from None


def _refuse(folder: Path, error: OSError) -> NoReturn:
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    remedy = "free some space and give --resume, or choose another folder by --scratch"
    fault = (error.strerror or str(error)).lower()
    raise OutputError(
        printable(folder), f"cannot be written: {fault}", remedy if full else "choose another folder by --scratch"
    ) from error
