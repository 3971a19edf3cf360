"""Score runs: whether the straights that were found are in one run if they are so in truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from cylx.errors import InputError
from cylx.evaluation.matching import read_id
from cylx.evaluation.rates import rates


@dataclass(frozen=True, slots=True)
class RunScore:
    """Pairs of straights in one run, of all pairs of straights that match straights of true runs.

    Parameters
    ----------
    truth, predicted : int
        Number of runs in the truth and in the result.
    pairs_truth, pairs_predicted, pairs_matched : int
        Pairs that are in one run in the truth, in the result, in both.
    precision, recall, f1 : float
        Of the pairs, in [0, 1]; all 1 if there are none.
    """

    truth: int
    predicted: int
    pairs_truth: int
    pairs_predicted: int
    pairs_matched: int
    precision: float
    recall: float
    f1: float


def score_runs(
    truth: Mapping[str, object], result: Mapping[str, object], true_of: Mapping[int, int]
) -> RunScore | None:
    """Score the runs of a result; None unless both documents list `runs`.

    Parameters
    ----------
    truth, result : mapping
        JSON objects; each of their `runs` has a list `cylinders` of `id`.
    true_of : mapping of int to int
        `id` of the true cylinder by `id` of the one that matches it.

    Raises
    ------
    InputError
        If a list is malformed.
    """
    if "runs" not in truth or "runs" not in result:
        return None
    known, given = _read(truth, "truth"), _read(result, "result")
    in_truth = {cylinder: run for run, cylinders in enumerate(known) for cylinder in cylinders}
    in_result = {cylinder: run for run, cylinders in enumerate(given) for cylinder in cylinders}
    straights = [(in_truth[true], in_result.get(own)) for own, true in true_of.items() if true in in_truth]
    right = _pairs(true for true, _ in straights)
    claimed = _pairs(own for _, own in straights if own is not None)
    both = _pairs(pair for pair in straights if pair[1] is not None)
    return RunScore(len(known), len(given), right, claimed, both, *rates(both, claimed - both, right - both))


def _pairs(groups: Iterable[object]) -> int:
    """Return the number of pairs in one group."""
    return sum(n * (n - 1) // 2 for n in Counter(groups).values())


def _read(document: Mapping[str, object], place: str) -> list[list[int]]:
    """Return the cylinders of each run."""
    entries = document["runs"]
    if not isinstance(entries, list | tuple):
        raise InputError(f"{place}.runs", "is not a list", "give a list of runs, or leave it out")
    found = []
    for index, entry in enumerate(entries):
        here = f"{place}.runs[{index}]"
        if not isinstance(entry, Mapping) or not isinstance(entry.get("cylinders"), list | tuple):
            raise InputError(here, "has no list 'cylinders'", "give each run the ids of its cylinders")
        found.append([read_id(one, f"{here}.cylinders[{k}]") for k, one in enumerate(entry["cylinders"])])
    return found
