"""The triangles of a PLY file: what is read of a mesh, and what a mesh cannot be."""

import io
import struct

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from cylx.errors import InputError
from cylx.io import read_object

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "f4")
FACES = [[0, 1, 2], [0, 3, 1], [1, 3, 2]]
NO_TRIANGLES = "has faces that are not triangles; triangulate the mesh"
NO_POINTS = "has faces that refer to missing points; save the mesh again"
NO_INTEGERS = "the property {} is not a list of integers; save the mesh again"
VERTICES = "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in CORNERS)


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def read_bytes(data, name="can.ply"):
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        return read_object(name)

    return read_bytes


def mesh(faces, encoding, name="vertex_indices", *, faces_first=False):
    """Write a mesh with plyfile."""
    vertices = np.array([tuple(corner) for corner in CORNERS], [(axis, "f4") for axis in "xyz"])
    lists = np.empty(len(faces), [("quality", "f4"), (name, "O")])
    lists["quality"] = 0.5
    lists[name] = [np.array(face, "i4") for face in faces]
    elements = [PlyElement.describe(vertices, "vertex"), PlyElement.describe(lists, "face")]
    out = io.BytesIO()
    text = encoding == "ascii"
    PlyData(elements[::-1] if faces_first else elements, text=text, byte_order="=" if text else encoding).write(out)
    return out.getvalue()


def by_hand(rows, prop="list uchar int vertex_indices", *, faces=None, vertices=VERTICES):
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    faces = rows.count("\n") if faces is None else faces
    return f"{header}element face {faces}\nproperty {prop}\nend_header\n{vertices}{rows}"


@pytest.mark.parametrize("encoding", ["ascii", "<", ">"])
@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
@pytest.mark.parametrize("faces_first", [False, True])
def test_points_and_triangles_come_as_they_are(read, encoding, name, faces_first):
    points, triangles = read(mesh(FACES, encoding, name, faces_first=faces_first))
    assert (points.dtype, triangles.dtype) == (np.float64, np.int64)
    assert np.array_equal(points, CORNERS)
    assert triangles.tolist() == FACES


@pytest.mark.parametrize(
    "data",
    [
        VERTICES,
        by_hand(""),
        by_hand("3 0 1 2\n", "list uchar int tristrips"),
        by_hand("").replace("element face 0\nproperty list uchar int vertex_indices\n", ""),
    ],
    ids=["rows of text", "empty element", "other property", "no element"],
)
def test_what_has_no_faces_is_a_cloud(read, data):
    points, triangles = read(data, "can.ply" if data.startswith("ply") else "can.xyz")
    assert np.array_equal(points, CORNERS)
    assert triangles is None


def test_a_pcd_is_a_cloud(read):
    fields = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    points, triangles = read(f"{fields}WIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA ascii\n{VERTICES}", "can.pcd")
    assert np.array_equal(points, CORNERS)
    assert triangles is None


BINARY = mesh(FACES, "<")
REFUSED = {
    "quad": (by_hand("4 0 1 2 3\n"), NO_TRIANGLES),
    "triangle and quad": (by_hand("3 0 1 2\n4 0 1 2 3\n"), NO_TRIANGLES),
    "edge": (by_hand("2 0 1\n"), NO_TRIANGLES),
    "face of nothing": (by_hand("0\n"), NO_TRIANGLES),
    "one beyond": (by_hand("3 0 1 4\n"), NO_POINTS),
    "negative": (by_hand("3 0 1 -1\n"), NO_POINTS),
    "largest unsigned": (by_hand("3 0 1 4294967295\n", "list uchar uint vertex_indices"), NO_POINTS),
    "a point that is not finite": (by_hand("3 0 1 2\n", vertices=VERTICES.replace("0 0 1", "nan 0 1")), NO_POINTS),
    "a number, no list": (by_hand("3\n", "int vertex_indices"), NO_INTEGERS.format("vertex_indices")),
    "fractions": (by_hand("3 0 1 1.5\n", "list uchar float vertex_index"), NO_INTEGERS.format("vertex_index")),
    "word": (by_hand("3 0 one 2\n"), "its faces cannot be read: "),
    "short row": (by_hand("3 0 1 2\n3 1\n"), "its faces cannot be read: "),
    "too few rows": (by_hand("3 0 1 2\n", faces=2), "its faces cannot be read: "),
    "far too few rows": (by_hand("3 0 1 2\n", faces=10**15), "its faces cannot be read: "),
    "length that is too great": (
        by_hand("99999999999 0\n", "list uint int vertex_index"),
        "its faces cannot be read: ",
    ),
    "binary, cut off in a face": (BINARY[:-3], "its faces cannot be read: "),
    "binary, without faces": (BINARY[: BINARY.index(b"end_header") + 11 + 48], "its faces cannot be read: "),
    "binary, promises": (BINARY.replace(b"face 3", b"face 9" + b"0" * 14), "its faces cannot be read: "),
    "binary, list without end": (BINARY[:-13] + struct.pack("<B", 255) + BINARY[-12:], "its faces cannot be read: "),
    "no points": (by_hand("").replace("vertex 4", "vertex 0").replace(VERTICES, ""), "holds no points; "),
    "empty": ("", "is empty; "),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_mesh_that_cannot_be_used_is_refused(read, case):
    data, fault = REFUSED[case]
    with pytest.raises(InputError) as refused:
        read(data)
    assert str(refused.value).startswith(f"can.ply: {fault}")
    assert "\n" not in str(refused.value)
    assert refused.value.exit_code == 3


def test_a_mesh_from_a_stream_is_refused(monkeypatch):
    class Stream:
        buffer = io.BytesIO(BINARY)

    monkeypatch.setattr("sys.stdin", Stream)
    with pytest.raises(InputError, match=r"^-: is not a file, and a mesh has to be read twice; save it to a file$"):
        read_object("-")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.ply: no such file"):
        read_object(tmp_path / "none.ply")
