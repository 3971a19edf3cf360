"""`cylx deviation`: designs in every form, what is written, what is said, and the exit code."""

import json
import re
import sys
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import isolated, isolated_start, write_cloud
from cylx.io.design import read_design
from cylx.io.inputs import open_input
from tests.support.tanks import DEPTH, tank

TRUTH = {"cylinders": [{"name": "tank A", "start": [0, 0, -4.0], "end": [0, 0, 4.0], "radius": 3.0}]}


@pytest.fixture(scope="module")
def points():
    return tank(points=40_000)[0]


@pytest.fixture
def put(tmp_path, points):
    write_cloud(tmp_path / "tank.ply", points)

    def write(name, content):
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    return write


def test_all_outputs(put, run_cylx, tmp_path):
    design = put("tank.json", TRUTH)
    names = [tmp_path / f"out.{suffix}" for suffix in ("json", "html", "xml")]
    limits = ("--dent", 0.01, "--radius", 0.01, "--offset", 0.01, "--tilt", 0.1, "--ovality", 0.02)
    done = run_cylx(
        "deviation", tmp_path / "tank.ply", design, *limits, "-o", names[0], "--report", names[1], "--junit", names[2]
    )  # fmt: skip
    assert done.exit_code == 1, done.stderr
    assert "tank A" in done.stdout
    assert re.search(r"cylinder 0, tank A: dent fail: 0\.0\d+ ± 0\.00\d+, allowed 0\.01", done.stderr)
    content = json.loads(names[0].read_text(encoding="utf-8"))
    jsonschema.validate(content, json.loads(run_cylx("config", "schema", "--deviation").stdout))
    (entry,) = content["cylinders"]
    assert content["verdict"] == entry["verdict"] == "fail"
    verdicts = {check["of"]: check["verdict"] for check in entry["checks"]}
    assert verdicts == {
        "found": "pass", "offset": "pass", "tilt_deg": "pass", "radius": "pass", "ovality": "pass", "dent": "fail",
    }  # fmt: skip
    (patch,) = entry["patches"]
    assert patch["kind"] == "dent"
    assert patch["depth"] == pytest.approx(DEPTH, abs=0.003)
    page = names[1].read_text(encoding="utf-8")
    assert '"Deviations (fail)"' in page
    assert '"Dents and bulges"' in page
    assert '"maps":[{' in page
    root = ElementTree.fromstring(names[2].read_bytes())
    assert (root.get("tests"), root.get("failures")) == ("6", "1")
    (failed,) = root.iter("failure")
    assert failed.get("message").startswith("dent ")


def test_the_same_call_gives_the_same_bytes(put, run_cylx, tmp_path):
    design = put("tank.json", TRUTH)
    for name in ("a", "b"):
        run_cylx(
            "deviation", tmp_path / "tank.ply", design, "-o", tmp_path / name, "--report", tmp_path / f"{name}.html"
        )
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_exit_codes(put, run_cylx, tmp_path):
    scan, design = tmp_path / "tank.ply", put("tank.json", TRUTH)
    assert run_cylx("deviation", scan, design).exit_code == 0
    assert run_cylx("deviation", scan, design, "--dent", 0.05).exit_code == 0
    assert run_cylx("deviation", scan, design, "--ovality", 0).exit_code == 0
    assert run_cylx("deviation", scan, design, "--ovality", 0, "--certain").exit_code == 1
    other = {"cylinders": [*TRUTH["cylinders"], {"start": [20, 0, 0], "end": [20, 0, 1], "radius": 1}]}
    done = run_cylx("deviation", scan, put("other.json", other), "--json")
    assert done.exit_code == 1
    content = json.loads(done.stdout)
    assert [entry["verdict"] for entry in content["cylinders"]] == ["pass", "fail"]
    assert content["cylinders"][1]["fault"] == "only 0 usable points"
    assert "built" not in content["cylinders"][1]


CSV = "name;start_x;start_y;start_z;end_x;end_y;end_z;diameter\ntank A;0;0;-4,0;0;0;4,0;6\n"
AXIS = "id,axis_point_x,axis_point_y,axis_point_z,axis_direction_x,axis_direction_y,axis_direction_z,height,radius\n"


@pytest.mark.parametrize(
    ("name", "text"), [("a.csv", CSV), ("b.csv", AXIS + "7,0,0,0,0,0,2,8,3\n"), ("c.json", json.dumps(TRUTH))]
)
def test_tables(put, name, text):
    (one,) = read_design(put(name, text)).cylinders
    assert (one.start, one.end, one.radius) == ((0, 0, -4), (0, 0, 4), 3)
    assert one.name in {"tank A", "7"}


@pytest.mark.parametrize("suffix", [".csv", ".step", ".ifc"])
@pytest.mark.parametrize("unit", ["m", "mm", "ft"])
def test_what_export_writes_is_read(run_cylx, tmp_path, suffix, unit):
    pytest.importorskip({".step": "OCP", ".ifc": "ifcopenshell", ".csv": "csv"}[suffix])
    from cylx.units import METRES
    from tests.export.test_export import SHAPES, export

    path = tmp_path / f"out{suffix}"
    path.write_bytes(export(suffix, unit=unit).data)
    design = read_design(path)
    scale = 1.0 if design.metres is None else design.metres / METRES[unit]
    assert len(design.cylinders) == len(SHAPES)
    for one, shape in zip(design.cylinders, SHAPES, strict=True):
        ends = np.sort([one.start, one.end], axis=0) * scale
        np.testing.assert_allclose(ends, np.sort([shape.start, shape.end], axis=0), atol=1e-6)
        assert one.radius * scale == pytest.approx(shape.radius, rel=1e-6)
        assert one.name.startswith("cylinder ") or suffix == ".csv"


@pytest.mark.parametrize(("suffix", "library"), [("step", "OCP"), ("ifc", "ifcopenshell")])
def test_what_native_code_reads_is_read_in_a_process_of_its_own(put, monkeypatch, suffix, library):
    pytest.importorskip(library)
    asked = []

    def answer(source, kind):
        asked.append((source.head(99), kind))
        return {"units": "mm", "metres": 0.001, "cylinders": [["a", [0, 0, 0], [0, 0, 2], 0.5]]}

    monkeypatch.setattr(isolated, "ask_isolated", answer)
    design = read_design(put(f"a.{suffix}", "rubbish"))
    assert asked == [(b"rubbish", suffix)]
    assert (design.format, design.metres, design.cylinders[0].end) == (suffix, 0.001, (0, 0, 2))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the limits are those of Linux")
@pytest.mark.parametrize(
    ("code", "fault"),
    [
        ("ctypes.string_at(0)", "broken IFC: the library that reads it crashed (SIGSEGV)"),
        ("while True: pass", "takes too long to read for a file of its size"),
    ],
)
def test_a_design_that_crashes_or_hangs_a_library_is_one_line(put, monkeypatch, code, fault):
    pytest.importorskip("ifcopenshell")
    start = isolated_start.START.replace(
        "from cylx.io.isolated_child",
        f"import ctypes, cylx.io.design_ifc as d\ndef read_ifc(source):\n    {code}\nd.read_ifc = read_ifc\n"
        "from cylx.io.isolated_child",
    )
    monkeypatch.setattr(isolated_start, "START", start.replace("; import ctypes", "\nimport ctypes"))
    monkeypatch.setattr(isolated, "_SECONDS", 1)
    with open_input(put("a.ifc", "ISO-10303-21;")) as source, isolated.Reader("ifc", source.file) as reader:
        with pytest.raises(InputError) as refused:
            reader.ask(source)
        assert refused.value.fault == fault


def test_a_pipe_with_a_bore_is_one_cylinder(tmp_path):
    """As other programs write it: a hollow solid whose surfaces are halves, in an assembly that moves it."""
    pytest.importorskip("OCP")
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    axis = gp_Ax2(gp_Pnt(10, 20, 30), gp_Dir(1, 0, 0))
    halves = [BRepPrimAPI_MakeCylinder(axis, radius, 500.0).Shape() for radius in (50.0, 45.0)]
    writer = STEPControl_Writer()
    writer.Transfer(BRepAlgoAPI_Cut(*halves).Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "pipe.stp"))
    design = read_design(tmp_path / "pipe.stp")
    (one,) = design.cylinders
    np.testing.assert_allclose(sorted([one.start, one.end]), [(10, 20, 30), (510, 20, 30)], atol=1e-6)
    assert (one.radius, design.units) == (pytest.approx(50), "mm")


def test_ifc_as_other_programs_write_it(tmp_path):
    """Hollow profiles, types that are mapped, discs swept along lines, clippings, and a place on a map."""
    ifcopenshell = pytest.importorskip("ifcopenshell")
    file = ifcopenshell.file(schema="IFC4")

    def point(*x):
        return file.create_entity("IfcCartesianPoint", tuple(map(float, x)))

    def axes(*x):
        return file.create_entity("IfcAxis2Placement3D", point(*x))

    up = file.create_entity("IfcDirection", (0.0, 0.0, 1.0))
    context = file.create_entity("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, axes(0, 0, 0))
    units = file.create_entity(
        "IfcUnitAssignment", [file.create_entity("IfcSIUnit", None, "LENGTHUNIT", "MILLI", "METRE")]
    )
    file.create_entity("IfcProject", ifcopenshell.guid.new(), RepresentationContexts=[context], UnitsInContext=units)
    system = file.create_entity("IfcProjectedCRS", "EPSG:25832")
    file.create_entity("IfcMapConversion", context, system, 1000.0, 2000.0, 3.0, 0.0, 1.0, 0.001)
    profile = file.create_entity("IfcCircleHollowProfileDef", "AREA", None, None, 50.0, 5.0)
    swept = file.create_entity("IfcExtrudedAreaSolid", profile, axes(0, 0, 100), up, 400.0)
    plane = file.create_entity("IfcPlane", axes(0, 0, 450))
    half = file.create_entity("IfcHalfSpaceSolid", plane, False)
    cut = file.create_entity("IfcBooleanClippingResult", "DIFFERENCE", swept, half)
    line = file.create_entity("IfcPolyline", [point(0, 0, 0), point(200, 0, 0)])
    disc = file.create_entity("IfcSweptDiskSolid", line, 20.0)
    shape = file.create_entity("IfcShapeRepresentation", context, "Body", "CSG", [cut])
    source = file.create_entity("IfcRepresentationMap", axes(0, 0, 0), shape)
    target = file.create_entity("IfcCartesianTransformationOperator3D", None, None, point(0, 0, 0))
    mapped = file.create_entity("IfcMappedItem", source, target)
    for name, item in (("hollow", mapped), ("disc", disc)):
        body = file.create_entity("IfcShapeRepresentation", context, "Body", "X", [item])
        definition = file.create_entity("IfcProductDefinitionShape", None, None, [body])
        place = file.create_entity("IfcLocalPlacement", None, axes(1000, 0, 0))
        file.create_entity(
            "IfcTank", ifcopenshell.guid.new(), None, name, None, None, place, definition, None
        )  # fmt: skip
    file.write(str(tmp_path / "a.ifc"))
    design = read_design(tmp_path / "a.ifc")
    found = {one.name: one for one in design.cylinders}
    assert design.units == "m"  # of the map
    np.testing.assert_allclose(found["hollow"].start, (1000, 2001, 3.1), atol=1e-9)
    np.testing.assert_allclose(found["hollow"].end, (1000, 2001, 3.5), atol=1e-9)
    assert found["hollow"].radius == pytest.approx(0.05)
    np.testing.assert_allclose(found["disc"].end, (1000, 2001.2, 3.0), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "text", "code", "fault"),
    [
        ("a.json", "{}", 3, "has no list 'cylinders'"),
        ("a.json", '{"cylinders": []}', 3, "has no cylinder"),
        ("a.json", '{"cylinders": [3]}', 3, "is not an object"),
        ("a.json", '{"cylinders": [{"radius": 1}]}', 3, "has neither ends nor an axis with a height"),
        ("a.json", '{"cylinders": [{"start": [0,0,0], "end": [0,0,0], "radius": 1}]}', 3, "has no length"),
        ("a.json", '{"cylinders": [{"start": [0,0,0], "end": [0,0,1], "radius": -1}]}', 3, "no radius"),
        ("a.json", '{"cylinders": [{"start": [0,0], "end": [0,0,1], "radius": 1}]}', 3, "that is no number"),
        ("a.csv", "a,b\n1,2\n", 3, "has no column radius"),
        ("a.csv", AXIS + "7,0,0,0,0,0,2,8\n", 3, "expected 9 columns, found 8"),
        ("a.csv", AXIS + "7,0,0,0,0,0,2,8,x\n", 3, "'x' is not a number"),
        ("a.ifc", "hello", 3, "is not IFC"),
        ("a.step", "hello", 3, "is not STEP"),
        ("a.step", "ISO-10303-21;\nrubbish", 3, "broken STEP"),
        ("a.dwg", "hello", 2, "is no format of a design"),
    ],
)
def test_designs_that_are_none(put, run_cylx, tmp_path, name, text, code, fault):
    if name.endswith(".step"):
        pytest.importorskip("OCP")
    done = run_cylx("deviation", tmp_path / "tank.ply", put(name, text))
    assert (done.exit_code, done.stderr.count("\n")) == (code, 1), done.stderr
    assert fault in done.stderr


def test_units_are_converted_or_asked_for(put, run_cylx, tmp_path):
    text = AXIS + "7,0,0,0,0,0,1,8000,3000\n"
    design = put("mm.csv", text)
    done = run_cylx("deviation", tmp_path / "tank.ply", design, "--design-units", "mm", "--units", "m", "--json")
    assert done.exit_code == 0, done.stderr
    content = json.loads(done.stdout)
    assert (content["design"]["scale"], content["input"]["units"]) == (0.001, "m")
    assert content["cylinders"][0]["design"]["radius"] == 3.0
    done = run_cylx("deviation", tmp_path / "tank.ply", design, "--design-units", "mm")
    assert (done.exit_code, "give that of the scan by --units" in done.stderr) == (2, True)
