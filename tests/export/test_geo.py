"""Maps as another reader sees them: GDAL, by pyogrio."""

import json
import sqlite3

import numpy as np
import pytest

from cylx.errors import OutputError
from cylx.export.geo import Feature, Layer, MapCrs, geojson, geopackage

UTM32 = MapCrs(None, 25832, "ETRS89 / UTM zone 32N")
LINE = [(512345.123, 5412345.456, 301.25), (512346.0, 5412345.5, 302.5)]
STEMS = Layer("stems", "POINT", [Feature(LINE[0], {"id": 1, "dbh": 0.31, "kind": "oak", "alive": True})])
PIPES = Layer(
    "pipes",
    "LINESTRING",
    [Feature(LINE, {"id": 0, "radius": 0.1}), Feature(LINE[::-1], {"id": 1, "radius": None, "note": "a"})],
)


def read(data, tmp_path, name="map.gpkg", layer=None):
    raw = pytest.importorskip("pyogrio.raw", reason="needs pyogrio, which brings GDAL")
    shapely = pytest.importorskip("shapely")
    path = tmp_path / name
    path.write_bytes(data)
    meta, _, shapes, values = raw.read(path, layer=layer)
    return meta, shapely.from_wkb(shapes), dict(zip(meta["fields"], values, strict=True))


def test_points_and_lines_are_read_by_gdal(tmp_path):
    data = geopackage([STEMS, PIPES], UTM32)
    meta, (point,), values = read(data, tmp_path, layer="stems")
    assert meta["crs"] == "EPSG:25832"
    assert list(point.coords) == [LINE[0]]
    assert {name: one.tolist() for name, one in values.items()} == {
        "id": [1], "dbh": [0.31], "kind": ["oak"], "alive": [True],
    }  # fmt: skip
    meta, lines, values = read(data, tmp_path, layer="pipes")
    assert [list(line.coords) for line in lines] == [LINE, LINE[::-1]]
    assert values["note"].tolist() == [None, "a"]
    assert np.isnan(values["radius"][1])


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize("kind", ["MULTILINESTRING", "POLYGON"])
def test_lists_of_lines(tmp_path, kind, size):
    ring = [(0.0, 0.0, 1.0), (4.0, 0.0, 1.0), (4.0, 4.0, 2.0), (0.0, 0.0, 1.0)]
    ring = [place[:size] for place in ring]
    _, (shape,), _ = read(geopackage([Layer("a", kind, [Feature([ring])])], None), tmp_path)
    (line,) = shape.geoms if kind == "MULTILINESTRING" else [shape.exterior]
    assert list(line.coords) == ring
    assert shape.has_z == (size == 3)


def test_a_crs_without_a_code_is_kept(tmp_path):
    pytest.importorskip("pyproj")
    wkt = (
        'PROJCS["site",GEOGCS["g",DATUM["d",SPHEROID["s",6378137,298.257222101]],PRIMEM["Greenwich",0],'
        'UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",9],'
        'PARAMETER["scale_factor",1],UNIT["metre",1]]'
    )
    meta, *_ = read(geopackage([PIPES], MapCrs(wkt, None, "site")), tmp_path)
    assert meta["crs"].startswith('PROJCS["site"')


def test_without_a_crs_it_is_undefined(tmp_path):
    meta, *_ = read(geopackage([PIPES], None), tmp_path)
    assert meta["crs"] is None or "Undefined" in meta["crs"]


def test_the_tables_are_those_of_the_standard(tmp_path):
    path = tmp_path / "map.gpkg"
    path.write_bytes(geopackage([STEMS], UTM32))
    base = sqlite3.connect(path)
    try:
        assert base.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
        assert base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert base.execute("PRAGMA foreign_key_check").fetchall() == []
        assert {row[0] for row in base.execute("SELECT srs_id FROM gpkg_spatial_ref_sys")} == {-1, 0, 4326, 25832}
        assert base.execute("SELECT min_x, min_y FROM gpkg_contents").fetchone() == LINE[0][:2]
    finally:
        base.close()


def test_the_same_layers_give_the_same_bytes():
    assert geopackage([STEMS, PIPES], UTM32) == geopackage([STEMS, PIPES], UTM32)


def test_names_cannot_leave_their_quotes(tmp_path):
    layer = Layer('a"b', "POINT", [Feature((0.0, 1.0), {'x" TEXT); --': "v\x1b[2J", "fid": 3})])
    _, _, values = read(geopackage([layer], None), tmp_path, layer='a"b')
    assert values['x" TEXT); --'].tolist() == ["v\\u001b[2J"]
    assert values["fid_"].tolist() == [3]


def test_an_empty_layer(tmp_path):
    _, shapes, _ = read(geopackage([Layer("none", "LINESTRING", [])], UTM32), tmp_path)
    assert len(shapes) == 0


def test_geojson_is_in_degrees(tmp_path):
    pyproj = pytest.importorskip("pyproj")
    data = geojson([PIPES], UTM32, "a.geojson")
    first = json.loads(data)["features"][0]
    assert first["geometry"]["type"] == "LineString"
    lon, lat = pyproj.Transformer.from_crs(25832, 4258, always_xy=True).transform(*LINE[0][:2])
    assert first["geometry"]["coordinates"][0] == pytest.approx([lon, lat, 301.25], abs=1e-8)
    meta, lines, values = read(data, tmp_path, "map.geojson")
    assert meta["crs"] == "EPSG:4979"  # 4326 with heights
    assert values["id"].tolist() == [0, 1]
    assert lines[0].has_z


def test_geojson_heights_are_in_metres():
    pytest.importorskip("pyproj")
    feet = MapCrs(None, 2263, "NAD83 / New York Long Island (ftUS)", 1200 / 3937)
    data = geojson([Layer("a", "POINT", [Feature((981234.0, 199000.0, 100.0))])], feet, "a.geojson")
    lon, lat, height = json.loads(data)["features"][0]["geometry"]["coordinates"]
    assert -74.1 < lon < -73.7
    assert 40.5 < lat < 41.0
    assert height == pytest.approx(30.4801, abs=1e-4)


@pytest.mark.parametrize(
    ("crs", "fault"),
    [(None, "the scan says no CRS"), (MapCrs('LOCAL_CS["site",UNIT["metre",1]]', None, "site"), "cannot be converted")],
)
def test_geojson_says_why_not(crs, fault):
    pytest.importorskip("pyproj")
    with pytest.raises(OutputError, match=fault):
        geojson([PIPES], crs, "a.geojson")
