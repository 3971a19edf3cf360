"""Standard input, output and error of the command line: always open, and apart from what libraries print."""

from __future__ import annotations

import io
import os
import sys
import warnings
from typing import TextIO, cast

_own: list[bool] = []


def occupy_closed_streams() -> None:
    """Open the null device in place of closed standard streams, or the next file would take their place.

    Standard output stays closed for Python, so that an answer that cannot be given is an error. Messages that nobody
    can see are none.
    """
    file = os.open(os.devnull, os.O_RDWR)
    while file <= 2:
        os.set_inheritable(file, True)
        file = os.open(os.devnull, os.O_RDWR)
    os.close(file)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115  open until the end
    _own.append(True)


def keep_libraries_apart(*, quiet: bool) -> None:
    """Send what libraries print on standard output to standard error, and with `quiet` nowhere.

    Python's own streams go on as before. Only in a process of the command line, until its end.

    Parameters
    ----------
    quiet : bool
        Whether warnings of libraries are not shown either.
    """
    if not _own or os.name == "nt":
        return
    if sys.stdout is not None and _is_at(sys.stdout, 1):
        sys.stdout = _elsewhere(sys.stdout)
    if quiet:
        warnings.simplefilter("ignore")
        if _is_at(sys.stderr, 2):
            sys.stderr = _elsewhere(sys.stderr)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2)
        os.close(null)
    os.dup2(2, 1)


def _is_at(stream: TextIO, file: int) -> bool:
    try:
        return stream.fileno() == file
    except (OSError, ValueError, io.UnsupportedOperation):
        return False


def _elsewhere(stream: TextIO) -> TextIO:
    """Return the same stream on another descriptor."""
    stream.flush()
    old = cast("io.TextIOWrapper", stream)
    raw = os.fdopen(os.dup(old.fileno()), "wb")
    return io.TextIOWrapper(raw, old.encoding, old.errors, line_buffering=old.line_buffering)
