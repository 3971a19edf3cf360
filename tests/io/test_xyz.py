"""Rows of text: separators, comments, names, counts, and every digit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cylx.io import read_cloud, write_cloud
from cylx.io.formats import TEXT_SUFFIXES

FAR = np.array([[512345.678, 5412345.432, 123.4], [5e6 + 0.001, -5e6 - 0.002, 0.003], [1e-3, 0.1, 1 / 3]])


@pytest.fixture
def read(tmp_path):
    def read(text, name="scan.xyz"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_cloud(path)

    return read


SAME = {
    "spaces": "1 2 3\n4 5 6\n",
    "many spaces": "  1   2 3  \n4 5    6\n",
    "tabs": "1\t2\t3\n4\t5\t6\n",
    "commas": "1,2,3\n4,5,6\n",
    "commas and spaces": "1, 2, 3\n4 ,5,  6\n",
    "semicolons": "1;2;3\n4;5;6\n",
    "separator at the end": "1,2,3,\n4,5,6,\n",
    "separator at some ends": "1;2;3\n4;5;6;\n",
    "no line end at the end": "1 2 3\n4 5 6",
    "Windows": "1 2 3\r\n4 5 6\r\n",
    "old Macintosh": "1 2 3\r4 5 6\r",
    "empty lines": "\n\n1 2 3\n   \n\n4 5 6\n\n",
    "comments": "# a scan\n// of something\n1 2 3\n# here\n4 5 6 // there\n",
    "comment of three words": "# made by hand\n1 2 3\n4 5 6\n",
    "comment in Latin-1": b"# gr\xf6\xdfer\n1 2 3\n4 5 6\n",
    "names": "x y z\n1 2 3\n4 5 6\n",
    "names in capitals": "X,Y,Z\n1,2,3\n4,5,6\n",
    "names in quotes": '"x";"y";"z"\n1;2;3\n4;5;6\n',
    "names in a comment": "//X Y Z\n1 2 3\n4 5 6\n",
    "other names": "lon lat height\n1 2 3\n4 5 6\n",
    "a title": "Exported from the scanner today\n1 2 3\n4 5 6\n",
    "count": "2\n1 2 3\n4 5 6\n",
    "count and comment": "# scan\n2\n\n1 2 3\n4 5 6\n",
    "byte order mark": "\ufeff1 2 3\n4 5 6\n",
    "byte order mark before names": "\ufeffx,y,z\n1,2,3\n4,5,6\n",
    "scientific": "1e0 +2 3.\n.4E1 500e-2 6\n",
}


@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
@pytest.mark.parametrize("suffix", TEXT_SUFFIXES)
def test_ways_to_write_the_same(read, text, suffix):
    cloud = read(text, f"scan{suffix}")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert (cloud.table, cloud.valid, cloud.source.format) == (None, None, "xyz")


NAMED = {
    "x y z intensity label\n1 2 3 0.5 7\n": ("x", "y", "z", "intensity", "label"),
    "# x y z intensity label\n1 2 3 0.5 7\n": ("x", "y", "z", "intensity", "label"),
    "//X Y Z Rf Gf\n1 2 3 0.5 7\n": ("x", "y", "z", "Rf", "Gf"),
    "x,y,z,scan angle,scan angle\n1,2,3,0.5,7\n": ("x", "y", "z", "scan_angle", "scan_angle_2"),
    "1 2 3 0.5 7\n": ("x", "y", "z", "column_4", "column_5"),
    "# one two three four five\n1 2 3 0.5 7\n": ("x", "y", "z", "column_4", "column_5"),
    "x y z\n1 2 3 0.5 7\n": ("x", "y", "z", "column_4", "column_5"),
    "a b c d e\n1 2 3 0.5 7\n": ("x", "y", "z", "d", "e"),
    "a b c x y\n1 2 3 0.5 7\n": ("x", "y", "z", "x_2", "y_2"),
}


@pytest.mark.parametrize(("text", "names"), NAMED.items(), ids=range(len(NAMED)))
def test_further_columns_are_kept_by_name(read, text, names):
    cloud = read(text)
    assert cloud.table.dtype.names == names
    assert cloud.table[0].tolist() == (1, 2, 3, 0.5, 7)
    assert cloud.points.tolist() == [[1, 2, 3]]


def test_coordinates_are_found_by_name(read):
    cloud = read("label,Z,Y,X\n7,3,2,1\n")
    assert cloud.points.tolist() == [[1, 2, 3]]
    assert cloud.table.dtype.names == ("label", "z", "y", "x")


def test_every_digit_counts(read):
    assert np.array_equal(read("\n".join(" ".join(map(repr, row)) for row in FAR.tolist())).points, FAR)


def test_rows_that_are_not_finite_are_kept_in_the_table_alone(read):
    cloud = read("1 2 3\nnan NaN nan\n4 5 6\n7 -inf 9\n")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert cloud.valid.tolist() == [True, False, True, False]
    assert cloud.table["z"][3] == 9


def test_names_in_a_comment_go_with_a_separator(read):
    assert read("# x, y, z, scan angle\n1,2,3,4\n").table.dtype.names == ("x", "y", "z", "scan_angle")


@given(
    points=hnp.arrays("f8", st.tuples(st.integers(1, 9), st.just(3)), elements=st.floats(-1e9, 1e9)),
    suffix=st.sampled_from(TEXT_SUFFIXES),
    dtype=st.sampled_from(["f4", "f8"]),
)
def test_any_points_round_trip_bit_by_bit(tmp_path_factory, points, suffix, dtype):
    path = tmp_path_factory.mktemp("xyz") / f"scan{suffix}"
    write_cloud(path, points, dtype=dtype)
    assert np.array_equal(read_cloud(path).points.astype(dtype), points.astype(dtype))


@pytest.mark.parametrize("suffix", TEXT_SUFFIXES)
def test_properties_come_back_under_their_names(tmp_path, suffix):
    path = tmp_path / f"scan{suffix}"
    write_cloud(path, FAR, properties={"label": np.array([-1, 0, 7], "i4"), "scan time": np.array([0.1, 2, 3])})
    cloud = read_cloud(path)
    assert np.array_equal(cloud.points, FAR)
    assert cloud.table.dtype.names == ("x", "y", "z", "label", "scan_time")
    assert cloud.table["label"].tolist() == [-1, 0, 7]


def test_files_look_as_their_suffix_promises(tmp_path):
    written = {}
    for suffix in (".xyz", ".csv", ".pts"):
        path = tmp_path / f"scan{suffix}"
        write_cloud(
            path, np.array([[0.1, 1, np.nan]]), properties={"label": np.array([3], "u1")} if suffix == ".csv" else {}
        )
        written[suffix] = path.read_bytes()
    assert written == {".xyz": b"0.1 1.0 nan\n", ".csv": b"x,y,z,label\n0.1,1.0,nan,3\n", ".pts": b"1\n0.1 1.0 nan\n"}
