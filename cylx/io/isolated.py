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
import subprocess
import sys
import tempfile
import threading
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import spawn
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_START = (
    "import json, sys; sys.path[:], *about = json.loads(sys.stdin.buffer.readline()); "
    "from cylx.io.isolated_child import serve; serve(*about)"
)
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
_LINUX = sys.platform.startswith("linux")
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
    with _readable(source) as file, Reader(kind, file) as reader:
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
    with _readable(source) as file, Reader(kind, file) as reader:
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
    with _readable(source) as file, Reader(kind, file, target) as reader:
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
            self.target = self._given or stack.enter_context(_target())
            names, fds = zip(*(stack.enter_context(_passed_on(one)) for one in (self.file, self.target)), strict=True)
            self._process = stack.enter_context(_process([fd for fd in fds if fd is not None]))
            self._target_name = names[1]
            self._send([_search_path(), self.kind, os.getpid(), names[0]])
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
        if _LINUX:
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


@contextmanager
def _process(fds: list[int]) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process that ignores the settings of Python in the environment; kill it at the end."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
    command = [os.fsdecode(spawn.get_executable() or sys.executable), "-I", "-S", "-c", _START]
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=nothing, pass_fds=fds, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()


@contextmanager
def _target() -> Iterator[IO[bytes]]:
    """Yield an empty file for the points: in memory on Linux where Python can, else on disk."""
    if _LINUX:
        in_memory = hasattr(os, "memfd_create")  # not in all builds of Python
        with os.fdopen(os.memfd_create("cylx"), "r+b") if in_memory else tempfile.TemporaryFile() as file:
            yield file
        return
    with tempfile.TemporaryDirectory(prefix="cylx-") as folder, (Path(folder) / "points").open("w+b") as file:
        yield file


@contextmanager
def _readable(source: Input) -> Iterator[IO[bytes]]:
    """Yield the file of an input as one that another process can open: on Linux any, elsewhere one with a name."""
    if _LINUX:
        yield source.file
        return
    if source.path is not None:
        with source.path.open("rb") as file:
            yield file
        return
    with tempfile.TemporaryDirectory(prefix="cylx-") as folder:
        path = Path(folder) / "scan"
        source.file.seek(0)
        with path.open("wb") as copy:
            while block := source.file.read(1 << 20):
                copy.write(block)
        with path.open("rb") as file:
            yield file


@contextmanager
def _passed_on(file: IO[bytes]) -> Iterator[tuple[str, int | None]]:
    """Yield the name of a file for the process, and the descriptor that it inherits for this; not one of 0 to 2."""
    if not _LINUX:
        yield str(Path(file.name).absolute()), None
        return
    import fcntl  # noqa: PLC0415  not on Windows

    descriptor = file.fileno()
    if descriptor > 2:
        yield f"/proc/self/fd/{descriptor}", descriptor
        return
    descriptor = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 3)
    try:
        yield f"/proc/self/fd/{descriptor}", descriptor
    finally:
        os.close(descriptor)


def _search_path() -> list[str]:
    """Return where the process finds its modules: as here, but never in the current folder."""
    home = str(Path(__file__).resolve().parents[2])
    places = [str(place) for place in sys.path if place]
    return places if home in places else [home, *places]
