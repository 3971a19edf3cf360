"""The comparison of two results: what is the same, what differs, what is missing."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.errors import InputError, UsageError
from cylx.evaluation import Difference, Tolerances, compare
from tests.support.documents import cylinder, document, random_documents, tilted


def plant():
    return document(
        cylinder(inliers=1000),
        cylinder(point=(0, 0, 8), inliers=400),  # a second piece of the same pipe
        cylinder(point=(20, 3, 1), direction=(1, 2, 3), radius=0.5, inliers=200),
        cylinder(point=(0, 40, 0), direction=(1, 0, 0), radius=0.05, height=0.0, inliers=60),
    )


EXACT = Tolerances(angle_deg=0, offset=0, radius=0, height=0, inliers=0)


def test_a_result_is_the_same_as_itself_in_any_order_without_any_tolerance():
    a = plant()
    turned = {"cylinders": a["cylinders"][::-1]}
    assert compare(a, turned, tolerances=EXACT).same
    assert compare(a, turned).matched == 4
    assert compare(document(), document()).same


def changed(index, **change):
    b = plant()
    b["cylinders"][index] = {**b["cylinders"][index], **change}
    return b


@pytest.mark.parametrize(
    ("b", "kind", "what", "difference", "tolerance"),
    [
        (changed(0, axis_direction=list(tilted(0.2))), "moved", "angle_deg", 0.2, 0.1),
        (changed(0, axis_point=[0.02, 0, 0]), "moved", "offset", 0.02, 0.01),
        (changed(0, axis_point=[0, 0, 0.5]), "moved", "shift", 0.1, 0.05),
        (changed(0, radius=1.01), "resized", "radius", 0.01, 0.005),
        (changed(0, height=3.5), "resized", "height", 0.1, 0.05),
        (changed(0, inliers=900), "recounted", "inliers", 0.1, 0.05),
    ],
)
def test_each_property_has_a_tolerance(b, kind, what, difference, tolerance):
    found = compare(plant(), b)
    assert not found.same
    (only,) = found.differences
    assert (only.kind, only.what, only.id_a, only.id_b, only.tolerance) == (kind, what, 0, 0, tolerance)
    assert only.difference == pytest.approx(difference, rel=1e-9)
    wider = Tolerances(**{{"shift": "height"}.get(what, what): 1.001 * difference})
    assert compare(plant(), b, tolerances=wider).same


def test_values_are_shown_where_each_result_has_its_own():
    (only,) = compare(plant(), changed(0, radius=1.01)).differences
    assert (only.a, only.b) == (1.0, 1.01)


def test_missing_and_extra_cylinders_are_named():
    a, b = plant(), plant()
    lost = b["cylinders"].pop(2)
    b["cylinders"].append(cylinder(point=(-50, 0, 0), radius=3.0, id=9))
    found = compare(a, b)
    assert found.differences == (
        Difference(kind="missing", id_a=lost["id"], id_b=None, what="cylinder", a=0.5),
        Difference(kind="extra", id_a=None, id_b=9, what="cylinder", b=3.0),
    )
    assert (found.cylinders_a, found.cylinders_b, found.matched) == (4, 4, 3)


def test_blends_are_compared_like_cylinders_and_apart_from_them():
    a = {**plant(), "blends": [cylinder(point=(5, 5, 5), id=0), cylinder(point=(9, 9, 9), id=1)]}
    same = compare(a, {**a, "blends": a["blends"][::-1]}, tolerances=EXACT)
    assert (same.same, same.matched, same.blends_a, same.blends_b, same.blends_matched) == (True, 4, 2, 2, 2)
    b = {**plant(), "blends": [{**a["blends"][0], "radius": 1.01}]}
    moved, lost = compare(a, b).differences
    assert (moved.kind, moved.of, moved.what, moved.a, moved.b) == ("resized", "blends", "radius", 1.0, 1.01)
    assert lost == Difference(kind="missing", id_a=1, id_b=None, what="blend", a=1.0, of="blends")
    swapped = compare({"cylinders": a["blends"]}, {"cylinders": [], "blends": a["blends"]})
    assert [one.kind for one in swapped.differences] == ["missing", "missing", "extra", "extra"]


def test_no_list_of_blends_is_an_empty_one():
    for b in ({**plant(), "blends": []}, plant()):
        assert compare(plant(), b, tolerances=EXACT).same
    only = compare(plant(), {**plant(), "blends": [cylinder(point=(5, 5, 5), id=7)]})
    assert [(one.kind, one.id_b, one.of) for one in only.differences] == [("extra", 7, "blends")]


@pytest.mark.parametrize(
    ("blends", "place"), [("x", "b"), ([{}], "b.blends[0].axis_point"), ([cylinder(radius=0)], "b.blends[0]")]
)
def test_a_fault_in_a_blend_is_named(blends, place):
    with pytest.raises(InputError) as failed:
        compare(plant(), {**plant(), "blends": blends})
    assert failed.value.place == place


def test_pieces_of_one_pipe_are_not_taken_for_one_another():
    a, b = plant(), plant()
    del b["cylinders"][0]
    (only,) = compare(a, b).differences
    assert (only.kind, only.id_a) == ("missing", 0)


def test_heights_and_inliers_are_compared_only_where_both_are_known():
    a, b = plant(), plant()
    for entry in b["cylinders"]:
        del entry["height"], entry["inliers"]
    assert compare(document(a["cylinders"][0]), document(b["cylinders"][0])).same


@given(st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_the_comparison_is_symmetric(seed):
    truth, result = random_documents(seed)
    result["cylinders"] = [entry for entry in result["cylinders"] if math.isfinite(entry["radius"])]
    forth, back = compare(truth, result), compare(result, truth)
    assert forth.same == back.same
    assert forth.matched == back.matched
    mirrored = {(d.kind, d.what, d.id_b, d.id_a) for d in back.differences if d.kind in ("moved", "resized")}
    assert mirrored == {(d.kind, d.what, d.id_a, d.id_b) for d in forth.differences if d.kind in ("moved", "resized")}


def test_a_comparison_is_json():
    found = compare(plant(), changed(0, radius=1.01)).to_dict()
    assert json.loads(json.dumps(found)) == found
    assert found["same"] is False
    assert found["differences"][0]["what"] == "radius"


@pytest.mark.parametrize("value", [-0.1, math.nan])
def test_a_tolerance_must_not_be_negative(value):
    with pytest.raises(UsageError, match="tolerance offset: must be >= 0"):
        Tolerances(offset=value)
