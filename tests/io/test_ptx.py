"""PTX: scans with poses, what nobody measured, and files that are damaged."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.errors import InputError
from cylx.io import read_cloud, stream_cloud
from cylx.io.streamed_cloud import ROWS

TURN = Rotation.from_euler("xyz", [0.1, -0.2, 2.0]).as_matrix()
AT = np.array([500000.25, 5400000.5, 300.0])


NO_TURN, NO_MOVE = np.eye(3), np.zeros(3)


def scan(rows, turn=NO_TURN, at=NO_MOVE, shape=None):
    """Return a scan as text; rows are in the coordinates of the scanner."""
    columns, high = shape or (1, len(rows))
    axes = "".join(" ".join(map(repr, axis)) + "\n" for axis in turn.T.tolist())
    matrix = "".join(" ".join(map(repr, axis)) + " 0\n" for axis in turn.T.tolist())
    place = " ".join(map(repr, at.tolist()))
    body = "".join(" ".join(map(str, row)) + "\n" for row in rows)
    return f"{columns}\n{high}\n{place}\n{axes}{matrix}{place} 1\n{body}"


ONE = scan([(1.0, 2.0, 3.0, 0.5), (0, 0, 0, 0.5), (-1.5, 0.25, 8.0, 1)], TURN, AT)
TWO = scan([(1, 1, 1, 0.25, 255, 0, 7), (2, 2, 2, 0, 1, 2, 3)], shape=(2, 1))


@pytest.fixture
def put(tmp_path):
    def write(text, name="scan.ptx"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("name", ["scan.ptx", "scan.txt", "scan", "scan.PTX"])
def test_each_scan_is_moved_by_its_pose(put, name, ends):
    cloud = read_cloud(put((ONE + TWO).replace("\n", ends), name))
    assert (cloud.source.format, cloud.source.units, cloud.source.doubts) == ("ptx", "m", ())
    own = np.array([[1.0, 2.0, 3.0], [-1.5, 0.25, 8.0]])
    np.testing.assert_allclose(cloud.points[:2], own @ TURN.T + AT, rtol=0, atol=1e-9)
    assert cloud.points[2:].tolist() == [[1, 1, 1], [2, 2, 2]]
    assert cloud.valid.tolist() == [True, False, True, True, True]
    table = cloud.table
    assert table.dtype.names == ("x", "y", "z", "scan", "intensity", "red", "green", "blue")
    assert table["scan"].tolist() == [0, 0, 0, 1, 1]
    assert table["intensity"].tolist() == [0.5, 0.5, 1.0, 0.25, 0.0]
    assert table["red"].tolist() == [0, 0, 0, 255, 1]
    assert table["blue"].tolist() == [0, 0, 0, 7, 3]


def test_without_intensity_there_is_none(put):
    assert read_cloud(put(scan([(1, 2, 3)]))).table.dtype.names == ("x", "y", "z", "scan")
    names = read_cloud(put(scan([(1, 2, 3, 4, 5, 6)]))).table.dtype.names
    assert names == ("x", "y", "z", "scan", "red", "green", "blue")


def test_a_scan_can_be_chosen(put):
    cloud = read_cloud(put(ONE + TWO), scan=1)
    assert cloud.points.tolist() == [[1, 1, 1], [2, 2, 2]]
    with pytest.raises(InputError, match="has 2 scans, from 0 to 1, and none of number 2"):
        read_cloud(put(ONE + TWO), scan=2)


def test_an_empty_scan_a_blank_line_and_a_missing_line_end_do_no_harm(put):
    empty = scan([], shape=(0, 0))
    text = empty + ONE + "\n" + empty + TWO.rstrip("\n")
    assert read_cloud(put(text)).table["scan"].tolist() == [1, 1, 1, 3, 3]


def test_a_matrix_for_columns_is_understood(put):
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = TURN, AT
    rows = "".join(" ".join(map(repr, row)) + "\n" for row in moved.tolist())
    text = "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + rows + "1 2 3 0.5\n"
    np.testing.assert_allclose(read_cloud(put(text)).points, [TURN @ [1, 2, 3] + AT], atol=1e-9)


def test_a_scale_is_doubted(put):
    cloud = read_cloud(put(scan([(1, 2, 3, 0)], 2 * np.eye(3))))
    assert cloud.points.tolist() == [[2, 4, 6]]
    ((fault, _),) = cloud.source.doubts
    assert "the matrix of scan 0 is more than a rotation and a move" in fault


def test_pieces_are_the_whole(put, tmp_path):
    rng = np.random.default_rng(5)
    rows = np.round(rng.normal(size=(ROWS + 100, 4)), 3).tolist()
    path = put(scan(rows, TURN, AT) + TWO)
    whole, streamed = read_cloud(path), stream_cloud(path, tmp_path / "spool")
    parts = list(streamed.parts())
    assert [len(part) for part in parts] == [ROWS, 102]
    np.testing.assert_array_equal(np.concatenate(parts), whole.table)
    assert (streamed.rows, streamed.source) == (whole.rows, whole.source)


HEAD = "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
ROWS_ = "1 2 3 0.5\n1 2 4 0.5\n"
BAD = {
    "a word": (HEAD + "1 2 3 0.5\n1 a 4 0.5\n", ":12: 'a' is not a number; export the file again"),
    "a column less": (HEAD + "1 2 3 0.5\n1 2 4\n", ":12: expected 4 columns, found 3; get a complete copy of the file"),
    "an empty row": (
        HEAD.replace("2\n", "3\n", 1) + "1 2 3 0.5\n\n1 2 4 1\n",
        ":12: expected 4 columns, found 0; get a complete copy of the file",
    ),
    "cut short": (
        HEAD + "10.25 2.25 3.25 0.5\n",
        ": scan 0 promises 2 points, the file holds 1; get a complete copy of the file",
    ),
    "cut in the header": (
        HEAD + ROWS_ + HEAD[:13],
        ":16: the header of scan 1 has '1 0' where 3 numbers must be; give a PTX file as scanners write it",
    ),
    "cut between header lines": (
        HEAD + ROWS_ + HEAD[:10],
        ": the file ends within the header of scan 1; get a complete copy of the file",
    ),
    "many points": (
        HEAD.replace("2\n", "4000000\n", 1) + ROWS_,
        ":1: scan 0 promises 4e+06 x 1 points, more than a file of 86 bytes can hold; get a complete copy of the file",
    ),
    "half a point": (
        HEAD.replace("2\n", "2.5\n", 1) + ROWS_,
        ":1: scan 0 has 2.5 x 1 points; get a complete copy of the file",
    ),
    "a colour": (
        HEAD + "1 2 3 0.5 1 2 300\n" * 2,
        ": scan 0 has a blue that is not from 0 to 255; export the file again",
    ),
    "five columns": (
        HEAD + "1 2 3 4 5\n" * 2,
        ":11: expected x y z, an intensity and perhaps a colour, found 5 columns; give a PTX file as scanners write it",
    ),
    "no pose": (
        HEAD.replace("0 0 0 1\n", "0 0 0 2\n") + ROWS_,
        ":7: the matrix of scan 0 is no pose; export the file again",
    ),
    "nothing measured": (HEAD + "0 0 0 0.5\n" * 2, ": no point has finite coordinates; export the file again"),
    "no points": (scan([], shape=(0, 0)), ": holds no points; give a file with points"),
    "a name": (
        "x y z\n" + HEAD + ROWS_,
        ":1: the header of scan 0 has 'x y z' where 1 number must be; give a PTX file as scanners write it",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_damage_is_one_line(put, text, message):
    path = put(text)
    with pytest.raises(InputError) as refused:
        read_cloud(path)
    assert str(refused.value) == f"{path}{message}"


def test_it_is_found_by_its_content_but_nothing_else_is(put):
    assert read_cloud(put(ONE, "a.xyz")).source.format == "ptx"
    assert read_cloud(put("2\n1 2 3 4\n1 2 4 4\n", "a.pts")).source.format == "xyz"


def test_an_annotated_cloud_is_ply_in_the_coordinates_of_the_project(put, run_cylx, tmp_path):
    rng = np.random.default_rng(1)
    angle, height = rng.uniform(0, 2 * np.pi, 3000), rng.uniform(0, 2, 3000)
    points = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), height]) + rng.normal(0, 0.001, (3000, 3))
    own = (points - [3, 0, 1]) @ TURN
    path = put(scan([(*row, 0.5) for row in np.round(own, 6).tolist()], TURN, np.array([3.0, 0.0, 1.0])))
    done = run_cylx("extract", path)
    assert done.exit_code == 0, done.stderr
    back = read_cloud(tmp_path / "scan.annotated.ply")
    assert {"scan", "intensity", "cylinder_id"} <= set(back.table.dtype.names)
    np.testing.assert_allclose(back.points, points, atol=1e-5)
