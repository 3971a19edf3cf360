"""What is read of LAS, LAZ and COPC files if a box is wanted: no more than the blocks that it reaches."""

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import las, read_cloud, stream_cloud
from cylx.io.las_blocks import Block, blocks_within

laspy = pytest.importorskip("laspy")
pytest.importorskip("lazrs")

MAP = np.array([451000.0, 5411000.0, 300.0])


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(0, 8, size=(6000, 3)).round(3) + MAP


@pytest.fixture
def read(monkeypatch):
    """Count the points that are unpacked."""
    counts, keep = [], las._table_of

    def counted(chunk, header):
        counts.append(len(chunk))
        return keep(chunk, header)

    monkeypatch.setattr(las, "_table_of", counted)
    return counts


def inside(points, crop):
    low, high = (np.array(corner) for corner in crop)
    return points[((points >= low) & (points <= high)).all(axis=1)]


def box(low, high):
    return tuple((MAP + low).tolist()), tuple((MAP + high).tolist())


@pytest.mark.parametrize("legacy", [True, False])
def test_of_a_copc_file_only_the_nodes_that_a_box_reaches_are_read(tmp_path, points, read, legacy):
    from tests.support.copc import write_copc

    together, counts = write_copc(tmp_path / "scan.copc.laz", points, legacy=legacy)
    assert np.abs(read_cloud(tmp_path / "scan.copc.laz").points - together).max() < 1e-6
    cloud = stream_cloud(tmp_path / "scan.copc.laz", tmp_path / "spool")
    assert cloud.rows == 6000
    read.clear()
    crop = box([0.5, 0.5, 0.5], [1.5, 1.5, 1.5])  # within one node of 64
    found = np.concatenate([cloud.coordinates(table) for _, table in cloud.reached(crop)])
    assert sum(read) == len(found) == counts[0] < 6000 / 32
    assert len(inside(found, crop)) == len(inside(together, crop)) > 0


@pytest.mark.parametrize("crop", [box([0, 0, 0], [3, 1, 1]), (None,) * 2, box([7, 7, 7], [99, 99, 99])])
def test_rows_keep_their_numbers(tmp_path, points, crop):
    from tests.support.copc import write_copc

    together, _ = write_copc(tmp_path / "scan.copc.laz", points)
    crop = ((None,) * 3, (None,) * 3) if crop[0] is None else crop
    cloud = stream_cloud(tmp_path / "scan.copc.laz", tmp_path / "spool")
    for start, table in cloud.reached(crop):
        assert np.abs(cloud.coordinates(table) - together[start : start + len(table)]).max() < 1e-6


def las_file(path, points):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 1e-3), MAP
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(path)
    return path


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_a_file_beside_the_box_is_not_read(tmp_path, points, read, suffix):
    cloud = stream_cloud(las_file(tmp_path / f"scan{suffix}", points), tmp_path / "spool")
    read.clear()
    assert list(cloud.reached(box([9, 0, 0], [20, 8, 8]))) == []
    assert read == []
    assert sum(len(table) for _, table in cloud.reached(box([7, 0, 0], [20, 8, 8]))) == 6000
    assert sum(len(table) for _, table in cloud.reached(None)) == 6000


@pytest.mark.parametrize("bounds", [bytes(48), np.array([1.0, 0.0] * 3).tobytes(), b"\xff" * 48])
def test_bounds_that_do_not_hold_the_points_are_not_believed(tmp_path, points, bounds):
    path = las_file(tmp_path / "scan.las", points)
    data = bytearray(path.read_bytes())
    data[179:227] = bounds
    path.write_bytes(data)
    cloud = stream_cloud(path, tmp_path / "spool")
    assert sum(len(table) for _, table in cloud.reached(box([0, 0, 0], [1, 1, 1]))) == 6000


def test_a_damaged_index_is_refused(tmp_path, points):
    from tests.support.copc import write_copc

    path = tmp_path / "scan.copc.laz"
    write_copc(path, points)
    data = bytearray(path.read_bytes())
    data[375 + 54 + 40 : 375 + 54 + 48] = (len(data)).to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(InputError, match="the index of its COPC nodes is damaged"):
        stream_cloud(path, tmp_path / "spool")


def test_a_block_counts_if_the_box_reaches_it():
    near, far = Block(0, 10, (0.0,) * 3, (1.0,) * 3), Block(10, 7, (5.0,) * 3, (6.0,) * 3)
    assert blocks_within([near, far], ((1.0, None, None), (2.0, 2.0, None))) == [near]
    assert blocks_within([near, far], ((None,) * 3, (None,) * 3)) == [near, far]
    assert blocks_within([near, far], ((None, 2.0, None), (None, 4.0, None))) == []
