"""PLY: every variant reads to the same points and properties."""

import io
import re
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from plyfile import PlyData, PlyElement

from cylx.errors import InputError
from cylx.io import expected_points, read_cloud, write_annotated, write_cloud

SCALARS = ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"]
FAR = np.array([[512345.678, 5412345.432, 123.4], [5e6 + 0.001, -5e6 - 0.002, 0.003], [1e-3, 0.1, 1 / 3]])
ENCODINGS = ["ascii", "<", ">"]


def vertices(coordinates, dtype="f8", **properties):
    fields = [(axis, dtype) for axis in "xyz"] + [(name, value.dtype) for name, value in properties.items()]
    table = np.zeros(len(coordinates), fields)
    for place, axis in enumerate("xyz"):
        table[axis] = coordinates[:, place]
    for name, value in properties.items():
        table[name] = value
    return table


def ply_bytes(table, encoding, *, faces=None, **document):
    elements = [PlyElement.describe(table, "vertex")]
    if faces is not None:
        lists = np.empty(len(faces), [("vertex_indices", "O"), ("quality", "f4")])
        lists["vertex_indices"] = [np.array(face, "i4") for face in faces]
        elements.insert(document.pop("faces_at", 1), PlyElement.describe(lists, "face"))
    text = encoding == "ascii"
    out = io.BytesIO()
    PlyData(elements, text=text, byte_order="=" if text else encoding, **document).write(out)
    return out.getvalue()


@pytest.fixture
def read(tmp_path):
    def read(data, name="scan.ply"):
        path = tmp_path / name
        path.write_bytes(data)
        return read_cloud(path)

    return read


def in_words(change):
    """Return a function that changes the words of a header, and not its body."""

    def changed(data):
        head, mark, body = data.partition(b"end_header\n")
        return change(head + mark) + body

    return changed


HEADERS = {
    "everything in capitals": bytes.upper,
    "keywords in capitals": lambda head: re.sub(rb"(?m)^[a-z_]+", lambda word: word[0].upper(), head),
    "types with a capital": lambda head: head.replace(b"double", b"Double"),
    "a capital": lambda head: head.replace(b"element vertex", b"element Vertex"),
    "vertices": lambda head: head.replace(b"element vertex", b"element vertices"),
    "point": lambda head: head.replace(b"element vertex", b"element point"),
    "Points": lambda head: head.replace(b"element vertex", b"element Points"),
    "capital coordinates": lambda head: re.sub(rb"(?m) [xyz]$", lambda axis: axis[0].upper(), head),
    "lines of Windows": lambda head: head.replace(b"\n", b"\r\n"),
    "lines of an old Mac": lambda head: head.replace(b"\n", b"\r"),
    "blanks behind the first word": lambda head: head.replace(b"ply\n", b"ply \t\n", 1),
    "a mark of UTF-8": lambda head: b"\xef\xbb\xbf" + head,
    "lines that are indented": lambda head: head.replace(b"\nproperty", b"\n  property"),
}


@pytest.mark.parametrize("name", ["scan.ply", "scan"], ids=["suffix", "content"])
@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("kind", HEADERS)
def test_headers_that_others_write_are_read_and_what_is_written_back_is_standard(
    read, tmp_path, make_extraction, kind, encoding, name
):
    table = vertices(np.array([[0.0, 0.5, 1.0], [2.0, 2.5, -3.0]]), label=np.array([7, 8], "i4"))
    cloud = read(in_words(HEADERS[kind])(ply_bytes(table, encoding, faces=[(0, 1, 1)])), name)
    assert np.array_equal(cloud.points, np.column_stack([table[axis] for axis in "xyz"]))
    assert expected_points(tmp_path / name) == 2
    write_annotated(tmp_path / "out.ply", make_extraction(cloud))
    again = PlyData.read(tmp_path / "out.ply")["vertex"]
    assert all(np.array_equal(again[key], cloud.table[key]) for key in cloud.table.dtype.names)
    assert np.array_equal(read_cloud(tmp_path / "out.ply").points, cloud.points)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_far_coordinates_in_double_lose_nothing(read, encoding):
    assert np.array_equal(read(ply_bytes(vertices(FAR), encoding)).points, FAR)


def test_ascii_keeps_more_digits_than_its_float_type_has(read):
    data = ply_bytes(vertices(FAR), "ascii").replace(b"property double", b"property float")
    assert np.array_equal(read(data).points, FAR)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_properties_of_every_scalar_type_are_kept(read, encoding):
    rng = np.random.default_rng(0)
    extra = {f"p_{kind}": rng.integers(0, 100, 5).astype(kind) for kind in SCALARS}
    extra |= {f"top_{kind}": np.full(5, np.iinfo(kind).max, kind) for kind in SCALARS if kind[0] in "iu"}
    table = vertices(rng.normal(size=(5, 3)), "f4", **extra)
    cloud = read(ply_bytes(table, encoding))
    assert cloud.table.dtype.names == table.dtype.names
    for name in extra:
        assert np.array_equal(cloud.table[name], table[name])
        assert cloud.table[name].dtype.newbyteorder("=") == table[name].dtype


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("faces_at", [0, 1])
def test_faces_are_read_over(read, encoding, faces_at):
    data = ply_bytes(vertices(FAR), encoding, faces=[[0, 1, 2], [2, 1, 0, 1], []], faces_at=faces_at)
    assert np.array_equal(read(data).points, FAR)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_list_among_the_properties_of_a_vertex_is_kept(read, encoding):
    lists = [[1], [0, 2], []]
    kind = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[encoding]
    scalars = "property double x\nproperty double y\nproperty double z"
    header = f"ply\nformat {kind} 1.0\nelement vertex 3\n{scalars}\nproperty list uchar int near\nend_header\n"
    rows = [
        " ".join(map(str, [*point, len(near), *near])).encode() + b"\n"
        if encoding == "ascii"
        else struct.pack(f"{encoding}dddB{len(near)}i", *point, len(near), *near)
        for point, near in zip(FAR.tolist(), lists, strict=True)
    ]
    cloud = read(header.encode() + b"".join(rows))
    assert np.array_equal(cloud.points, FAR)
    assert [near.tolist() for near in cloud.table["near"]] == lists


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_comments_do_not_matter(read, encoding):
    data = ply_bytes(vertices(FAR), encoding, comments=["end_header is not here"], obj_info=["element vertex 9"])
    data = data.replace(b"element vertex 3", "comment größer\nelement vertex 3".encode("latin-1"))
    assert np.array_equal(read(data).points, FAR)


@pytest.mark.parametrize("newline", [b"\r\n", b"\r"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_other_line_ends(read, encoding, newline):
    table = vertices(FAR)
    table["x"][0] = np.frombuffer(b"\n\r\n\r\n\r\n\x40", "f8")[0]  # a body that begins like a line end
    header, mark, body = ply_bytes(table, encoding).partition(b"end_header\n")
    body = body.replace(b"\n", newline) if encoding == "ascii" else body
    cloud = read((header + mark).replace(b"\n", newline) + body)
    assert np.array_equal(cloud.points, np.column_stack([table[axis] for axis in "xyz"]))


def test_coordinates_are_found_wherever_they_stand(read):
    table = np.zeros(2, [("nx", "f4"), ("Z", "f8"), ("Y", "i2"), ("X", "f4")])
    table["X"], table["Y"], table["Z"] = [1, 2], [3, 4], [5, 6]
    assert read(ply_bytes(table, "<")).points.tolist() == [[1, 3, 5], [2, 4, 6]]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_rows_that_are_not_finite_are_kept_in_the_table_alone(read, encoding):
    points = np.array([[np.nan, 1, 2], [1, 2, 3], [4, np.inf, 6], [7, 8, 9]])
    cloud = read(ply_bytes(vertices(points), encoding))
    assert cloud.points.tolist() == [[1, 2, 3], [7, 8, 9]]
    assert cloud.valid.tolist() == [False, True, False, True]
    assert np.array_equal(np.column_stack([cloud.table[axis] for axis in "xyz"]), points, equal_nan=True)


def test_a_signalling_nan_is_a_nan(read):
    table = vertices(np.ones((2, 3)), "f4")
    table["y"].view("u4")[1] = 0x7F800001
    assert read(ply_bytes(table, "<")).valid.tolist() == [True, False]


def test_lines_are_ended_as_one_likes_and_empty_ones_left_out(read):
    data = ply_bytes(vertices(FAR), "ascii")
    assert np.array_equal(read(data.rstrip(b"\n")).points, FAR)
    assert np.array_equal(read(data + b"\n\n").points, FAR)


def test_what_follows_the_last_element_is_left_alone(read):
    assert np.array_equal(read(ply_bytes(vertices(FAR), "<") + b"\0" * 7).points, FAR)


def test_a_binary_file_is_mapped_and_not_copied(read):
    cloud = read(ply_bytes(vertices(FAR, intensity=np.ones(3)), "<"))
    owner = cloud.table
    while isinstance(owner, np.ndarray):
        owner = owner.base
    assert type(owner).__name__ == "mmap"


@given(
    points=hnp.arrays("f8", st.tuples(st.integers(1, 9), st.just(3)), elements=st.floats(-1e9, 1e9)),
    encoding=st.sampled_from(ENCODINGS),
)
def test_any_points_round_trip_bit_by_bit(tmp_path_factory, points, encoding):
    path = tmp_path_factory.mktemp("ply") / "scan.ply"
    path.write_bytes(ply_bytes(vertices(points), encoding))
    assert np.array_equal(read_cloud(path).points, points)


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_written_clouds_are_read_by_plyfile(tmp_path, dtype):
    path = tmp_path / "out.ply"
    properties = {
        "label": np.array([-1, 0, 7], "i4"),
        "scan time": np.array([2**60, 2, 3], "u8"),
        "seen": np.array([True, False, True]),
        "half": np.array([0.5, 1, 2], "f2"),
    }
    write_cloud(path, FAR, properties=properties, dtype=dtype)
    document = PlyData.read(path)
    table = document["vertex"].data
    assert document.byte_order == "<"
    assert [(name, table.dtype[name].str[1:]) for name in table.dtype.names] == [
        *((axis, dtype) for axis in "xyz"), ("label", "i4"), ("scan_time", "f8"), ("seen", "u1"), ("half", "f4"),
    ]  # fmt: skip
    assert np.array_equal(np.column_stack([table[axis] for axis in "xyz"]), FAR.astype(dtype))
    assert table["scan_time"].tolist() == [2.0**60, 2, 3]


def test_a_cloud_of_nothing_is_a_file_with_a_header(tmp_path):
    write_cloud(tmp_path / "none.ply", np.empty((0, 3)))
    assert PlyData.read(tmp_path / "none.ply")["vertex"].count == 0


XYZ = "property float x\nproperty float y\nproperty float z\n"
LONG = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("t", "i8"), ("id", "u8"), ("ok", "u1")]
MANY = np.array([(1, 2, 3, -(2**62) - 1, 2**63 + 1, 1), (4, 5, 6, 7, 8, 0)], LONG)
NAMED = XYZ + "property int64 t\nproperty unsigned long id\nproperty bool ok\n"


@pytest.mark.parametrize("near", ["", "property list uchar int near\n"], ids=["", "a list"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_integers_of_8_bytes_and_booleans_are_read(read, encoding, near):
    kind = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[encoding]
    header = f"ply \t\nformat {kind} 1.0\nelement vertex 2\n{NAMED}{near}end_header\n"
    if encoding == "ascii":
        exact = 8 if near else 2**63 + 1  # plyfile reads text as doubles
        body = f"1 2 3 {-(2**62) if near else -(2**62) - 1} {exact} 1{' 1 5' if near else ''}\n"
        body = f"{body}4 5 6 7 8 0{' 0' if near else ''}\n".encode()
    else:
        rows = MANY.astype([(name, kind if kind == "u1" else encoding + kind) for name, kind in LONG])
        body = b"".join(row.tobytes() + (b"\0" if near else b"") for row in rows)
    table = read(b"\xef\xbb\xbf" + header.encode() + body).table
    assert [table.dtype[name].kind for name in ("t", "id", "ok")] == ["i", "u", "u"]
    assert table["ok"].tolist() == [1, 0]
    assert table["t"][1] == 7
    if not (near and encoding == "ascii"):
        assert table["t"].tolist() == MANY["t"].tolist()
        assert table["id"].tolist() == MANY["id"].tolist()


def test_long_integers_of_faces_do_not_matter(read):
    face = struct.pack("<Bqqq", 3, 0, 1, 2)
    about = "element face 1\nproperty list uchar int64 vertex_indices\n"
    vertex = f"element vertex 1\n{XYZ}"
    for elements, body in ((about + vertex, face + bytes(12)), (vertex + about, bytes(12) + face)):
        data = f"ply\nformat binary_little_endian 1.0\n{elements}end_header\n".encode() + body
        assert read(data).points.tolist() == [[0, 0, 0]]
    data = f"ply\nformat ascii 1.0\n{vertex}property list uchar int64 near\nend_header\n1 2 3 1 7\n"
    with pytest.raises(InputError, match="the list property 'near' is made of int64; leave it out"):
        read(data.encode())


def test_text_may_have_decimal_commas_and_the_nan_of_windows(read):
    data = f"ply\nformat ascii 1.0\nelement vertex 3\n{XYZ}end_header\n1,5 2,5 3\n-nan(ind) 1.#QNAN 2\n1 2 3\n"
    assert read(data.encode()).points.tolist() == [[1.5, 2.5, 3], [1, 2, 3]]
    with pytest.raises(InputError, match="some numbers have a decimal comma, others a point"):
        read(data.replace("1 2 3", "1.0 2 3").encode())


def test_thousands_of_properties_are_refused_at_once(read):
    names = "".join(f"property uchar a{place}\n" for place in range(5000))
    data = f"ply\nformat ascii 1.0\nelement vertex 1\n{XYZ}{names}end_header\n"
    with pytest.raises(InputError, match="expected at most 4096 properties, found 5003"):
        read(data.encode())
