"""Bad input: what is in the file, and the one line that says so."""

import os
import struct
import tracemalloc

import pytest

from cylx.errors import InputError, UsageError
from cylx.io import read_cloud

XYZ = "property float x\nproperty float y\nproperty float z\n"
LITTLE = "binary_little_endian"
COPY = "get a complete copy of the file"
PLY_AGAIN = "export the file again as PLY 1.0"
PCD_AGAIN = "export the file again as PCD 0.7"
NUMBERS = "write numbers like -1.5 or 2e-3"
ROWS = "give rows of x y z"
NO_FINITE = "scan: no point has finite coordinates; export the file again"


def ply(elements=f"element vertex 2\n{XYZ}", body=b"", kind="ascii"):
    return f"ply\nformat {kind} 1.0\n{elements}end_header\n".encode() + body


def pcd(body=b"", **changed):
    lines = {
        "VERSION": "0.7",
        "FIELDS": "x y z",
        "SIZE": "4 4 4",
        "TYPE": "F F F",
        "COUNT": "1 1 1",
        "WIDTH": "2",
        "HEIGHT": "1",
        "POINTS": "2",
        "DATA": "ascii",
    } | changed
    return "".join(f"{key} {value}\n" for key, value in lines.items() if value is not None).encode() + body


PLY = {
    b"": "scan: is empty; check how it was made",
    b"plyer\n": "scan: is not PLY: it does not begin with the line 'ply'; give it its right suffix",
    b"ply": f"scan: the file ends within the PLY header; {COPY}",
    ply()[:-1]: f"scan: the file ends within the PLY header; {COPY}",
    b"ply\n" + b"comment\n" * 140000: "scan: the PLY header has no end; export the file again",
    b"ply\nformat ascii 2.0\n": "scan:2: unknown format 'ascii 2.0'; "
    "use one of ascii, binary_little_endian, binary_big_endian, version 1.0",
    b"ply\nformat\n": "scan:2: unknown format ''; "
    "use one of ascii, binary_little_endian, binary_big_endian, version 1.0",
    b"ply\nelement vertex 1\nend_header\n": f"scan: the PLY header has no format line; {PLY_AGAIN}",
    ply("element vertex -1\n"): f"scan:3: element 'vertex' has the impossible count '-1'; {PLY_AGAIN}",
    ply("element vertex 1e3\n"): f"scan:3: element 'vertex' has the impossible count '1e3'; {PLY_AGAIN}",
    ply(f"element vertex {'9' * 30}\n"): f"scan:3: element 'vertex' has the impossible count '{'9' * 30}'; {PLY_AGAIN}",
    ply("element vertex\n"): f"scan:3: 'vertex' is not the name and count of an element; {PLY_AGAIN}",
    ply("element vertex 1\nproperty half x\n"): f"scan:4: 'half x' is not a property type and name; {PLY_AGAIN}",
    ply("element vertex 1\nproperty list int x\n"): "scan:4: 'list int x' is not a property type and name; "
    + PLY_AGAIN,
    ply("element vertex 1\nproperty a b c d\n"): f"scan:4: 'a b c d' is not a property type and name; {PLY_AGAIN}",
    ply("property float x\n"): f"scan:3: 'property float x' is not a line of a PLY header; {PLY_AGAIN}",
    ply("\x1b[31mhello\n"): f"scan:3: '\\x1b[31mhello' is not a line of a PLY header; {PLY_AGAIN}",
    ply("element face 1\nproperty float x\n"): "scan: the PLY header has no vertex element; give a PLY with points",
    ply("element vertex 1\nproperty float x\n"): "scan: the vertex element has no property y, z; "
    "give a PLY with x, y and z",
    ply(f"element vertex 1\n{XYZ}".replace("float y", "list uchar float y")): "scan: the property y is a list; "
    "give a PLY with one x, y and z per point",
    ply(
        f"element vertex 1\n{XYZ}property int x\n"
    ): f"scan: the vertex element has the property 'x' twice; {PLY_AGAIN}",
    ply(f"element vertex 0\n{XYZ}"): "scan: holds no points; give a file with points",
    ply(body=b"1 2 3\n"): f"scan: the header promises 2 points, the file holds 1; {COPY}",
    ply(f"element vertex {10**15}\n{XYZ}", b"1 2 3\n"): "scan: the header promises 1000000000000000 points, "
    f"the file holds 1; {COPY}",
    ply(body=b"1 2 3\n4 5\n"): "scan:9: expected 3 columns, found 2; give every row the same columns",
    ply(body=b"1 2 3 4\n4 5 6\n"): "scan:8: expected 3 columns, found 4; give every row the same columns",
    ply(body=b"1 2 3\n4 five 6\n"): f"scan:9: y is 'five', not a number; {NUMBERS}",
    ply(body=b"1 2 3\n4 \xff 6\n"): f"scan:9: y is '\\\\xff', not a number; {NUMBERS}",
    ply(f"element vertex 1\n{XYZ}property uchar red\n", b"1 2 3 300\n"): "scan:9: red is '300', "
    f"not a number of type uint8; {NUMBERS}",
    ply(body=b"nan 1 1\n1 inf 1\n"): NO_FINITE,
    ply(body=bytes(23), kind=LITTLE): f"scan: the header promises 2 points, the file holds 1; {COPY}",
    ply(f"element vertex {10**15}\n{XYZ}", bytes(24), LITTLE): "scan: the header promises 1000000000000000 points, "
    f"the file holds 2; {COPY}",
    ply(body=struct.pack("<6f", *[float("nan")] * 6), kind=LITTLE): NO_FINITE,
    ply(f"element face 99\nproperty list uint int i\nelement vertex 1\n{XYZ}", bytes(40), LITTLE): "scan: the header "
    f"promises 99 elements 'face', the file is too short; {COPY}",
    ply(
        f"element face 1\nproperty list uint int i\nelement vertex 1\n{XYZ}", b"\xff" * 40, LITTLE
    ): f"scan: broken PLY: element 'face': row 0: property 'i': early end-of-file; {COPY}",
    ply(f"element face 9\nelement vertex 1\n{XYZ}", bytes(40), LITTLE): "scan: the element 'face' has no properties; "
    + PLY_AGAIN,
    ply(f"element vertex 1\n{XYZ}property list uchar int i\n", b"1 2 3 2 7\n"): "scan: broken PLY: element 'vertex': "
    f"row 0: property 'i': early end-of-line; {COPY}",
    ply(f"element vertex {10**15}\n{XYZ}property list uchar int i\n", b"1 2 3 0\n"): "scan: the header promises "
    f"1000000000000000 points, the file holds at most 1; {COPY}",
}
PCD = {
    b"": "scan: is empty; check how it was made",
    b"hello\n": "scan: is not PCD: it does not begin with its header; give it its right suffix",
    b"hello": "scan: is not PCD: it does not begin with its header; give it its right suffix",
    b"VERSION 0.7\n": f"scan: the file ends within the PCD header; {COPY}",
    pcd()[:-1]: f"scan: the file ends within the PCD header; {COPY}",
    b"VERSION 0.7\n" * 100000: f"scan: the PCD header has no end; {PCD_AGAIN}",
    b"VERSION 0.7\nhello\n": f"scan:2: 'hello' is not a line of a PCD header; {PCD_AGAIN}",
    pcd(FIELDS="x y i"): "scan: FIELDS has no z; give a PCD with x, y and z",
    pcd(FIELDS=None): "scan: FIELDS has no x, y, z; give a PCD with x, y and z",
    pcd(SIZE="4 4"): f"scan: 3 FIELDS, but SIZE has 2; {PCD_AGAIN}",
    pcd(TYPE=None): f"scan: 3 FIELDS, but TYPE has 0; {PCD_AGAIN}",
    pcd(SIZE="4 4 -4"): f"scan: SIZE is '4 4 -4', not made of counts; {PCD_AGAIN}",
    pcd(TYPE="F F Q"): f"scan: field 'z' has the unknown type 'Q' of size 4; {PCD_AGAIN}",
    pcd(SIZE="4 4 2"): f"scan: field 'z' has the unknown type 'F' of size 2; {PCD_AGAIN}",
    pcd(COUNT="1 1 2"): "scan: field z has 2 values; give a PCD with one x, y and z per point",
    pcd(COUNT=f"1 1 {10**12}"): f"scan: expected at most 4096 values per point, found 1000000000002; {PCD_AGAIN}",
    pcd(WIDTH="3"): f"scan: WIDTH x HEIGHT is 3, but POINTS is 2; {PCD_AGAIN}",
    pcd(POINTS=""): f"scan: the PCD header does not say how many POINTS there are; {PCD_AGAIN}",
    pcd(POINTS=None, HEIGHT=None): f"scan: the PCD header does not say how many POINTS there are; {PCD_AGAIN}",
    pcd(POINTS="-2"): f"scan: POINTS is '-2', not made of counts; {PCD_AGAIN}",
    pcd(POINTS="0", WIDTH="0"): "scan: holds no points; give a file with points",
    pcd(DATA="zip"): "scan:9: unknown DATA 'zip'; use one of ascii, binary, binary_compressed",
    pcd(b"1 2 3\n"): f"scan: the header promises 2 points, the file holds 1; {COPY}",
    pcd(b"1 2 3\n4 five 6\n"): f"scan:11: y is 'five', not a number; {NUMBERS}",
    pcd(b"1 2 3\n4 5\n"): "scan:11: expected 3 columns, found 2; give every row the same columns",
    pcd(b"nan nan nan\n" * 2): NO_FINITE,
    pcd(bytes(23), DATA="binary"): f"scan: the header promises 2 points, the file holds 1; {COPY}",
    pcd(bytes(24), DATA="binary", WIDTH=10**15, POINTS=10**15): "scan: the header promises 1000000000000000 points, "
    f"the file holds 2; {COPY}",
    pcd(bytes(5), DATA="binary_compressed"): f"scan: the file ends within the compressed body; {COPY}",
    pcd(struct.pack("<II50x", 51, 24), DATA="binary_compressed"): "scan: the file ends within the compressed body; "
    + COPY,
    pcd(struct.pack("<II50x", 50, 25), DATA="binary_compressed"): "scan: the body does not hold the 2 points "
    f"that the header promises; {COPY}",
    pcd(
        struct.pack("<II50x", 50, 24 * 10**8), DATA="binary_compressed", WIDTH=2 * 10**8, POINTS=2 * 10**8
    ): f"scan: the body does not hold the 200000000 points that the header promises; {COPY}",
    pcd(struct.pack("<II", 50, 24) + b"\xff" * 50, DATA="binary_compressed"): "scan: the compressed body is damaged; "
    + COPY,
}
TEXT = {
    b"": "scan: is empty; check how it was made",
    b"1 2 3\n4 5\n": "scan:2: expected 3 columns, found 2; give every row the same columns",
    b"# scan\n\n1 2 3\n4 5 6 7\n": "scan:4: expected 3 columns, found 4; give every row the same columns",
    b"1,2,3\n4 5 6\n": "scan:2: expected 3 columns, found 1; give every row the same columns",
    b"1 2 3\n4 five 6\n": f"scan:2: y is 'five', not a number; {NUMBERS}",
    b"x,y,z,label\n1,2,3,4\n1,2,3,wall\n": f"scan:3: label is 'wall', not a number; {NUMBERS}",
    b"1,2,3\n4,,6\n": f"scan:2: y is empty; {NUMBERS}",
    b"1,5;2,5;3.5\n": "scan:1: some numbers have a decimal comma, others a point; write all of them with a point",
    b"1,5;2,5;1.003,5\n": f"scan:1: z is '1.003,5', not a number; {NUMBERS}",
    b"1 2 3\n4 5 " + b"x" * 50 + b"\n": f"scan:2: z is '{'x' * 37}...', not a number; {NUMBERS}",
    b"1 2 3\n4 5 \xff\n": f"scan:2: z is '\\\\xff', not a number; {NUMBERS}",
    b"1 2 3\n4 5 1_000\n": f"scan:2: z is '1_000', not a number; {NUMBERS}",
    b"1 2\n3 4\n": f"scan:1: expected at least 3 columns, found 2; {ROWS}",
    b"1 2 x\n1 2 3\n": f"scan:1: z is 'x', not a number; {NUMBERS}",
    b"# Title\n\nSome words.\nMore words.\n": f"scan:4: x is 'More', not a number; {NUMBERS}",
    b"hello world\n": f"scan: holds no row of numbers; {ROWS}",
    b"# nothing\n\n": f"scan: holds no row of numbers; {ROWS}",
    b"3\n": f"scan: holds no row of numbers; {ROWS}",
    b"3\n1 2 3\n4 5 6\n": "scan: the count in the first line is 3, the file holds 2 points; "
    "get a complete copy of the file, or correct the count",
    b"1\n1 2 3\n4 5 6\n": "scan: the count in the first line is 1, the file holds 2 points; "
    "get a complete copy of the file, or correct the count",
    b"1 " * 1001: f"scan:1: expected at most 1000 columns, found 1001; {ROWS}",
    b"1 2 3\n\0\0\0": "scan: is not text; give a PLY, a PCD, or rows of x y z as text",
    "1 2 x".encode("utf-16"): f"scan:1: z is 'x', not a number; {NUMBERS}",
    b"nan nan nan\n": NO_FINITE,
}
OTHER = {
    b"\0\1\2\3": "scan: is neither text nor of a format that cylx reads; convert it to PLY",
    b"LASF\0\0": "scan: the file ends within the LAS header; get a complete copy of the file",
    b"#!/bin/sh\necho\nexit 0\n": f"scan:3: x is 'exit', not a number; {NUMBERS}",
}
TABLE = [
    (suffix, data, message)
    for suffix, table in ((".ply", PLY), (".pcd", PCD), (".xyz", TEXT), (".pts", TEXT), ("", OTHER), (".scan", OTHER))
    for data, message in table.items()
]


@pytest.fixture
def at_home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("suffix", "data", "message"), TABLE, ids=range(len(TABLE)))
def test_bad_files(at_home, suffix, data, message):
    (at_home / f"scan{suffix}").write_bytes(data)
    with pytest.raises(InputError) as refused:
        read_cloud(f"scan{suffix}")
    assert str(refused.value) == message.replace("scan", f"scan{suffix}", 1)
    assert refused.value.exit_code == 3


@pytest.mark.parametrize(("suffix", "data", "message"), TABLE, ids=range(len(TABLE)))
def test_bad_files_take_no_memory(at_home, suffix, data, message):
    (at_home / f"scan{suffix}").write_bytes(data)
    with pytest.raises(InputError):
        read_cloud(f"scan{suffix}")
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            read_cloud(f"scan{suffix}")
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


MISSING = {
    "scam.xyz": "scam.xyz: no such file; did you mean 'scan.xyz'?",
    "none.e57": "none.e57: no such file; check the path",
    "nowhere/scan.xyz": "nowhere/scan.xyz: no such file; check the path",
    "scan.xyz/scan.xyz": "scan.xyz/scan.xyz: cannot be read: not a directory; check the path and the disk",
    "folder": "folder: is a folder; give the files in it",
    "a\nb": "'a\\nb': no such file; check the path",
    "a\0b": "'a\\x00b': cannot be read: embedded null byte; check the path and the disk",
    "\udcff": "'\\udcff': no such file; check the path",
}


@pytest.mark.skipif(os.name == "nt", reason="the system has other words")
@pytest.mark.parametrize(("path", "message"), MISSING.items(), ids=range(len(MISSING)))
def test_files_that_are_not_there(at_home, path, message):
    (at_home / "scan.xyz").write_text("1 2 3\n")
    (at_home / "folder").mkdir()
    with pytest.raises(InputError) as refused:
        read_cloud(path)
    assert str(refused.value) == message


def test_a_file_that_may_not_be_read(at_home, monkeypatch):
    def refuse(*_args, **_settings):
        raise PermissionError(13, "Permission denied")

    (at_home / "scan.xyz").write_text("1 2 3\n")
    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(InputError) as refused:
        read_cloud("scan.xyz")
    assert str(refused.value) == "scan.xyz: may not be read; ask its owner for the permission"


def test_a_disk_that_fails_in_the_middle(at_home, monkeypatch):
    def fail(*_args, **_settings):
        raise OSError(5, "Input/output error")

    (at_home / "scan.xyz").write_text("1 2 3\n")
    monkeypatch.setattr("cylx.io.rows.np.loadtxt", fail)
    with pytest.raises(InputError) as refused:
        read_cloud("scan.xyz")
    assert str(refused.value) == "scan.xyz: cannot be read: input/output error; check the path and the disk"


def test_a_machine_that_is_too_small(at_home, monkeypatch):
    def fail(*_args, **_settings):
        raise MemoryError

    (at_home / "scan.xyz").write_text("1 2 3\n")
    monkeypatch.setattr("cylx.io.rows.np.loadtxt", fail)
    with pytest.raises(InputError, match="does not fit into memory; thin it out, or use a larger machine"):
        read_cloud("scan.xyz")


def test_a_format_nobody_knows():
    with pytest.raises(UsageError, match="format: unknown format 'obj'; use one of ply, pcd, xyz, las, e57, npy"):
        read_cloud("scan.las", format="obj")
