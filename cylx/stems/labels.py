"""The stem of each point: that between two of whose sections it lies, on the surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cylx.records.stems import Stem
from cylx.stems.columns import Columns

AWAY = 0.25
"""Points this share of the radius from the surface are on a stem, and at least `LEAST_AWAY` metres."""
LEAST_AWAY = 0.02
LONGEST = 1.0
"""Between sections further apart than this, metres, there are no points of the stem."""
BEYOND = 0.2
"""The lowest and the highest section reach this much further, metres."""


def label_stems(stems: Sequence[Stem], columns: Columns) -> NDArray[np.int32]:
    """Return the index of the stem of each point, -1 for none."""
    labels = np.full(len(columns.points), -1, np.int32)
    for k, stem in enumerate(stems):
        centers = np.stack([one.center for one in stem.sections])
        reach = max(one.diameter for one in stem.sections)
        margin = np.array([reach, reach, BEYOND])
        bottom, top = centers.min(axis=0) - margin, centers.max(axis=0) + margin
        indices = columns.within(bottom, top)
        points = columns.points[indices]
        z = centers[:, 2]
        near = (points[:, 2] > bottom[2]) & (points[:, 2] < top[2])
        indices, points = indices[near], points[near]
        x, y = (np.interp(points[:, 2], z, centers[:, d]) for d in (0, 1))
        radius = np.interp(points[:, 2], z, [0.5 * one.diameter for one in stem.sections])
        tilt = stem.direction[2]  # distances across an axis that leans are shorter than level ones
        away = np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) * (0.5 + 0.5 * tilt) - radius)
        place = np.clip(np.searchsorted(z, points[:, 2]), 1, len(z) - 1)
        together = np.diff(z)[place - 1] <= LONGEST
        labels[indices[(away < np.maximum(AWAY * radius, LEAST_AWAY)) & together]] = k
    return labels
