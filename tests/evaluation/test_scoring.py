"""The judge: how it matches cylinders with a truth, and what it counts."""

import importlib.util
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.errors import InputError, UsageError
from cylx.evaluation import compare, evaluate
from tests.support.documents import cylinder, document, random_documents, tilted

ORACLE = Path(__file__).resolve().parents[3] / "shared" / "bench" / "evaluate.py"


def test_the_errors_are_angle_offset_in_radii_and_relative_radius():
    truth = document(cylinder(point=(10, 0, 0), radius=2.0))
    result = document(cylinder(point=(10, 0.2, 7), direction=(0, 0, -3), radius=2.1))
    (pair,) = evaluate(truth, result).pairs
    assert (pair.angle_deg, pair.offset) == (0.0, pytest.approx(0.1))
    assert pair.radius == pytest.approx(0.05)
    (pair,) = evaluate(truth, document(cylinder(point=(10, 0, 0), direction=tilted(3), radius=2.0))).pairs
    assert pair.angle_deg == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("change", "matched"),
    [
        ({"direction": tilted(4.99)}, 1),
        ({"direction": tilted(5.01)}, 0),
        ({"point": (0.249, 0, 0)}, 1),
        ({"point": (0.251, 0, 0)}, 0),
        ({"radius": 1.149}, 1),
        ({"radius": 1.151}, 0),
        ({"radius": 0.851}, 1),
        ({"radius": -1.0}, 0),
        ({"height": 0.0}, 1),
        ({"height": None}, 1),
    ],
)
def test_a_match_needs_all_three_errors_below_their_limits(change, matched):
    assert evaluate(document(cylinder()), document(cylinder(**change))).matched == matched


def test_as_many_as_possible_are_matched_before_the_errors_count():
    truth = document(cylinder(), cylinder(point=(0.2, 0, 0)))
    result = document(cylinder(point=(0.19, 0, 0)), cylinder(point=(0.4, 0, 0)))
    # nearest first would give the second truth the first cylinder, and leave nothing for the first
    assert [(pair.truth_id, pair.result_id) for pair in evaluate(truth, result).pairs] == [(0, 0), (1, 1)]


def test_duplicates_are_false_and_what_may_be_ignored_is_not():
    truth = document(cylinder(), cylinder(point=(10, 0, 0), ignore=True), cylinder(point=(20, 0, 0)))
    result = document(cylinder(point=(0.1, 0, 0)), cylinder(), cylinder(point=(10, 0, 0)), cylinder(point=(30, 0, 0)))
    found = evaluate(truth, result)
    assert (found.truth, found.predicted, found.matched, found.duplicates, found.ignored) == (2, 4, 1, 1, 1)
    assert (found.missed, found.false) == ((2,), (0, 3))
    assert found.pairs[0].result_id == 1
    assert (found.precision, found.recall) == (1 / 3, 1 / 2)
    assert found.f1 == pytest.approx(2 / 5)


def test_the_spread_of_the_errors():
    truth = document(*(cylinder(point=(10 * i, 0, 0)) for i in range(3)))
    result = document(*(cylinder(point=(10 * i + x, 0, 0)) for i, x in enumerate((0.0, 0.01, 0.2))))
    spread = evaluate(truth, result).offset
    assert (spread.median, spread.mean, spread.max) == pytest.approx((0.01, 0.07, 0.2))


@pytest.mark.parametrize(
    ("n_truth", "n_found", "rates"), [(0, 0, (1, 1, 1)), (1, 0, (0, 0, 0)), (0, 1, (0, 0, 0)), (1, 1, (1, 1, 1))]
)
def test_empty_lists(n_truth, n_found, rates):
    found = evaluate(document(*[cylinder()] * n_truth), document(*[cylinder()] * n_found))
    assert (found.precision, found.recall, found.f1) == rates
    assert (found.angle_deg is None) == (found.matched == 0)


def test_what_is_no_cylinder_in_a_result_is_counted_apart():
    result = document(cylinder(radius=math.nan), cylinder(direction=(0, 0, 0)), cylinder(point=(0, math.inf, 0)))
    found = evaluate(document(cylinder()), result)
    assert (found.predicted, found.unusable, found.false) == (0, 3, ())


def test_coordinates_far_away_lose_nothing():
    far = np.array([512345678.0, 5412345432.0, 123400.0])
    truth = document(cylinder(point=far, direction=(1, 1, 1), radius=100.0))
    result = document(cylinder(point=far + [1, -1, 0] + 1000 * np.ones(3), direction=(1, 1, 1), radius=100.0))
    assert evaluate(truth, result).offset.max == pytest.approx(math.sqrt(2) / 100, rel=1e-6)


@pytest.mark.skipif(not (ORACLE.exists() or os.environ.get("CI")), reason="needs ../shared/bench beside the project")
@pytest.mark.parametrize("seed", range(60))
def test_the_judge_agrees_with_the_benchmark(seed):
    spec = importlib.util.spec_from_file_location("benchmark_evaluate", ORACLE)
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    truth, result = random_documents(seed)
    theirs, ours = benchmark.evaluate(truth, result), evaluate(truth, result)
    usable = [entry["id"] for entry in result["cylinders"] if math.isfinite(entry["radius"])]
    assert (ours.truth, ours.predicted, ours.matched) == (theirs["truth"], theirs["predicted"], theirs["matched"])
    assert (ours.duplicates, ours.ignored) == (theirs["duplicates"], theirs["ignored_predictions"])
    assert list(ours.missed) == theirs["missed"]
    assert [(pair.truth_id, pair.result_id) for pair in ours.pairs] == [(i, usable[j]) for i, j in theirs["pairs"]]
    if ours.truth + len(ours.false):  # with nothing to find and nothing found the benchmark says 0, and we say 1
        assert (ours.precision, ours.recall) == (theirs["precision"], theirs["recall"])
        assert ours.f1 == pytest.approx(theirs["f1"])
    if ours.matched:
        assert ours.angle_deg.mean == pytest.approx(theirs["angle_deg_mean"])
        assert ours.offset.median == pytest.approx(theirs["axis_rel_median"])
        assert 100 * ours.radius.mean == pytest.approx(theirs["radius_pct_mean"])


@given(st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_the_order_of_the_lists_does_not_matter(seed):
    truth, result = random_documents(seed)
    rng = np.random.default_rng(seed)
    shuffled = [{"cylinders": list(rng.permutation(np.array(d["cylinders"], dtype=object)))} for d in (truth, result)]
    before, after = evaluate(truth, result), evaluate(*shuffled)
    assert sorted(before.pairs, key=lambda p: p.truth_id) == sorted(after.pairs, key=lambda p: p.truth_id)
    assert sorted(before.false) == sorted(after.false)


@given(st.integers(0, 10**6), st.floats(1e-3, 1e3))
@settings(max_examples=50, deadline=None)
def test_the_unit_of_length_does_not_matter(seed, scale):
    truth, result = random_documents(seed)

    def scaled(entries):
        return document(
            *(
                {**entry, "axis_point": [scale * x for x in entry["axis_point"]], "radius": scale * entry["radius"]}
                for entry in entries["cylinders"]
            )
        )

    before, after = evaluate(truth, result), evaluate(scaled(truth), scaled(result))
    assert (before.matched, before.missed, before.false) == (after.matched, after.missed, after.false)


def test_an_evaluation_is_json():
    found = evaluate(document(cylinder(), cylinder(point=(9, 9, 9))), document(cylinder(radius=1.01)))
    as_json = json.loads(json.dumps(found.to_dict()))
    assert as_json == found.to_dict()
    assert as_json["pairs"][0]["radius"] == pytest.approx(0.01)
    assert as_json["missed"] == [1]


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        ([], "truth: has no list 'cylinders'; give a result of 'cylx extract', or a truth in its form"),
        ({"cylinders": {}}, "truth: has no list 'cylinders'; give a result of 'cylx extract', or a truth in its form"),
        ({"cylinders": [1]}, "truth.cylinders[0]: is not an object; give each cylinder as an object with its keys"),
        (document(cylinder(), {}), "truth.cylinders[1].axis_point: is missing; give three numbers"),
        (
            document(cylinder(point=(1, 2))),
            "truth.cylinders[0].axis_point: is not a list of three numbers; give three numbers",
        ),
        (
            document(cylinder(direction=(0, 0, "1"))),
            "truth.cylinders[0].axis_direction[2]: is not a number: '1'; give a number",
        ),
        (document(cylinder(radius=True)), "truth.cylinders[0].radius: is not a number: True; give a number"),
        (document(cylinder(radius=None)), "truth.cylinders[0].radius: is missing; give a number"),
        (document(cylinder(height="tall")), "truth.cylinders[0].height: is not a number: 'tall'; give a number"),
        (
            document(cylinder(id="a")),
            "truth.cylinders[0].id: is not a whole number: 'a'; give a whole number, or leave it out",
        ),
        (
            document(cylinder(), cylinder(radius=0.0)),
            "truth.cylinders[1]: has no finite axis or no radius > 0; correct its numbers, or leave it out",
        ),
        (
            document(cylinder(point=(math.nan, 0, 0))),
            "truth.cylinders[0]: has no finite axis or no radius > 0; correct its numbers, or leave it out",
        ),
    ],
)
def test_a_malformed_truth_is_refused(truth, message):
    with pytest.raises(InputError) as caught:
        evaluate(truth, document())
    assert str(caught.value) == message
    with pytest.raises(InputError) as caught:
        compare(document(), truth)
    assert str(caught.value) == message.replace("truth", "b", 1)


@pytest.mark.parametrize("limit", ["angle_deg", "offset", "radius"])
def test_a_limit_must_be_positive(limit):
    with pytest.raises(UsageError, match=f"limit {limit}: must be > 0, not 0"):
        evaluate(document(), document(), **{limit: 0.0})
