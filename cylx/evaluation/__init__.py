"""Evaluation of a result against a truth, and comparison of two results.

Both take JSON objects: any mapping whose `cylinders` have `axis_point`, `axis_direction`, `radius` and, if known,
`id`, `height`, `inliers` and (in a truth) `ignore` and `pieces`. If a truth and a result list `fittings` or `runs`,
these are evaluated, too.
"""

from cylx.evaluation.differences import Difference, Tolerances
from cylx.evaluation.fittings import FittingScores, KindScore
from cylx.evaluation.rates import Spread
from cylx.evaluation.regression import Comparison, compare
from cylx.evaluation.runs import RunScore
from cylx.evaluation.scoring import Evaluation, Match, evaluate

__all__ = [
    "Comparison",
    "Difference",
    "Evaluation",
    "FittingScores",
    "KindScore",
    "Match",
    "RunScore",
    "Spread",
    "Tolerances",
    "compare",
    "evaluate",
]
