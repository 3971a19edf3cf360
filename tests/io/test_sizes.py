"""How many points a file has, told before it is read."""

import pytest

from cylx.io import expected_points

LAS = bytearray(375)

LAS[:4], LAS[25], LAS[247:249] = b"LASF", 4, b"\x10\x01"


@pytest.mark.parametrize(
    ("content", "points"),
    [
        (b"ply\nformat ascii 1.0\nelement vertex 7\nproperty float x\n" + bytes(100), 7),
        (b"ply\r\nformat ascii 1.0\r\nelement vertex 123456789\r\n", 49),
        (b"# .PCD v.7\nVERSION .7\nPOINTS 9\nDATA binary\n" + bytes(100), 9),
        (b"VERSION .7\nPOINTS 9\nDATA ascii\n", 9),
        (bytes(LAS), 272),
        (b"1 2 3\n" * 1000, 1000),
        (b"1 2 3\n" * 100_000, 100_000),
        (b"\0" * 800, 100),
        (b"", 0),
    ],
)
def test_points_are_expected_by_header_or_size(tmp_path, content, points):
    (tmp_path / "scan").write_bytes(content)
    assert expected_points(tmp_path / "scan") == pytest.approx(points, rel=0.001)
    assert expected_points(tmp_path / "gone") == expected_points(tmp_path) == 0
