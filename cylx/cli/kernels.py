"""A quick start: Numba without what no kernel here needs, and garbage collected when there is some."""

from __future__ import annotations

import gc
import sys
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
