"""What is exported is read back by another program than wrote it: shapes, places, units, names, and the same bytes."""

import csv
import hashlib
import io
import json
import os
import re
import struct
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData

from cylx.errors import InputError, OutputError, UsageError
from cylx.export import METRES, draw, format_of, render
from cylx.export.formats import FORMATS
from cylx.export.geo import MapCrs
from cylx.export.meshes import SIDES, Z_UP
from cylx.geometry.cylinder import Cylinder
from cylx.optional.open3d import import_open3d
from cylx.palette import cylinder_colors
from cylx.results import ResultCylinder

UTM = np.array([500000.0, 5000000.0, 100.0])
SHAPES = [
    Cylinder((0.25, -0.5, 1.0), (0, 0, 1), 0.125, 2.0),
    Cylinder((3.0, 1.0, 0.7), (0.6, 0.0, 0.8), 0.05, 0.75),
    Cylinder((-1.0, 2.0, 0.3), (1, 2, -3), 0.3, 0.2),
]
VOLUME = SIDES / (2 * np.pi) * np.sin(2 * np.pi / SIDES)  # of the prism in its cylinder
PLACES = pytest.mark.parametrize("origin", [np.zeros(3), UTM], ids=["near", "utm"])


def found(shape, number, **others):
    """Write down a cylinder as a result has it."""
    vectors = {"axis_point": shape.point, "axis_direction": shape.direction, "start": shape.start, "end": shape.end}
    numbers = {"radius": shape.radius, "height": shape.height, "inliers": 100 + number, "rmse": 0.01, "support": 3}
    keys = {name: vector.tolist() for name, vector in vectors.items()}
    return ResultCylinder.model_validate({"id": number, **keys, **numbers, "coverage_deg": 180.0, **others})


def drawing_of(shapes, unit="m", **others):
    cylinders = [found(shape, i, **others) for i, shape in enumerate(shapes)]
    return draw(cylinders, cylinder_colors(np.arange(len(shapes))), unit=unit)


def export(suffix, origin=(0, 0, 0), unit="m", shapes=SHAPES):
    drawing = drawing_of([shape.moved(origin) for shape in shapes], unit)
    drawing = replace(drawing, crs=MapCrs(None, 4326, "degrees")) if suffix == ".geojson" else drawing
    return render(drawing, format_of(f"out{suffix}"), f"out{suffix}")


def library(suffix):
    """Skip where the library of a format is missing."""
    known = FORMATS[suffix]
    return pytest.importorskip(known.library, reason=f"needs cylx[{known.extra}]") if known.library else None


def check_mesh(mesh, shape, scale=1.0, tolerance=1e-6):
    """Hold a mesh against a cylinder."""
    near = tolerance * scale * shape.radius
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(VOLUME * np.pi * shape.radius**2 * shape.height * scale**3, rel=1e-3)
    offsets = mesh.vertices - scale * shape.point
    heights = offsets @ shape.direction
    distances = np.linalg.norm(offsets - np.outer(heights, shape.direction), axis=1)
    rim = distances > near
    assert rim.sum() == 2 * SIDES
    np.testing.assert_allclose(distances[rim], scale * shape.radius, atol=near)
    np.testing.assert_allclose(np.abs(heights), scale * shape.height / 2, atol=near)


def check_parts(mesh, origin):
    """Hold the connected parts of a mesh against the cylinders."""
    parts = mesh.split(only_watertight=True)
    assert len(parts) == len(SHAPES)
    for part in parts:
        (shape,) = (one for one in SHAPES if np.linalg.norm(part.bounds.mean(axis=0) - one.point - origin) < 0.1)
        check_mesh(part, shape.moved(origin), tolerance=1e-4)


def test_the_chord_error_is_small():
    assert 1 - np.cos(np.pi / SIDES) < 0.01


# --- meshes


@PLACES
def test_ply_is_read_by_plyfile(origin):
    trimesh = library(".ply")
    exported = export(".ply", origin)
    assert (exported.offset is None) == (not origin.any())
    away = np.array(exported.offset or (0, 0, 0))
    content = PlyData.read(io.BytesIO(exported.data))
    said = "cylx; add 499999 4999999 100 to all coordinates" if exported.offset else "cylx"
    assert content.comments[0] == said
    vertices = content["vertex"].data
    faces = np.vstack(content["face"]["vertex_indices"])
    assert len(vertices) == len(SHAPES) * (2 * SIDES + 2)
    for i, shape in enumerate(SHAPES):
        own = vertices[vertices["cylinder_id"] == i]
        points = np.column_stack([own[axis].astype(float) for axis in "xyz"]) + away
        first = np.flatnonzero(vertices["cylinder_id"] == i)[0]
        here = faces[(faces >= first).all(axis=1) & (faces < first + len(own)).all(axis=1)] - first
        check_mesh(trimesh.Trimesh(points, here, process=False), shape.moved(origin), tolerance=1e-4)
        assert {tuple(color) for color in own[["red", "green", "blue"]].tolist()} == {
            tuple(cylinder_colors(np.array([i]))[0].tolist())
        }


@PLACES
def test_stl_is_read_by_hand_and_by_trimesh(origin):
    trimesh = library(".stl")
    exported = export(".stl", origin)
    header, count = exported.data[:80].decode("ascii").strip(), struct.unpack("<I", exported.data[80:84])[0]
    assert header.startswith("cylx")
    assert ("add 499999 4999999 100 to all coordinates" in header) == bool(origin.any())
    assert count == len(SHAPES) * 4 * SIDES
    assert len(exported.data) == 84 + 50 * count
    mesh = trimesh.load(io.BytesIO(exported.data), file_type="stl")
    check_parts(mesh.apply_translation(exported.offset or (0, 0, 0)), origin)


@PLACES
def test_obj_is_read_by_hand_and_by_trimesh(origin):
    trimesh = library(".obj")
    exported = export(".obj", origin)
    assert exported.offset is None
    text = exported.data.decode("ascii")
    assert re.findall(r"^o (.*)$", text, re.MULTILINE) == ["cylinder 0", "cylinder 1", "cylinder 2"]
    corners = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("v ")], float)
    assert corners.shape == (len(SHAPES) * (2 * SIDES + 2), 6)
    np.testing.assert_allclose(255 * corners[0, 3:], cylinder_colors(np.array([0]))[0], atol=1e-3)
    check_parts(trimesh.load(io.BytesIO(exported.data), file_type="obj", process=False), origin)


@PLACES
@pytest.mark.parametrize("unit", ["m", "in"])
def test_glb_is_read_by_hand_and_by_trimesh(origin, unit):
    trimesh = library(".glb")
    exported, scale = export(".glb", origin, unit), METRES[unit]
    assert exported.offset is None
    magic, version, length, size, kind = struct.unpack("<4sIII4s", exported.data[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(exported.data), b"JSON")
    content = json.loads(exported.data[20 : 20 + size])
    nodes = {node["name"]: node for node in content["nodes"]}
    assert [content["meshes"][nodes[f"cylinder {i}"]["mesh"]]["name"] for i in range(3)] == [
        f"cylinder {i}" for i in range(3)
    ]
    for i, shape in enumerate(SHAPES):
        assert nodes[f"cylinder {i}"]["matrix"][12:15] == pytest.approx(scale * (shape.point + origin), rel=1e-15)
    light = content["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"]
    shown = [255 * (12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055) for x in light[:3]]
    np.testing.assert_allclose(shown, cylinder_colors(np.array([0]))[0], atol=8)  # eight bits of light
    scene = trimesh.load(io.BytesIO(exported.data), file_type="glb", process=False)
    for i, shape in enumerate(SHAPES):
        transform, name = scene.graph[f"cylinder {i}"]
        mesh = scene.geometry[name].copy().apply_transform(np.linalg.inv(Z_UP) @ transform)
        check_mesh(mesh, shape.moved(origin), scale, tolerance=1e-5)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".glb"])
def test_meshes_are_read_by_open3d(suffix, tmp_path):
    library(suffix)
    (tmp_path / f"out{suffix}").write_bytes(export(suffix).data)
    mesh = import_open3d().io.read_triangle_mesh(str(tmp_path / f"out{suffix}"))
    assert len(mesh.triangles) == len(SHAPES) * 4 * SIDES
    area = SIDES * np.sin(np.pi / SIDES) * sum(2 * shape.radius * shape.height for shape in SHAPES)
    area += SIDES * np.sin(2 * np.pi / SIDES) * sum(shape.radius**2 for shape in SHAPES)
    assert mesh.get_surface_area() == pytest.approx(area, rel=1e-5)


# --- a table


def test_csv_has_a_line_a_cylinder_and_every_number():
    uncertainty = {"radius": 1e-5, "axis_angle_deg": 0.5, "axis_offset": 2e-5, "covariance": np.eye(5).tolist()}
    others = {"uncertainty": uncertainty, "evidence": {"slope": 0.25}, "confidence": 0.875}
    data = render(drawing_of([shape.moved(UTM) for shape in SHAPES], **others), format_of("a.csv"), "a.csv").data
    rows = list(csv.DictReader(io.StringIO(data.decode())))
    assert [int(row["id"]) for row in rows] == [0, 1, 2]
    assert [float(rows[1][f"axis_point_{axis}"]) for axis in "xyz"] == (SHAPES[1].point + UTM).tolist()
    assert {name: float(rows[0][name]) for name in rows[0] if "_" in name and "axis_" not in name[:5]}.items() >= {
        "uncertainty_radius": 1e-5, "uncertainty_axis_angle_deg": 0.5, "uncertainty_axis_offset": 2e-5,
        "evidence_slope": 0.25,
    }.items()  # fmt: skip
    assert float(rows[0]["confidence"]) == 0.875
    assert not any("covariance" in name for name in rows[0])


def test_csv_without_cylinders_has_its_first_line():
    (line,) = render(drawing_of([]), format_of("a.csv"), "a.csv").data.decode().splitlines()
    assert line.startswith("id,axis_point_x,")


# --- CAD


def step_solids(data, folder):
    """Give (volume, centre) of the solids of a STEP file, in its own unit."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    (folder / "read.step").write_bytes(data)
    reader = STEPControl_Reader()
    reader.ReadFile(str(folder / "read.step"))
    reader.TransferRoots()
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_SOLID)
    while explorer.More():
        properties = GProp_GProps()
        BRepGProp.VolumeProperties_s(explorer.Current(), properties)
        center = properties.CentreOfMass()
        yield properties.Mass(), np.array([center.X(), center.Y(), center.Z()])
        explorer.Next()


@PLACES
@pytest.mark.parametrize("unit", ["mm", "ft"])
def test_step_has_exact_cylinders_in_the_unit_of_the_scan(origin, unit, tmp_path, capfd):
    library(".step")
    data = export(".step", origin, unit).data
    assert capfd.readouterr().out == ""
    text = re.sub(r"\s+", " ", data.decode("ascii"))
    assert ("CONVERSION_BASED_UNIT('FOOT'" in text) == (unit == "ft")
    assert re.findall(r"= PRODUCT\('(.*?)'", text) == ["cylinder 0", "cylinder 1", "cylinder 2"]
    radii = [float(radius) for radius in re.findall(r"CYLINDRICAL_SURFACE\('',#\d+,(.*?)\)", text)]
    assert radii == pytest.approx([shape.radius for shape in SHAPES], rel=1e-12)
    scale = METRES[unit] / METRES["mm"]  # the reader works in millimetres
    solids = list(step_solids(data, tmp_path))
    for (volume, center), shape in zip(solids, SHAPES, strict=True):
        assert volume == pytest.approx(np.pi * shape.radius**2 * shape.height * scale**3, rel=1e-5)
        np.testing.assert_allclose(center / scale, shape.point + origin, atol=1e-6)


@PLACES
@pytest.mark.parametrize("unit", list(METRES))
def test_ifc_has_pipe_segments_in_the_unit_of_the_scan(origin, unit):
    ifcopenshell = library(".ifc")
    from ifcopenshell.util.placement import get_local_placement
    from ifcopenshell.util.unit import calculate_unit_scale

    text = export(".ifc", origin, unit).data.decode()
    model = ifcopenshell.file.from_string(text)
    assert model.schema == "IFC4"
    radii = re.findall(r"IFCCIRCLEPROFILEDEF\(\.AREA\.,'cylinder \d',#\d+,(.*?)\)", text)
    assert list(map(float, radii)) == [shape.radius for shape in SHAPES]  # read by hand, too
    assert calculate_unit_scale(model) == pytest.approx(METRES[unit])
    segments = model.by_type("IfcPipeSegment")
    assert [segment.Name for segment in segments] == ["cylinder 0", "cylinder 1", "cylinder 2"]
    identifiers = [entity.GlobalId for entity in model.by_type("IfcRoot")]
    assert len(set(identifiers)) == len(identifiers)
    assert {len(identifier) for identifier in identifiers} == {22}
    for segment, shape in zip(segments, SHAPES, strict=True):
        (solid,) = segment.Representation.Representations[0].Items
        assert (solid.SweptArea.Radius, solid.Depth) == pytest.approx((shape.radius, shape.height), rel=1e-12)
        place = get_local_placement(segment.ObjectPlacement)
        np.testing.assert_allclose(place[:3, 3], shape.start + origin, rtol=1e-14, atol=1e-12)
        np.testing.assert_allclose(place[:3, 2], shape.direction, atol=1e-12)
        assert np.linalg.det(place[:3, :3]) == pytest.approx(1.0)
    (own, *_) = model.by_type("IfcPropertySet")
    assert {part.Name for part in own.HasProperties} == {"id", "radius", "inliers", "rmse", "coverage_deg"}


def test_ifc_keeps_to_its_schema():
    ifcopenshell = library(".ifc")
    validate = pytest.importorskip("ifcopenshell.validate", reason="it needs more packages")
    logger = validate.json_logger()
    validate.validate(ifcopenshell.file.from_string(export(".ifc").data.decode()), logger)
    assert logger.statements == []


@PLACES
@pytest.mark.parametrize("unit", list(METRES))
def test_dxf_has_centre_lines_in_the_unit_of_the_scan(origin, unit):
    ezdxf = library(".dxf")
    text = export(".dxf", origin, unit).data.decode()
    by_hand = [re.findall(r"(?m)^ *([123][01])\n(.*)", body)[:6] for body in text.split("\nAcDbLine\n")[1:]]
    for groups, shape in zip(by_hand, SHAPES, strict=True):
        assert [code for code, _ in groups] == ["10", "20", "30", "11", "21", "31"]
        ends = np.array([float(number) for _, number in groups])
        np.testing.assert_allclose(
            ends, np.concatenate([shape.start, shape.end]) + np.tile(origin, 2), rtol=1e-15, atol=1e-15
        )
    document = ezdxf.read(io.StringIO(text))
    auditor = document.audit()
    assert (auditor.errors, auditor.fixes) == ([], [])
    if unit == "us-ft":  # ezdxf has no factor for it
        assert document.header["$INSUNITS"] == 21
    else:
        assert ezdxf.units.conversion_factor(document.units, ezdxf.units.M) == pytest.approx(METRES[unit])
    lines = list(document.modelspace())
    assert {line.dxf.layer for line in lines} == {"cylx_centre_lines"}
    for i, (line, shape) in enumerate(zip(lines, SHAPES, strict=True)):
        np.testing.assert_allclose(line.dxf.start, shape.start + origin, rtol=1e-15, atol=1e-15)
        np.testing.assert_allclose(line.dxf.end, shape.end + origin, rtol=1e-15, atol=1e-15)
        assert dict(line.get_xdata("CYLX"))[1071] == i
        assert dict(line.get_xdata("CYLX"))[1041] == shape.radius
        assert tuple(line.rgb) == tuple(cylinder_colors(np.array([i]))[0])


# --- all formats

SAME = """
import sys, hashlib
from tests.export.test_export import FORMATS, export
for suffix in sys.argv[1:]:
    print(hashlib.sha256(export(suffix).data).hexdigest())
"""


def test_the_same_drawing_gives_the_same_bytes():
    known = [suffix for suffix, one in FORMATS.items() if one.library is None or find_spec(one.library)]
    once = {suffix: export(suffix).data for suffix in known}
    assert all(export(suffix).data == once[suffix] for suffix in known)
    done = subprocess.run(
        [sys.executable, "-c", SAME, *known], capture_output=True, text=True, check=True,
        cwd=Path(__file__).parents[2], env={**os.environ, "PYTHONHASHSEED": "4"},
    )  # fmt: skip
    assert done.stdout.split() == [hashlib.sha256(data).hexdigest() for data in once.values()]


def test_other_cylinders_have_other_identifiers():
    library(".ifc")
    identifiers = [
        set(re.findall(rb"IFCPIPESEGMENT\('(.{22})'", export(".ifc", origin).data)) for origin in ((0, 0, 0), UTM)
    ]
    assert len(identifiers[0]) == 3
    assert not identifiers[0] & identifiers[1]


@pytest.mark.parametrize("suffix", [".ifc", ".dxf"])
def test_without_cylinders_a_file_may_be_empty(suffix):
    library(suffix)
    assert export(suffix, shapes=[]).data


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".stl", ".step"])
def test_or_it_may_not(suffix):
    library(suffix)
    with pytest.raises(OutputError, match=r"there is no cylinder, and a .* file cannot be empty"):
        export(suffix, shapes=[])


def test_a_cylinder_without_height_is_in_tables_only():
    drawing = drawing_of([Cylinder((0, 0, 0), (0, 0, 1), 1.0, 0.0), SHAPES[0]])
    assert (drawing.flat, [piece.id for piece in drawing.pieces]) == ([0], [1])
    assert len(render(drawing, format_of("a.csv"), "a.csv").data.splitlines()) == 3


def test_an_axis_needs_a_direction():
    with pytest.raises(InputError, match="result: cylinder 0: a direction needs a finite length > 0"):
        draw([found(SHAPES[0], 0, axis_direction=[0.0, 0.0, 0.0])], np.zeros((1, 3), np.uint8))


@pytest.mark.parametrize(("suffix", "known"), FORMATS.items())
def test_a_missing_library_is_named_with_its_extra(suffix, known, monkeypatch):
    if known.library is None:
        known.demand("a.csv", "m" if known.has_unit else None)
        return
    monkeypatch.setitem(sys.modules, known.library, None)
    remedy = re.escape(f"needs {known.library}, which is not installed; pip install 'cylx[{known.extra}]'")
    with pytest.raises(UsageError, match=remedy):
        known.demand("out", "m")
