"""Read formats that native libraries decode in a process of its own, with limits on its time and memory.

Whatever a damaged or hostile file does to the library, it does to that process: a crash, a hang or a flood of memory is
an `InputError`. On Linux the process has no network if the system permits it. The points come back in a file without a
name that both processes map, so they are in memory once.
"""

from __future__ import annotations

import errno
import json
import os
import queue
import re
import signal
import threading
from contextlib import ExitStack, suppress
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.isolated_start import LINUX, passed_on, readable, search_path, started, target_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_SECONDS, _BYTES_A_SECOND = 20, 250_000
"""Processor time that every file may take, and the bytes that are read in each further second, at the least."""
_TABLE_A_SECOND = 1 << 23
"""Bytes of points for which a second is added, once their number is known and believed."""
_MEMORY = 512 << 20
"""Memory beside the points that every file may take; twice the size of the file is added, ..."""
_MEMORY_A_THREAD = 4 << 20
"""... and this for each thread that decodes."""
_COPIES = 5
"""Copies of the body of a PCD that are made while it is unpacked."""
_LEAST_TABLE, _MOST_EXPANSION = 1 << 30, 100
"""Bytes that the points may always take, and the multiple of the size of the file that they may take beyond."""
_TYPE = re.compile(r"[<>|][iuf][1248]")
_REMEDY = "get a complete copy of the file, or convert it to PLY with other software"
_REMEDY_OF_DESIGN = "export the file again, or give the cylinders as CSV"
_NAMES = {"las": "LAS", "e57": "E57", "pcd": "PCD", "step": "STEP", "ifc": "IFC"}
_MODEL = {"step": 60, "ifc": 60}
"""Memory of the objects that a byte of a text becomes, in bytes."""


def read_isolated(source: Input, kind: str, **wanted: int | None) -> NDArray[np.void]:
    """Read all points of a LAS, LAZ or E57 file, or the compressed body of a PCD, in a process of its own.

    Parameters
    ----------
    source : Input
    kind : {"las", "e57", "pcd"}
    **wanted : int or None
        What the reader needs: `scan`, the only scan of an E57 file to read; `start`, `points` and `width`, the byte at
        which the body of a PCD begins, the number of its points and their bytes.

    Returns
    -------
    ndarray of shape (points,), structured
        See `read_las` and `read_e57`; for PCD the field `byte`, see `unpack_columns`.

    Raises
    ------
    InputError
        If the reader refuses the file, dies, or takes more time or memory than a file of this size can need.
    """
    with readable(source) as file, Reader(kind, file) as reader:
        return reader.read(source, **wanted)


def ask_isolated(source: Input, kind: str) -> dict[str, Any]:
    """Read a design in a process of its own.

    Parameters
    ----------
    source : Input
    kind : {"step", "ifc"}

    Returns
    -------
    dict
        See `cylx.io.isolated_child`.

    Raises
    ------
    InputError
        As `read_isolated`.
    """
    with readable(source) as file, Reader(kind, file) as reader:
        return reader.ask(source)


def spool_isolated(source: Input, kind: str, target: IO[bytes], **wanted: int | None) -> tuple[int, np.dtype[np.void]]:
    """Read all points as `read_isolated` does, into a file without a header.

    Parameters
    ----------
    source : Input
    kind : {"las", "e57", "pcd"}
    target : binary file
        With a name, open for reading and writing. It is written piece by piece, and need not fit into memory.
    **wanted : int or None

    Returns
    -------
    count : int
        Number of rows.
    dtype : dtype
        Of a row.

    Raises
    ------
    InputError
        As `read_isolated`.
    OSError
        If the disk has no room for them.
    """
    with readable(source) as file, Reader(kind, file, target) as reader:
        return reader.fill(source, **wanted)


class Reader:
    """A process that reads one file, or several files one after the other.

    Parameters
    ----------
    kind : {"las", "e57", "pcd", "step", "ifc"}
    file : file
        A file with a name, or on Linux any file; its content is read anew for each request.
    target : file, optional
        Where the points go; by default an unnamed file.
    """

    def __init__(self, kind: str, file: IO[bytes], target: IO[bytes] | None = None) -> None:
        self.kind = kind
        self.file = file
        self._remedy = _REMEDY_OF_DESIGN if kind in _MODEL else _REMEDY
        self._given = target
        self._stack = ExitStack()
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def __enter__(self) -> Reader:
        """Start the process."""
        with ExitStack() as stack:
            self.target = self._given or stack.enter_context(target_file())
            names, fds = zip(*(stack.enter_context(passed_on(one)) for one in (self.file, self.target)), strict=True)
            self._process = stack.enter_context(started([fd for fd in fds if fd is not None]))
            self._target_name = names[1]
            self._send([search_path(), self.kind, os.getpid(), names[0]])
            threading.Thread(target=self._listen, daemon=True).start()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """Kill the process."""
        self._stack.close()

    @property
    def alive(self) -> bool:
        """Whether the process can be asked again."""
        return self._process.poll() is None

    def read(self, source: Input, **wanted: int | None) -> NDArray[np.void]:
        """Let the process read the points of the file; see `read_isolated`."""
        count, dtype = self.fill(source, **wanted)
        if LINUX:
            return np.asarray(np.memmap(self.target, dtype, "c", shape=(count,)))
        self.target.seek(0)
        return np.fromfile(self.target, dtype, count)

    def fill(self, source: Input, **wanted: int | None) -> tuple[int, np.dtype[np.void]]:
        """Let the process read the file into the target; return the number of points, and the type of a row.

        Raises
        ------
        InputError
            As `ask`.
        """
        return self._shape(source.place, self.ask(source, **wanted))

    def ask(self, source: Input, **wanted: int | None) -> dict[str, Any]:
        """Let the process read the file, and return its answer.

        Parameters
        ----------
        source : Input
            Names and measures the file.
        **wanted : int or None

        Raises
        ------
        InputError
            As `read_isolated`. If the process has died or was killed, this object is of no further use.
        """
        unpacked = (wanted.get("points") or 0) * (wanted.get("width") or 0)
        seconds = _SECONDS + (source.size + unpacked) // _BYTES_A_SECOND
        most = max(_LEAST_TABLE, _MOST_EXPANSION * source.size)
        memory = _MEMORY + _MODEL.get(self.kind, 2) * source.size + _COPIES * unpacked
        memory += _MEMORY_A_THREAD * (os.cpu_count() or 1)
        request = {"place": source.place, "seconds": seconds, "memory": memory, "most": most, "wanted": wanted}
        request |= {"table_a_second": _TABLE_A_SECOND, "reserve": self._given is not None}
        self._send(request | {"target": self._target_name})
        line = self._answer(4 * seconds + most // _TABLE_A_SECOND)
        if line is None:
            raise InputError(source.place, "takes too long to read for a file of its size", self._remedy)
        if not line.endswith(b"\n"):
            raise InputError(source.place, self._cause_of_death(), self._remedy)
        return self._accepted(source.place, json.loads(line))

    def _send(self, request: object) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # a dead process shows when its answer is read
            self._process.stdin.write(json.dumps(request).encode("ascii") + b"\n")
            self._process.stdin.flush()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with suppress(OSError, ValueError):
            for line in self._process.stdout:
                self._answers.put(line)
        self._answers.put(b"")

    def _answer(self, seconds: int) -> bytes | None:
        """Wait for a line; None if it does not come in time. A stopped program (Ctrl-Z) does not count its pause."""
        for _ in range(seconds):
            with suppress(queue.Empty):
                return self._answers.get(timeout=1.0)
        return None

    def _cause_of_death(self) -> str:
        code = self._process.wait()
        name = _NAMES[self.kind]
        if code == -getattr(signal, "SIGXCPU", 0):
            return "takes too long to read for a file of its size"
        if code == -getattr(signal, "SIGKILL", 0):
            return f"the process that reads the {name} was killed, perhaps for want of memory"
        cause = signal.Signals(-code).name if code < 0 and -code in set(signal.Signals) else f"exit code {code}"
        return f"broken {name}: the library that reads it crashed ({cause})"

    def _accepted(self, place: str, answer: dict[str, Any]) -> dict[str, Any]:
        if "refused" in answer:
            raise InputError(*answer["refused"])
        if "memory" in answer:
            raise InputError(place, "asks for more memory than a file of its size can need", self._remedy)
        if "full" in answer:
            raise OSError(errno.ENOSPC, answer["full"])
        if "bug" in answer:
            raise RuntimeError(answer["bug"])
        return answer

    def _shape(self, place: str, answer: dict[str, Any]) -> tuple[int, np.dtype[np.void]]:
        columns = [(str(name), kind) for name, kind in answer["columns"] if _TYPE.fullmatch(kind)]
        count, dtype = int(answer["count"]), np.dtype(columns)
        if os.fstat(self.target.fileno()).st_size != count * dtype.itemsize:
            raise RuntimeError(f"the table of {place} has not its size")
        return count, dtype
