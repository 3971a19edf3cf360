"""Cases of ../shared/cases about files of point clouds: each is made by its own program, and read."""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud, write_annotated
from cylx.io.annotated_checks import las_obstacle

CASES = Path(__file__).resolve().parents[2] / "shared" / "cases"
if not CASES.exists() and os.environ.get("CI") != "true":
    pytest.skip("the cases of ../shared/cases are not here", allow_module_level=True)

COPY = "get a complete copy of the file"
PLY = "export the file again as PLY 1.0"
NUMBERS = "write numbers like -1.5 or 2e-3"
NUMBERED = "column 1 seems to number the points; x, y, z are column 2, column 3, column 4"
VERSIONS = "use one of ascii, binary_little_endian, binary_big_endian, version 1.0"
TOLERANCE = {".las": 6e-5, ".laz": 6e-5}

READ = {
    "cc-semicolon-header": ["pcv.txt"],
    "csv-easting": ["survey.csv"],
    "csv-paraview": ["frame.csv"],
    "hash-in-names": [
        "sf_first.pcd", "sf_last.pcd", "sf_mid.pcd", "hdr_first.csv", "hdr_hash_id.csv", "hdr_num.csv", "cc.asc",
        "sfply.ply",
    ],
    "las-dup-extra": [
        "ok.las", "dup.las", "case.las", "std.las", "X.las", "empty.las", "latin.las", "vlrtwice.las",
    ],
    "las-quirks": [
        *(f"pf{point_format}.las" for point_format in range(11)), "v10.las", "v12.las", "v13.las", "laz7.laz",
        "renamed.laz", "v14_only_legacy.las", "v14_pf6_legacyset.las", "longrec.las", "twobytes.las", "tail.las",
        "bbox.las", "extra.las", "scale1e9.las",
    ],
    "pcd-count0": ["a.pcd"],
    "ply-quirks": [
        "bom.ply", "space.ply", "crlf.ply", "cr.ply", "nonascii.ply", "objinfo.ply", "long.ply", "ulong.ply",
        "bool.ply", "facefirst.ply", "facefirsta.ply", "big.ply", "tail.ply", "taila.ply", "nofinalnl.ply",
        "blank.ply", "nan.ply", "Nan2.ply", "comma.ply", "headersp.ply", "vlist.ply", "xyzcaps.ply", "bomdata.ply",
        "headersp2.ply", "upper.ply", "vertices.ply", "point.ply",
    ],
}  # fmt: skip
REFUSED = {
    "las-quirks/morecount.las": f": the header promises 20050 points, the file holds 20000; {COPY}",
    "las-quirks/trunc.las": f": the header promises 20000 points, the file holds 9996; {COPY}",
    "las-quirks/trunc.laz": f": the table of its compressed chunks is damaged; {COPY}",
    "las-quirks/nanscale.las": ": the scale of x is nan; export the file again",
    "las-quirks/zeroscale.las": ": the scale of x is 0; export the file again",
    "ply-quirks/leadnl.ply": ": is not PLY: it does not begin with the line 'ply'; give it its right suffix",
    "ply-quirks/floatcol.ply": f":11: red is '255.0', not a number of type uint8; {NUMBERS}",
    "ply-quirks/negcol.ply": f":9: red is '256', not a number of type uint8; {NUMBERS}",
    "ply-quirks/moretok.ply": ":8: expected 3 columns, found 4; give every row the same columns",
    "ply-quirks/format11.ply": f":2: unknown format 'ascii 1.1'; {VERSIONS}",
    "ply-quirks/nov.ply": f":2: unknown format 'ascii'; {VERSIONS}",
    "ply-quirks/minus1.ply": f":3: element 'vertex' has the impossible count '-1'; {PLY}",
    "ply-quirks/more.ply": f": the header promises 20100 points, the file holds 20000; {COPY}",
    "ply-quirks/endheader.ply": f":7: 'end header' is not a line of a PLY header; {PLY}",
    "ply-quirks/half.ply": f":4: 'float16 x' is not a property type and name; {PLY}",
    "ply-quirks/oneline.ply": ":8: expected 3 columns, found 60000; give every row the same columns",
    "ply-quirks/pxpypz.ply": ": the vertex element has no property x, y, z; give a PLY with x, y and z",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a function that makes the files of a case, once."""

    @cache
    def make(case):
        folder = tmp_path_factory.mktemp(case)
        surroundings = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        subprocess.run([sys.executable, CASES / case / "make.py"], cwd=folder, env=surroundings, check=True)
        return folder

    return make


@pytest.fixture(scope="module")
def scene():
    sys.path.insert(0, str(CASES))
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        import common
    finally:
        sys.dont_write_bytecode = before
        sys.path.remove(str(CASES))
    return common.scene


@pytest.mark.parametrize("case", READ)
def test_the_points_are_those_of_the_scene(made, scene, case):
    points = scene()
    for name in READ[case]:
        cloud = read_cloud(made(case) / name)
        assert len(cloud.points) == len(points), name
        assert np.abs(cloud.points - points).max() < TOLERANCE.get(Path(name).suffix, 6e-6), name
        assert (cloud.source.notes, cloud.source.doubts) == ((), ()), name


@pytest.mark.parametrize("name", REFUSED)
def test_the_others_are_refused_in_one_line(made, name):
    case, _, file = name.partition("/")
    path = made(case) / file
    with pytest.raises(InputError) as refused:
        read_cloud(path)
    assert str(refused.value) == f"{path}{REFUSED[name]}"


@pytest.mark.parametrize(
    ("name", "moved", "within"),
    [
        ("cm.las", (4e5, 5e6, 0), 0.0051),
        ("mm_utm.las", (4e5, 5e6, 0), 0.00051),
        ("off0_utm.las", (4e5, 5e5, 0), 0.00051),
    ],
)
def test_map_coordinates_are_as_exact_as_their_steps(made, scene, name, moved, within):
    assert np.abs(read_cloud(made("las-quirks") / name).points - scene() - moved).max() < within


def test_a_negative_scale_is_a_mirror(made, scene):
    points = read_cloud(made("las-quirks") / "negscale.las").points
    assert np.abs(points * [-1, 1, 1] - scene()).max() < 6e-5


def test_points_that_are_withheld_are_left_out_and_counted_and_come_back(made, scene, tmp_path, make_extraction):
    cloud = read_cloud(made("las-quirks") / "withheld.las")
    assert (len(cloud.points), cloud.rows) == (20000, 24000)
    assert np.abs(cloud.points - scene()).max() < 6e-5
    assert cloud.source.notes == ("4000 of 24000 points are marked as withheld, and left out",)
    write_annotated(tmp_path / "out.las", make_extraction(cloud))
    back = read_cloud(tmp_path / "out.las")
    assert (back.table["withheld"] != 0).sum() == 4000
    assert all(np.array_equal(back.table[axis], cloud.table[axis]) for axis in "xyz")
    assert (back.table["cylinder_id"][back.table["withheld"] != 0] == -1).all()


def test_blanks_among_the_numbers_of_a_binary_file_are_numbers(made, scene):
    points = read_cloud(made("ply-quirks") / "binws.ply").points
    odd = np.frombuffer(b"\n \n?", "<f4")[0]  # in place of the first of all numbers
    assert np.isclose(points[0, 0], odd)
    assert np.abs(points.ravel()[1:] - scene().ravel()[1:]).max() < 6e-6


def test_fewer_points_are_read_where_the_header_counts_fewer(made, scene):
    assert np.allclose(read_cloud(made("las-quirks") / "lesscount.las").points, scene()[:19950], atol=6e-5)
    assert np.allclose(read_cloud(made("ply-quirks") / "less.ply").points, scene()[:19900], atol=6e-6)


def test_a_header_that_counts_nothing_is_a_warning(made):
    cloud = read_cloud(made("las-quirks") / "zerocount.las")
    assert len(cloud.points) == 20000
    assert "counts 0 points" in cloud.source.doubts[0][0]


@pytest.mark.parametrize("name", ["pnt.txt", "pnezd.csv"])
def test_point_numbers_are_no_coordinates_and_that_is_said(made, scene, name):
    cloud = read_cloud(made("point-number-first") / name)
    assert np.abs(cloud.points - scene()).max() < 6e-6
    assert cloud.source.doubts == ((NUMBERED, "name the columns x, y and z"),)


def test_degrees_are_called_degrees(made):
    cloud = read_cloud(made("cc-semicolon-header") / "entwine35.csv")
    assert cloud.points[:, 2].min() > 600
    assert "degrees" in cloud.source.doubts[0][0]


@pytest.mark.parametrize("name", ["base.las", "software.las", "vlr.las", "v10.las", "pf6v12.las"])
def test_what_is_in_latin_1_or_of_an_early_version_comes_back(made, tmp_path, make_extraction, name):
    cloud = read_cloud(made("las-header-latin") / name)
    assert (len(cloud.points), las_obstacle("out.las", cloud)) == (6000, "")
    write_annotated(tmp_path / "out.las", make_extraction(cloud))
    assert np.array_equal(read_cloud(tmp_path / "out.las").points, cloud.points)
    before, after = ((made("las-header-latin") / name).read_bytes(), (tmp_path / "out.las").read_bytes())
    assert before[58:90] == after[58:90]
    assert after.count(b"Stra\xdfe") == before.count(b"Stra\xdfe")


@pytest.mark.parametrize("share", [10, 50])
@pytest.mark.parametrize("suffix", ["xyz", "npy"])
def test_zeros_are_counted_in_a_warning(made, share, suffix):
    from cylx.records import Scene
    from cylx.scene.cautions import damage

    cloud = read_cloud(made("zeros-invalid") / f"z{share}.{suffix}")
    kinds = {caution.kind: caution.fault for caution in damage(cloud, Scene(0.02, 0.002, 3.0))}
    zeros = 20000 * share // (100 - share)
    assert kinds == {
        "zeros": f"{zeros} of {20000 + zeros} points are (0, 0, 0), as some programs write where nothing was measured"
    }
