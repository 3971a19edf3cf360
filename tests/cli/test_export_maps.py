"""Units and maps from the scan to other programs, without asking."""

import json

import numpy as np
import pytest

from tests.io.test_crs import CODED

pytestmark = pytest.mark.usefixtures("remembering")
AT = np.array([512345.0, 5412345.0, 300.0])


@pytest.fixture(scope="module")
def scan():
    """A pipe on a map, as LAS."""
    laspy = pytest.importorskip("laspy")
    rng = np.random.default_rng(1)
    angle, height = rng.uniform(0, 2 * np.pi, 3000), rng.uniform(0, 2, 3000)
    points = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), height]) + rng.normal(0, 0.001, (3000, 3)) + AT
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = AT, [0.0001] * 3
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", CODED.encode()))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    return cloud


@pytest.fixture
def result(run_cylx, scan, tmp_path):
    scan.write(tmp_path / "a.las")
    done = run_cylx("extract", tmp_path / "a.las", "--no-annotate", "--rejected", tmp_path / "r.json")
    assert done.exit_code == 0, done.stderr
    return tmp_path / "a.cylinders.json"


def test_the_result_says_unit_and_crs(result, run_cylx, tmp_path):
    content = json.loads(result.read_text(encoding="utf-8"))
    assert content["input"]["units"] == "m"
    assert content["input"]["crs"] == {"name": "UTM 32N", "wkt": CODED, "epsg": 25832}
    assert json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))["input"] == content["input"]
    said = run_cylx("info", tmp_path / "a.las").stdout
    assert "units    m\ncrs      UTM 32N, EPSG:25832\n" in said
    assert "max      512345.2" in said


def test_units_are_overridden(run_cylx, scan, tmp_path):
    scan.write(tmp_path / "a.las")
    done = run_cylx("extract", tmp_path / "a.las", "--no-annotate", "--units", "ft", "-o", "-")
    assert json.loads(done.stdout)["input"]["units"] == "ft"


def test_resuming_heeds_the_unit(run_cylx, scan, tmp_path):
    scan.write(tmp_path / "a.las")
    base = ("extract", tmp_path / "a.las", "--no-annotate", "--resume")
    assert run_cylx(*base).exit_code == 0
    before = (tmp_path / "a.cylinders.json").stat().st_mtime_ns
    assert run_cylx(*base).exit_code == 0
    assert (tmp_path / "a.cylinders.json").stat().st_mtime_ns == before
    assert run_cylx(*base, "--units", "ft").exit_code == 0
    assert json.loads((tmp_path / "a.cylinders.json").read_text(encoding="utf-8"))["input"]["units"] == "ft"


def test_a_mesh_beside_the_result_has_the_unit(run_cylx, scan, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    scan.write(tmp_path / "a.las")
    done = run_cylx("extract", tmp_path / "a.las", "--no-annotate", "--mesh", tmp_path / "a.glb")
    assert done.exit_code == 0, done.stderr
    assert trimesh.load(tmp_path / "a.glb").extents.max() == pytest.approx(2.0, abs=0.1)


def test_exports_need_no_unit(result, run_cylx, tmp_path):
    done = run_cylx("export", result, tmp_path / "a.pcf", tmp_path / "a.gpkg", "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["crs"] == "UTM 32N"
    assert "UNITS-BORE MM" in (tmp_path / "a.pcf").read_text(encoding="utf-8")


def test_gdal_sees_the_centre_line_where_it_is(result, run_cylx, tmp_path):
    raw, shapely = pytest.importorskip("pyogrio.raw"), pytest.importorskip("shapely")
    names = [tmp_path / "a.gpkg", tmp_path / "a.geojson"]
    pyproj = pytest.importorskip("pyproj")
    assert run_cylx("export", result, *names).exit_code == 0
    meta, _, shapes, values = raw.read(names[0])
    (line,) = shapely.from_wkb(shapes)
    assert meta["crs"] == "EPSG:25832"
    found = json.loads(result.read_text(encoding="utf-8"))["cylinders"][0]
    assert list(line.coords) == [tuple(found["start"]), tuple(found["end"])]
    assert dict(zip(meta["fields"], values, strict=True))["radius"].tolist() == [found["radius"]]
    (line,) = shapely.from_wkb(raw.read(names[1])[2])
    back = pyproj.Transformer.from_crs(4326, 25832, always_xy=True).transform(*line.coords[0][:2])
    np.testing.assert_allclose(back, found["start"][:2], atol=2e-4)


def test_a_scan_in_millimetres_is_drawn_in_the_unit_of_the_map(result, run_cylx, tmp_path):
    pytest.importorskip("pyproj")
    raw, shapely = pytest.importorskip("pyogrio.raw"), pytest.importorskip("shapely")
    content = json.loads(result.read_text(encoding="utf-8"))
    del content["input"]["crs"], content["input"]["units"]
    for name in ("start", "end", "axis_point"):
        content["cylinders"][0][name] = [1000 * x for x in content["cylinders"][0][name]]
    (tmp_path / "mm.json").write_text(json.dumps(content), encoding="utf-8")
    out = tmp_path / "a.gpkg"
    done = run_cylx("export", tmp_path / "mm.json", out, "--units", "mm", "--crs", "EPSG:25832")
    assert done.exit_code == 0, done.stderr
    (line,) = shapely.from_wkb(raw.read(out)[2])
    np.testing.assert_allclose(line.coords[0][:2], AT[:2], atol=0.02)


def test_ifc_says_where_it_is_on_the_map(result, run_cylx, tmp_path):
    ifcopenshell = pytest.importorskip("ifcopenshell")
    from ifcopenshell.util.placement import get_local_placement

    for name, units in (("a.ifc", "m"), ("b.ifc", "mm")):
        assert run_cylx("export", result, tmp_path / name, "--units", units).exit_code == 0
        file = ifcopenshell.open(str(tmp_path / name))
        (moved,), (system,) = file.by_type("IfcMapConversion"), file.by_type("IfcProjectedCRS")
        assert (system.Name, system.Description) == ("EPSG:25832", "UTM 32N")
        assert (system.MapUnit is None) == (units == "m")
        (pipe,) = file.by_type("IfcPipeSegment")
        place = get_local_placement(pipe.ObjectPlacement)[:3, 3]
        assert np.abs(place).max() < 200
        scale = moved.Scale or 1.0
        on_map = place * scale + [moved.Eastings, moved.Northings, moved.OrthogonalHeight]
        found = json.loads(result.read_text(encoding="utf-8"))["cylinders"][0]
        np.testing.assert_allclose(on_map, np.multiply(found["start"], scale), atol=1e-6)
    validate = pytest.importorskip("ifcopenshell.validate", reason="it needs more packages")
    logger = validate.json_logger()
    validate.validate(ifcopenshell.open(str(tmp_path / "b.ifc")), logger)
    assert logger.statements == []


@pytest.mark.parametrize(
    ("options", "code", "fault"),
    [
        (["a.geojson"], 4, "GeoJSON is in degrees of WGS 84, and the scan says no CRS"),
        (["a.gpkg", "--crs", "EPSG:1"], 2, "--crs: is no CRS"),
        (["a.step"], 2, "has a unit of length"),
    ],
)
def test_what_cannot_be_is_said(result, run_cylx, tmp_path, options, code, fault):
    pytest.importorskip("pyproj")
    content = json.loads(result.read_text(encoding="utf-8"))
    del content["input"]["crs"], content["input"]["units"]
    (tmp_path / "plain.json").write_text(json.dumps(content), encoding="utf-8")
    done = run_cylx("export", tmp_path / "plain.json", tmp_path / options[0], *options[1:])
    assert (done.exit_code, done.stderr.count("\n")) == (code, 1)
    assert fault in done.stderr
    assert not (tmp_path / options[0]).exists()


def test_large_numbers_keep_their_digits(run_cylx, scan, tmp_path):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = AT * 1000, [0.1] * 3
    large = laspy.LasData(header)
    large.x, large.y, large.z = (np.asarray(one) * 1000 for one in (scan.x, scan.y, scan.z))
    large.write(tmp_path / "mm.las")
    said = run_cylx("info", tmp_path / "mm.las").stdout
    assert "e+" not in said.replace("GB", "")
    assert "5412344" in said
    done = run_cylx("extract", tmp_path / "mm.las", "--no-annotate", "-v")
    assert "e+" not in done.stderr, done.stderr
