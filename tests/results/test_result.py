"""The JSON of a result: keys and their order, units, what is left out, what is refused."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx import __version__
from cylx.config import Config
from cylx.errors import InputError
from cylx.geometry.cylinder import Cylinder
from cylx.records import CylinderFit, Extraction, NominalRadius, PointCloud, Scene, Source, StageReport
from cylx.results import Result, ResultCylinder, result_schema

KEYS = ["schema", "cylx_version", "input", "method", "config", "scene", "stages", "cylinders", "warnings"]
CYLINDER_KEYS = [
    "id", "axis_point", "axis_direction", "radius", "height", "start", "end", "inliers", "rmse", "coverage_deg",
    "support", "payoff",
]  # fmt: skip

finite = st.floats(-1e6, 1e6, allow_nan=False)
positive = st.floats(1e-6, 1e6)
fits = st.builds(
    CylinderFit,
    cylinder=st.builds(
        Cylinder,
        point=st.tuples(finite, finite, finite),
        direction=st.sampled_from([(0, 0, 1), (1, -2, 3), (-1, 0, 0), (1e-9, 1, 1)]),
        radius=positive,
        height=st.just(0.0) | positive,
    ),
    inliers=st.integers(0, 10**9).map(np.int64),
    rmse=positive.map(np.float64),
    coverage=st.floats(0, 2 * np.pi),
    support=st.integers(0, 1000),
    payoff=st.floats(0, 1).map(np.float32),
    evidence=st.dictionaries(st.text(min_size=1), st.floats(), max_size=3),
)
matches = st.builds(
    NominalRadius,
    decision=st.sampled_from(["snapped", "ambiguous", "none"]),
    name=st.none() | st.text(min_size=1),
    nominal_radius=positive,
    likelihood_ratio=st.floats(1e-9, 1e9),
    free_radius=positive,
    free_radius_sd=st.just(0.0) | positive,
)
givens = st.sampled_from([(), ("spacing",), ("noise",), ("spacing", "noise")])
listed_fits = st.builds(replace, fits, nominal=matches)
sides = st.sampled_from(["convex", "concave", "unknown"])
sided_fits = st.builds(replace, fits, form=st.just(0.0) | positive.map(np.float64), side=sides)


BY_SCHEMA = jsonschema.Draft202012Validator(result_schema())


@st.composite
def extractions(draw):
    """Anything a pipeline could find out."""
    points = np.array(draw(st.lists(st.tuples(finite, finite, finite), min_size=1, max_size=4)))
    source = Source(draw(st.text(min_size=1).filter(lambda name: "/" not in name)), "ply", "0" * 64)
    return Extraction(
        cylinders=tuple(draw(st.lists(fits | listed_fits, max_size=3))),
        labels=np.full(len(points), -1, np.int32),
        residuals=np.full(len(points), np.nan, np.float32),
        cloud=PointCloud(points, source=source),
        scene=Scene(draw(positive), draw(positive), draw(positive), draw(givens)),
        stages=(StageReport("slicing", draw(st.integers(0, 99)), 0, {"too few points": np.int64(3)}),),
        config=Config(),
        warnings=tuple(draw(st.lists(st.text(), max_size=2))),
        blends=draw(st.none() | st.lists(sided_fits | listed_fits, max_size=2).map(tuple)),
    )


def refuse_constant(name):
    raise AssertionError(f"{name} is not JSON")


@settings(max_examples=40, deadline=None)
@given(extractions())
def test_what_is_written_is_by_the_schema_and_reads_back(extraction):
    result = Result.of(extraction)
    text = result.to_json()
    content = json.loads(text.encode("utf-8", "surrogatepass"), parse_constant=refuse_constant)
    BY_SCHEMA.validate(content)
    assert Result.parse(content, "r.json") == result
    assert Result.parse(content, "r.json").to_json() == text
    assert text.endswith("}\n")


@settings(max_examples=40, deadline=None)
@given(extractions())
def test_keys_come_in_the_order_of_the_contract(extraction):
    content = json.loads(Result.of(extraction).to_json())
    listed = [] if extraction.blends is None else ["blends"]
    assert list(content) == [*KEYS[:-1], *listed, KEYS[-1]]
    assert list(content["input"]) == ["file", "format", "points", "sha256", "bounds"]
    for cylinder in content["cylinders"]:
        assert [key for key in cylinder if key not in {"evidence", "catalogue"}] == CYLINDER_KEYS
        assert cylinder.get("catalogue", {}).get("name", "") is not None


def test_the_numbers_are_those_of_the_extraction(make_extraction):
    cloud = PointCloud.from_array([[0, 0, 0], [np.nan, 0, 0], [2, -1, 4]])
    content = json.loads(Result.of(make_extraction(cloud)).to_json())
    assert content["cylx_version"] == __version__
    bounds = {"min": [0, -1, 0], "max": [2, 0, 4]}
    assert content["input"] == {"file": "<array>", "format": "array", "points": 3, "bounds": bounds}
    assert content["config"] == Config().model_dump(mode="json")
    assert content["scene"] == {"spacing": 0.25, "noise": 0.0}
    assert content["stages"] == [{"name": "slicing", "considered": 40, "kept": 38, "rejected": {"too few points": 2}}]
    assert content["warnings"] == ["made by hand"]
    assert [cylinder["id"] for cylinder in content["cylinders"]] == [0, 1]
    assert content["cylinders"][1] == {
        "id": 1,
        "axis_point": [0, 0, 2],
        "axis_direction": [0, 0, 1],
        "radius": 2,
        "height": 4,
        "start": [0, 0, 0],
        "end": [0, 0, 4],
        "inliers": 23,
        "rmse": 0.25,
        "coverage_deg": 360,
        "support": 3,
        "payoff": 0.5,
        "evidence": {"slope": 0.125},
    }


def test_vectors_have_no_negative_zeros(make_extraction):
    fit = CylinderFit(Cylinder((-0.0, 0, 0), (-1e-300, -0.0, 1), 1.0), 1, 0.0, 1.0, 1, 1.0)
    assert "-0.0" not in json.dumps(ResultCylinder.of(0, fit).model_dump())


def test_evidence_that_is_not_finite_is_left_out():
    fit = CylinderFit(
        Cylinder((0, 0, 0), (0, 0, 1), 1.0), 1, 0.0, 1.0, 1, 1.0, evidence={"a": np.inf, "b": np.nan, "c": 2}
    )
    assert ResultCylinder.of(0, fit).evidence == {"c": 2.0}


@pytest.mark.parametrize(
    ("file", "shown"), [("/some/where/scan.ply", "scan.ply"), ("-", "-"), ("s\udcff.ply", "s\\udcff.ply")]
)
def test_the_file_is_named_without_its_folder(make_extraction, file, shown):
    cloud = PointCloud([[0, 0, 0]], source=Source(file, "ply", "0" * 64))
    content = json.loads(Result.of(make_extraction(cloud)).to_json().encode())
    assert content["input"]["file"] == shown


def test_confidence_and_uncertainty_are_written_once_they_are_known(make_extraction):
    content = Result.of(make_extraction()).to_object()
    uncertainty = {"radius": 0.1, "axis_angle_deg": 0.2, "axis_offset": 0.3, "covariance": np.eye(5).tolist()}
    content["cylinders"][0] |= {"confidence": 0.9, "uncertainty": uncertainty}
    read = Result.parse(content, "r.json").to_object()
    assert read == content
    order = [*CYLINDER_KEYS, "confidence", "uncertainty", "evidence"]
    assert list(read["cylinders"][0]) == order
    assert "confidence" not in read["cylinders"][1]


def test_form_and_side_are_written_once_they_are_measured(make_extraction):
    content = Result.of(make_extraction()).to_object()
    content["cylinders"][0] |= {"form": 0.5, "side": "concave"}
    read = Result.parse(content, "r.json")
    assert (read.cylinders[0].form, read.cylinders[0].side) == (0.5, "concave")
    assert list(read.to_object()["cylinders"][0]) == [*CYLINDER_KEYS, "form", "side", "evidence"]
    assert {"form", "side"}.isdisjoint(read.to_object()["cylinders"][1])


def test_blends_have_a_list_of_their_own_and_numbers_of_their_own(make_extraction):
    content = Result.of(make_extraction(blends=2)).to_object()
    assert list(content)[-3:] == ["cylinders", "blends", "warnings"]
    assert [blend["id"] for blend in content["blends"]] == [0, 1]
    assert list(content["blends"][0]) == CYLINDER_KEYS
    assert [blend["axis_point"] for blend in content["blends"]] == [[3, 0, 2], [5, 0, 2]]
    assert Result.parse(content, "r.json").to_object() == content


@pytest.mark.parametrize(("blends", "there"), [(None, False), (0, True)])
def test_no_blends_and_none_looked_for_are_two_things(make_extraction, blends, there):
    content = Result.of(make_extraction(blends=blends)).to_object()
    assert ("blends" in content) == there
    assert content.get("blends", []) == []
    assert Result.parse(content, "r.json").blends == ([] if there else None)


@pytest.mark.parametrize(
    ("blends", "said"), [(None, "2 cylinders in"), (0, "2 cylinders in"), (1, "2 cylinders and 1 blend in")]
)
def test_blends_are_named_where_there_are_some(make_extraction, blends, said):
    made = make_extraction(blends=blends)
    assert repr(made).startswith(said)
    assert repr(Result.of(made)).startswith(said)


def test_every_key_of_the_schema_has_a_meaning():
    schema = result_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for part in [schema, *schema["$defs"].values()]:
        for key, entry in part.get("properties", {}).items():
            assert "description" in entry, key


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("schema",), "other/1", "r.json: schema: 'other/1' is not one of its values; choose cylx.cylinders/1"),
        (("cylinders", 0, "radius"), -1, "r.json: cylinders.0.radius: -1 is out of range; it must be > 0"),
        (
            ("cylinders", 1, "rmse"),
            "x",
            "r.json: cylinders.1.rmse: 'x' is not a number; write a number such as 0.05",
        ),
        (
            ("cylinders", 0, "axis_point"),
            [0, 0],
            "r.json: cylinders.0.axis_point: [0, 0] is too short; it must have 3 or more entries",
        ),
        (("color",), 1, "r.json: color: unknown key; the keys here are schema, cylx_version"),
        (("input",), None, "r.json: input: null is not a section; write its keys below it, indented"),
        (
            ("cylinders", 0, "side"),
            "left",
            "r.json: cylinders.0.side: 'left' is not one of its values; choose convex or concave or unknown",
        ),
        (("cylinders", 0, "form"), -1, "r.json: cylinders.0.form: -1 is out of range; it must be >= 0"),
        (("cylinders", 0, "radius"), ..., "r.json: cylinders.0.radius: is missing; add it"),
    ],
)
def test_a_fault_is_named(make_extraction, path, value, message):
    content = Result.of(make_extraction()).to_object()
    *parents, key = path
    part = content
    for parent in parents:
        part = part[parent]
    if value is ...:
        del part[key]
    else:
        part[key] = value
    with pytest.raises(InputError) as caught:
        Result.parse(content, "r.json")
    assert str(caught.value).startswith(message)
    assert caught.value.exit_code == 3
