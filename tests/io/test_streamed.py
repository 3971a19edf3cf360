"""What is read in pieces is what is read as a whole."""

import contextlib
import errno
import gzip
import io
import os
import tracemalloc

import numpy as np
import pytest

from cylx.errors import InputError, OutputError
from cylx.io import (
    isolated,
    isolated_child,
    read_cloud,
    stream_arrays,
    stream_cloud,
    streamed,
    streamed_cloud,
    streamed_formats,
    write_cloud,
)


@pytest.fixture
def points():
    return np.random.default_rng(0).normal(size=(1000, 3)).round(3)


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch):
    for module in (streamed, streamed_cloud, streamed_formats):
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
            assert all(np.array_equal(table[name], whole.table[name], equal_nan=True) for name in table.dtype.names)
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


def text_of(points, mark=" ", every=lambda row: row):
    """Give rows of text."""
    return "".join(every(mark.join(f"{value:.3f}" for value in point)) + "\n" for point in points)


TEXTS = {
    "bare": text_of,
    "a count": lambda points: f"{len(points)}\n{text_of(points)}",
    "names and commas": lambda points: f"x,y,z\n{text_of(points, ',')}",
    "comments and empty lines": lambda points: f"# made\n\n{text_of(points, every=lambda row: row + '  # a point')}",
    "words": lambda points: text_of(points, every=lambda row: f"{row} wall"),
    "decimal commas": lambda points: text_of(points).replace(".", ","),
    "a line that needs a closer look at the end": lambda points: f'{text_of(points[:-1])}"1" 2 3\n',
    "a gap in the last block": lambda points: f"x;y;z;i\n{text_of(points[:-1], ';', lambda row: row + ';4')}1;2;3;\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_by_blocks(tmp_path, points, name):
    path = tmp_path / "scan.txt"
    path.write_text(TEXTS[name](points), encoding="utf-8")
    same_as_whole(path, tmp_path / "spool")


BROKEN = {
    "a word in a late block": lambda points: f"{text_of(points[:950])}1 2 high\n{text_of(points[951:])}",
    "a row too short": lambda points: f"{text_of(points[:950])}1 2\n{text_of(points[951:])}",
    "another count": lambda points: f"{len(points) + 1}\n{text_of(points)}",
    "two decimal marks": lambda points: f"{text_of(points[:500]).replace('.', ',')}{text_of(points[500:])}",
}


@pytest.mark.parametrize("name", BROKEN)
def test_damaged_text_is_refused_as_in_one_piece(tmp_path, points, name):
    path = tmp_path / "scan.txt"
    path.write_text(BROKEN[name](points), encoding="utf-8")
    with pytest.raises(InputError) as whole:
        read_cloud(path)
    with pytest.raises(InputError) as parts:
        stream_cloud(path, tmp_path / "spool")
    assert str(parts.value) == str(whole.value)


def test_text_takes_no_more_than_a_block(tmp_path, points):
    path, many = tmp_path / "scan.xyz", 250
    path.write_text(text_of(np.tile(points, (many, 1))), encoding="utf-8")
    tracemalloc.start()
    try:
        cloud = stream_cloud(path, tmp_path / "spool")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert cloud.rows == 1000 * many
    table = cloud.rows * cloud.dtype.itemsize
    assert peak < 0.5 * table < (tmp_path / "spool").stat().st_size


def test_ascii_ply_by_blocks(tmp_path, points):
    head = "ply\nformat ascii 1.0\nelement list 2\nproperty int a\nelement vertex 1000\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "property uchar ring\nend_header\n1\n2\n"
    path = tmp_path / "scan.ply"
    path.write_text(head + text_of(points, every=lambda row: row + " 7"), encoding="utf-8")
    same_as_whole(path, tmp_path / "spool")
    path.write_text(head + text_of(points[:-1], every=lambda row: row + " 7"), encoding="utf-8")
    with pytest.raises(InputError, match="the header promises 1000 points, the file holds 999"):
        stream_cloud(path, tmp_path / "spool")


def test_e57_goes_from_its_process_to_the_disk(tmp_path, points, monkeypatch):
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "scan.e57"
    with contextlib.closing(pye57.E57(str(path), mode="w")) as file:
        for part in (points[:400], points[400:]):
            columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), part.T.copy(), strict=True))
            file.write_scan_raw({**columns, "intensity": np.arange(float(len(part)))})
    same_as_whole(path, tmp_path / "spool")
    one = stream_cloud(path, tmp_path / "spool", scan=1)
    assert (one.rows, one.source.selection.scan) == (600, 1)
    assert np.abs(one.coordinates(next(one.parts())) - points[400:700]).max() < 1e-6  # written in single precision
    monkeypatch.setattr(isolated, "target_file", None)  # nothing else takes the points
    assert stream_cloud(path, tmp_path / "spool").rows == 1000


def test_a_disk_without_room_for_the_copy_is_told_of(tmp_path, points, monkeypatch):
    write_cloud(tmp_path / "scan.xyz", points)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(streamed, "spool_cloud", full)
    with pytest.raises(OutputError, match="cannot be written: no space left; free some space"):
        stream_cloud(tmp_path / "scan.xyz", tmp_path / "spool")


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="the disk cannot be asked for room")
def test_the_room_for_points_is_taken_first(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / "spool").touch()
    monkeypatch.setattr(os, "posix_fallocate", full)
    monkeypatch.setattr(isolated_child, "_allow_table", lambda size, rate: None)
    with pytest.raises(isolated_child.NoRoomError, match="No space left"):
        isolated_child.Target(str(tmp_path / "spool"), 1 << 20, 1, reserve=True)(10, np.dtype([("x", "f8")]))
    assert len(isolated_child.Target(str(tmp_path / "spool"), 1 << 20, 1)(10, np.dtype([("x", "f8")]))) == 10


def test_standard_input_and_a_scan_that_is_none(tmp_path, points, monkeypatch):
    write_cloud(tmp_path / "scan.ply", points)
    with (tmp_path / "scan.ply").open("rb") as file:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(file))
        cloud = stream_cloud("-", tmp_path / "spool")
        assert (np.concatenate([cloud.coordinates(part) for part in cloud.parts()]) == points).all()
    with pytest.raises(InputError, match="neither E57 nor PTX"):
        stream_cloud(tmp_path / "scan.ply", tmp_path / "spool", scan=0)


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
