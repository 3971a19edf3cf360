"""Damaged files of every format: one line that says so, or a cloud; never a traceback, never much memory."""

import struct
import tracemalloc

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud

POINTS = np.round(np.random.default_rng(0).normal(size=(6, 3)), 6)
ROWS = ["{!r} {!r} {!r} 7".format(*point) for point in POINTS.tolist()]
FACE = "element face 2\nproperty list uint int vertex_indices\n"
NEAR = "property list uchar int near\n"
FLIPS = 120


def ply(kind, *, near="", before="", after=""):
    vertices = f"element vertex 6\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n{near}"
    header = f"ply\nformat {kind} 1.0\ncomment a sample\n{before}{vertices}{after}end_header\n"
    if kind == "ascii":
        rows = "".join(f"{row} 2 5 6\n" if near else f"{row}\n" for row in ROWS)
        face = "3 0 1 2\n" * 2
        return (header + (face if before else "") + rows + (face if after else "")).encode()
    order = "<" if "little" in kind else ">"
    tail = struct.pack(f"{order}Bii", 2, 5, 6) if near else b""
    body = b"".join(struct.pack(f"{order}dddB", *point, 7) + tail for point in POINTS)
    face = struct.pack(f"{order}I3i", 3, 0, 1, 2) * 2
    return header.encode() + (face if before else b"") + body + (face if after else b"")


def pcd(kind):
    names = "FIELDS x y z i\nSIZE 8 8 8 4\nTYPE F F F U\nCOUNT 1 1 1 2\n"
    header = f"# .PCD v0.7\nVERSION 0.7\n{names}WIDTH 3\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 6\nDATA {kind}\n"
    if kind == "ascii":
        return (header + "".join(f"{row} 8\n" for row in ROWS)).encode()
    if kind == "binary":
        return header.encode() + b"".join(struct.pack("<dddII", *point, 7, 8) for point in POINTS)
    raw = POINTS.T.tobytes() + struct.pack("<12I", *[7, 8] * 6)
    packed = b"".join(bytes([len(part) - 1]) + part for part in (raw[k : k + 32] for k in range(0, len(raw), 32)))
    return header.encode() + struct.pack("<II", len(packed), len(raw)) + packed


KINDS = ("ascii", "binary_little_endian", "binary_big_endian")
FILES = {
    **{f"{kind}.ply": ply(kind) for kind in KINDS},
    **{f"{kind}-near.ply": ply(kind, near=NEAR) for kind in KINDS},
    **{f"{kind}-face-after.ply": ply(kind, after=FACE) for kind in KINDS},
    **{f"{kind}-face-before.ply": ply(kind, before=FACE) for kind in KINDS},
    **{f"{kind}.pcd": pcd(kind) for kind in ("ascii", "binary", "binary_compressed")},
    "plain.xyz": "".join(f"{row}\n" for row in ROWS).encode(),
    "named.csv": ("x,y,z,label\n" + "".join(row.replace(" ", ",") + "\n" for row in ROWS)).encode(),
    "counted.pts": ("6\n" + "".join(f"{row}\n" for row in ROWS)).encode(),
}


def damaged(data):
    """Cut the file short, and change a few of its bytes."""
    for size in range(1, len(data), 9):
        yield data[:size]
    rng = np.random.default_rng(len(data))
    for _ in range(FLIPS):
        changed = bytearray(data)
        for place in rng.integers(len(data), size=rng.integers(1, 4)):
            changed[place] = rng.integers(256) if rng.random() < 0.5 else changed[place] ^ 1 << rng.integers(8)
        yield bytes(changed)


@pytest.mark.parametrize("name", FILES)
def test_damaged_files_are_refused_or_read(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(FILES[name])
    assert np.array_equal(read_cloud(path).points, POINTS)  # it can be read as long as it is whole; open3d is there now
    refusals = []
    tracemalloc.start()
    try:
        for data in damaged(FILES[name]):
            path.write_bytes(data)
            try:
                cloud = read_cloud(path)
            except InputError as error:
                refusals.append(str(error))
            else:
                assert 0 < len(cloud.points) <= cloud.rows
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
    assert len(refusals) > 10
    assert all(line.isprintable() and line.startswith(str(path)) for line in refusals)
