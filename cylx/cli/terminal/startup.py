"""Start and end of the command line in its own process: fast, and with nothing left behind."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

from cylx.cli.terminal.signals import Ended, deafen, end_by, listen
from cylx.cli.terminal.streams import occupy_closed_streams

BLAS = "scipy.linalg.cython_blas"
INTERRUPTED = 130


def import_numba_without_blas() -> None:
    """Import the part of Numba that looks for BLAS while hiding BLAS from it.

    Numba would import all of scipy.linalg for BLAS, which takes longer than reading a cloud. The kernels of cylx do not
    multiply matrices. A program that imports cylx may, so only the command line hides BLAS, in its own process.
    """
    if BLAS in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules[BLAS] = None  # type: ignore[assignment]  # the import system treats None as "not found"
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules[BLAS]


def collect_rarely() -> None:
    """Run the garbage collector rarely: imports make half a million permanent objects, which it scans again and again.

    Arrays do not need it: reference counting frees them.
    """
    gc.set_threshold(100_000, 50, 100)


@contextmanager
def own_process() -> Iterator[None]:
    """Switch off features for long-lived processes: early and final garbage collection, and plug-ins.

    Pydantic searches the metadata of all installed packages for plug-ins, and the interpreter collects garbage once
    more at exit; each takes a tenth of a second.
    """
    collect_rarely()
    occupy_closed_streams()
    listen()
    os.environ.pop("NUMBA_DISABLE_JIT", None)  # without compiling, a scan would take days
    os.environ.pop("NUMBA_NUM_THREADS", None)  # of threads that no kernel uses; Numba cannot be imported with 0
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # processes that are started look for no modules in the current folder, which may be full of files of others; they
    # are told where the modules are (for Python 3.10, which does not know this variable, see `isolate_processes`)
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    try:
        yield
    except KeyboardInterrupt:  # before the command, or after it
        raise SystemExit(INTERRUPTED) from None
    except Ended as ended:
        _finish()
        end_by(ended.number)
    finally:
        _finish()


def _finish() -> None:
    """Remove unfinished outputs, and leave the rest to the system."""
    deafen()
    if (staging := sys.modules.get("cylx.io.staging")) is not None:
        staging.remove_unfinished()
    gc.freeze()
