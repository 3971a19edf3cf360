"""Whether an annotated cloud that was written earlier is whole: its rows and its size are what its header says."""

from __future__ import annotations

import re
import struct
from pathlib import Path

from cylx.io.formats import LAS_SUFFIXES

_MOST_HEADER = 1 << 20
_PLY_SIZES = {
    **dict.fromkeys((b"char", b"uchar", b"int8", b"uint8"), 1),
    **dict.fromkeys((b"short", b"ushort", b"int16", b"uint16"), 2),
    **dict.fromkeys((b"int", b"uint", b"float", b"int32", b"uint32", b"float32"), 4),
    **dict.fromkeys((b"double", b"float64"), 8),
}


def is_whole_cloud(path: str | Path, rows: int) -> bool:
    """Return whether a PLY, PCD, LAS or LAZ as we write them has its points and is not cut short.

    Parameters
    ----------
    path : str or Path
    rows : int
        Number of points that it should have.
    """
    try:
        size = Path(path).stat().st_size
        with Path(path).open("rb") as file:
            head = file.read(_MOST_HEADER)
        suffix = Path(path).suffix.lower()
        if suffix in LAS_SUFFIXES:
            return _is_whole_las(head, size, rows)
        return _is_whole_pcd(head, size, rows) if suffix == ".pcd" else _is_whole_ply(head, size, rows)
    except (OSError, ValueError, KeyError, struct.error):
        return False


def _is_whole_ply(head: bytes, size: int, rows: int) -> bool:
    text, end, _ = head.partition(b"end_header\n")
    count = re.search(rb"^element vertex (\d+)$", text, re.MULTILINE)
    kinds = re.findall(rb"^property (\w+)(?: \w+ \w+)? [!-~]+$", text, re.MULTILINE)
    if not end or count is None or int(count[1]) != rows:
        return False
    least = sum(1 if kind == b"list" else _PLY_SIZES[kind] for kind in kinds) * rows + len(text) + len(end)
    return size >= least if b"list" in kinds else size == least


def _is_whole_pcd(head: bytes, size: int, rows: int) -> bool:
    text, end, _ = head.partition(b"DATA binary\n")
    sizes = re.search(rb"^SIZE ([\d ]+)$", text, re.MULTILINE)
    count = re.search(rb"^POINTS (\d+)$", text, re.MULTILINE)
    if not end or count is None or sizes is None or int(count[1]) != rows:
        return False
    return size == sum(map(int, sizes[1].split())) * rows + len(text) + len(end)


def _is_whole_las(head: bytes, size: int, rows: int) -> bool:
    start = struct.unpack_from("<I", head, 96)[0]
    kind, width, points = struct.unpack_from("<BHI", head, 104)
    after = 0  # the records after the points
    if head[25] >= 4:
        after, _, points = struct.unpack_from("<QIQ", head, 235)
    if head[:4] != b"LASF" or points != rows or after > size:
        return False
    if kind & 0x80:
        table = struct.unpack_from("<q", head, start)[0]
        return bool(start + 8 <= table <= size - 8)
    return bool(size >= start + width * rows)
