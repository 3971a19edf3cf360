"""Start the process that decodes files, and hand it the files it reads and writes; see `isolated`."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager, suppress
from multiprocessing import spawn
from pathlib import Path
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cylx.io.inputs import Input

START = (
    "import json, sys; sys.path[:], *about = json.loads(sys.stdin.buffer.readline()); "
    "from cylx.io.isolated_child import serve; serve(*about)"
)
LINUX = sys.platform.startswith("linux")


@contextmanager
def started(fds: list[int]) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process that ignores the settings of Python in the environment; kill it at the end."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
    command = [os.fsdecode(spawn.get_executable() or sys.executable), "-I", "-S", "-c", START]
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
def target_file() -> Iterator[IO[bytes]]:
    """Yield an empty file for the points: in memory on Linux where Python can, else on disk."""
    if LINUX:
        in_memory = hasattr(os, "memfd_create")  # not in all builds of Python
        with os.fdopen(os.memfd_create("cylx"), "r+b") if in_memory else tempfile.TemporaryFile() as file:
            yield file
        return
    with tempfile.TemporaryDirectory(prefix="cylx-") as folder, (Path(folder) / "points").open("w+b") as file:
        yield file


@contextmanager
def readable(source: Input) -> Iterator[IO[bytes]]:
    """Yield the file of an input as one that another process can open: on Linux any, elsewhere one with a name."""
    if LINUX:
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
def passed_on(file: IO[bytes]) -> Iterator[tuple[str, int | None]]:
    """Yield the name of a file for the process, and the descriptor that it inherits for this; not one of 0 to 2."""
    if not LINUX:
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


def search_path() -> list[str]:
    """Return where the process finds its modules: as here, but never in the current folder."""
    home = str(Path(__file__).resolve().parents[2])
    places = [str(place) for place in sys.path if place]
    return places if home in places else [home, *places]
