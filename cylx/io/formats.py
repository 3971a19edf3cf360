"""Find the format of a file by its suffix, or else by its first bytes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cylx.errors import InputError

if TYPE_CHECKING:
    from cylx.io.inputs import Input

TEXT_SUFFIXES = (".xyz", ".txt", ".csv", ".pts", ".asc")
LAS_SUFFIXES = (".las", ".laz")
FORMATS = ("ply", "pcd", "xyz", "las", "e57", "npy")
_CERTAIN = {
    ".ply": "ply",
    ".pcd": "pcd",
    **dict.fromkeys(LAS_SUFFIXES, "las"),
    ".e57": "e57",
    ".npy": "npy",
    ".npz": "npy",
}
_BEGINNINGS = {
    b"LASF": "las",
    b"ASTM-E57": "e57",
    b"\x93NUMPY": "npy",
    b"PK\x03\x04": "npy",
    b"ply\n": "ply",
    b"ply\r": "ply",
    **dict.fromkeys((b"# .PCD", b"#.PCD", b"VERSION", b"FIELDS"), "pcd"),
}


def cloud_suffix(path: str | Path) -> str:
    """Return the suffix of a cloud in lower case; `.gz` is ignored.

    Examples
    --------
    >>> cloud_suffix("site/scan.PLY.gz")
    '.ply'
    """
    return Path(cloud_name(path)).suffix.lower()


def cloud_name(path: str | Path) -> str:
    """Return a path without its `.gz`, if it has one.

    Examples
    --------
    >>> cloud_name("site/scan.ply.gz")
    'site/scan.ply'
    """
    name = str(path)
    return name[:-3] if name.lower().endswith(".gz") else name


def recognise(source: Input, suffix: str) -> str:
    """Find the format of an input, one of `FORMATS`.

    Parameters
    ----------
    source : Input
    suffix : str
        Suffix of its name, in lower case.

    Raises
    ------
    InputError
        If it is neither of a known format nor text.
    """
    if suffix in _CERTAIN:
        return _CERTAIN[suffix]
    head = source.head(1024).lstrip()
    for beginning, kind in _BEGINNINGS.items():
        if head.startswith(beginning):
            return kind
    if suffix not in TEXT_SUFFIXES and b"\0" in head:
        raise InputError(source.place, "is neither text nor of a format that cylx reads", "convert it to PLY")
    return "xyz"
