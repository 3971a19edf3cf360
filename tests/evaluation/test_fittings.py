"""The judge of fittings: what matches, what is ignored, and how well elbows are measured."""

import copy
import json
import math

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.evaluation import evaluate
from cylx.evaluation.fittings import GOOD_ANGLE_DEG, GOOD_BEND, KINDS
from cylx.synthetic import piping
from tests.support.documents import cylinder, document


def elbow(bend_radius=3.0, angle_deg=90.0, radius=1.0, start=(0, 0, 0), **more):
    """Give an elbow that begins along x and turns towards y."""
    start, turned = np.array(start, dtype=float), math.radians(angle_deg)
    center = start + np.array([0, bend_radius, 0])
    end = center + bend_radius * np.array([math.sin(turned), -math.cos(turned), 0])
    places = {"center": center.tolist(), "start": start.tolist(), "end": end.tolist(), "normal": [0, 0, 1]}
    sizes = {"bend_radius": bend_radius, "angle_deg": angle_deg, "radius": radius}
    return {"kind": "elbow", "joins": [0, 1], **places, **sizes, **more}


def reducer(start_radius=1.0, end_radius=0.5, center=(0, 0, 0), **more):
    ends = {"start_radius": start_radius, "end_radius": end_radius}
    return {"kind": "reducer", "joins": [0, 1], "center": list(center), **ends, **more}


def fitting(kind, center=(0, 0, 0), joins=(0,), **more):
    return {"kind": kind, "joins": list(joins), "center": list(center), **more}


def judged(true, found):
    """Score fittings beside two cylinders of radius 1 and 0.5."""
    pipes = document(cylinder(), cylinder(point=(50, 0, 0), radius=0.5))
    documents = ({**pipes, "fittings": [{"id": i, **one} for i, one in enumerate(given)]} for given in (true, found))
    return evaluate(*documents).fittings


def test_the_truth_is_perfect():
    truth = piping(points=40000, seed=0).truth()
    result = copy.deepcopy(truth)
    for name in ("cylinders", "fittings"):
        result[name] = [one for one in result[name] if not one["ignore"]]
    outcome = evaluate(truth, result)
    assert set(outcome.fittings.kinds) >= {"elbow", "tee", "reducer", "flange", "inline"}
    for score in outcome.fittings.kinds.values():
        assert (score.precision, score.recall, score.f1, score.ignored) == (1, 1, 1, 0)
    assert (outcome.fittings.good_elbows, outcome.fittings.bend_radius.max) == (1, 0)
    assert outcome.runs.precision == outcome.runs.recall == 1
    assert outcome.runs.pairs_truth > 5
    assert json.loads(json.dumps(outcome.to_dict()))["fittings"]["kinds"]["elbow"]["f1"] == 1


@pytest.mark.parametrize("left_out", ["truth", "result", "both"])
def test_without_fittings_or_runs_nothing_changes(left_out):
    full = {**document(cylinder()), "fittings": [fitting("cap")], "runs": [{"cylinders": [0]}]}
    truth, result = (document(cylinder()) if left_out in {name, "both"} else full for name in ("truth", "result"))
    outcome = evaluate(truth, result)
    assert (outcome.fittings, outcome.runs) == (None, None)
    assert outcome.to_dict() == evaluate(document(cylinder()), document(cylinder())).to_dict()
    assert not {"fittings", "runs"} & set(outcome.to_dict())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("away", "matched"), [(0.99, 1), (1.01, 0)])
def test_the_place_is_within_the_largest_radius(kind, away, matched):
    make = {"elbow": lambda place: elbow(start=place), "reducer": lambda place: reducer(center=place)}.get(
        kind, lambda place: fitting(kind, place, joins=(1, 0))
    )
    score = judged([make((0, 0, 0))], [make((0, 0, away))]).kinds[kind]
    assert (score.truth, score.predicted, score.matched) == (1, 1, matched)
    assert (score.missed, score.false) == (((), ()) if matched else ((0,), (0,)))


def test_what_is_of_another_kind_does_not_match():
    kinds = judged([fitting("tee", joins=(0, 1))], [fitting("cross", joins=(0, 1))]).kinds
    assert (kinds["tee"].recall, kinds["cross"].precision) == (0, 0)


@pytest.mark.parametrize(("error", "matched"), [(1.14, 1), (1.16, 0), (0.86, 1), (0.84, 0)])
def test_radii_agree_within_their_limit(error, matched):
    assert judged([elbow()], [elbow(radius=error)]).kinds["elbow"].matched == matched
    assert judged([reducer()], [reducer(end_radius=0.5 * error)]).kinds["reducer"].matched == matched


def test_a_reducer_has_no_first_end():
    assert judged([reducer()], [reducer(0.5, 1.0)]).kinds["reducer"].matched == 1


@pytest.mark.parametrize(
    ("bend", "angle", "good"),
    [
        (1 + 0.99 * GOOD_BEND, 0.99 * GOOD_ANGLE_DEG, 1),
        (1 + 1.01 * GOOD_BEND, 0.0, 0),
        (1 - 1.01 * GOOD_BEND, 0.0, 0),
        (1.0, 1.01 * GOOD_ANGLE_DEG, 0),
        (1.0, -1.01 * GOOD_ANGLE_DEG, 0),
    ],
)
def test_elbows_are_well_measured_within_both_limits(bend, angle, good):
    scores = judged([elbow()], [elbow(3.0 * bend, 90 + angle)])
    assert scores.kinds["elbow"].matched == 1
    assert scores.good_elbows == good
    assert (scores.bend_radius.max, scores.angle_deg.max) == pytest.approx((abs(bend - 1), abs(angle)))


def test_a_long_bend_is_where_its_arc_is_and_not_where_its_centre_is():
    # half the bend radius: the centres are 5 pipe radii apart, the middles of the arcs 0.38 with a turn of 45 degrees
    scores = judged([elbow(10.0, 45.0)], [elbow(5.0, 45.0, start=(10 - 5, 0, 0) * np.array(math.tan(math.pi / 8)))])
    assert scores.kinds["elbow"].matched == 1
    assert scores.bend_radius.max == pytest.approx(0.5)


def test_ends_say_where_the_middle_is():
    ends = {"kind": "inline", "joins": [0], "start": [0, 0, -3], "end": [0, 0, 3.5]}
    assert judged([fitting("inline")], [ends]).kinds["inline"].matched == 1
    assert judged([fitting("inline", (0, 0, 2))], [ends]).kinds["inline"].matched == 0


def test_a_mitre_is_an_elbow_without_a_bend():
    corner = {"center": [0.5, 0, 0], "start": [0.5, 0, 0], "end": [0.5, 0, 0]}
    scores = judged([elbow(0.5)], [elbow(0.0, **corner)])
    assert (scores.kinds["elbow"].matched, scores.bend_radius.max, scores.good_elbows) == (1, 1, 0)


def test_a_half_turn_has_a_middle_by_its_normal():
    assert judged([elbow(angle_deg=180.0)], [elbow(angle_deg=179.9)]).good_elbows == 1
    assert judged([elbow(angle_deg=180.0)], [elbow(angle_deg=180.0, normal=[0, 0, -1])]).kinds["elbow"].matched == 0


def test_a_second_one_is_false_and_the_nearest_is_matched():
    score = judged([fitting("cap")], [fitting("cap", (0.5, 0, 0)), fitting("cap", (0.1, 0, 0))]).kinds["cap"]
    assert (score.matched, score.false) == (1, (0,))


def test_what_need_not_be_found_is_ignored_whatever_it_is_taken_for():
    true = [fitting("inline"), fitting("flange", (5, 0, 0), ignore=True), elbow(start=(9, 0, 0), ignore=True)]
    found = [
        fitting("inline"),
        fitting("flange", (5, 0, 0.5)),
        fitting("joint", (5, 0, 0)),
        fitting("flange", (6.5, 0, 0)),
    ]
    kinds = judged(true, found).kinds
    assert "elbow" not in kinds
    flange = kinds["flange"]
    assert (flange.truth, flange.predicted, flange.ignored, flange.false) == (0, 2, 1, (3,))
    assert (kinds["joint"].ignored, kinds["joint"].precision, kinds["inline"].f1) == (1, 1, 1)


def test_what_is_between_the_ends_of_one_that_need_not_be_found_is_ignored():
    chord = {"kind": "joint", "joins": [0, 1], "start": [0, 0, 0], "end": [10, 10, 0]}  # 2.9 from the middle of the arc
    assert judged([elbow(10.0, ignore=True)], [chord]).kinds["joint"].ignored == 1
    assert judged([elbow(10.0)], [chord]).kinds["joint"].ignored == 0


def test_numbers_that_are_none_match_nothing():
    found = [elbow(center=[math.nan, 0, 0]), elbow(radius=math.nan), fitting("cap", (math.inf, 0, 0))]
    kinds = judged([elbow(), fitting("cap")], found).kinds
    assert (kinds["elbow"].matched, kinds["elbow"].predicted, kinds["cap"].matched) == (0, 2, 0)
    scores = judged([elbow()], [elbow(bend_radius=3.0, angle_deg=math.nan, end=[3, 3, 0])])
    assert (scores.kinds["elbow"].matched, scores.angle_deg) == (0, None)


def test_empty_lists():
    scores = judged([], [])
    assert (scores.kinds, scores.good_elbows, scores.bend_radius) == ({}, None, None)
    assert judged([], [fitting("cap")]).kinds["cap"].precision == 0
    assert judged([fitting("cap")], []).kinds["cap"].recall == 0


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (7, "truth.fittings: is not a list; give a list of fittings, or leave it out"),
        ([3], "truth.fittings[0]: is not an object; give each fitting as an object with its keys"),
        (
            [{"kind": "knee"}],
            f"truth.fittings[0].kind: is not a kind of fitting: 'knee'; give one of {', '.join(KINDS)}",
        ),
        ([{"kind": "cap"}], "truth.fittings[0].center: is missing; give three numbers"),
        ([fitting("elbow")], "truth.fittings[0].bend_radius: is missing; give a number"),
        (
            [fitting("elbow", bend_radius=1, angle_deg=1, radius=1)],
            "truth.fittings[0].start: is missing; give three numbers",
        ),
        ([fitting("reducer")], "truth.fittings[0].start_radius: is missing; give a number"),
        (
            [fitting("cap", joins=[9])],
            "truth.fittings[0].joins: names no cylinder of the truth; list the ids of those it joins",
        ),
        (
            [fitting("cap", (math.nan, 0, 0))],
            "truth.fittings[0]: has no finite place or no sizes > 0; correct its numbers, or leave it out",
        ),
        (
            [elbow(0.0)],
            "truth.fittings[0]: has no finite place or no sizes > 0; correct its numbers, or leave it out",
        ),
        (
            [fitting("cap", id="a")],
            "truth.fittings[0].id: is not a whole number: 'a'; give a whole number, or leave it out",
        ),
    ],
)
def test_a_malformed_truth_is_named(entries, message):
    truth, result = ({**document(cylinder()), "fittings": given} for given in (entries, []))
    with pytest.raises(InputError) as caught:
        evaluate(truth, result)
    assert str(caught.value) == message
