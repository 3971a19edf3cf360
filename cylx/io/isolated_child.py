"""The process that decodes files by native libraries, under limits; see `isolated` for the side that starts it.

It reads one request a line, fills a file with the points, and answers one line; a design is in the answer itself. It
imports only what the format needs.
"""

# ruff: noqa: PLC0415  (only what the format needs)
from __future__ import annotations

import ctypes
import json
import mmap
import os
import signal
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_LIBRARIES = {
    "las": ("laspy", "lazrs", "cylx.io.las"),
    "e57": ("pye57", "cylx.io.e57"),
    "pcd": ("cylx.io.pcd",),
    "step": ("cylx.io.design_step", "OCP.STEPCAFControl", "OCP.BRepAdaptor", "OCP.XCAFDoc", "OCP.TopExp"),
    "ifc": ("cylx.io.design_ifc", "ifcopenshell.util.placement", "ifcopenshell.util.unit"),
}
_DESIGNS = {"step", "ifc"}
_NEW_USER, _NEW_NETWORK = 0x10000000, 0x40000000  # of unshare(2)
_DIE_WITH_PARENT = 1  # of prctl(2)


def serve(kind: str, parent: int, request_name: str) -> None:
    """Answer the requests on standard input until it ends.

    Parameters
    ----------
    kind : {"las", "e57", "pcd", "step", "ifc"}
        The format of all files.
    parent : int
        Id of the process that asks.
    request_name : str
        The file to read, as a name that this process can open; its content may change between two requests.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # libraries may print
    _die_with(parent)
    _leave_network(request_name)
    _import_libraries(kind)
    for line in sys.stdin.buffer:
        answers.write(json.dumps(_answer(kind, json.loads(line), request_name)).encode() + b"\n")
        answers.flush()


class NoRoomError(BaseException):
    """The disk has no room for the points; not an `Exception`, as readers take these for faults of the file."""


class Target:
    """The file that receives the points, mapped into memory.

    Parameters
    ----------
    name : str
        A file that exists.
    most : int
        Largest size in bytes.
    rate : int
        Bytes for which a second is added to the time allowed.
    reserve : bool
        Whether the room on the disk is taken first: a disk that is full later would kill the process.
    """

    def __init__(self, name: str, most: int, rate: int, *, reserve: bool = False) -> None:
        self.name = name
        self.rate = rate
        self.most = most
        self.reserve = reserve
        self.table: NDArray[np.void] | None = None

    def __call__(self, count: int, dtype: np.dtype[np.void]) -> NDArray[np.void]:
        """Return a table of zeros in the file.

        Raises
        ------
        MemoryError
            If it would be larger than allowed.
        NoRoomError
            If the disk has no room for it.
        """
        import numpy as np

        size = count * dtype.itemsize
        if size > self.most:
            raise MemoryError
        _allow_table(size, self.rate)
        with Path(self.name).open("r+b") as file:
            file.truncate(0)
            file.truncate(size)
            if self.reserve and hasattr(os, "posix_fallocate"):
                try:
                    os.posix_fallocate(file.fileno(), 0, size)
                except OSError as error:
                    raise NoRoomError(error.strerror) from None
            mapped = mmap.mmap(file.fileno(), size)
        self.table = np.frombuffer(mapped, dtype, count)
        return self.table


def _answer(kind: str, request: dict[str, Any], name: str) -> dict[str, Any]:
    from cylx.errors import InputError
    from cylx.io.inputs import Input

    _limit(request["seconds"], request["memory"])
    target = Target(request["target"], request["most"], request["table_a_second"], reserve=request["reserve"])
    try:
        with Path(name).open("rb") as file:
            source = Input(request["place"], file, os.fstat(file.fileno()).st_size, "", Path(file.name))
            if kind in _DESIGNS:
                return _design(kind, source)
            table = _read(kind, source, request, target)
    except InputError as error:
        return {"refused": [error.place, error.fault, error.remedy]}
    except MemoryError:
        return {"memory": True}
    except NoRoomError as error:
        return {"full": str(error)}
    except BaseException as error:  # noqa: BLE001  a panic of Rust, too
        return {"bug": f"{type(error).__name__}: {error}"}
    return {"count": len(table), "columns": [(column, table.dtype[column].str) for column in table.dtype.names or ()]}


def _read(kind: str, source: Input, request: dict[str, Any], target: Target) -> NDArray[np.void]:
    if kind == "e57":
        from cylx.io.e57 import read_e57

        return read_e57(source, allocate=target, **request["wanted"])
    if kind == "pcd":
        from cylx.io.pcd import unpack_body

        return unpack_body(source, allocate=target, **request["wanted"])
    from cylx.io.las import read_las

    return read_las(source, allocate=target)


def _design(kind: str, source: Input) -> dict[str, Any]:
    """Return the units, the metres and the cylinders of a design: name, start, end and radius of each."""
    if kind == "step":
        from cylx.io.design_step import read_step as read
    else:
        from cylx.io.design_ifc import read_ifc as read
    design = read(source)
    cylinders = [(one.name, one.start, one.end, one.radius) for one in design.cylinders]
    return {"units": design.units, "metres": design.metres, "cylinders": cylinders}


def _import_libraries(kind: str) -> None:
    """Import everything before the limits count, and before anything of the file is read."""
    with suppress(Exception):  # the reader says it
        for name in _LIBRARIES[kind]:
            import_module(name)
    if kind == "pcd":
        from cylx.optional.open3d import import_open3d

        with suppress(Exception):
            import_open3d()


def _limit(seconds: int, memory: int) -> None:
    """Limit the time and memory of a request, beyond what is used already; leave no core files."""
    with suppress(ImportError):  # Windows has no such limits
        import resource

        usage = resource.getrusage(resource.RUSAGE_SELF)
        _set(resource.RLIMIT_CPU, int(usage.ru_utime + usage.ru_stime) + seconds)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if (held := _held()) is not None:
            _set(resource.RLIMIT_AS, held + memory)


def _allow_table(size: int, rate: int) -> None:
    """Raise the limits of time and memory by what the table needs."""
    with suppress(ImportError):
        import resource

        soft, _ = resource.getrlimit(resource.RLIMIT_CPU)
        if soft != resource.RLIM_INFINITY:
            _set(resource.RLIMIT_CPU, soft + size // rate)
        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        if _held() is not None and soft != resource.RLIM_INFINITY:
            _set(resource.RLIMIT_AS, soft + size)


def _set(limit: int, value: int) -> None:
    """Set a limit, as far as that of the parent allows it."""
    import resource

    _, hard = resource.getrlimit(limit)
    with suppress(ValueError, OSError):
        resource.setrlimit(limit, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def _held() -> int | None:
    """Return the address space of this process in bytes; None where the system does not tell, and has no limit."""
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    except (OSError, ValueError):
        return None
    return pages * mmap.PAGESIZE


def _die_with(parent: int) -> None:
    """Let Linux kill this process when its parent ends; elsewhere it ends when it next reads or answers."""
    if not sys.platform.startswith("linux"):
        return
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)


def _leave_network(name: str) -> None:
    """Move this process into a network of its own, without a connection, where Linux permits it."""
    if not sys.platform.startswith("linux"):
        return
    with suppress(OSError, AttributeError):
        unshare = ctypes.CDLL(None, use_errno=True).unshare
        if unshare(_NEW_NETWORK) == 0:
            return
        about = Path(name).stat()  # in a user namespace root may open only what is its own
        if about.st_uid == os.geteuid() or about.st_mode & 0o004 or os.geteuid() != 0:
            unshare(_NEW_USER | _NEW_NETWORK)
