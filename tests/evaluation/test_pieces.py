"""True cylinders that something interrupts may be found whole or in pieces."""

import pytest

from cylx.errors import InputError
from cylx.evaluation import evaluate
from tests.support.documents import cylinder, document

WHOLE = cylinder(height=20.0, pieces=[[[0, 0, -10], [0, 0, -1]], [[0, 0, 1], [0, 0, 10]]])
LOW, HIGH = (cylinder(point=(0, 0, z), height=9.0) for z in (-5.5, 5.5))


@pytest.mark.parametrize(
    ("found", "counts"),
    [
        ([cylinder(height=20.0)], (1, 0, 0)),
        ([LOW], (1, 0, 0)),
        ([LOW, HIGH], (1, 0, 1)),
        ([LOW, LOW], (1, 1, 0)),
        ([cylinder(height=20.0), HIGH], (1, 1, 0)),
        ([LOW, HIGH, cylinder(point=(0, 0, 20), height=2.0)], (1, 1, 1)),  # there are two pieces only
        ([LOW, cylinder(point=(0, 0, 5.5), height=None)], (1, 1, 0)),
    ],
    ids=["whole", "one piece", "both", "one twice", "whole and a piece", "three", "unknown height"],
)
def test_a_further_piece_is_neither_right_nor_false(found, counts):
    outcome = evaluate(document(WHOLE), document(*found))
    assert (outcome.matched, outcome.duplicates, outcome.ignored) == counts
    assert outcome.recall == 1


LOWER, UPPER = ({**one, "pieces": [[[0, 0, 0], [0, 0, 1]]]} for one in (LOW, HIGH))


@pytest.mark.parametrize(
    ("found", "counts"),
    [
        ([cylinder(height=20.0)], (1, 1, 0)),
        ([LOW, HIGH], (2, 2, 0)),
        ([LOW], (2, 1, 1)),
        ([cylinder(point=(0, 0, -3), height=14.0)], (2, 1, 1)),  # too little of the upper one
        ([cylinder(height=None)], (2, 1, 1)),
    ],
    ids=["through", "both", "one", "hardly through", "unknown height"],
)
def test_one_that_goes_through_two_in_line_misses_none(found, counts):
    outcome = evaluate(document(LOWER, UPPER), document(*found))
    assert (outcome.truth, outcome.matched, len(outcome.missed)) == counts
    assert evaluate(document(LOW, HIGH), document(*found)).truth == 2


def test_without_pieces_a_second_one_is_false():
    outcome = evaluate(document(cylinder(height=20.0)), document(LOW, HIGH))
    assert (outcome.matched, outcome.duplicates, outcome.ignored) == (1, 1, 0)


def test_both_pieces_count_in_runs():
    truth = {**document(WHOLE, cylinder(point=(50, 0, 0))), "runs": [{"cylinders": [0, 1]}]}
    result = {**document(LOW, HIGH, cylinder(point=(50, 0, 0))), "runs": [{"cylinders": [0, 1]}, {"cylinders": [2]}]}
    score = evaluate(truth, result).runs
    assert (score.pairs_truth, score.pairs_predicted, score.pairs_matched) == (3, 1, 1)


def test_pieces_that_are_no_list_are_named():
    with pytest.raises(InputError) as caught:
        evaluate(document(cylinder(pieces=3)), document())
    assert str(caught.value) == (
        "truth.cylinders[0].pieces: is not a list; give a list of pairs of points, or leave it out"
    )


@pytest.mark.parametrize(
    ("middle", "counts"),
    [(11.0, (1, 0, 1)), (4.0, (1, 1, 0)), (30.0, (1, 1, 0))],
    ids=["on the ignored one", "on the other", "on none"],
)
def test_what_is_on_an_ignored_one_in_line_is_no_duplicate(middle, counts):
    known = document(cylinder(height=20.0), cylinder(point=(0, 0, 11), height=2.0, radius=0.95, ignore=True))
    outcome = evaluate(known, document(cylinder(height=20.0), cylinder(point=(0, 0, middle), height=1.0, radius=0.95)))
    assert (outcome.matched, outcome.duplicates, outcome.ignored) == counts
