"""A quick start and end: nothing is imported that is not needed, and garbage is collected when there is some."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

BLAS = "scipy.linalg.cython_blas"


def import_numba_without_blas() -> None:
    """Import the part of Numba that looks for BLAS, with BLAS out of sight.

    It would import all of scipy.linalg for it, which takes longer than reading a cloud. No kernel of cylx multiplies
    matrices. Those of a program that imports cylx may, so that only the command line does this: its process is its own.
    """
    if BLAS in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules[BLAS] = None  # type: ignore[assignment]  # what the import system takes for "not to be found"
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules[BLAS]


def collect_rarely() -> None:
    """Let the garbage collector wait: imports make half a million objects, which all stay, and it looks at each often.

    Arrays are freed without it, when the last that holds them lets go.
    """
    gc.set_threshold(100_000, 50, 100)


@contextmanager
def own_process() -> Iterator[None]:
    """Do without what only long-lived processes need: garbage collected early and at the end, and plug-ins.

    Pydantic asks the metadata of everything that is installed for plug-ins, and the interpreter looks for garbage once
    more before it ends: a tenth of a second each.
    """
    collect_rarely()
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        yield
    finally:
        gc.freeze()
