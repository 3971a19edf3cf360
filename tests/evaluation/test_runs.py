"""The judge of runs: pairs of straights that are together."""

import pytest

from cylx.errors import InputError
from cylx.evaluation import evaluate
from tests.support.documents import cylinder, document


def judged(true_runs, found_runs, found=range(6), n=6):
    """Score runs over cylinders 10 apart; `found` says which of the true ones the result has, with ids from 100."""
    truth = document(*(cylinder(point=(10 * i, 0, 0)) for i in range(n)))
    result = document(*(cylinder(point=(10 * i, 0, 0)) for i in found))
    for i, entry in enumerate(result["cylinders"]):
        entry["id"] = 100 + i
    truth["runs"], result["runs"] = ([{"cylinders": run} for run in runs] for runs in (true_runs, found_runs))
    return evaluate(truth, result).runs


def test_pairs_that_are_together_count():
    score = judged([[0, 1, 2], [3, 4]], [[100, 101], [102, 103, 104], [105]])
    assert (score.truth, score.predicted) == (2, 3)
    assert (score.pairs_truth, score.pairs_predicted, score.pairs_matched) == (4, 4, 2)  # 105 is in no true run
    assert (score.precision, score.recall, score.f1) == (0.5, 0.5, 0.5)


def test_straights_that_were_not_found_count_neither_way():
    score = judged([[0, 1, 2], [3, 4, 5]], [[100, 101], [102, 103]], found=[0, 2, 3, 5])
    assert (score.pairs_truth, score.pairs_predicted, score.precision, score.recall) == (2, 2, 1, 1)


def test_a_straight_in_no_run_is_alone():
    score = judged([[0, 1]], [], found=[0, 1])
    assert (score.pairs_truth, score.pairs_predicted, score.recall) == (1, 0, 0)


def test_without_pairs_nothing_is_wrong():
    score = judged([[0], [1]], [[100], [101]], found=[0, 1])
    assert (score.precision, score.recall, score.f1) == (1, 1, 1)


@pytest.mark.parametrize(
    ("runs", "message"),
    [
        ("none", "truth.runs: is not a list; give a list of runs, or leave it out"),
        ([3], "truth.runs[0]: has no list 'cylinders'; give each run the ids of its cylinders"),
        ([{"id": 1}], "truth.runs[0]: has no list 'cylinders'; give each run the ids of its cylinders"),
        (
            [{"cylinders": [0, "b"]}],
            "truth.runs[0].cylinders[1]: is not a whole number: 'b'; give a whole number, or leave it out",
        ),
    ],
)
def test_a_malformed_truth_is_named(runs, message):
    with pytest.raises(InputError) as caught:
        evaluate({**document(cylinder()), "runs": runs}, {**document(cylinder()), "runs": []})
    assert str(caught.value) == message
