"""What is read in pieces is what is read as a whole."""

import gzip

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud, stream_arrays, stream_cloud, write_cloud
from cylx.io import streamed as module


@pytest.fixture
def points():
    return np.random.default_rng(0).normal(size=(1000, 3)).round(3)


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch):
    monkeypatch.setattr(module, "ROWS", 300)


def same_as_whole(path, spool):
    """Tell that the pieces make the table of the file, twice."""
    cloud, whole = stream_cloud(path, spool), read_cloud(path)
    for _ in range(2):
        parts = list(cloud.parts())
        assert [len(part) for part in parts] == [300, 300, 300, 100]
        table = np.concatenate(parts)
        assert (cloud.coordinates(table) == whole.points).all()
        if whole.table is not None:
            assert table.dtype.names == whole.table.dtype.names == cloud.dtype.names
            assert all((table[name] == whole.table[name]).all() for name in table.dtype.names)
    assert (cloud.rows, cloud.bare) == (1000, whole.table is None)
    assert cloud.source.sha256 == whole.source.sha256
    assert cloud.source.format == whole.source.format
    assert (cloud.few(3).points == whole.points[:3]).all()


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz"])
def test_clouds_with_and_without_properties(tmp_path, points, suffix):
    write_cloud(tmp_path / f"bare{suffix}", points)
    same_as_whole(tmp_path / f"bare{suffix}", tmp_path / "spool")
    write_cloud(tmp_path / f"more{suffix}", points, properties={"time": np.arange(1000.0), "ring": np.arange(1000) % 7})
    same_as_whole(tmp_path / f"more{suffix}", tmp_path / "spool")


def test_rows_that_are_withheld_are_no_points(tmp_path, points):
    laspy = pytest.importorskip("laspy")
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.x, cloud.y, cloud.z = points.T
    cloud.withheld = (np.arange(1000) % 4 == 0).astype(np.uint8)
    cloud.write(tmp_path / "scan.las")
    streamed, whole = stream_cloud(tmp_path / "scan.las", tmp_path / "spool"), read_cloud(tmp_path / "scan.las")
    places = streamed.coordinates(np.concatenate(list(streamed.parts())))
    assert np.array_equal(np.isfinite(places).all(axis=1), np.arange(1000) % 4 != 0)
    assert np.array_equal(places[whole.valid], whole.points)
    assert len(whole.points) == 750


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_on_the_disk(tmp_path, points, order):
    np.save(tmp_path / "scan.npy", np.asarray(points, order=order))
    same_as_whole(tmp_path / "scan.npy", tmp_path / "spool")


def test_a_packed_file_and_one_of_the_other_byte_order(tmp_path, points):
    write_cloud(tmp_path / "scan.ply", points)
    (tmp_path / "scan.ply.gz").write_bytes(gzip.compress((tmp_path / "scan.ply").read_bytes()))
    same_as_whole(tmp_path / "scan.ply.gz", tmp_path / "spool")
    head, _, body = (tmp_path / "scan.ply").read_bytes().partition(b"end_header\n")
    swapped = np.frombuffer(body, "<f8").astype(">f8").tobytes()
    (tmp_path / "big.ply").write_bytes(head.replace(b"little", b"big") + b"end_header\n" + swapped)
    same_as_whole(tmp_path / "big.ply", tmp_path / "spool")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las(tmp_path, points, suffix):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = [1e-3] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.classification = np.arange(1000) % 5
    cloud.write(tmp_path / f"scan{suffix}")
    same_as_whole(tmp_path / f"scan{suffix}", tmp_path / "spool")


def test_pieces_of_arrays(tmp_path, points):
    cloud = stream_arrays((points[i : i + 70] for i in range(0, 1000, 70)), tmp_path / "spool")
    assert (np.concatenate([cloud.coordinates(part) for part in cloud.parts()]) == points).all()
    with pytest.raises(ValueError, match=r"must have shape \(n, 3\), not \(4,\)"):
        stream_arrays([np.zeros(4)], tmp_path / "spool")
    with pytest.raises(InputError, match="holds no points"):
        stream_arrays([], tmp_path / "spool")


def test_a_file_that_is_changed_meanwhile_is_refused(tmp_path, points):
    write_cloud(tmp_path / "scan.ply", points)
    cloud = stream_cloud(tmp_path / "scan.ply", tmp_path / "spool")
    write_cloud(tmp_path / "scan.ply", points + 1.0, overwrite=True)
    with pytest.raises(InputError, match="was changed while its cylinders were sought"):
        list(cloud.parts())
