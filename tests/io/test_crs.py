"""The unit and the CRS that files say, as WKT, as GeoTIFF keys, and as metadata of E57."""

import io
import struct

import numpy as np
import pytest

from cylx.io import read_cloud
from cylx.io.crs import crs_facts, las_crs

UTM = (
    'PROJCS["UTM 32N",GEOGCS["ETRS89",DATUM["ETRS89",SPHEROID["GRS 1980",6378137,298.257222101]],'
    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],'
    'PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],'
    'PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1]]'
)
CODED = UTM[:-1] + ',AUTHORITY["EPSG","25832"]]'
FEET = 'VERT_CS["heights",VERT_DATUM["d",2005],UNIT["foot",0.3048]]'


def las(*records, minor=2, late=()):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=6 if minor == 4 else 3, version=f"1.{minor}")
    header.offsets, header.scales = [512000, 5412000, 0], [0.001] * 3
    header.vlrs.extend(laspy.VLR("LASF_Projection", number, "", data) for number, data in records)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = np.array([[512345.1, 5412345.1, 300.0], [512346.1, 5412346.1, 301.0]]).T
    if late:
        vlrs = [laspy.VLR("LASF_Projection", number, "", data) for number, data in late]
        cloud.evlrs = laspy.vlrs.vlrlist.VLRList(vlrs)
    file = io.BytesIO()
    cloud.write(file)
    return file.getvalue()


def keys(*entries, doubles=()):
    rows = [(1, 1, 0, len(entries)), *entries]
    out = [(34735, b"".join(struct.pack("<4H", *row) for row in rows))]
    return [*out, (34736, struct.pack(f"<{len(doubles)}d", *doubles))] if doubles else out


def source_of(tmp_path, data):
    (tmp_path / "a.las").write_bytes(data)
    return read_cloud(tmp_path / "a.las").source


@pytest.mark.parametrize("late", [False, True])
def test_wkt_before_and_after_the_points(tmp_path, late):
    record = [(2112, CODED.encode() + b"\0")]
    source = source_of(tmp_path, las(minor=4, late=record) if late else las(*record))
    assert (source.units, source.crs.name, source.crs.epsg, source.crs.wkt) == ("m", "UTM 32N", 25832, CODED)
    assert source.doubts == ()


def test_a_code_is_found_where_there_is_none():
    pytest.importorskip("pyproj")
    assert crs_facts(UTM.replace("UTM 32N", "ETRS89 / UTM zone 32N"))["crs"].epsg == 25832


@pytest.mark.parametrize(
    ("vertical", "factor", "units", "doubts"),
    [
        (FEET, 1.0, None, 1),
        (FEET.replace("0.3048", "1"), 1.0, "m", 0),
        (FEET, 0.3048, "ft", 0),
        (FEET, 1200 / 3937, "us-ft", 0),  # two millionths bend no pipe
        (FEET, 1000.0, None, 1),
    ],
)
def test_heights_may_be_in_another_unit(vertical, factor, units, doubts):
    level = UTM.replace('UNIT["metre",1]', f'UNIT["u",{factor!r}]')
    found = crs_facts(f'COMPD_CS["both",{level},{vertical}]')
    assert (found.get("units"), len(found.get("doubts", ()))) == (units, doubts)


def test_degrees_are_no_unit():
    found = crs_facts('GEOGCS["d",DATUM["d",SPHEROID["s",6378137,298]],UNIT["degree",0.0174532925199433]]')
    assert "units" not in found
    assert found["crs"].name == "d"


@pytest.mark.parametrize(
    ("records", "units", "epsg"),
    [
        (keys((1024, 0, 1, 1), (3072, 0, 1, 25832)), "m", 25832),
        (keys((1024, 0, 1, 1), (3072, 0, 1, 2263)), "us-ft", 2263),
        (keys((1024, 0, 1, 1), (3072, 0, 1, 25832), (4096, 0, 1, 7837)), "m", 25832),
        (keys((1024, 0, 1, 1), (3072, 0, 1, 32767), (3076, 0, 1, 9002)), "ft", None),
        (keys((1024, 0, 1, 1), (3072, 0, 1, 32767), (3077, 34736, 1, 0), doubles=[0.001]), "mm", None),
        (keys((1024, 0, 1, 1), (3072, 0, 1, 25832), (3076, 0, 1, 9001), (4099, 0, 1, 9002)), None, 25832),
        (keys((1024, 0, 1, 2), (2048, 0, 1, 4326)), None, 4326),
        (keys((3077, 34736, 1, 7), doubles=[0.001]), None, None),
        (keys((3072, 0, 1, 1999)), None, 1999),  # there is none
        ([(34735, b"\1")], None, None),
        ([(2112, b"somewhere\0")], None, None),
    ],
)
def test_geotiff_keys(tmp_path, records, units, epsg):
    pytest.importorskip("pyproj")
    source = source_of(tmp_path, las(*records))
    assert (source.units, source.crs and source.crs.epsg) == (units, epsg)


def test_without_pyproj_the_code_and_the_unit_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("cylx.io.crs.is_found", lambda _: False)
    source = source_of(tmp_path, las(*keys((1024, 0, 1, 1), (3072, 0, 1, 25832), (3076, 0, 1, 9001))))
    assert (source.units, source.crs.name, source.crs.wkt, source.crs.epsg) == ("m", "EPSG:25832", None, 25832)
    source = source_of(tmp_path, las((2112, CODED.encode())))
    assert (source.units, source.crs.epsg, source.crs.wkt) == ("m", 25832, CODED)


def test_a_unit_that_is_given_comes_first(tmp_path):
    (tmp_path / "a.las").write_bytes(las((2112, CODED.encode())))
    assert read_cloud(tmp_path / "a.las", units="mm").source.units == "mm"


def test_any_bytes_are_no_crs():
    whole = las((2112, CODED.encode()), *keys((3072, 0, 1, 25832), (3077, 34736, 1, 0), doubles=[1.0]))
    start = struct.unpack_from("<I", whole, 96)[0]
    rng = np.random.default_rng(3)
    for _ in range(300):
        head = bytearray(whole[:start])
        for place in rng.integers(94, start, 4):
            head[place] = rng.integers(256)
        for cut in (len(head), int(rng.integers(227, start))):
            las_crs(bytes(head[:cut]))


def test_e57_is_in_metres_and_may_say_a_crs(tmp_path):
    pye57 = pytest.importorskip("pye57")
    from tests.support.e57 import edited

    path = tmp_path / "a.e57"
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw({f"cartesian{axis}": np.arange(5.0) for axis in "XYZ"})
    source = read_cloud(path).source
    assert (source.units, source.crs) == ("m", None)
    text = CODED.replace('"', "&quot;").encode()
    kept = path.read_bytes()
    edited(path, lambda xml: _with_crs(xml, text))
    assert kept != path.read_bytes()
    source = read_cloud(path).source
    assert (source.units, source.crs.epsg, source.crs.wkt) == ("m", 25832, CODED)


def _with_crs(xml, text):
    element = b'<coordinateMetadata type="String">' + text + b"</coordinateMetadata>"
    for old in (b'<coordinateMetadata type="String"/>', b'<coordinateMetadata type="String"></coordinateMetadata>'):
        xml = xml.replace(old, b"")
    return xml.replace(b"</e57Root>", element + b"</e57Root>")
