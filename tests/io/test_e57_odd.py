"""E57 files as programs write them, and such as promise what they do not hold."""

import re

import numpy as np
import pye57
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud
from tests.support.e57 import edited, paged, unpaged, with_xml, xml_of

N = 100
POINTS = np.random.default_rng(1).uniform(1, 2, (N, 3)).astype("f4").astype(float)
OUT_OF_BOUNDS = "broken E57: element value out of min/max bounds (E57_ERROR_VALUE_OUT_OF_BOUNDS)"
COPY = "get a complete copy of the file"


def write(path, *scans):
    with pye57.E57(str(path), mode="w") as file:
        for fields, options in scans:
            file.write_scan_raw(fields, **{name: np.array(value, float) for name, value in options.items()})
    # older versions write 3 as 3.00000000000000000e+00; the tests look for 3
    return edited(path, lambda xml: re.sub(rb">(\d)\.0+e\+00<", rb">\1<", xml))


def seen(points=POINTS, **others):
    return {f"cartesian{axis}": points[:, place].copy() for place, axis in enumerate("XYZ")} | others


@pytest.fixture
def scan(tmp_path):
    pose = {"rotation": [1, 0, 0, 0], "translation": [1, 2, 3]}
    return write(tmp_path / "scan.e57", (seen(intensity=np.arange(N, dtype="f4")), pose))


def fault_of(path):
    with pytest.raises(InputError) as refused:
        read_cloud(path)
    return str(refused.value).removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("w", "z", "turned"),
    [
        (b"0", b"0", POINTS),
        (b"2", b"0", POINTS),
        (b"1e300", b"1e300", POINTS[:, [1, 0, 2]] * [-1, 1, 1]),
        (b"1e-300", b"-1e-300", POINTS[:, [1, 0, 2]] * [1, -1, 1]),
    ],
)
def test_a_rotation_of_any_length(tmp_path, w, z, turned):
    path = write(tmp_path / "scan.e57", (seen(), {"rotation": [3, 0, 0, 4], "translation": [5, 6, 7]}))
    edited(path, lambda xml: xml.replace(b">3</w>", b">%s</w>" % w).replace(b">4</z>", b">%s</z>" % z))
    assert np.abs(read_cloud(path).points - turned - [5, 6, 7]).max() < 1e-5


@pytest.mark.parametrize(
    ("old", "new", "right"),
    {
        "another order": (
            rb"<w type(.*?)</w>(.*?)(<x type.*?/>)(.*?)(<y.*?/>)(.*?)(<z.*?/>)", rb"\7\5\3<w type\1</w>", None
        ),
        "whole numbers": (rb'<x type="Float">1</x>', b'<x type="Integer" minimum="0" maximum="9">1</x>', None),
        "scaled numbers": (
            rb'<x type="Float">1</x>',
            b'<x type="ScaledInteger" minimum="0" maximum="99" scale="0.1">10</x>', None,
        ),
        "a word": (rb'<x type="Float">1</x>', b'<x type="String">1</x>', "broken E57: scan 0 has a pose that is none"),
        "infinite": (
            rb'<x type="Float">1</x>', b'<x type="Float">1e999</x>', "broken E57: scan 0 has a pose that is not finite"
        ),
        "no x": (rb'<x type="Float">1</x>', b"", "broken E57: scan 0 has a pose that is none"),
        "a pose of another type": (
            rb"<pose.*</pose>", b'<pose type="Float">1</pose>', "broken E57: scan 0 has a pose that is none"
        ),
        "a rotation of another type": (
            rb"<rotation.*</rotation>", b'<rotation type="Integer">1</rotation>',
            "broken E57: scan 0 has a pose that is none",
        ),
        "no rotation": (rb"<rotation.*</rotation>", b"", None),
    }.values(),
)  # fmt: skip
def test_poses_as_they_come(scan, old, new, right):
    edited(scan, lambda xml: re.sub(old, new, xml, count=1, flags=re.DOTALL))
    if right is not None:
        # libraries of older versions of pye57 look at the numbers themselves
        assert fault_of(scan) in {f"{right}; {COPY}", f"{OUT_OF_BOUNDS}; {COPY}" if "finite" in right else right}
    else:
        assert np.abs(read_cloud(scan).points - POINTS - [1, 2, 3]).max() < 1e-5


SECOND = b'<vectorChild type="Structure"><guid type="String">b</guid>%s</vectorChild>'
EMPTY_POINTS = (
    b'<points type="CompressedVector" fileOffset="48" recordCount="0"><prototype type="Structure">%s</prototype>'
    b'<codecs type="Vector" allowHeterogeneousChildren="1"></codecs></points>'
)


@pytest.mark.parametrize(
    "second",
    [
        b"",
        EMPTY_POINTS % b'<cartesianX type="Float"/><cartesianY type="Float"/><cartesianZ type="Float"/>',
        EMPTY_POINTS % b'<intensity type="Float"/>',
    ],
    ids=["without points", "of 0 points", "without coordinates"],
)
def test_an_empty_scan_beside_another(scan, second):
    edited(scan, lambda xml: re.sub(rb"(</vectorChild>\s*)(</data3D>)", rb"\1" + SECOND % second + rb"\2", xml))
    cloud = read_cloud(scan)
    assert len(cloud.points) == N
    assert (cloud.table["scan"] == 0).all()
    assert len(read_cloud(scan, scan=0).points) == N
    with pytest.raises(InputError, match="holds no points"):
        read_cloud(scan, scan=1)


def spherical(path, invalid=None):
    """Write what pye57 cannot: points by range, azimuth and elevation."""
    reach = np.linalg.norm(POINTS, axis=1)
    angles = np.column_stack([reach, np.arctan2(POINTS[:, 1], POINTS[:, 0]), np.arcsin(POINTS[:, 2] / reach)])
    others = {} if invalid is None else {"cartesianInvalidState": invalid}
    write(path, (seen(angles, **others), {}))
    pairs = zip((b"X", b"Y", b"Z", b"Inv"), (b"Range", b"Azimuth", b"Elevation", b"Inv"), strict=True)

    def renamed(xml):
        for old, new in pairs:
            for mark in (b"<", b"/"):
                xml = xml.replace(mark + b"cartesian" + old, mark + b"spherical" + new)
        return xml.replace(b"<sphericalBounds", b"<cartesianBounds")

    return edited(path, renamed)


def test_spherical_coordinates_with_invalid_states(tmp_path):
    assert np.abs(read_cloud(spherical(tmp_path / "a.e57")).points - POINTS).max() < 1e-5
    state = (np.arange(N) % 3).astype("i1")
    cloud = read_cloud(spherical(tmp_path / "b.e57", state))
    assert np.array_equal(cloud.valid, state == 0)
    assert np.abs(cloud.points - POINTS[state == 0]).max() < 1e-5


def constant(name, value=5):
    return b'<%s type="ScaledInteger" minimum="%d" maximum="%d" scale="0.5">%d</%s>' % (name, value, value, value, name)


def of_fields(path, fields, count):
    """Write an E57 file whose fields take no place: a header, a section with an empty packet, and the XML."""
    streams = len(fields)
    packet = bytes([1, 0, 0, 0]) + streams.to_bytes(2, "little") + bytes(2 * streams)
    packet += bytes(-len(packet) % 4)
    packet = packet[:2] + (len(packet) - 1).to_bytes(2, "little") + packet[4:]
    numbers = (32 + len(packet), 80, 0)
    section = b"\1" + bytes(7) + b"".join(number.to_bytes(8, "little") for number in numbers)
    plain = write(path, (seen(), {})).read_bytes()
    xml = re.sub(
        rb"(<prototype[^>]*>).*(</)(?=prototype)", rb"\1%s\2" % b"".join(fields), xml_of(plain), flags=re.DOTALL
    )
    logical = bytearray(unpaged(plain)[:48] + section + packet)
    place = len(logical)
    logical[24:32] = (place // 1020 * 1024 + place % 1020).to_bytes(8, "little")
    path.write_bytes(with_xml(paged(bytes(logical)), xml.replace(b'"%d"' % N, b'"%d"' % count)))
    return path


CONSTANT = [constant(b"cartesian" + axis) for axis in (b"X", b"Y", b"Z")]


def test_points_that_are_all_the_same_take_no_place_but_are_not_believed_by_the_million(tmp_path):
    few = read_cloud(of_fields(tmp_path / "few.e57", CONSTANT, 1000))
    assert len(few.points) == 1000
    assert (few.points == 2.5).all()
    path = of_fields(tmp_path / "many.e57", CONSTANT, 60_000_000)
    size = path.stat().st_size
    assert fault_of(path) == f"promises 60000000 points, more than a file of {size} bytes can hold; {COPY}"


def test_one_bit_a_point_is_counted(tmp_path):
    bit = [constant(b"cartesianX").replace(b'maximum="5"', b'maximum="6"'), *CONSTANT[1:]]
    path = of_fields(tmp_path / "bit.e57", bit, 60_000_000)
    assert "more than a file of" in fault_of(path)


def test_some_columns_may_be_constant(tmp_path):
    fields = seen(rowIndex=np.full(N, 7, "u2"), columnIndex=np.zeros(N, "u2"))
    try:
        path = write(tmp_path / "scan.e57", (fields, {}))
    except pye57.libe57.E57Exception:
        pytest.skip("pye57 0.4.1 does not write them")
    assert b'minimum="7" maximum="7"' in xml_of(path.read_bytes())
    table = read_cloud(path).table
    assert ((table["rowIndex"] == 7) & (table["columnIndex"] == 0)).all()


def outcome(path):
    try:
        return f"{len(read_cloud(path).points)} points"
    except InputError as refused:
        return str(refused)


def test_damage_with_right_checksums_is_one_line_or_a_cloud(tmp_path, scan):
    rng = np.random.default_rng(3)
    logical = np.frombuffer(unpaged(scan.read_bytes()), "u1")
    for _ in range(200):
        damaged = logical.copy()
        places = rng.integers(0, len(damaged), rng.integers(1, 5))
        damaged[places] = rng.integers(0, 256, len(places))
        path = tmp_path / "damaged.e57"
        path.write_bytes(paged(damaged.tobytes()))
        shown = outcome(path)
        assert shown.isprintable()
        assert len(shown) < 400 + len(str(path))


@pytest.mark.parametrize("count", [b"9223372036854775807", b"-1", b"101"])
def test_a_count_that_is_not_held(scan, count):
    edited(scan, lambda xml: xml.replace(b'recordCount="100"', b'recordCount="%s"' % count))
    assert fault_of(scan).endswith(COPY)
