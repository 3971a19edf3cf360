"""Of a file of any size the header and some pieces are enough to say what it is."""

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import glance, glance_at, write_cloud

MANY = 5_000_000_000
"""More points than four bytes can count."""


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch):
    monkeypatch.setattr(glance, "PIECES", 3)
    monkeypatch.setattr(glance, "ROWS", 500)


@pytest.fixture
def points():
    return np.random.default_rng(0).normal(size=(1500, 3)).round(3)


def test_rows_are_spread_over_the_file():
    assert glance._starts(MANY) == [(0, 500), (MANY // 2 - 250, MANY // 2 + 250), (MANY - 500, MANY)]
    assert glance._starts(1200) == [(0, 500), (350, 850), (700, 1200)]
    assert glance._starts(7) == [(0, 7)]


def huge_las(path, points, many=MANY):
    """Write a LAS file of very many points that takes hardly any place: those that are not looked at are zeros."""
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 1e-3), np.array([451000.0, 5411000.0, 300.0])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = (points + header.offsets).T
    cloud.write(path)
    data = path.read_bytes()
    start, width = int.from_bytes(data[96:100], "little"), header.point_format.size
    with path.open("r+b") as file:
        for number, (first, last) in enumerate(glance._starts(many)):
            file.seek(start + first * width)
            file.write(data[start + 500 * number * width :][: (last - first) * width])
        file.truncate(start + many * width)
        file.seek(107)
        file.write(bytes(4))
        file.seek(247)
        file.write(many.to_bytes(8, "little"))
    return points + header.offsets


def test_a_las_file_of_more_points_than_four_bytes_can_count(tmp_path, points):
    path = tmp_path / "scan.las"
    together = huge_las(path, points)
    seen = glance_at(path)
    assert seen.rows == MANY
    assert np.abs(seen.sample.points - together).max() < 1e-6
    assert np.abs(seen.bounds - [together.min(axis=0), together.max(axis=0)]).max() < 0.0011
    assert "gps_time" in seen.dtype.names


def test_copc(tmp_path, points):
    pytest.importorskip("lazrs")
    from tests.support.copc import write_copc

    together, counts = write_copc(tmp_path / "scan.copc.laz", points, level=3)
    seen = glance_at(tmp_path / "scan.copc.laz")
    assert seen.rows == 1500
    assert len(seen.sample.points) <= 3 * max(counts) < 1500
    assert {tuple(p) for p in seen.sample.points.round(3)} <= {tuple(p) for p in together.round(3)}


@pytest.mark.parametrize("suffix", [".ply", ".npy"])
def test_tables_of_rows(tmp_path, points, suffix):
    path, many = tmp_path / f"scan{suffix}", np.tile(points, (4, 1))
    if suffix == ".npy":
        np.save(path, many)
    else:
        write_cloud(path, many)
    seen = glance_at(path)
    assert (seen.rows, seen.bounds, seen.dtype.names) == (6000, None, ("x", "y", "z"))
    assert (seen.sample.points == np.concatenate([many[a:b] for a, b in glance._starts(6000)])).all()


def test_what_has_to_be_read_as_a_whole(tmp_path, points):
    write_cloud(tmp_path / "scan.xyz", points)
    assert glance_at(tmp_path / "scan.xyz") is None
    assert glance_at("-") is None
    np.save(tmp_path / "scan.npy", np.full((9, 3), np.nan))
    with pytest.raises(InputError, match="no point has finite coordinates"):
        glance_at(tmp_path / "scan.npy")
