"""Fast start and exit: skip imports that are not needed, and run the garbage collector rarely."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

BLAS = "scipy.linalg.cython_blas"


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
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        yield
    finally:
        gc.freeze()
