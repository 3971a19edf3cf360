"""Text as programs and surveyors write it: which columns are the coordinates, and what is said about it."""

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud, write_annotated

POINTS = np.random.default_rng(0).normal(size=(30, 3)).round(4) + np.array([5, 6, 7])


def rows(columns=lambda i, p: p, sep=",", mark="."):
    lines = [columns(i, [float(x) for x in point]) for i, point in enumerate(POINTS)]
    cells = [[repr(c).replace(".", mark) if isinstance(c, float) else str(c) for c in line] for line in lines]
    return "".join(sep.join(line) + "\n" for line in cells)


def numbered(i, p):
    return [i + 1, *p]


def more(i, p):
    return [*p, i % 5]


def quoted(mark):
    return lambda _, p: ['"' + repr(x).replace(".", mark) + '"' for x in p]


LINES = rows().splitlines(keepends=True)
PTS = rows(more, " ").splitlines(keepends=True)
SILENT = {
    "units in round brackets": "X (m),Y (m),Z (m)\n" + rows(),
    "units in square brackets": "x[m];y[m];z[m]\n" + rows(sep=";"),
    "units behind a line": "id,x_m,y_m,z_m\n" + rows(numbered),
    "units behind a space": "id,x mm,y mm,z mm\n" + rows(numbered),
    "units behind a slash": "x/m y/m z/m\n" + rows(sep=" "),
    "capitals": "X[MM] Y[MM] Z[MM]\n" + rows(sep=" "),
    "a line of units": "X;Y;Z\n[m];[m];[m]\n" + rows(sep=";"),
    "z first": "Z (US ft),Y (US ft),X (US ft)\n" + rows(lambda _, p: p[::-1]),
    "map": "Point ID,Easting,Northing,Elevation\n" + rows(numbered),
    "map, north first": "Northing,Easting,Height\n" + rows(lambda _, p: [p[1], p[0], p[2]]),
    "map with units": "id,Easting (m),Northing (m),Ellipsoidal height (m)\n" + rows(numbered),
    "map, one letter": "P,E,N,H\n" + rows(numbered),
    "map and z": "E,N,height,Z\n" + rows(lambda _, p: [p[0], p[1], 3.5, p[2]]),
    "German": "Punktnummer;Rechtswert;Hochwert;Höhe\n" + rows(numbered, ";", ","),
    "German in Latin-1": ("Nr;Rechtswert;Hochwert;Höhe [m]\n" + rows(numbered, ";", ",")).encode("latin-1"),
    "Spanish": "Punto;Este;Norte;Cota\n" + rows(numbered, ";", ","),
    "French": "Est;Nord;Altitude\n" + rows(sep=";", mark=","),
    "ParaView": '"i","Points:0","Points:1","Points:2"\n' + rows(numbered),
    "ParaView with normals": "Normals:0,Normals:1,Normals:2,Points:0,Points:1,Points:2\n"
    + rows(lambda _, p: [0, 0, 1, *p]),
    "VeloView": "i,Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2\n" + rows(numbered),
    "an array": "xyz[0],xyz[1],xyz[2]\n" + rows(),
    "pos_x": "id pos_x pos_y pos_z\n" + rows(numbered, " "),
    "PosX": "id PosX PosY PosZ\n" + rows(numbered, " "),
    "Coordinate X": "Coordinate X,Coordinate Y,Coordinate Z\n" + rows(),
    "X-Koordinate": "X-Koordinate;Y-Koordinate;Z-Koordinate\n" + rows(sep=";"),
    "ROS": "%time,field.x,field.y,field.z\n" + rows(numbered),
    "normals first": "Nx;Ny;Nz;X (m);Y (m);Z (m)\n" + rows(lambda _, p: [0, 0, 1, *p], ";"),
    "colours first": "r,g,b,x,y,z\n" + rows(lambda _, p: [1, 2, 255, *p]),
    "x beside global_x": "global_x,global_y,global_z,x,y,z\n" + rows(lambda _, p: [9, 9, 9, *p]),
    "CloudCompare": "//X Y Z Scalar_field_#2\n" + rows(more, " "),
    "CloudCompare with a count": "//X;Y;Z;Illuminance (PCV);Roughness(0.01)\n30\n"
    + rows(lambda i, p: [*p, i % 5, 1], ";"),
    "a # within a name": "Scalar field #2,Time,X,Y,Z\n" + rows(lambda i, p: [i % 7, 0, *p]),
    "a # behind a name": "Point #,X,Y,Z\n" + rows(numbered),
    "a # as name": "#,X,Y,Z\n" + rows(numbered),
    "a # as name beside spaces": "# X Y Z\n" + rows(numbered, " "),
    "a # as comment": "# x y z\n" + rows(more, " "),
    "a word before the names": "# Fields: id x y z\n" + rows(numbered, " "),
    "more names than columns": "X Y Z Scan Angle\n" + rows(more, " "),
    "a name of two words": "Point ID X Y Z\n" + rows(numbered, " "),
    "a number in a name": "X Y Z Return 1\n" + rows(lambda i, p: [*p, i % 2, 3], " "),
    "a name that is NaN": "nan,X,Y,Z\n" + rows(numbered),
    "titles": "Survey of plant 7\nExported 2024-05-03 by Acme\n\nX,Y,Z,I\n" + rows(more),
    "a title of numbers": "Survey of 3 March 2024 5\nX Y Z I\n" + rows(more, " "),
    "Excel": "sep=;\nX;Y;Z;I\n" + rows(more, ";"),
    "names again below": "x,y,z\n" + rows().replace("\n", "\nx,y,z\n", 1),
    "decimal commas and semicolons": "x;y;z\n" + rows(sep=";", mark=","),
    "decimal commas and tabs": "x\ty\tz\n" + rows(sep="\t", mark=","),
    "decimal commas and spaces": "x y z\n" + rows(sep=" ", mark=","),
    "decimal commas in quotes": '"x","y","z"\n' + rows(quoted(",")),
    "numbers in quotes": '"x","y","z"\n' + rows(quoted(".")),
    "count below": "x y z i\n" + "".join(PTS) + "30\n",
    "a count of points": "30 points\nX Y Z I\n" + "".join(PTS),
    "count above names": "30\nX Y Z I\n" + "".join(PTS),
    "blocks with counts": "x y z i\n10\n" + "".join(PTS[:10]) + "20\n" + "".join(PTS[10:]),
    "counts of all blocks but the first": "x y z i\n" + "".join(PTS[:10]) + "20\n" + "".join(PTS[10:]),
    "a count of a block as large as the first": "x y z i\n" + "".join([*PTS[:15], "15\n", *PTS[15:]]),
    "a block of nothing": "0\n30\nx y z i\n" + "".join(PTS),
    "counts with empty cells": "10,,\nx,y,z\n" + "".join(LINES[:10]) + "20,,\n" + "".join(LINES[10:]),
    "values that are missing": "x,y,z,label\n" + rows(lambda i, p: [*p, "" if i % 2 else i]),
    "a column without values": "x,y,z,label\n" + rows(lambda _, p: [*p, ""]),
    "a first column without values": "label,x,y,z\n" + rows(lambda _, p: ["", *p]),
    "separators at the ends": "x,y,z,i,\n" + rows(lambda i, p: [*p, i % 5, ""]),
    "gaps in the first row": "id,x,y,z\n7,,,\n" + rows(numbered),
    "no values in the first row": "id,x,y,z\nNA,NULL,NULL,NULL\n" + rows(numbered),
    "two empty columns at the end": "x,y,z,a,b\n" + rows(lambda _, p: [*p, "", ""]),
    "pixels beside points": "x,y,X,Y,Z\n" + rows(lambda _, p: [1, 2, *p]),
    "X and Easting": "id,X_Easting,Y_Northing,Z_Elevation\n" + rows(numbered),
    "Easting (X)": "id,Easting(X),Northing(Y),Elevation(Z)\n" + rows(numbered),
    "blanks before commas": "x ,y ,z\n" + rows(sep=" ,"),
    "two titles": "Plant 7\nScan 3 of 9 by 2 people\nX Y Z i\n" + rows(more, " "),
    "a title with as many words as columns": "Plant 7 hall 3\nX Y Z i\n" + rows(more, " "),
    "the end of a text of DOS": "x y z\n" + rows(sep=" ") + "\x1a",
    "Dutch": "Nr;Oost;Noord;Hoogte\n" + rows(numbered, ";", ","),
    "UTF-16": ("x;y;z\n" + rows(sep=";")).encode("utf-16"),
    "UTF-16 without a mark": ("x;y;z\n" + rows(sep=";")).encode("utf-16-be"),
    "UTF-32": ("x;y;z\n" + rows(sep=";")).encode("utf-32"),
    "a byte order mark before quotes": '\ufeff"X","Y","Z"\n' + rows(),
    "bars": "x|y|z|i\n" + rows(more, "|"),
}


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "scan.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_cloud(path)

    return read


@pytest.mark.parametrize("text", SILENT.values(), ids=SILENT)
def test_names_tell_the_coordinates(read, text):
    cloud = read(text)
    assert np.array_equal(cloud.points, POINTS)
    assert (cloud.source.notes, cloud.source.doubts) == ((), ())


WORDS = "left out, as it holds words: "
NO_NAMES = "no line names the columns; x, y, z are column "
TOLD = {
    "no names": (rows(more), NO_NAMES + "1, column 2, column 3 of 4"),
    "unknown names": (
        "foo,bar,baz\n" + rows(),
        "the names of the columns do not tell the coordinates; x, y, z are 'foo', 'bar', 'baz'",
    ),
    "a title that looks like names": (
        "Laser survey yesterday\n" + rows(sep=" "),
        "the names of the columns do not tell the coordinates; x, y, z are 'Laser', 'survey', 'yesterday'",
    ),
    "a letter in a title": (
        "Plant X scan\n" + rows(sep=" "),
        "the names of the columns do not tell the coordinates; x, y, z are 'Plant', 'X', 'scan'",
    ),
    "x, y and z of something": (
        "u,v,cam_x,cam_y,cam_z\n" + rows(lambda _, p: [3, 4, *p]),
        "x, y, z are 'cam_x', 'cam_y', 'cam_z'",
    ),
    "a column of words": ("Point,X,Y,Z\n" + rows(lambda i, p: [f"P{i}", *p]), WORDS + "'Point'"),
    "words with separators": ("x,y,z,code\n" + rows(lambda _, p: [*p, '"tree, big"']), WORDS + "'code'"),
    "words with a #": ("x;y;z;code\n" + rows(lambda i, p: [*p, f"tree #{i}"], ";"), WORDS + "'code'"),
    "words with spaces": ("code\tx\ty\tz\n" + rows(lambda _, p: ["big tree", *p], "\t"), WORDS + "'code'"),
    "codes that are missing": (
        "Point,Northing,Easting,Elevation,Code\n" + rows(lambda i, p: [f"P{i}", p[1], p[0], p[2], ""]),
        WORDS + "'Point'",
    ),
    "times": ("time,x,y,z\n" + rows(lambda i, p: [f"2024-05-03 12:00:{i:02}", *p]), WORDS + "'time'"),
}


@pytest.mark.parametrize(("text", "note"), TOLD.values(), ids=TOLD)
def test_one_line_says_what_was_taken_or_left_out(read, text, note):
    cloud = read(text)
    assert np.array_equal(cloud.points, POINTS)
    assert (cloud.source.notes, cloud.source.doubts) == ((note,), ())


SEVERAL = "several columns may be the coordinates; x, y, z are "
TAKEN = "column 2, column 3, column 4"
DOUBTFUL = {
    "numbers first": (rows(numbered), f"column 1 seems to number the points; x, y, z are {TAKEN}"),
    "numbers first, spaces": (rows(numbered, " "), f"column 1 seems to number the points; x, y, z are {TAKEN}"),
    "numbers first, in any order": (
        rows(lambda i, p: [7 * i % 30, *p], " "),
        f"column 1 seems to number the points; x, y, z are {TAKEN}",
    ),
    "numbers first, decimal commas": (
        rows(numbered, ";", ","),
        f"column 1 seems to number the points; x, y, z are {TAKEN}",
    ),
    "numbers first, unknown names": (
        "no,a,b,c\n" + rows(numbered),
        "'no' seems to number the points; x, y, z are 'a', 'b', 'c'",
    ),
    "two places": (
        "local_x,local_y,local_z,global_x,global_y,global_z\n" + rows(lambda _, p: [*p, 1, 2, 3]),
        SEVERAL + "'local_x', 'local_y', 'local_z'",
    ),
    "two heights": (
        "E,N,Ellipsoidal height,Orthometric height\n" + rows(lambda _, p: [*p, 3.5]),
        SEVERAL + "'E', 'N', 'Ellipsoidal height'",
    ),
    "row names of R": (
        '"x" "y" "z"\n' + rows(lambda i, p: [f'"{i + 1}"', *p], " "),
        "the first column has no name and seems to name the points; x, y, z are columns 2, 3, 4",
    ),
    "x, y and z twice": ("X,Y,Z,X,Y,Z\n" + rows(lambda _, p: [*p, 1, 2, 3]), SEVERAL + "'X', 'Y', 'Z'"),
    "degrees": (
        "Time,Latitude,Longitude,Elevation\n" + rows(lambda i, p: [i / 10, p[1], p[0], p[2]]),
        "x and y are 'Longitude' and 'Latitude', degrees beside lengths",
    ),
}


@pytest.mark.parametrize(("text", "fault"), DOUBTFUL.values(), ids=DOUBTFUL)
def test_a_guess_is_a_warning(read, text, fault):
    cloud = read(text)
    assert np.array_equal(cloud.points, POINTS)
    ((said, _),) = cloud.source.doubts
    assert (said, cloud.source.notes) == (fault, ())


RENAME = "name the columns x, y and z"
COLUMNS = "give every row the same columns"
WRONG = {
    "intensity is no z": (
        "id,X,Y,Intensity\n" + rows(numbered),
        f": no columns are called x, y and z, and 'Intensity' is none of them; {RENAME}",
    ),
    "an angle is no y": (
        "range,azimuth,pitch\n" + rows(),
        f": no columns are called x, y and z, and 'range' is none of them; {RENAME}",
    ),
    "velocities are no coordinates": (
        "vel_x,vel_y,vel_z,a\n" + rows(more),
        f": no columns are called x, y and z, and 'vel_x' is none of them; {RENAME}",
    ),
    "y is no x": ("a,X,Y,b\n" + rows(more), f": has a column 'X', but none for z; {RENAME}"),
    "names in the middle": (
        "Point ID X Y Z Return Number\n" + rows(lambda i, p: [i, *p, i % 5], " "),
        ": has 7 names for 5 columns; give each column one name",
    ),
    "decimal commas as separators": (
        "x,y,z\n" + rows(mark=","),
        ": has 3 names and 6 columns, as decimal commas give; write numbers "
        "with a point, or semicolons between the columns",
    ),
    "two decimal marks": (
        "x;y;z\n1,5;2,5;3,5\n1.5;2,5;3,5\n",
        ":3: some numbers have a decimal comma, others a point; write all of them with a point",
    ),
    "the first row is damaged": (
        "P1,5.0,?,6.0\n" + rows(lambda i, p: [f"P{i}", *p]),
        ":1: x is 'P1', not a number; write numbers like -1.5 or 2e-3",
    ),
    "rows of words differ": (
        "A 1 2 3\nB 1 2 3 4\n",
        ":2: expected 4 columns, found 5; give every row the same columns",
    ),
    "thousands": ("x;y;z\n1.234,5;2,5;3,5\n", ":2: x is '1.234,5', not a number; write numbers like -1.5 or 2e-3"),
    "no y in one row": ("x,y,z\n1,2,3\n4,,6\n", ":3: y is empty; write numbers like -1.5 or 2e-3"),
    "a count too many": (
        "10\n" + "".join(PTS[:10]) + "21\n" + "".join(PTS[10:]),
        ": the count in the first line is 31, the file holds 30 points; get a "
        "complete copy of the file, or correct the count",
    ),
    "a row of one number": ("".join([*PTS[:10], "7\n", *PTS[10:]]), f":11: expected 4 columns, found 1; {COLUMNS}"),
    "a count of one block among those without": (
        "".join([*PTS[:10], "15\n", *PTS[10:25], "7\n", *PTS[25:]]),
        f":11: expected 4 columns, found 1; {COLUMNS}",
    ),
    "one long line": ("1 " * 1_000_000, ":1: the line is too long for a row; give every point a line"),
    "a long line between others": (
        "1 2 3\n" * 10 + "1 " * 1_000_000,
        ":11: the line is too long for a row; give every point a line",
    ),
    "PTX": (
        "scan\n2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + "1 0 0 0\n" * 4 + "1 2 3 0.5\n" * 4,
        ": is PTX with something above it; remove what is above the first count",
    ),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_never_silently_the_wrong_three(read, tmp_path, text, message):
    with pytest.raises(InputError) as refused:
        read(text)
    assert str(refused.value) == f"{tmp_path / 'scan.csv'}{message}"


def test_what_windows_writes_for_nan_is_nan(read):
    cloud = read("x,y,z,i\n1,2,3,-nan(ind)\n1.#QNAN,-1.#IND,1.#INF,0\n4,5,6,1.#QNAN\n")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert np.isnan(cloud.table["i"][[0, 2]]).all()
    assert read("1 2 3\n1 2 1.#QNAN\n").points.tolist() == [[1, 2, 3]]


def test_a_row_without_any_coordinate_is_a_row_without_a_point(read):
    cloud = read("x,y,z,i\n1,2,3,4\n,,,5\n")
    assert (cloud.points.tolist(), cloud.rows) == ([[1, 2, 3]], 2)


def test_names_with_colons_reach_the_annotated_cloud(read, tmp_path, make_extraction):
    cloud = read("Normals:0,Points:0,Points:1,Points:2\n0.5,1,2,3\n")
    write_annotated(tmp_path / "out.ply", make_extraction(cloud))
    back = read_cloud(tmp_path / "out.ply")
    assert (back.points.tolist(), back.table["Normals:0"].tolist()) == ([[1, 2, 3]], [0.5])


def test_the_commands_say_which_columns_were_taken(tmp_path, run_cylx, fake_pipeline):
    (tmp_path / "a.csv").write_text(rows(more))
    (tmp_path / "b.csv").write_text("Point,X,Y,Z\n" + rows(lambda i, p: [f"P{i}", *p]))
    note = NO_NAMES + "1, column 2, column 3 of 4"
    assert f"note: {tmp_path / 'a.csv'}: {note}" in run_cylx("info", tmp_path / "a.csv").stderr.splitlines()
    shown = run_cylx("extract", tmp_path / "a.csv", "--no-annotate")
    assert f"note: {note}" in shown.stderr.splitlines()
    both = run_cylx("extract", tmp_path / "a.csv", tmp_path / "b.csv", "--out-dir", tmp_path / "out", "--no-annotate")
    assert f"note: {tmp_path / 'a.csv'}: {note}" in both.stderr.splitlines()
    assert f"note: {tmp_path / 'b.csv'}: {WORDS}'Point'" in both.stderr.splitlines()
    assert fake_pipeline.calls
    assert run_cylx("extract", tmp_path / "a.csv", "--no-annotate", "--overwrite", "-q").stderr == ""


def test_a_guess_is_among_the_warnings_of_the_scan(tmp_path, run_cylx):
    (tmp_path / "a.csv").write_text(rows(numbered))
    shown = run_cylx("info", tmp_path / "a.csv", "--json")
    assert '"kind": "columns"' in shown.stdout
    assert "seems to number the points" in shown.stderr
