"""LAZ files with one number changed, for which lazrs would allocate gigabytes or abort."""

import struct

import laspy
import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud

CHUNK = "the table of its compressed chunks is damaged; get a complete copy of the file"
LAYER = "a compressed chunk is damaged; get a complete copy of the file"
N = 200


def laz(path, kind, version, points=N, extra=0):
    header = laspy.LasHeader(point_format=kind, version=version)
    header.scales = [0.001] * 3
    header.add_extra_dims([laspy.ExtraBytesParams(f"extra{place}", "u1") for place in range(extra)])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = np.random.default_rng(0).uniform(0, 3, (3, points))
    cloud.write(str(path))
    return bytearray(path.read_bytes())


def outcome(path, data):
    path.write_bytes(data)
    try:
        return len(read_cloud(path).points)
    except InputError as refused:
        return str(refused).removeprefix(f"{path}: ")


@pytest.fixture(params=[(3, "1.2"), (7, "1.4")], ids=["in one piece", "in layers"])
def kind(request):
    return request.param


@pytest.mark.parametrize(
    ("size", "right"),
    [(0, CHUNK), (1, CHUNK), (7, CHUNK), (50_001, N), (50_000 | 1 << 30, N), (0x7F000000, N), (0xFFFFFFFF, CHUNK)],
)
def test_another_size_of_chunks(tmp_path, kind, size, right):
    data = laz(tmp_path / "scan.laz", *kind)
    place = data.index(b"laszip encoded") - 2 + 54 + 12
    assert struct.unpack_from("<I", data, place)[0] == 50_000
    struct.pack_into("<I", data, place, size)
    assert outcome(tmp_path / "scan.laz", data) == right


@pytest.mark.parametrize("points", [0, 1, N - 1, N + 1, 50_001, 400_000_000, 0xFFFFFFFF])
def test_another_number_of_points(tmp_path, kind, points):
    data = laz(tmp_path / "scan.laz", *kind)
    struct.pack_into("<I", data, 107, points)
    if kind[1] == "1.4":
        struct.pack_into("<Q", data, 247, points)
    found = outcome(tmp_path / "scan.laz", data)
    assert isinstance(found, str) or found <= points
    if points > 1_000_000:
        assert "more than a file of" in found


@pytest.mark.parametrize("layer", range(-1, 12))
def test_another_size_of_a_layer(tmp_path, layer):
    data = laz(tmp_path / "scan.laz", 7, "1.4", extra=2)
    start, width = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<H", data, 105)[0]
    struct.pack_into("<I", data, start + 8 + width + 4 + 4 * layer, 0xC0000000)
    assert outcome(tmp_path / "scan.laz", data) == (N if layer < 0 else LAYER)


@pytest.mark.parametrize(("offset", "number"), [(4, 0x10000000), (4, 0), (4, 2), (4, 9), (8, 0xFFFFFFFF)])
def test_another_table(tmp_path, kind, offset, number):
    data = laz(tmp_path / "scan.laz", *kind)
    start = struct.unpack_from("<I", data, 96)[0]
    struct.pack_into("<I", data, struct.unpack_from("<q", data, start)[0] + offset, number)
    found = outcome(tmp_path / "scan.laz", data)
    assert found == N or found.endswith("get a complete copy of the file")


def test_equal_points_compress_a_lot(tmp_path):
    header = laspy.LasHeader(point_format=6, version="1.4")
    cloud = laspy.LasData(header)
    cloud.x = cloud.y = cloud.z = np.zeros(300_000)
    cloud.write(str(tmp_path / "flat.laz"))
    assert (tmp_path / "flat.laz").stat().st_size < 300_000 * 30 // 1500
    assert len(read_cloud(tmp_path / "flat.laz").points) == 300_000


def test_several_chunks_of_any_size(tmp_path):
    data = laz(tmp_path / "scan.laz", 7, "1.4", points=120_000)
    assert outcome(tmp_path / "scan.laz", data) == 120_000
