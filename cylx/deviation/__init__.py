"""A scan against cylinders that are given: where each is, how large and how round, and where it is dented.

points ─ assign ─> those of each design cylinder ─ fit ─> its cylinder ─ surface ─> cells ─ form ─> Form, patches
"""

from __future__ import annotations

from cylx.deviation.comparison import Comparison, compare_with_design
from cylx.deviation.measure import Deviation, Measured, measure_deviations, shapes_of
from cylx.deviation.verdict import Check, Tolerances, check_deviation, overall

__all__ = [
    "Check",
    "Comparison",
    "Deviation",
    "Measured",
    "Tolerances",
    "check_deviation",
    "compare_with_design",
    "measure_deviations",
    "overall",
    "shapes_of",
]
