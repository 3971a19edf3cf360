"""What is at a path that somebody gave, where a name may be too long and a folder may not be searched.

`pathlib` raises for such a path, before Python 3.14; here there is nothing, and who opens it says what is wrong.
"""

from __future__ import annotations

import os
from pathlib import Path


def has_file(path: str | Path) -> bool:
    """Return whether there is a file at a path, or a link to one, as far as can be seen."""
    return os.path.isfile(path)  # noqa: PTH113  `Path` raises


def has_folder(path: str | Path) -> bool:
    """Return whether there is a folder at a path, or a link to one, as far as can be seen."""
    return os.path.isdir(path)  # noqa: PTH112  `Path` raises


def has_anything(path: str | Path) -> bool:
    """Return whether there is anything at a path, or at the end of the links there, as far as can be seen."""
    return os.path.exists(path)  # noqa: PTH110  `Path` raises
