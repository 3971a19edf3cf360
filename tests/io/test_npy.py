"""NPY and NPZ: arrays of numpy as clouds."""

import io
import zipfile
from contextlib import suppress

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud

POINTS = np.array([5e5, 5e6, 0]) + np.random.default_rng(0).normal(size=(50, 3))


@pytest.fixture
def put(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(name, array=None, **arrays):
        with (tmp_path / name).open("wb") as file:
            if array is None:
                np.savez_compressed(file, **arrays)
            else:
                np.save(file, array)
        return name

    return write


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<f2", "<i4", "<i8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_an_array_of_any_numbers_is_read(put, kind, order):
    array = np.asarray(np.round(POINTS - [5e5, 5e6, 0], 1).astype(kind), order=order)
    cloud = read_cloud(put("scan.npy", array))
    assert np.array_equal(cloud.points, array.astype("f8"))
    assert cloud.source.format == "npy"


def test_further_columns_are_kept(put):
    cloud = read_cloud(put("scan.npy", np.column_stack([POINTS, np.arange(50), np.ones(50)])))
    assert np.array_equal(cloud.points, POINTS)
    assert cloud.table.dtype.names == ("x", "y", "z", "column_4", "column_5")
    assert np.array_equal(cloud.table["column_4"], np.arange(50))


def test_a_structured_array_has_its_fields(put):
    array = np.zeros(50, [("intensity", ">u2"), ("X", "f8"), ("Y", "f4"), ("Z", "f8"), ("rgb", "u1", 3), ("on", "?")])
    array["X"], array["rgb"] = POINTS[:, 0], [1, 2, 3]
    table = read_cloud(put("scan.npy", array)).table
    assert table.dtype.names == ("intensity", "X", "Y", "Z", "rgb_0", "rgb_1", "rgb_2", "on")
    assert np.array_equal(table["X"], POINTS[:, 0])
    assert table["rgb_2"].tolist() == [3] * 50


def test_points_that_are_not_finite_are_left_out(put):
    array = POINTS.copy()
    array[3, 1] = np.nan
    cloud = read_cloud(put("scan.npy", array))
    assert (cloud.rows, len(cloud.points)) == (50, 49)


def test_an_archive_holds_one_array_or_one_called_points(put):
    assert np.array_equal(read_cloud(put("one.npz", cloud=POINTS)).points, POINTS)
    assert np.array_equal(read_cloud(put("two.npz", points=POINTS, labels=np.ones(50))).points, POINTS)


def test_it_is_recognised_by_its_content(put, run_cylx, tmp_path):
    for name in (put("a", POINTS), put("b", points=POINTS)):
        shown = run_cylx("info", "-", input=(tmp_path / name).read_bytes())
        assert shown.stdout.splitlines()[1:3] == ["format   npy", "points   50, 50 of them finite"]


DEPTHS = "as an image of depths has; compute its points from the focal length first"
WRONG = {
    "one row": (POINTS[0], "has the shape (3,), not (N, 3); give an array of shape (N, 3) or wider"),
    "lying": (POINTS.T, "has the shape (3, 50), not (N, 3); transpose it"),
    "pairs": (POINTS[:, :2], "has the shape (50, 2), not (N, 3); give an array of shape (N, 3) or wider"),
    "cube": (POINTS[None], "has the shape (1, 50, 3), not (N, 3); give an array of shape (N, 3) or wider"),
    "nothing": (POINTS[:0], "holds no points; give a file with points"),
    "number": (np.array(3.0), "has the shape (), not (N, 3); give an array of shape (N, 3) or wider"),
    "complex": (POINTS.astype(complex), "is made of complex128, not of numbers; give an array of floats"),
    "words": (np.full((9, 3), "a"), "is made of <U1, not of numbers; give an array of floats"),
    "objects": (POINTS.astype(object), "holds Python objects, which are not supported; save an array of numbers"),
    "no z": (np.zeros(5, [("x", "f8"), ("y", "f8")]), "the structured array has no field z; give one with x, y and z"),
    "two x": (
        np.zeros(5, [("x", "f8", 2), ("y", "f8"), ("z", "f8")]),
        "the field x has several values per point; give one x, y and z per point",
    ),
    "name": (
        np.zeros(5, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("who", "U5")]),
        "the field 'who' is made of <U5, not of numbers; leave it out",
    ),
    "depths": (
        np.zeros((48, 64), "u2"),
        f"has the shape (48, 64), {DEPTHS}",
    ),
    "depths in metres": (
        np.ones((480, 640), "f4"),
        f"has the shape (480, 640), {DEPTHS}",
    ),
    "depths, upright": (
        np.ones((640, 480), "f4"),
        f"has the shape (640, 480), {DEPTHS}",
    ),
    "truths": (POINTS > 0, "is made of bool, not of numbers; give an array of floats"),
    "grid": (
        np.zeros((5, 5), [("x", "f8"), ("y", "f8"), ("z", "f8")]),
        "is a structured array of shape (5, 5), not (N,); flatten it",
    ),
}


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
@pytest.mark.parametrize(("array", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arrays_are_named(put, array, message, suffix):
    name = put("scan.npy", array) if suffix == ".npy" else put("scan.npz", points=array)
    with pytest.raises(InputError) as refused:
        read_cloud(name)
    assert str(refused.value) == f"{name}: {message}"


def test_an_archive_of_nothing_holds_no_array(put):
    with pytest.raises(InputError) as refused:
        read_cloud(put("scan.npz"))
    assert str(refused.value) == "scan.npz: holds no array; save the points alone, or as points=…"


def test_two_arrays_are_one_too_many(put):
    with pytest.raises(InputError) as refused:
        read_cloud(put("scan.npz", a=POINTS, b=POINTS))
    assert str(refused.value) == (
        "scan.npz: holds 2 arrays, none of them called points: 'a', 'b'; save the points alone, or as points=…"
    )


def npy(array=POINTS):
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


@pytest.mark.parametrize("size", [*range(1, 200, 7), 500, len(npy()) - 1])
def test_a_file_cut_short_is_one_line(tmp_path, size):
    (tmp_path / "cut.npy").write_bytes(npy()[:size])
    with pytest.raises(InputError) as refused:
        read_cloud(tmp_path / "cut.npy")
    assert "\n" not in str(refused.value)


def test_damaged_archives_are_one_line(put, tmp_path):
    data = (tmp_path / put("scan.npz", points=POINTS)).read_bytes()
    for size in range(1, len(data), 37):
        (tmp_path / "cut.npz").write_bytes(data[:size])
        with pytest.raises(InputError):
            read_cloud("cut.npz")
    for place in range(0, len(data), 11):
        broken = data[:place] + bytes([data[place] ^ 255]) + data[place + 1 :]
        (tmp_path / "cut.npz").write_bytes(broken)
        try:
            assert len(read_cloud("cut.npz").points) == 50
        except InputError:
            continue


def test_a_bomb_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", npy(np.zeros((10**6, 3))))
    with pytest.raises(InputError, match="is more than 100 times as large when unpacked"):
        read_cloud(tmp_path / "bomb.npz")


def test_a_header_that_promises_too_much_takes_no_memory(tmp_path):
    data = npy().replace(b"(50, 3)", b"(50000000000, 3)")[: len(npy())]
    (tmp_path / "scan.npy").write_bytes(data.replace(b" " * 9 + b"\n", b"\n"))
    with pytest.raises(InputError):
        read_cloud(tmp_path / "scan.npy")


def with_shape(text):
    """Write the header of an array by hand."""
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {text}, }}"
    head += " " * (117 - len(head)) + "\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode() + bytes(240)


@pytest.mark.parametrize(
    "shape",
    [
        "(-1, 3)",
        "(10, -3)",
        "(True, 3)",
        f"({10**30}, 3)",
        f"(1, {2**63})",
        "(1.5, 3)",
        "'ab'",
        "3",
    ],
)
def test_impossible_shapes_are_one_line(tmp_path, shape):
    (tmp_path / "scan.npy").write_bytes(with_shape(shape))
    with pytest.raises(InputError) as refused:
        read_cloud(tmp_path / "scan.npy")
    assert len(str(refused.value).removeprefix(str(tmp_path))) < 200
    assert str(refused.value).isprintable()


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_damage_to_packed_arrays_is_one_line(tmp_path, method):
    with zipfile.ZipFile(tmp_path / "whole.npz", "w", method) as archive:
        archive.writestr("points.npy", npy())
    data = (tmp_path / "whole.npz").read_bytes()
    assert np.array_equal(read_cloud(tmp_path / "whole.npz").points, POINTS)
    for place in range(30, 120):
        (tmp_path / "cut.npz").write_bytes(data[:place] + bytes([data[place] ^ 0x55]) + data[place + 1 :])
        with suppress(InputError):
            read_cloud(tmp_path / "cut.npz")


def test_a_name_that_is_not_utf_8_is_one_line(tmp_path):
    with zipfile.ZipFile(tmp_path / "scan.npz", "w") as archive:
        archive.writestr("pünkte.npy", npy())
    data = (tmp_path / "scan.npz").read_bytes().replace("ü".encode(), b"\xff\xfe")
    (tmp_path / "scan.npz").write_bytes(data)
    with pytest.raises(InputError, match="is not a complete NPZ"):
        read_cloud(tmp_path / "scan.npz")
