"""How right a result is, and whether two results are the same cylinders.

Both questions are asked of JSON objects: any mapping whose `cylinders` have `axis_point`, `axis_direction`, `radius`
and, where they are known, `id`, `height`, `inliers` and (in a truth) `ignore`.
"""

from cylx.evaluation.regression import Comparison, Difference, Tolerances, compare
from cylx.evaluation.scoring import Evaluation, Match, Spread, evaluate

__all__ = ["Comparison", "Difference", "Evaluation", "Match", "Spread", "Tolerances", "compare", "evaluate"]
