"""Differences of fittings and runs: which are there, how they lie, and what they join."""

import pytest

from cylx.errors import InputError
from cylx.evaluation import compare

ELBOW = {
    "id": 0,
    "kind": "elbow",
    "center": [0.0, 0.0, 0.0],
    "start": [1.0, 0.0, 0.0],
    "end": [0.0, 1.0, 0.0],
    "bend_radius": 1.0,
    "radius": 0.3,
    "angle_deg": 90.0,
}


def cylinder(number):
    shape = {"axis_point": [10 * number, 0, 0], "axis_direction": [0, 0, 1], "radius": 1, "height": 4, "inliers": 9}
    return {"id": number, **shape}


def result(fittings=(), runs=()):
    listed = [{"id": i, "cylinders": members, "length": 4.0 * len(members)} for i, members in enumerate(runs)]
    return {"cylinders": [cylinder(i) for i in range(3)], "fittings": list(fittings), "runs": listed}


def told(a, b):
    return [(one.kind, one.of, one.what, one.id_a, one.id_b) for one in compare(a, b).differences]


def test_the_same_is_the_same_in_any_order():
    tee = {"id": 1, "kind": "tee", "center": [5.0, 0.0, 0.0], "angle_deg": 90.0}
    a, b = result([ELBOW, tee], [[0, 1], [2]]), result([dict(tee, id=0), dict(ELBOW, id=1)], [[2], [1, 0]])
    assert told(a, b) == []
    assert compare(a, b).to_dict()["fittings_matched"] == 2


def test_results_without_runs_are_compared_as_before():
    plain = {"cylinders": [cylinder(0)]}
    assert "fittings_a" not in compare(plain, plain).to_dict()


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        ({"bend_radius": 1.2}, ("resized", "fittings", "bend_radius", 0, 0)),
        ({"angle_deg": 88.0}, ("moved", "fittings", "angle_deg", 0, 0)),
        ({"center": [0.2, 0.0, 0.0]}, ("moved", "fittings", "center", 0, 0)),
    ],
)
def test_what_changed_of_a_fitting_is_told(change, difference):
    assert told(result([ELBOW]), result([ELBOW | change])) == [difference]


def test_a_fitting_elsewhere_is_another_one():
    far = ELBOW | {"center": [9.0, 0.0, 0.0]}
    assert told(result([ELBOW]), result([far])) == [
        ("missing", "fittings", "elbow", 0, None),
        ("extra", "fittings", "elbow", None, 0),
    ]


def test_runs_that_part_and_join_are_told():
    together, apart = result(runs=[[0, 1], [2]]), result(runs=[[0], [1], [2]])
    assert told(together, apart) == [("parted", "runs", "run", 0, 1)]
    assert told(apart, together) == [("joined", "runs", "run", 1, 0)]


def test_a_run_of_another_length_is_told():
    longer = result(runs=[[0, 1]])
    longer["runs"][0]["length"] = 9.0
    assert told(result(runs=[[0, 1]]), longer) == [("resized", "runs", "length", 0, 0)]


@pytest.mark.parametrize("key", ["fittings", "runs"])
def test_a_list_that_is_none_is_refused(key):
    with pytest.raises(InputError, match=f"b.{key}"):
        compare(result(), result() | {key: 3})
