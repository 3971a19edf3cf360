"""Evaluation of a result against a truth, and comparison of two results.

Both take JSON objects: any mapping whose `cylinders` have `axis_point`, `axis_direction`, `radius` and, if known,
`id`, `height`, `inliers` and (in a truth) `ignore`.
"""

from cylx.evaluation.regression import Comparison, Difference, Tolerances, compare
from cylx.evaluation.scoring import Evaluation, Match, Spread, evaluate

__all__ = ["Comparison", "Difference", "Evaluation", "Match", "Spread", "Tolerances", "compare", "evaluate"]
