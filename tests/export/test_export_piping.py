"""Piping in every format, read back by another program: the volume of each part, and that parts meet."""

import io
import re
from itertools import pairwise

import numpy as np
import pytest
from plyfile import PlyData
from scipy.spatial.transform import Rotation

from cylx.export import METRES, draw, format_of, render
from cylx.export.formats import FORMATS
from cylx.export.meshes import Z_UP
from cylx.export.step import SHARE
from cylx.geometry.cylinder import Cylinder
from cylx.palette import cylinder_colors
from cylx.results.fittings import ResultJoint
from tests.export.test_export import VOLUME, library, step_solids
from tests.support.pcf import read_pcf
from tests.support.piping import LINKS, VOLUMES, piping

TURN = Rotation.from_rotvec([0.1, -0.15, 0.2]).as_matrix()
UTM = np.array([500000.0, 5000000.0, 100.0])


def drawing_of(unit="m", runs=True, change=None, **how):
    cylinders, fittings, found = piping(**how)
    if change is not None:
        cylinders, fittings, found = change(cylinders, fittings, found)
    colors = cylinder_colors(np.array([one.id for one in cylinders]))
    return draw(cylinders, colors, unit=unit, fittings=fittings, runs=found if runs else ())


def export(suffix, **how):
    return render(drawing_of(**how), format_of(f"a{suffix}"), f"a{suffix}").data


# --- meshes


@pytest.mark.parametrize("origin", [np.zeros(3), UTM], ids=["near", "utm"])
def test_glb_has_closed_meshes_of_the_right_volume(origin):
    trimesh = library(".glb")
    scene = trimesh.load(io.BytesIO(export(".glb", rotation=TURN, origin=origin)), file_type="glb", process=False)
    parts = drawing_of(rotation=TURN).piping.parts
    ports = {part.name: [port.place for port in part.ports] for part in parts}
    assert set(scene.geometry) == set(VOLUMES)
    for name, volume in VOLUMES.items():
        mesh = scene.geometry[name]
        assert mesh.is_watertight, name
        if re.match("tee|cross", name):  # rods that overlap
            assert len(mesh.split()) == (2 if name == "tee 5" else 3)
            continue
        chords = VOLUME**2 if name in {"elbow 4", "elbow 11"} else VOLUME  # of the tube, and of its centre line
        assert mesh.volume == pytest.approx(volume * chords, rel=1e-3), name
        transform, _ = scene.graph[name]
        middle = (np.linalg.inv(Z_UP) @ transform)[:3, 3] - origin
        if not re.match("elbow|cap|flange 10", name):  # what is straight is between its ports
            np.testing.assert_allclose(middle, np.mean(ports[name], axis=0), atol=1e-8)


def test_ply_tells_fittings_from_cylinders():
    library(".ply")
    vertices = PlyData.read(io.BytesIO(export(".ply")))["vertex"].data
    assert set(vertices["cylinder_id"]) == {-1, *range(14)}
    assert set(vertices["fitting_id"]) == {-1, *range(15)}
    assert ((vertices["cylinder_id"] < 0) == (vertices["fitting_id"] >= 0)).all()


def test_obj_names_fittings():
    library(".obj")
    text = export(".obj").decode()
    assert text.splitlines()[0] == "# 14 cylinders, 15 fittings"
    assert set(re.findall(r"^o (.*)$", text, re.MULTILINE)) == set(VOLUMES)


def test_bends_are_on_their_torus():
    trimesh = library(".glb")
    scene = trimesh.load(io.BytesIO(export(".glb")), file_type="glb", process=False)
    transform, _ = scene.graph["elbow 4"]
    corners = scene.geometry["elbow 4"].copy().apply_transform(np.linalg.inv(Z_UP) @ transform).vertices
    x, y, z = (corners - [6.0, 0.2, 0.0]).T
    distances = np.hypot(np.hypot(x, y) - 0.2, z)
    assert (np.isclose(distances, 0.06, atol=1e-6) | np.isclose(distances, 0.0, atol=1e-6)).all()


# --- CAD


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_step_has_tori_and_cones(unit, tmp_path):
    library(".step")
    data = export(".step", unit=unit, rotation=TURN, origin=(10.0, 20.0, 30.0))
    text = re.sub(r"\s+", " ", data.decode("ascii"))
    names = re.findall(r"= PRODUCT\('(.*?)'", text)
    assert set(names) == set(VOLUMES)
    assert text.count("TOROIDAL_SURFACE(") == 2
    assert text.count("CONICAL_SURFACE(") == 1  # that of the eccentric one is ruled
    scale = METRES[unit] / METRES["mm"]
    for name, (volume, _) in zip(names, step_solids(data, tmp_path), strict=True):
        assert volume == pytest.approx(VOLUMES[name] * scale**3, rel=2e-4), name


def test_step_of_many_parts_has_each_number_once():
    library(".step")
    text = re.sub(r"'(?:[^']|'')*'", "''", export(".step").decode("ascii"))
    defined = [int(number) for number in re.findall(r"^#(\d+) = ", text, re.MULTILINE)]
    assert len(VOLUMES) > SHARE
    assert defined == list(range(1, len(defined) + 1))
    assert {int(number) for number in re.findall(r"#(\d+)", text)} == set(defined)
    assert text.count("= PRODUCT(") == text.count("= STYLED_ITEM(") == len(VOLUMES)


def places_of(model, products):
    from ifcopenshell.util.placement import get_local_placement

    return {one: get_local_placement(one.ObjectPlacement) for one in model.by_type(products)}


@pytest.mark.parametrize("unit", ["m", "ft"])
def test_ifc_has_fittings_with_ports_that_meet(unit):
    ifcopenshell = library(".ifc")
    model = ifcopenshell.file.from_string(export(".ifc", unit=unit, rotation=TURN, origin=UTM).decode())
    kinds = {one.Name: (one.ObjectType, one.PredefinedType) for one in model.by_type("IfcPipeFitting")}
    assert kinds["elbow 4"] == ("elbow", "BEND")
    assert kinds["tee 5"] == ("tee", "JUNCTION")
    assert kinds["cross 6"] == ("cross", "JUNCTION")
    assert kinds["reducer 2"] == ("reducer", "TRANSITION")
    assert kinds["flange 3"] == ("flange", "CONNECTOR")
    assert kinds["cap 0"] == ("cap", "OBSTRUCTION")
    assert kinds["inline 1"] == ("inline", "NOTDEFINED")
    assert {one.Name for one in model.by_type("IfcPipeSegment")} | set(kinds) == set(VOLUMES)
    places = places_of(model, "IfcDistributionPort")
    joined = model.by_type("IfcRelConnectsPorts")
    assert len(joined) == LINKS
    for one in joined:
        first, second = places[one.RelatingPort], places[one.RelatedPort]
        np.testing.assert_allclose(first[:3, 3], second[:3, 3], atol=1e-8)
        np.testing.assert_allclose(first[:3, 2], -second[:3, 2], atol=1e-8)
        assert np.linalg.det(first[:3, :3]) == pytest.approx(1.0)
    owners = {port: one.RelatingObject for one in model.by_type("IfcRelNests") for port in one.RelatedObjects}
    assert set(owners) == set(places)
    systems = {
        one.RelatingGroup.Name: {part.Name for part in one.RelatedObjects}
        for one in model.by_type("IfcRelAssignsToGroup")
    }
    assert list(systems) == ["run 0", "run 1", "run 2", "run 3"]
    assert set.union(*systems.values()) == set(VOLUMES)
    assert {one.is_a() for one in model.by_type("IfcGroup")} == {"IfcDistributionSystem"}
    for one in [*model.by_type("IfcPipeSegment"), *model.by_type("IfcPipeFitting")]:
        assert [part.RepresentationIdentifier for part in one.Representation.Representations] == ["Axis", "Body"]
    identifiers = [entity.GlobalId for entity in model.by_type("IfcRoot")]
    assert len(set(identifiers)) == len(identifiers)


def test_ifc_bodies_have_the_right_volume():
    ifcopenshell = library(".ifc")
    geometry = pytest.importorskip("ifcopenshell.geom", reason="it needs its geometry")
    trimesh = library(".glb")
    model = ifcopenshell.file.from_string(export(".ifc", rotation=TURN).decode())
    settings = geometry.settings()
    settings.set("mesher-linear-deflection", 2e-4)
    settings.set("mesher-angular-deflection", 0.1)
    for one in [*model.by_type("IfcPipeSegment"), *model.by_type("IfcPipeFitting")]:
        shape = geometry.create_shape(settings, one).geometry
        mesh = trimesh.Trimesh(np.reshape(shape.verts, (-1, 3)), np.reshape(shape.faces, (-1, 3)))
        assert mesh.is_watertight, one.Name
        assert mesh.volume == pytest.approx(VOLUMES[one.Name], rel=0.02), one.Name


def test_ifc_of_piping_keeps_to_its_schema():
    ifcopenshell = library(".ifc")
    validate = pytest.importorskip("ifcopenshell.validate", reason="it needs more packages")
    logger = validate.json_logger()
    validate.validate(ifcopenshell.file.from_string(export(".ifc").decode()), logger)
    assert logger.statements == []


@pytest.mark.parametrize("origin", [np.zeros(3), UTM], ids=["near", "utm"])
def test_dxf_has_arcs_that_meet_the_lines(origin):
    ezdxf = library(".dxf")
    document = ezdxf.read(io.StringIO(export(".dxf", rotation=TURN, origin=origin).decode()))
    auditor = document.audit()
    assert (auditor.errors, auditor.fixes) == ([], [])
    ends, arcs = {}, {}
    for one in document.modelspace():
        data = dict(one.get_xdata("CYLX"))
        assert one.dxf.layer == ("cylx_centre_lines" if data[1000].startswith("cylinder") else "cylx_fittings")
        if one.dxftype() == "ARC":
            places = [one.start_point, one.end_point]
            arcs[data[1000]] = one
        else:
            places = [one.dxf.start, one.dxf.end]
        ends.setdefault(data[1000], []).extend(np.array(place) for place in places)
    assert set(ends) == set(VOLUMES)
    assert {name: arc.dxf.radius for name, arc in arcs.items()} == pytest.approx({"elbow 4": 0.2, "elbow 11": 0.15})
    for name, beside in (
        ("elbow 4", ("cylinder 2 piece 1", "cylinder 3 piece 0")),
        ("elbow 11", ("cylinder 10", "cylinder 11")),
    ):
        for other in beside:
            gap = min(np.linalg.norm(one - two) for one in ends[name] for two in ends[other])
            assert gap < 1e-8
        (first, last), angle = ends[name], {"elbow 4": 90, "elbow 11": 180}[name]
        assert np.linalg.norm(first - last) == pytest.approx(2 * arcs[name].dxf.radius * np.sin(np.radians(angle / 2)))


# --- PCF


@pytest.mark.parametrize("unit", list(METRES))
def test_pcf_has_components_in_millimetres_that_meet(unit):
    header, pipelines = read_pcf(export(".pcf", unit=unit, rotation=TURN, scale=1.0 / METRES[unit]))
    assert (header["UNITS-BORE"], header["UNITS-CO-ORDS"]) == ("MM", "MM")
    assert list(pipelines) == ["run-0", "run-1", "run-2", "run-3"]
    for components in pipelines.values():
        for k, one in enumerate(components[1:], start=1):
            earlier = [place for other in components[:k] for place in other.places]
            assert min(np.linalg.norm(a - b) for a in one.places for b in earlier) < 1e-3
        for one, after in pairwise(components):
            goes_on = np.linalg.norm(after.ends[0] - one.ends[1]) < 1e-3
            assert goes_on or is_a_dead_end(one, components)  # what follows is a branch
    kinds = [one.kind for one in pipelines["run-0"]]
    assert kinds[:8] == ["CAP", "PIPE", "VALVE", "PIPE", "REDUCER-CONCENTRIC", "PIPE", "FLANGE", "FLANGE"]
    assert {kind: kinds.count(kind) for kind in ("TEE", "CROSS", "REDUCER-ECCENTRIC", "ELBOW", "FLANGE")} == {
        "TEE": 1, "CROSS": 1, "REDUCER-ECCENTRIC": 1, "ELBOW": 2, "FLANGE": 3,
    }  # fmt: skip
    first = pipelines["run-0"][1]
    np.testing.assert_allclose(np.linalg.norm(first.ends[1] - first.ends[0]), 1950.0, atol=1e-3)
    assert first.bores == [200.0, 200.0]
    (reducer,) = (one for one in pipelines["run-0"] if one.kind == "REDUCER-CONCENTRIC")
    assert reducer.bores == [200.0, 120.0]


def is_a_dead_end(one, components):
    last = one.ends[1]
    return not any(
        np.linalg.norm(last - place) < 1e-3 for other in components if other is not one for place in other.places
    )


def test_pcf_elbows_have_their_corner():
    _, pipelines = read_pcf(export(".pcf", rotation=TURN))
    elbows = [one for components in pipelines.values() for one in components if one.kind == "ELBOW"]
    assert [int(one.values["ANGLE"]) for one in elbows] == [9000, 4500, 9000, 9000]  # half a turn in two parts
    for one in elbows:
        turn = np.radians(int(one.values["ANGLE"]) / 100)
        before, after = one.points["CENTRE-POINT"] - one.ends[0], one.ends[1] - one.points["CENTRE-POINT"]
        assert np.linalg.norm(before) == pytest.approx(np.linalg.norm(after), abs=1e-3)
        cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
        assert cosine == pytest.approx(np.cos(turn), abs=1e-4)
        if "BEND-RADIUS" in one.values:
            assert np.linalg.norm(before) == pytest.approx(
                float(one.values["BEND-RADIUS"]) * np.tan(turn / 2), abs=1e-3
            )
    assert [one.values["SKEY"] for one in elbows] == ["ELBW", "MIBW", "ELBW", "ELBW"]


def test_pcf_junctions_have_their_branches():
    _, pipelines = read_pcf(export(".pcf"))
    (tee,) = (one for one in pipelines["run-0"] if one.kind == "TEE")
    (cross,) = (one for one in pipelines["run-0"] if one.kind == "CROSS")
    np.testing.assert_allclose(tee.points["CENTRE-POINT"], [6200, 1000, 0], atol=1e-3)
    np.testing.assert_allclose(tee.branches[0][0], [6200, 1000, 80], atol=1e-3)
    assert tee.branches[0][1] == 80.0
    assert "ANGLE" not in tee.values
    assert len(cross.branches) == 2
    assert cross.values["ANGLE"] in {"6000", "12000"}
    (eccentric,) = (one for one in pipelines["run-0"] if one.kind == "REDUCER-ECCENTRIC")
    assert eccentric.values["FLAT-DIRECTION"] == "DOWN"  # the axis of the thinner end is 20 mm lower


def test_pcf_has_one_bore_for_a_size():
    def sized(cylinders, fittings, runs):
        size = {"radius": 0.1, "std": 1e-3, "length": 4.0, "cylinders": [0, 1]}
        first = type(runs[0]).model_validate({**runs[0].model_dump(), "sizes": [size]})
        cylinders = [one.model_copy(update={"radius": 0.101}) if one.id == 1 else one for one in cylinders]
        return cylinders, fittings, [first, *runs[1:]]

    _, pipelines = read_pcf(export(".pcf", change=sized))
    assert [one.bores for one in pipelines["run-0"][:4]] == [[200.0, 200.0]] * 4


def test_pcf_names_cannot_add_lines():
    match = {
        "decision": "snapped", "name": "DN\r\nPIPE\u2028\u202eé", "nominal_radius": 0.1, "likelihood_ratio": 1e3,
        "free_radius": 0.1, "free_radius_sd": 1e-3,
    }  # fmt: skip

    def named(cylinders, fittings, runs):
        found = [type(cylinders[0]).model_validate({**one.model_dump(), "catalogue": match}) for one in cylinders]
        return found, fittings, runs

    _, plain = read_pcf(export(".pcf"))
    _, pipelines = read_pcf(export(".pcf", change=named))
    assert [len(one) for one in pipelines.values()] == [len(one) for one in plain.values()]
    (said,) = {one.values.get("COMPONENT-ATTRIBUTE2") for one in pipelines["run-1"] if one.kind == "PIPE"}
    assert said == "DN\\u000d\\u000aPIPE\\u2028\\u202e\\xe9"


def test_pcf_of_cylinders_alone_has_a_pipeline_for_each():
    cylinders, _, _ = piping()
    drawing = draw(cylinders, cylinder_colors(np.arange(14)), unit="m")
    _, pipelines = read_pcf(render(drawing, format_of("a.pcf"), "a.pcf").data)
    assert list(pipelines) == [f"cylinder-{k}" for k in range(14)]
    assert {one.kind for components in pipelines.values() for one in components} == {"PIPE"}


# --- all formats


def test_a_joint_without_a_gap_has_no_body_and_still_joins():
    def closed(cylinders, fittings, runs):
        place = {"end": fittings[9].start, "length": 0.0}
        return cylinders, [one.model_copy(update=place) if one.id == 9 else one for one in fittings], runs

    assert "joint 9" not in {body.name for body in drawing_of(change=closed).bodies}
    _, pipelines = read_pcf(export(".pcf", change=closed))
    before, after = (
        next(one for one in pipelines["run-0"] if one.values["COMPONENT-ATTRIBUTE1"] == name)
        for name in ("cylinder 8", "cylinder 9")
    )
    assert min(np.linalg.norm(one - two) for one in before.ends for two in after.ends) < 1e-3
    ifcopenshell, ezdxf = library(".ifc"), library(".dxf")
    model = ifcopenshell.file.from_string(export(".ifc", change=closed).decode())
    (joint,) = (one for one in model.by_type("IfcPipeFitting") if one.Name == "joint 9")
    assert joint.Representation is None
    assert len(model.by_type("IfcRelConnectsPorts")) == LINKS
    document = ezdxf.read(io.StringIO(export(".dxf", change=closed).decode()))
    assert (document.audit().errors, document.audit().fixes) == ([], [])


def around_a_corner(cylinders, fittings, runs):
    """Let a gap be where elbow 4 is, of which the first end was seen to be farther from the corner."""
    (elbow,) = (one for one in fittings if one.id == 4)
    away = np.array(elbow.start) - elbow.center
    onward = np.cross(elbow.normal, away)  # as long as the bend radius
    joint = ResultJoint(
        **elbow.model_dump(include={"id", "joins", "ends", "confidence", "inliers", "rms", "coverage", "std"}),
        kind="joint",
        start=(np.array(elbow.start) - 0.5 * onward).tolist(),
        end=elbow.end,
        length=0.3,
        assumed=True,
    )
    return cylinders, [joint if one.id == 4 else one for one in fittings], runs


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_a_gap_around_a_corner_is_drawn_as_the_bend_that_is_missing(unit):
    how = {"rotation": TURN, "scale": 1.0 / METRES[unit]}
    plain, bent = (drawing_of(unit, change=change, **how).piping.parts for change in (None, around_a_corner))
    (elbow,), (joint,) = (
        [one for one in parts if one.name == name] for parts, name in ((plain, "elbow 4"), (bent, "joint 4"))
    )
    (torus,), (drawn,) = elbow.solids, joint.solids
    for what in ("center", "normal", "start", "angle", "radius"):
        np.testing.assert_allclose(getattr(drawn, what), getattr(torus, what), rtol=1e-9, atol=1e-9 / METRES[unit])
    for one, other in zip(joint.ports, elbow.ports, strict=True):
        np.testing.assert_allclose(one.place, other.place, atol=1e-9 / METRES[unit])
    _, pipelines = read_pcf(export(".pcf", unit=unit, change=around_a_corner, **how))
    (component,) = (one for one in pipelines["run-0"] if one.values["COMPONENT-ATTRIBUTE1"] == "joint 4")
    assert component.kind == "ELBOW"
    assert component.values["COMPONENT-ATTRIBUTE2"] == "assumed"
    assert float(component.values["BEND-RADIUS"]) == pytest.approx(200.0)
    model = library(".ifc").file.from_string(export(".ifc", unit=unit, change=around_a_corner, **how).decode())
    (fitting,) = (one for one in model.by_type("IfcPipeFitting") if one.Name == "joint 4")
    assert (fitting.PredefinedType, fitting.ObjectType) == ("BEND", "joint")
    (disk,) = (
        one for shape in fitting.Representation.Representations for one in shape.Items if one.is_a("IfcSweptDiskSolid")
    )
    assert disk.Directrix.BasisCurve.Radius == pytest.approx(0.2 / METRES[unit])


def test_step_has_the_torus_of_a_gap_around_a_corner():
    library(".step")
    text = export(".step", change=around_a_corner).decode("ascii")
    assert text.count("TOROIDAL_SURFACE(") == 2


def test_a_gap_in_a_line_is_drawn_straight():
    (joint,) = (one for one in drawing_of(rotation=TURN).piping.parts if one.name == "joint 9")
    (rod,) = joint.solids
    assert isinstance(rod, Cylinder)
    assert rod.height == pytest.approx(0.3)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".stl", ".csv", ".ifc", ".dxf", ".pcf"])
def test_the_same_piping_gives_the_same_bytes_and_other_bytes_than_cylinders_alone(suffix):
    library(suffix)
    cylinders, _, runs = piping()
    colors = cylinder_colors(np.arange(14))
    plain, empty = (
        render(draw(cylinders, colors, unit="m", **how), FORMATS[suffix], "a").data
        for how in ({}, {"fittings": [], "runs": runs})
    )
    assert plain == empty
    assert export(suffix) == export(suffix)
    assert (export(suffix) == plain) == (suffix == ".csv")
