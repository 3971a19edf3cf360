"""What was not accepted: the reason, the evidence, the order; and the JSON of it."""

import json
from collections import Counter

import jsonschema
import numpy as np
import pytest

from cylx import __version__
from cylx.config import load_config
from cylx.geometry.cylinder import cylinder_coordinates, surface_distances
from cylx.pipeline import extract_cylinders
from cylx.records import PointCloud
from cylx.results import Rejections, Result, rejections_schema, result_schema
from cylx.synthetic import multi

SAME_AGAIN = {"found before", "joined"}


def run(points, *overrides, **settings):
    return extract_cylinders(PointCloud.from_array(points), load_config(overrides=overrides), **settings)


@pytest.fixture(scope="module")
def room():
    return multi(points=10000, cylinders=3, planes=1, boxes=1, spheres=1, cones=1, seed=2)


@pytest.fixture(scope="module")
def found(room):
    return run(room.points)


def test_all_that_was_refused_is_told_of_but_what_is_the_same_again(found):
    counted = Counter()
    for stage in found.stages:
        if stage.name in {"verification", "merging"}:
            counted.update({reason: count for reason, count in stage.rejected.items() if reason not in SAME_AGAIN})
    assert Counter(rejection.reason for rejection in found.rejected) == counted
    assert len(counted) >= 2


def test_the_likeliest_come_first_and_what_was_not_measured_last(found):
    fits = [rejection.fit for rejection in found.rejected]
    keys = [(fit.confidence is None, -(fit.confidence or 0), -fit.inliers) for fit in fits]
    assert keys == sorted(keys)
    assert {fit.confidence is None for fit in fits} == {True, False}
    evidence = set(found.cylinders[0].evidence)
    for fit in fits:
        assert set(fit.evidence) == (set() if fit.confidence is None else evidence)


def test_the_numbers_are_those_of_the_points_on_the_surface(room, found):
    for fit in (rejection.fit for rejection in found.rejected):
        shape = fit.cylinder
        distances = np.abs(surface_distances(room.points, shape))
        heights, _, _ = cylinder_coordinates(room.points, shape.point, shape.direction)
        # what is part of something flat is not its own
        about = distances[np.abs(heights) <= 0.5 * shape.height + 1e-9]
        # a surface may be noisier than usual, four times at most
        assert fit.inliers <= (about < 24 * found.scene.noise).sum()
        assert fit.rmse < 24 * found.scene.noise
        assert 0 <= fit.coverage <= 2 * np.pi
        assert fit.support >= 1


def test_what_is_found_is_refused_under_stricter_limits(room, found):
    none = run(room.points, "verification.min_height=50", "averaging.merge=false")
    assert none.cylinders == ()
    for fit in found.cylinders:
        (same, *_) = (
            rejection
            for rejection in none.rejected
            if np.linalg.norm(rejection.fit.cylinder.point - fit.cylinder.point) < 0.1 * fit.cylinder.radius
        )
        assert same.fit.cylinder.radius == pytest.approx(fit.cylinder.radius, rel=0.01)
        assert same.fit.confidence > 0.9
        assert same.reason
    few = run(room.points, "verification.min_inliers=1000000")
    assert {rejection.reason for rejection in few.rejected if rejection.fit.confidence} == {"too few points"}


@pytest.mark.parametrize("most", [1, 2])
def test_what_is_beyond_the_number_asked_for_is_told_of(room, found, most):
    other = run(room.points, f"max_cylinders={most}")
    beyond = [rejection.fit for rejection in other.rejected if rejection.reason == "beyond max_cylinders"]
    expected = [value for fit in found.cylinders[most:] for value in (fit.cylinder.radius, fit.confidence)]
    assert [value for fit in beyond for value in (fit.cylinder.radius, fit.confidence)] == pytest.approx(expected)


def test_the_same_is_refused_on_any_number_of_threads_and_in_any_unit(room, found):
    text = Rejections.of(found).to_json()
    assert Rejections.of(run(room.points, threads=3)).to_json() == text
    other = run(1000.0 * room.points).rejected
    # what nothing speaks for may turn on the last digit
    one_by_one = [
        [one for one in rejected if (one.fit.confidence or 0.0) >= 0.1] for rejected in (found.rejected, other)
    ]
    assert [one.reason for one in one_by_one[1]] == [one.reason for one in one_by_one[0]]
    for one, two in zip(*one_by_one, strict=True):
        assert two.fit.cylinder.radius == pytest.approx(1000.0 * one.fit.cylinder.radius, rel=1e-4)
        assert two.fit.rmse == pytest.approx(1000.0 * one.fit.rmse, rel=1e-2)


def test_without_verification_nothing_has_a_confidence(room):
    off = run(room.points, "verification.enabled=false", "max_cylinders=1")
    assert len(off.rejected) > 0
    assert {rejection.fit.confidence for rejection in off.rejected} == {None}


# the JSON


def test_the_file_is_by_its_schema(found):
    text = Rejections.of(found).to_json()
    content = json.loads(text)
    jsonschema.validate(content, rejections_schema())
    assert list(content) == ["schema", "cylx_version", "input", "config", "rejected"]
    assert (content["schema"], content["cylx_version"]) == ("cylx.rejected/1", __version__)
    result = Result.of(found).to_object()
    assert (content["input"], content["config"]) == (result["input"], result["config"])
    assert len(content["rejected"]) == len(found.rejected)
    assert text.endswith("}\n")


def test_the_keys_are_those_of_a_cylinder_but_for_the_reason(found):
    rejected, cylinder = (Model.of(found).to_object() for Model in (Rejections, Result))
    first, last = rejected["rejected"][0], rejected["rejected"][-1]
    assert list(first) == [
        "reason",
        *(key for key in cylinder["cylinders"][0] if key not in {"id", "side", "uncertainty"}),
    ]
    assert list(last) == [key for key in first if key not in {"confidence", "form", "evidence"}]


def test_nothing_refused_is_an_empty_list(make_extraction):
    assert Rejections.of(make_extraction(rejected=0)).to_object()["rejected"] == []


def test_the_numbers_are_those_of_the_extraction(make_extraction):
    (rejected,) = Rejections.of(make_extraction()).to_object()["rejected"]
    assert rejected == {
        "reason": "agreement",
        "axis_point": [1, 0, 0],
        "axis_direction": [0, 1, 0],
        "radius": 0.5,
        "height": 1,
        "start": [1, -0.5, 0],
        "end": [1, 0.5, 0],
        "inliers": 7,
        "rmse": 0.125,
        "coverage_deg": 180,
        "support": 3,
        "payoff": 0.5,
    }


def test_every_key_of_the_schema_has_a_meaning():
    schema = rejections_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for part in [schema, *schema["$defs"].values()]:
        for key, entry in part.get("properties", {}).items():
            assert "description" in entry, key
    assert schema["$defs"]["Input"] == result_schema()["$defs"]["Input"]
