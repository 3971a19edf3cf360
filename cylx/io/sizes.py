"""Estimate the number of points in a file without reading all of it."""

from __future__ import annotations

import re
from pathlib import Path

from cylx.io.existing import has_file

_HEAD = 1 << 16
_BOM = b"\xef\xbb\xbf"
_PROMISES = {
    b"ply": re.compile(rb"[\r\n][ \t]*element[ \t]+(?:vertex|vertices|points?)[ \t]+(\d{1,18})\b", re.IGNORECASE),
    b"#": re.compile(rb"[\r\n]POINTS[ \t]+(\d{1,18})\b"),
    b"VERSION": re.compile(rb"[\r\n]POINTS[ \t]+(\d{1,18})\b"),
}
_BYTES_A_POINT = 8
"""Bytes per point in a binary file without a known header."""


def expected_points(path: str | Path) -> int:
    """Estimate the number of points in a file from its header, or else from its size.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    int
        0 if there is no such file, or no estimate.
    """
    try:
        if not has_file(path):  # a pipe can be read only once
            return 0
        size = Path(path).stat().st_size
        with Path(path).open("rb") as file:
            head = file.read(_HEAD)
    except (OSError, ValueError):
        return 0
    promised = _promised(head)
    if promised is not None:
        return min(promised, size)
    if b"\0" in head:
        return size // _BYTES_A_POINT
    return size * (head.count(b"\n") + 1) // max(len(head), 1)


def _promised(head: bytes) -> int | None:
    """Return the number of points in a header, None if there is none."""
    if head.startswith(b"LASF") and len(head) >= 255:
        long = int.from_bytes(head[247:255], "little") if head[25] >= 4 else 0
        return long or int.from_bytes(head[107:111], "little")
    head = head.removeprefix(_BOM)
    for start, pattern in _PROMISES.items():
        if head[: len(start)].lower() == start.lower() and (found := pattern.search(head)):
            return int(found[1])
    return None
