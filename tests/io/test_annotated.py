"""The annotated PLY: everything that came in, in its order, and what was found."""

import dataclasses
import errno
import io
import struct

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from cylx.errors import OutputError
from cylx.io import read_cloud, write_annotated, write_cloud
from cylx.palette import cylinder_colors
from cylx.records import PointCloud

GREY = [128, 128, 128]
FAR = np.array([[512345.678, 5412345.432, 123.4], [5e6 + 0.001, -5e6 - 0.002, 0.003], [1e-3, 0.1, 1 / 3]])
OURS = ["cylinder_id", "residual", "red", "green", "blue"]


@pytest.fixture
def annotate(tmp_path, make_extraction):
    """Write a cloud with the labels 1, -1, 0, 1, -1, 0 … and read it back with plyfile."""

    def annotate(cloud):
        labels = np.resize(np.array([1, -1, 0], "i4"), len(cloud.points))
        residuals = np.linspace(-0.5, 0.5, len(labels)).astype("f4")
        extraction = dataclasses.replace(make_extraction(cloud), labels=labels, residuals=residuals)
        write_annotated(tmp_path / "out.ply", extraction)
        document = PlyData.read(tmp_path / "out.ply")
        assert (document.text, document.byte_order, [e.name for e in document]) == (False, "<", ["vertex"])
        return document["vertex"].data

    return annotate


def cloud_of(tmp_path, table, *, encoding="<", more=()):
    path = tmp_path / "in.ply"
    elements = [PlyElement.describe(table, "vertex"), *more]
    PlyData(elements, text=encoding == "=", byte_order=encoding).write(path)
    return read_cloud(path)


def table_of(points, dtype, **properties):
    table = np.zeros(len(points), [*((axis, dtype) for axis in "xyz"), *((n, v.dtype) for n, v in properties.items())])
    table["x"], table["y"], table["z"] = np.asarray(points, dtype).T
    for name, values in properties.items():
        table[name] = values
    return table


def types(table):
    return {name: table.dtype[name].str[1:] for name in table.dtype.names}


def test_an_array_becomes_a_cloud_in_double(annotate):
    rows = annotate(PointCloud(FAR))
    coordinates = {"x": "f8", "y": "f8", "z": "f8"}
    assert types(rows) == coordinates | dict(zip(OURS, ("i4", "f4", "u1", "u1", "u1"), strict=True))
    assert np.array_equal(np.column_stack([rows[axis] for axis in "xyz"]), FAR)
    assert rows["cylinder_id"].tolist() == [1, -1, 0]
    assert np.array_equal(rows["residual"], np.array([-0.5, np.nan, 0.5], "f4"), equal_nan=True)


def test_rows_of_an_array_that_are_not_finite_are_nan(annotate):
    rows = annotate(PointCloud.from_array([[1, 2, 3], [np.inf, 5, 6], [7, 8, 9]]))
    assert np.array_equal(rows["x"], [1, np.nan, 7], equal_nan=True)
    assert np.array_equal(rows["y"], [2, np.nan, 8], equal_nan=True)
    assert rows["cylinder_id"].tolist() == [1, -1, -1]
    assert np.isnan(rows["residual"][1:]).all()


@pytest.mark.parametrize("encoding", ["=", "<", ">"])
def test_properties_keep_their_names_values_types_and_order(tmp_path, annotate, encoding):
    rng = np.random.default_rng(0)
    extra = {
        f"p_{kind}": rng.integers(0, 100, 3).astype(kind) for kind in ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
    }
    table = table_of(FAR, "f8", **extra)
    rows = annotate(cloud_of(tmp_path, table, encoding=encoding))
    assert list(rows.dtype.names) == [*table.dtype.names, *OURS]
    for name in table.dtype.names:
        assert rows.dtype[name].str[1:] == table.dtype[name].str[1:]
        assert np.array_equal(rows[name], table[name])


@pytest.mark.parametrize("encoding", ["<", ">"])
def test_float_coordinates_stay_float(tmp_path, annotate, encoding):
    rows = annotate(cloud_of(tmp_path, table_of(FAR, "f4"), encoding=encoding))
    assert {types(rows)[axis] for axis in "xyz"} == {"f4"}
    assert np.array_equal(rows["y"], FAR[:, 1].astype("f4"))


def test_rows_that_are_not_finite_are_written_as_they_were_read(tmp_path, annotate):
    points = np.array([[1, 2, 3], [np.nan, 5, 6], [7, 8, np.inf], [1, 1, 1]])
    rows = annotate(cloud_of(tmp_path, table_of(points, "f8", label=np.arange(4, dtype="i4"))))
    assert np.array_equal(np.column_stack([rows[axis] for axis in "xyz"]), points, equal_nan=True)
    assert rows["label"].tolist() == [0, 1, 2, 3]
    assert rows["cylinder_id"].tolist() == [1, -1, -1, -1]
    assert [[row[name] for name in OURS[2:]] for row in rows][1:] == [GREY] * 3


def test_colours_are_those_of_the_cylinders_and_the_original_ones_are_kept(tmp_path, annotate):
    colors = {name: np.arange(3, dtype="u1") + place for place, name in enumerate(("red", "green", "blue", "alpha"))}
    rows = annotate(cloud_of(tmp_path, table_of(FAR, "f4", **colors)))
    for name, values in colors.items():
        assert np.array_equal(rows[f"orig_{name}"], values)
        assert rows.dtype[f"orig_{name}"] == "u1"
    assert "alpha" not in rows.dtype.names
    shown = np.column_stack([rows[name] for name in OURS[2:]])
    assert np.array_equal(shown, cylinder_colors(np.array([1, -1, 0])))


def test_alpha_without_colours_is_no_colour(tmp_path, annotate):
    rows = annotate(cloud_of(tmp_path, table_of(FAR, "f4", alpha=np.ones(3, "f4"))))
    assert rows["alpha"].tolist() == [1, 1, 1]


def test_an_annotated_cloud_can_be_annotated_again(tmp_path, annotate):
    once = table_of(FAR, "f4", orig_red=np.array([1, 2, 3], "u1"), red=np.array([4, 5, 6], "u1"))
    annotate(cloud_of(tmp_path, once))
    rows = annotate(read_cloud((tmp_path / "out.ply").rename(tmp_path / "again.ply")))
    assert list(rows.dtype.names) == [
        "x", "y", "z", "orig_red", "orig_orig_red", "orig_cylinder_id", "orig_residual",
        "orig_orig_orig_red", "orig_green", "orig_blue", *OURS,
    ]  # fmt: skip
    assert rows["orig_red"].tolist() == [1, 2, 3]
    assert rows["orig_orig_red"].tolist() == [4, 5, 6]
    assert rows["orig_cylinder_id"].tolist() == [1, -1, 0]


def test_names_that_ply_cannot_hold_are_mended_and_long_integers_are_double(annotate):
    table = np.zeros(2, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("scan angle", "f4"), ("größe", "i2"), ("t", "u8")])
    table["scan angle"], table["größe"], table["t"] = [1, 2], [3, 4], [2**40, 2**53]
    rows = annotate(PointCloud(np.zeros((2, 3)), table))
    assert list(rows.dtype.names) == ["x", "y", "z", "scan_angle", "gr_e", "t", *OURS]
    assert rows["scan_angle"].tolist() == [1, 2]
    assert rows["t"].tolist() == [2.0**40, 2.0**53]


def test_packed_colours_of_a_pcd_are_kept_bit_by_bit(tmp_path, annotate):
    packed = np.array([0x00FF8040, 0x7FC00001, 0xFF000000], "u4").view("f4")
    write_cloud(tmp_path / "in.pcd", FAR, properties={"rgb": packed}, dtype="f8")
    rows = annotate(read_cloud(tmp_path / "in.pcd"))
    assert np.array_equal(np.ascontiguousarray(rows["rgb"]).view("u4"), packed.view("u4"))


def test_faces_are_dropped_and_lists_of_points_are_kept(tmp_path, annotate):
    table = np.empty(3, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("near", "O")])
    table["x"], table["y"], table["z"] = FAR.T
    table["near"] = [np.array(item, "i4") for item in ([1], [0, 2], [])]
    faces = np.array([([0, 1, 2],)], [("vertex_indices", "i4", (3,))])
    rows = annotate(cloud_of(tmp_path, table, more=[PlyElement.describe(faces, "face")]))
    assert [item.tolist() for item in rows["near"]] == [[1], [0, 2], []]
    assert np.array_equal(rows["y"], FAR[:, 1])


def test_many_rows_are_written_piece_by_piece(annotate, monkeypatch):
    monkeypatch.setattr("cylx.io.annotated.ROWS_AT_A_TIME", 7)
    points = np.random.default_rng(0).normal(size=(50, 3))
    points[3] = np.nan
    rows = annotate(PointCloud.from_array(points))
    assert np.array_equal(np.column_stack([rows[axis] for axis in "xyz"]), points, equal_nan=True)
    labels = np.resize([1, -1, 0], 49)
    assert rows["cylinder_id"].tolist() == [*labels[:3], -1, *labels[3:]]


def test_standard_output_gets_the_same_bytes(tmp_path, make_extraction, monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO())
    monkeypatch.setattr("sys.stdout", stream)
    write_annotated("-", make_extraction())
    write_annotated(tmp_path / "out.ply", make_extraction())
    assert stream.buffer.getvalue() == (tmp_path / "out.ply").read_bytes()


def test_nothing_is_left_when_the_disk_is_full(tmp_path, make_extraction, monkeypatch):
    def fail(*_args):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("cylx.io.annotated.cylinder_colors", fail)
    with pytest.raises(OutputError, match="no space left on device"):
        write_annotated(tmp_path / "out.ply", make_extraction())
    assert list(tmp_path.iterdir()) == []


def test_an_input_can_be_replaced_by_its_annotation(tmp_path, make_extraction):
    path = tmp_path / "scan.ply"
    write_cloud(path, FAR, properties={"label": np.array([7, 8, 9], "i4")})
    extraction = make_extraction(read_cloud(path))
    with pytest.raises(OutputError, match="exists already"):
        write_annotated(path, extraction)
    write_annotated(path, extraction, overwrite=True)
    assert PlyData.read(path)["vertex"].data["label"].tolist() == [7, 8, 9]


def test_colours_are_distinct_stable_and_never_grey():
    colors = cylinder_colors(np.arange(500))
    assert len({tuple(color) for color in colors.tolist()}) == 500
    assert (np.ptp(colors.astype(int), axis=1) > 50).all()
    assert np.array_equal(cylinder_colors(np.array([3, -1, 0])), [colors[3], GREY, colors[0]])
    neighbours = np.abs(np.diff(colors.astype(int), axis=0)).max(axis=1)
    assert neighbours.min() > 50


def test_a_list_property_does_not_fit_into_pcd(tmp_path, make_extraction):
    rows = b"".join(struct.pack("<fffBi", *point, 1, 7) for point in [(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "property list uchar int near\nend_header\n"
    (tmp_path / "scan.ply").write_bytes(header.encode() + rows)
    found = make_extraction(read_cloud(tmp_path / "scan.ply"))
    with pytest.raises(OutputError, match="PCD cannot hold the list property 'near'; choose a name"):
        write_annotated(tmp_path / "out.pcd", found)
    assert not (tmp_path / "out.pcd").exists()
