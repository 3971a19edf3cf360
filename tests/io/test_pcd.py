"""PCD: every variant reads to the same points and fields, in the order of the file."""

import os
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cylx.errors import InputError
from cylx.io import read_cloud, write_cloud
from cylx.optional.open3d import import_open3d

MUG = Path(__file__).resolve().parents[3] / "shared" / "data" / "pcl" / "table_scene_mug_stereo_textured.pcd"
BODIES = ["ascii", "binary", "binary_compressed"]
KINDS = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]
FAR = np.array([[512345.678, 5412345.432, 123.4], [5e6 + 0.001, -5e6 - 0.002, 0.003], [1e-3, 0.1, 1 / 3]])


def pack(raw):
    """Write LZF without a single back reference; open3d writes those in a test of its own."""
    out = b"".join(bytes([len(part) - 1]) + part for part in (raw[k : k + 32] for k in range(0, len(raw), 32)))
    return struct.pack("<II", len(out), len(raw)) + out


def pcd_bytes(table, body, *, height=1, **lines):
    fields = {
        name: (np.dtype(table.dtype[name].base), int(np.prod(table.dtype[name].shape))) for name in table.dtype.names
    }
    header = {
        "VERSION": "0.7",
        "FIELDS": " ".join(fields),
        "SIZE": " ".join(str(kind.itemsize) for kind, _ in fields.values()),
        "TYPE": " ".join(kind.kind.upper() for kind, _ in fields.values()),
        "COUNT": " ".join(str(count) for _, count in fields.values()),
        "WIDTH": str(len(table) // height),
        "HEIGHT": str(height),
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": str(len(table)),
        "DATA": body,
    } | lines
    head = "# .PCD v0.7 - Point Cloud Data file format\n" + "".join(f"{k} {v}\n" for k, v in header.items() if v != "")
    if body == "ascii":
        rows = (" ".join(str(v) for name in fields for v in np.atleast_1d(row[name])) for row in table)
        return (head + "".join(row + "\n" for row in rows)).encode()
    raw = (
        table.tobytes()
        if body == "binary"
        else b"".join(np.ascontiguousarray(table[name]).tobytes() for name in fields)
    )
    return head.encode() + (raw if body == "binary" else pack(raw))


def cloud_table(points, dtype="f8", extra=()):
    table = np.zeros(len(points), [*((axis, dtype) for axis in "xyz"), *extra])
    table["x"], table["y"], table["z"] = np.asarray(points, dtype).T
    return table


@pytest.fixture
def read(tmp_path):
    def read(data, name="scan.pcd"):
        path = tmp_path / name
        path.write_bytes(data)
        return read_cloud(path)

    return read


@pytest.mark.parametrize("body", BODIES)
def test_far_coordinates_in_float64_lose_nothing(read, body):
    assert np.array_equal(read(pcd_bytes(cloud_table(FAR), body)).points, FAR)


def test_ascii_keeps_more_digits_than_its_float_type_has(read):
    data = pcd_bytes(cloud_table(FAR), "ascii", SIZE="4 4 4")
    assert np.array_equal(read(data).points, FAR)


@pytest.mark.parametrize("body", BODIES)
def test_fields_of_every_type_are_kept_in_their_order(read, body):
    table = cloud_table(FAR, "f4", [(f"p_{kind}", kind) for kind in KINDS])
    for kind in KINDS:
        table[f"p_{kind}"] = np.iinfo(kind).max if kind[0] in "iu" else 0.1
    cloud = read(pcd_bytes(table, body))
    assert cloud.table.dtype.names == table.dtype.names
    for kind in KINDS:
        assert cloud.table[f"p_{kind}"].dtype == kind
        assert np.array_equal(cloud.table[f"p_{kind}"], table[f"p_{kind}"])


@pytest.mark.parametrize("body", BODIES)
def test_fields_that_open3d_breaks_are_kept(read, body):
    """Normals in float64, several values a field, padding, names that come twice, and packed colours with alpha."""
    extra = [("normal_x", "f8"), ("vp", "f4", (3,)), ("_", "u1", (3,)), ("rgba", "u4"), ("a b", "i2"), ("last", "f4")]
    table = cloud_table(FAR, "f8", extra)
    table["normal_x"], table["vp"], table["rgba"], table["a b"], table["last"] = 0.1, [7, 8, 9], 0x80FF4020, 3, 5
    cloud = read(pcd_bytes(table, body, FIELDS="x y z normal_x vp _ rgba last last"))
    assert cloud.table.dtype.names == (
        "x", "y", "z", "normal_x", "vp_0", "vp_1", "vp_2", "rgba", "last", "last_2",
    )  # fmt: skip
    assert np.array_equal(cloud.points, FAR)
    assert cloud.table[1].tolist()[3:] == (0.1, 7, 8, 9, 0x80FF4020, 3, 5)


@pytest.mark.parametrize("body", BODIES)
def test_nan_points_of_an_organised_cloud_keep_their_rows(read, body):
    points = np.array([[1, 2, 3], [np.nan] * 3, [4, 5, 6], [np.nan] * 3, [7, 8, 9], [1, np.inf, 2.0]])
    table = cloud_table(points, "f4", [("rgb", "f4"), ("label", "u4")])
    table["label"] = np.arange(6)
    cloud = read(pcd_bytes(table, body, height=2))
    assert cloud.valid.tolist() == [True, False, True, False, True, False]
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert cloud.table["label"].tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_headers_as_others_write_them(read, body, newline):
    table = cloud_table(FAR, "f4")
    data = pcd_bytes(table, body, VERSION=".7", TYPE="f f f", COUNT="", VIEWPOINT="")
    head, mark, rest = data.partition(b"DATA " + body.encode() + b"\n")
    head = head.replace(b"FIELDS", b"COLUMNS").replace(b"WIDTH", b"\n# a comment\nWIDTH")
    cloud = read((head + mark).replace(b"\n", newline.encode()) + rest)
    assert np.allclose(cloud.points, FAR, rtol=1e-6)


def test_points_may_be_said_by_width_and_height_alone(read):
    assert len(read(pcd_bytes(cloud_table(FAR), "binary", POINTS="")).points) == 3


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_open3d_and_we_agree_on_what_it_packs(tmp_path, dtype):
    open3d = import_open3d()
    rng = np.random.default_rng(0)
    points = rng.normal(size=(500, 3)).astype(dtype) + FAR[0].astype(dtype)
    theirs = open3d.t.geometry.PointCloud()
    theirs.point.positions = open3d.core.Tensor(points)
    theirs.point.label = open3d.core.Tensor(np.repeat(np.arange(5, dtype="i4"), 100)[:, None])
    path = tmp_path / "packed.pcd"
    assert open3d.t.io.write_point_cloud(str(path), theirs, compressed=True)
    assert b"DATA binary_compressed" in path.read_bytes()[:400]
    ours = read_cloud(path)
    assert np.array_equal(ours.points, points)
    assert np.array_equal(ours.table["label"], np.repeat(np.arange(5), 100))


def test_without_open3d_only_packed_bodies_cannot_be_read(read, monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    table = cloud_table(FAR)
    for body in ("ascii", "binary"):
        assert np.array_equal(read(pcd_bytes(table, body)).points, FAR)
    with pytest.raises(InputError) as refused:
        read(pcd_bytes(table, "binary_compressed"))
    assert refused.value.fault == "DATA binary_compressed needs open3d"
    assert refused.value.remedy == "install open3d, or save the file as DATA binary"


def test_a_damaged_packed_body_is_no_talk_on_the_console(read, capfd):
    with pytest.raises(InputError, match="the compressed body is damaged"):
        read(pcd_bytes(cloud_table(FAR), "binary_compressed")[:-40] + b"\xff" * 40)
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(not (MUG.exists() or os.environ.get("CI")), reason="needs ../shared/data beside the project")
def test_the_mug_reads_as_open3d_reads_it():
    open3d = import_open3d()
    theirs = open3d.t.io.read_point_cloud(str(MUG), remove_nan_points=False).point
    ours = read_cloud(MUG)
    assert (ours.rows, len(ours.points)) == (307200, 209280)
    for place, axis in enumerate("xyz"):
        assert np.array_equal(ours.table[axis], theirs.positions.numpy()[:, place], equal_nan=True)
    packed = ours.table["rgb"].view("u4")
    for place, shift in enumerate((16, 8, 0)):
        assert np.array_equal(packed >> shift & 255, theirs.colors.numpy()[:, place])


@given(
    points=hnp.arrays("f8", st.tuples(st.integers(1, 9), st.just(3)), elements=st.floats(-1e9, 1e9)),
    body=st.sampled_from(["ascii", "binary"]),
)
def test_any_points_round_trip_bit_by_bit(tmp_path_factory, points, body):
    path = tmp_path_factory.mktemp("pcd") / "scan.pcd"
    path.write_bytes(pcd_bytes(cloud_table(points), body))
    assert np.array_equal(read_cloud(path).points, points)


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_written_clouds_are_read_by_open3d_and_by_us(tmp_path, dtype):
    path = tmp_path / "out.pcd"
    write_cloud(path, FAR, properties={"label": np.array([-1, 0, 7], "i4"), "seen": np.ones(3, bool)}, dtype=dtype)
    theirs = import_open3d().t.io.read_point_cloud(str(path)).point
    ours = read_cloud(path)
    assert np.array_equal(theirs.positions.numpy(), FAR.astype(dtype))
    assert theirs.label.numpy()[:, 0].tolist() == ours.table["label"].tolist() == [-1, 0, 7]
    assert np.array_equal(ours.points, FAR.astype(dtype))


def driver_pcd(body="binary", keys=str, data="DATA", extra=""):
    """Write two points with padding before, between and behind x, y, z, and a count of 0, as drivers do."""
    counts, sizes = [4, 1, 1, 1, 0, 1, 3], [1, 4, 4, 4, 4, 2, 1]
    lines = {
        "VERSION": "0.7", "FIELDS": "_ x y z _ Scalar_field_#2 _", "SIZE": " ".join(map(str, sizes)),
        "TYPE": "U F F F U U U", "COUNT": " ".join(map(str, counts)), "WIDTH": "2", "HEIGHT": "1",
        "VIEWPOINT": "0 0 0 1 0 0 0", "POINTS": "2", data: body,
    }  # fmt: skip
    header = "# .PCD v0.7\n" + extra + "".join(f"{keys(key)} {value}\n" for key, value in lines.items())
    if body.lower() == "ascii":
        return (header + "".join(f"9 9 9 9 {k} {k + 1} {k + 2} {k + 7} 8 8 8\n" for k in (1, 4))).encode()
    rows = [bytes(4) + struct.pack("<fffH", k, k + 1, k + 2, k + 7) + bytes(3) for k in (1, 4)]
    return header.encode() + b"".join(rows)


@pytest.mark.parametrize(
    "data",
    [
        driver_pcd(),
        driver_pcd("ascii"),
        driver_pcd("BINARY", str.lower),
        driver_pcd(extra="VERSION .7\nFRAME_ID map\nSCALE 1 1 1\nTIMESTAMP\n# a remark\n\n"),
        b"\xef\xbb\xbf" + driver_pcd("ascii"),
        driver_pcd().replace(b"POINTS 2", b"POINTS 2 # two").replace(b"WIDTH 2", b"WIDTH 2 # wide"),
    ],
    ids=["binary", "ascii", "small letters", "unknown keys", "byte order mark", "remarks"],
)
def test_clouds_as_drivers_and_cloudcompare_write_them(read, data):
    cloud = read(data)
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert cloud.table.dtype.names == ("x", "y", "z", "Scalar_field_#2")
    assert cloud.table["Scalar_field_#2"].tolist() == [8, 11]


def test_a_remark_behind_the_fields_is_no_field(read):
    data = b"VERSION .7\nFIELDS x y z # of points\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3\n"
    assert read(data).points.tolist() == [[1, 2, 3]]
