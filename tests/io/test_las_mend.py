"""LAS headers as programs write them: names twice, Latin-1, early versions, counts in one place alone."""

import io
import json
import struct

import laspy
import numpy as np
import pytest

from cylx.errors import InputError, OutputError
from cylx.io import check_annotated, read_cloud, write_annotated
from cylx.io.las_mend import Spliced, mended

POINTS = np.random.default_rng(0).normal(size=(9, 3)).round(3)
EXTRA = ("amplitude", "deviation", "Deviatiom")


def las_bytes(point_format=6, version="1.4", extra=EXTRA, vlrs=(), compressed=False, evlrs=()):
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales = [0.001] * 3
    header.add_extra_dims([laspy.ExtraBytesParams(name, "f4") for name in extra])
    header.vlrs.extend(vlrs)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = POINTS.T
    for place, name in enumerate(extra):
        cloud[name] = np.arange(len(POINTS)) + 10 * place
    if evlrs:
        cloud.evlrs = laspy.vlrs.vlrlist.VLRList(evlrs)
    out = io.BytesIO()
    cloud.write(out, do_compress=compressed)
    return bytearray(out.getvalue())


def renamed(data, new):
    return bytearray(bytes(data).replace(b"Deviatiom".ljust(32, b"\0"), new.ljust(32, b"\0")))


def packed(data, kind, place, *values):
    struct.pack_into(f"<{kind}", data, place, *values)
    return data


def with_second_record(data):
    """Describe the extra bytes again in a second record."""
    size, start, count = struct.unpack_from("<HII", data, 94)
    records = data[size:start]
    packed(data, "II", 96, start + len(records), 2 * count)
    return data[:start] + records + data[start:]


LATIN = laspy.VLR("Acme", 77, "Strasze", b"hello")
NAMES = {
    "the same name twice": (renamed(las_bytes(), b"deviation"), "deviation_2"),
    "a name of the point format": (renamed(las_bytes(), b"intensity"), "intensity_2"),
    "the name X": (renamed(las_bytes(), b"X"), "X_2"),
    "no name": (renamed(las_bytes(), b""), "property"),
    "Latin-1": (renamed(las_bytes(), b"Neig\xfcng"), "Neig_ng"),
    "32 letters": (renamed(las_bytes(), b"a" * 32), "a" * 32),
    "two records": (with_second_record(las_bytes()), "Deviatiom"),
    "early version": (packed(packed(las_bytes(), "B", 25, 2), "I", 107, 9), "Deviatiom"),
}
VERSIONS = {
    "1.0": (packed(las_bytes(1, "1.2", ()), "B", 25, 0), "1.1"),
    "1.0 with colours": (packed(las_bytes(3, "1.2", ()), "B", 25, 0), "1.2"),
    "1.1 with colours": (packed(las_bytes(2, "1.2", ()), "B", 25, 1), "1.2"),
    "1.2 with format 6": (packed(packed(las_bytes(6, "1.4", ()), "B", 25, 2), "I", 107, 9), "1.4"),
    "1.3 with format 7": (packed(packed(las_bytes(7, "1.4", ()), "B", 25, 3), "I", 107, 9), "1.4"),
    "the legacy count alone": (packed(packed(las_bytes(3, "1.4", ()), "I", 107, 9), "Q", 247, 0), "1.4"),
    "bounds of zero": (packed(las_bytes(3, "1.2", ()), "6d", 179, *[0.0] * 6), "1.2"),
}


@pytest.fixture
def put(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(data, name="scan.las"):
        (tmp_path / name).write_bytes(data)
        return name

    return write


@pytest.mark.parametrize(("data", "name"), NAMES.values(), ids=NAMES)
def test_all_dimensions_are_read_and_written_under_names_that_differ(put, make_extraction, data, name):
    cloud = read_cloud(put(data))
    assert np.allclose(cloud.points, POINTS, atol=1e-9)
    assert cloud.table["amplitude"].tolist() == np.arange(9.0).tolist()
    assert cloud.table["deviation"].tolist() == np.arange(10.0, 19).tolist()
    assert cloud.table[name].tolist() == np.arange(20.0, 29).tolist()
    write_annotated("out.las", make_extraction(cloud))
    back = read_cloud("out.las")
    assert np.array_equal(back.table[name], cloud.table[name])
    assert (back.table["cylinder_id"] == 0).all()


@pytest.mark.parametrize(("data", "version"), VERSIONS.values(), ids=VERSIONS)
def test_versions_that_laspy_does_not_write_become_the_next_one(put, make_extraction, data, version):
    cloud = read_cloud(put(data))
    assert np.allclose(cloud.points, POINTS, atol=1e-9)
    assert cloud.source.doubts == ()
    write_annotated("out.las", make_extraction(cloud))
    with laspy.open("out.las") as reader:
        assert str(reader.header.version) == version
    assert np.array_equal(read_cloud("out.las").points, cloud.points)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_letters_in_latin_1_are_read_and_written_back(put, make_extraction, suffix):
    data = las_bytes(vlrs=[LATIN], evlrs=[laspy.VLR("Acme", 78, "Grosze", b"there")], compressed=suffix == ".laz")
    data = (
        bytes(data).replace(b"Strasze", b"Stra\xdfe ").replace(b"Grosze", b"Gr\xf6\xdfe ").replace(b"Acme", b"\xc4cme")
    )
    data = bytearray(data)
    data[58:90] = "Vermessung Müller".encode("latin-1").ljust(32, b"\0")
    cloud = read_cloud(put(data, f"scan{suffix}"))
    write_annotated(f"out{suffix}", make_extraction(cloud))
    with open(f"out{suffix}", "rb") as file:  # noqa: PTH123  beside the scan
        written = file.read()
    assert written[58:90] == data[58:90]
    for text in (b"\xc4cme", b"Stra\xdfe ", b"Gr\xf6\xdfe "):
        assert written.count(text) == data.count(text)
    assert np.array_equal(read_cloud(f"out{suffix}").points, cloud.points)
    write_annotated(f"again{suffix}", make_extraction(read_cloud(f"out{suffix}")))


def test_a_header_that_counts_nothing_is_told(put):
    cloud = read_cloud(put(packed(las_bytes(3, "1.2", ()), "I", 107, 0)))
    assert np.allclose(cloud.points, POINTS, atol=1e-9)
    assert cloud.source.doubts == (
        ("the header counts 0 points; 9 fit into the file and were read", "export it again"),
    )
    with pytest.raises(InputError, match="holds no points"):
        read_cloud(put(packed(las_bytes(3, "1.2", ()) + b"abc", "I", 107, 0)))


def test_a_description_that_does_not_fit_leaves_plain_bytes(put, make_extraction):
    data = las_bytes()
    place = bytes(data).index(b"Deviatiom") - 2
    data[place] = 10  # of 8 bytes: more than there are
    cloud = read_cloud(put(data))
    assert [name for name in cloud.table.dtype.names if name.startswith("ExtraBytes")][-1] == "ExtraBytes_11"
    write_annotated("out.las", make_extraction(cloud))


def test_a_scale_of_zero_is_no_scale(put, make_extraction):
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.add_extra_dim(laspy.ExtraBytesParams("range", "i2", offsets=np.array([1.0]), scales=np.array([0.5])))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = POINTS.T
    cloud["range"] = np.arange(9) / 2
    out = io.BytesIO()
    cloud.write(out)
    data = bytearray(out.getvalue())
    packed(data, "d", bytes(data).index(b"range") - 4 + 112, 0.0)
    cloud = read_cloud(put(data))
    assert cloud.table["range"].tolist() == (np.arange(9) - 2).tolist()
    write_annotated("out.las", make_extraction(cloud))


def test_an_ordinary_header_is_left_alone():
    data = bytes(las_bytes(evlrs=[LATIN]))
    assert mended(data, 9) == data
    spliced = Spliced(b"head", io.BytesIO(b"0123456789"))
    assert (spliced.read(2), spliced.seek(1, 1), spliced.read(9), spliced.read()) == (b"he", 3, b"d", b"456789")
    assert (spliced.seek(-1, 2), spliced.read(), spliced.tell()) == (9, b"9", 10)


def test_steps_that_double_precision_has_not_are_known_before(put):
    data = packed(packed(las_bytes(1, "1.2", ()), "d", 131, 1e-9), "d", 155, 1e15)
    with pytest.raises(OutputError, match="the steps of x, 1e-09, are lost so far from the origin; choose a name"):
        check_annotated("out.las", read_cloud(put(data)))


def forbid(*_args, **_settings):
    raise ValueError("no such\nluck " + "a" * 300)


def test_what_laspy_cannot_write_is_known_before_and_becomes_ply(put, monkeypatch, run_cylx, fake_pipeline, tmp_path):
    put(las_bytes())
    monkeypatch.setattr("laspy.LasHeader.write_to", forbid)
    cloud = read_cloud("scan.las")
    with pytest.raises(OutputError, match=r"laspy cannot write this file again: 'no such luck a+\.\.\.'; choose"):
        check_annotated("out.las", cloud)
    shown = run_cylx("extract", "scan.las")
    assert shown.exit_code == 0
    (note,) = (line for line in shown.stderr.splitlines() if line.startswith("note: "))
    assert note.startswith("note: laspy cannot write this file again: 'no such luck aaa")
    assert note.endswith("; the annotated cloud is scan.annotated.ply")
    assert "written to scan.cylinders.json and scan.annotated.ply" in shown.stderr
    assert len(read_cloud("scan.annotated.ply").table["cylinder_id"]) == 9
    assert json.loads((tmp_path / "scan.cylinders.json").read_text())["cylinders"]
    before = len(fake_pipeline.calls)
    again = run_cylx("extract", "scan.las")  # refused before it is computed
    assert (again.exit_code, len(fake_pipeline.calls)) == (4, before)
    assert run_cylx("extract", "scan.las", "--overwrite").exit_code == 0
