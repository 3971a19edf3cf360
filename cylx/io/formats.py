"""Find the format of a file by its suffix, or else by its first bytes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.errors import InputError
from cylx.io.foreign import Foreign, foreign_content, foreign_suffix

if TYPE_CHECKING:
    from cylx.io.inputs import Input

TEXT_SUFFIXES = (".xyz", ".txt", ".csv", ".pts", ".asc")
LAS_SUFFIXES = (".las", ".laz")
FORMATS = ("ply", "pcd", "xyz", "las", "e57", "npy", "ptx")
MAY_SAY_UNITS = ("las", "e57", "ptx")
"""Formats whose files may say the unit of their lengths."""
_CERTAIN = {
    ".ply": "ply",
    ".pcd": "pcd",
    **dict.fromkeys(LAS_SUFFIXES, "las"),
    ".e57": "e57",
    ".ptx": "ptx",
    ".npy": "npy",
    ".npz": "npy",
}
PTX_HEADER = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
"""Numbers in each line above the points of a scan of a PTX file."""
PTX_NUMBER = re.compile(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_ZIP = b"PK\x03\x04"
_BEGINNINGS = {
    b"LASF": "las",
    b"ASTM-E57": "e57",
    b"\x93NUMPY": "npy",
    _ZIP: "npy",
    **dict.fromkeys((b"ply\n", b"ply\r", b"ply ", b"PLY\n", b"PLY\r"), "ply"),
    **dict.fromkeys((b"# .PCD", b"#.PCD", b"# .pcd", b"VERSION", b"FIELDS", b"version 0.", b"version ."), "pcd"),
}
_HEAD = 1024
_BOM = b"\xef\xbb\xbf"
_WIDE_TEXT = (b"\xff\xfe", b"\xfe\xff")
_ARCHIVES = (".zip", ".xlsx", ".docx", ".ods", ".odt", ".kmz", ".usdz", ".3mf", ".ifczip")


def silent_suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that never say the unit of their lengths."""
    return (*(suffix for suffix, kind in _CERTAIN.items() if kind not in MAY_SAY_UNITS), *TEXT_SUFFIXES)


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
    whole = source.head(_HEAD)
    if suffix in _CERTAIN:
        foreign = foreign_content(whole)
        if foreign is not None:
            raise _unread(source, foreign)
        return _CERTAIN[suffix]
    head = whole.removeprefix(_BOM).lstrip()
    for beginning, kind in _BEGINNINGS.items():
        if head.startswith(beginning) and not (beginning == _ZIP and suffix in _ARCHIVES):
            return kind
    if is_ptx(whole):
        return "ptx"
    foreign = foreign_suffix(suffix) or foreign_content(whole)
    if foreign is not None:
        raise _unread(source, foreign)
    if suffix not in TEXT_SUFFIXES and b"\0" in head and not whole.startswith(_WIDE_TEXT):
        raise InputError(source.place, "is neither text nor of a format that cylx reads", "convert it to PLY")
    return "xyz"


def is_ptx(head: bytes) -> bool:
    """Return whether a file that begins with these bytes is PTX."""
    lines = head.removeprefix(b"\xef\xbb\xbf").lstrip().splitlines()[: len(PTX_HEADER)]
    words = [line.split() for line in lines]
    if len(words) == len(PTX_HEADER) and not head.endswith(b"\n") and len(head.splitlines()) == len(PTX_HEADER):
        words = words[:-1]  # the last line may be cut
    expected = list(PTX_HEADER)[: max(len(words), len(PTX_HEADER) - 1)]
    return [len(one) for one in words] == expected and all(PTX_NUMBER.fullmatch(w) for one in words for w in one)


def _unread(source: Input, foreign: Foreign) -> InputError:
    return InputError(source.place, f"is {foreign.name}, which cylx does not read", foreign.remedy)
