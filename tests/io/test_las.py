"""LAS and LAZ: what is read, what is refused, and what comes back."""

import io
import sys
from contextlib import suppress
from importlib.util import find_spec

import laspy
import numpy as np
import pytest

from cylx.errors import InputError, OutputError
from cylx.io import read_cloud, write_annotated
from cylx.io.inputs import open_input
from cylx.io.las_header import las_header

N = 500
RNG = np.random.default_rng(0)
STEPS = RNG.integers(-(10**6), 10**6, (N, 3))
OFFSET = np.array([500_000.0, 5_000_000.0, 0.0])
POINTS = OFFSET + STEPS / 1000.0
NORMALS = RNG.normal(size=(N, 3)).astype("f4")
FORMATS = range(11)


def las_bytes(point_format=3, *, compressed=False, steps=STEPS, evlrs=(), version=None, extra=True):
    version = version or ("1.4" if point_format >= 6 else "1.3" if point_format >= 4 else "1.2")
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales, header.offsets = [0.001] * 3, OFFSET
    scaled = laspy.ExtraBytesParams("range", "i2", offsets=np.array([1.0]), scales=np.array([0.5]))
    if extra:
        header.add_extra_dims(
            [laspy.ExtraBytesParams("amplitude", "f4"), laspy.ExtraBytesParams("normal", "3f4"), scaled]
        )
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "the coordinate system", b"somewhere\0"))
    cloud = laspy.LasData(header)
    count = len(steps)
    cloud.X, cloud.Y, cloud.Z = steps.T
    cloud.intensity = np.arange(count)
    cloud.classification = np.arange(count) % 5
    cloud.return_number = np.arange(count) % 4
    if extra:
        cloud.amplitude, cloud.normal, cloud["range"] = np.arange(count) / 4, NORMALS[:count], np.arange(count) % 9 / 2
    if "red" in header.point_format.dimension_names:
        cloud.red, cloud.green, cloud.blue = np.full(count, 40_000), np.arange(count), np.zeros(count)
    if evlrs:
        cloud.evlrs = laspy.vlrs.vlrlist.VLRList(evlrs)
    out = io.BytesIO()
    cloud.write(out, do_compress=compressed)
    return out.getvalue()


@pytest.fixture
def put(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(name, data):
        (tmp_path / name).write_bytes(data)
        return name

    return write


@pytest.mark.parametrize("compressed", [False, True], ids=["las", "laz"])
@pytest.mark.parametrize("point_format", FORMATS)
def test_every_point_format_is_read_with_all_its_dimensions(put, point_format, compressed):
    name = put("scan.laz" if compressed else "scan.las", las_bytes(point_format, compressed=compressed))
    cloud = read_cloud(name)
    assert np.abs(cloud.points - POINTS).max() < 2e-9
    assert np.array_equal(cloud.points, STEPS * 0.001 + OFFSET)
    assert (cloud.source.format, cloud.valid) == ("las", None)
    names = {name for name in laspy.PointFormat(point_format).dimension_names if name not in "XYZ"}
    assert set(cloud.table.dtype.names) - names == {
        "x", "y", "z", "amplitude", "normal_0", "normal_1", "normal_2", "range",
    }  # fmt: skip
    assert np.array_equal(cloud.table["intensity"], np.arange(N))
    assert np.array_equal(cloud.table["classification"], np.arange(N) % 5)
    assert np.array_equal(cloud.table["normal_2"], NORMALS[:, 2])
    assert np.array_equal(cloud.table["range"], np.arange(N) % 9 / 2)


def test_laz_is_las(put):
    plain = read_cloud(put("a.las", las_bytes()))
    packed = read_cloud(put("a.laz", las_bytes(compressed=True)))
    assert np.array_equal(plain.table, packed.table)


def test_it_is_recognised_by_its_content(put, run_cylx):
    data = las_bytes(compressed=True)
    assert read_cloud(put("scan", data)).source.format == "las"
    assert run_cylx("info", "-", input=data).stdout.splitlines()[1] == "format   las"


def test_one_point_will_do(put):
    assert read_cloud(put("one.las", las_bytes(steps=STEPS[:1]))).points.shape == (1, 3)


@pytest.mark.parametrize("compressed", [False, True], ids=["las", "laz"])
@pytest.mark.parametrize("point_format", [3, 7])
def test_a_file_cut_short_is_one_line_wherever_it_is_cut(put, point_format, compressed):
    data = las_bytes(point_format, compressed=compressed)
    for size in {*range(1, 400, 13), *range(400, len(data), len(data) // 40), len(data) - 1}:
        with pytest.raises(InputError) as refused:
            read_cloud(put("cut.las", data[:size]))
        assert str(refused.value).startswith("cut.las: ")
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("compressed", [False, True], ids=["las", "laz"])
def test_changed_bytes_are_one_line_or_a_cloud_of_finite_points(put, compressed):
    data = las_bytes(compressed=compressed)
    rng = np.random.default_rng(1)
    for where in [*rng.integers(0, len(data), 60), *rng.integers(len(data) - 40, len(data), 30), *range(90, 180, 3)]:
        broken = bytearray(data)
        broken[where] ^= 1 << int(rng.integers(8))
        put("flip.las", bytes(broken))
        with suppress(InputError):
            assert np.isfinite(read_cloud("flip.las").points).all()


def with_bytes(data, place, new):
    return data[:place] + new + data[place + len(new) :]


BAD = {
    "garbage": (b"garbage", "is not LAS: it does not begin with LASF; give it its right suffix"),
    "short": (b"LASF" + bytes(90), "the file ends within the LAS header; get a complete copy of the file"),
    "empty": (b"", "is empty; check how it was made"),
    "no points": (las_bytes(steps=STEPS[:0]), "holds no points; give a file with points"),
    "too few": (
        las_bytes(extra=False)[: -34 * 7],
        "the header promises 500 points, the file holds 493; get a complete copy of the file",
    ),
    "no scale": (with_bytes(las_bytes(), 131, bytes(8)), "the scale of x is 0; export the file again"),
    "no offset": (
        with_bytes(las_bytes(), 155, np.array([np.nan]).tobytes()),
        "the offset of x is nan; export the file again",
    ),
    "unknown": (
        with_bytes(las_bytes(), 104, b"\x0b"),
        "LAS 1.2 with point format 11 is not known; export the file again as LAS 1.2 or 1.4",
    ),
    "records": (
        with_bytes(las_bytes(), 100, b"\xff\xff\xff\xff"),
        "the LAS header has no room for its 4294967295 records; get a complete copy of the file",
    ),
}


@pytest.mark.parametrize(("data", "message"), BAD.values(), ids=BAD)
def test_bad_files(put, data, message):
    with pytest.raises(InputError) as refused:
        read_cloud(put("scan.las", data))
    assert str(refused.value) == f"scan.las: {message}"


@pytest.mark.parametrize(
    ("name", "missing", "fault"),
    [
        ("scan.laz", ["laspy", "lazrs"], "needs laspy and lazrs, which are not installed"),
        ("scan.laz", ["lazrs"], "needs lazrs, which is not installed"),
        ("scan.las", ["laspy", "lazrs"], "needs laspy, which is not installed"),
    ],
)
def test_a_missing_library_is_named_with_the_command_that_installs_it(put, monkeypatch, run_cylx, name, missing, fault):
    put(name, las_bytes(compressed=name.endswith("z")))
    for module in missing:
        monkeypatch.setitem(sys.modules, module, None)
        assert find_spec(module) is None
    shown = run_cylx("info", name)
    assert (shown.exit_code, shown.stderr) == (3, f"cylx: {name}: {fault}; pip install 'cylx[las]'\n")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("point_format", FORMATS)
def test_the_annotated_file_is_the_file_with_the_cylinders(put, make_extraction, point_format, suffix):
    wkt = laspy.VLR("LASF_Projection", 2112, "after the points", b"here\0")
    data = las_bytes(point_format, compressed=suffix == ".laz", evlrs=[wkt] if point_format >= 6 else ())
    found = make_extraction(read_cloud(put(f"scan{suffix}", data)))
    write_annotated(f"out{suffix}", found)
    before, after = laspy.read(f"scan{suffix}"), laspy.read(f"out{suffix}")
    assert (after.header.version, after.header.point_format.id) == (before.header.version, point_format)
    assert after.header.are_points_compressed == (suffix == ".laz")
    assert [record.user_id for record in after.vlrs].count("LASF_Projection") == 1
    assert [record.record_data_bytes() for record in after.evlrs or ()] == ([b"here\0"] if point_format >= 6 else [])
    colors = {"red", "green", "blue"} & set(before.point_format.dimension_names)
    for name in before.point_format.dimension_names:
        kept = after[f"orig_{name}" if name in colors else name]
        assert np.array_equal(np.asarray(before[name]), np.asarray(kept)), name
    assert (after["cylinder_id"].dtype, after["residual"].dtype) == (np.int32, np.float32)
    assert (after["cylinder_id"] == 0).all()
    assert set(after.point_format.extra_dimension_names) == {
        *before.point_format.extra_dimension_names, "cylinder_id", "residual", *(f"orig_{color}" for color in colors)
    }  # fmt: skip
    if colors:
        assert (after.red == after.red[0]).all()
        assert after.red[0] > 40_000


def test_the_annotated_file_can_be_annotated_again(put, make_extraction):
    write_annotated("a.las", make_extraction(read_cloud(put("scan.las", las_bytes(7)))))
    first = read_cloud("a.las").table["red"]
    write_annotated("b.las", make_extraction(read_cloud("a.las"), cylinders=0))
    again = laspy.read("b.las")
    assert (again["orig_cylinder_id"] == 0).all()
    assert (again["cylinder_id"] == -1).all()
    assert np.isnan(again["residual"]).all()
    assert np.array_equal(again["orig_red_2"], first)
    assert (again["orig_red"] == 40_000).all()


def test_the_same_cloud_gives_the_same_bytes(put, make_extraction, tmp_path):
    found = make_extraction(read_cloud(put("scan.laz", with_bytes(las_bytes(compressed=True), 90, bytes(4)))))
    for name in ("a.laz", "b.laz"):
        write_annotated(name, found)
    assert (tmp_path / "a.laz").read_bytes() == (tmp_path / "b.laz").read_bytes()


def test_the_index_of_a_copc_file_is_left_out(put, make_extraction):
    index = laspy.VLR("copc", 1000, "hierarchy", bytes(32))
    write_annotated("out.las", make_extraction(read_cloud(put("scan.las", las_bytes(6, evlrs=[index])))))
    assert not laspy.read("out.las").evlrs


def test_another_cloud_cannot_be_written_as_las(tmp_path, make_extraction):
    with pytest.raises(OutputError, match="the input is neither LAS nor LAZ; choose a name"):
        write_annotated(tmp_path / "out.las", make_extraction())
    assert not list(tmp_path.iterdir())


def test_a_las_file_can_be_annotated_as_ply_and_pcd(put, make_extraction):
    found = make_extraction(read_cloud(put("scan.las", las_bytes())))
    for name in ("out.ply", "out.pcd"):
        write_annotated(name, found)
        back = read_cloud(name)
        assert np.array_equal(back.points, POINTS) or np.abs(back.points - POINTS).max() < 2e-9
        assert np.array_equal(back.table["orig_green"], np.arange(N))
        assert (back.table["cylinder_id"] == 0).all()


def test_what_a_header_says_is_held_against_the_file(put):
    with open_input(put("scan.laz", las_bytes(6, compressed=True))) as source:
        facts = las_header(source)
    assert (facts.points, facts.compressed) == (N, True)
