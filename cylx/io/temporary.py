"""Temporary files beside what they become: their names tell whose they are, so that what the dead left can go."""

from __future__ import annotations

import contextlib
import os
import platform
import re
import secrets
import zlib
from functools import cache
from pathlib import Path

_NAME = re.compile(r"\.cylx-([0-9a-f]{8})-(\d+)-[0-9a-f]{16}(\..*)?", re.DOTALL)


def temporary_beside(target: Path, suffix: str) -> Path:
    """Name a temporary file in the folder of `target`, hidden, with the machine and the process in its name."""
    return target.with_name(f".cylx-{_machine()}-{os.getpid()}-{secrets.token_hex(8)}{suffix}")


def remove_leftovers(folder: str | Path, process: int | None = None) -> None:
    """Remove the temporary files that a process of this machine has left in a folder.

    Parameters
    ----------
    folder : str or Path
        What cannot be removed from it stays there.
    process : int, optional
        The id of a process that has ended; by default all that have ended.
    """
    with contextlib.suppress(OSError):
        for path in Path(folder).iterdir():
            found = _NAME.fullmatch(path.name)
            if found is None or found[1] != _machine():
                continue
            owner = int(found[2])
            if owner == process if process is not None else _has_ended(owner):
                with contextlib.suppress(OSError):
                    path.unlink()


@cache
def _machine() -> str:
    return f"{zlib.crc32(platform.node().encode('utf-8', 'replace')):08x}"


def _has_ended(process: int) -> bool:
    """Say whether a process is certainly gone; Windows has no way to ask that is not deadly."""
    if os.name == "nt":
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False
