"""Precision, recall and F1 from counts, and the spread of an error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Spread:
    """The median, mean and maximum of an error over the matches."""

    median: float
    mean: float
    max: float


def rates(matched: int, false: int, missed: int) -> tuple[float, float, float]:
    """Return precision, recall and F1, each in [0, 1]; all 1 if there is nothing to find and nothing was found."""
    if not matched + false + missed:
        return 1.0, 1.0, 1.0
    precision = matched / (matched + false) if matched + false else 0.0
    recall = matched / (matched + missed) if matched + missed else 0.0
    return precision, recall, 2 * matched / (2 * matched + false + missed)


def spread_of(values: Sequence[float]) -> Spread | None:
    """Return the spread of errors, None without any."""
    return Spread(float(np.median(values)), float(np.mean(values)), max(values)) if values else None
