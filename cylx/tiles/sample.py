"""Some of the points of a cloud in tiles, with their cylinders: what a page or a picture shows of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import IndexArray, MaskArray
from cylx.records import Extraction, PointCloud, TiledExtraction
from cylx.tiles.label import Labels
from cylx.tiles.survey import hashes

MOST_POINTS = 1 << 20
"""Points of the sample, about: half of it to all."""
LEAST_OF_EACH = 400
"""Points of each cylinder, about: half of it to all, as long as all of these are not more than the others."""


def sampled(extraction: TiledExtraction, labels: Labels) -> Extraction:
    """Return an extraction with some of its points, drawn by the numbers of their rows.

    Parameters
    ----------
    extraction : TiledExtraction
    labels : Labels
        Of all of its points.

    Returns
    -------
    Extraction
        Its spacing is that of the sample. Cylinders of few points have more of them than their share.
    """
    halvings = _halvings(labels.points, MOST_POINTS)
    least = min(LEAST_OF_EACH, MOST_POINTS // max(len(extraction.cylinders), 1))
    # the last one is of points without a cylinder
    of_each = np.array([*(min(halvings, _halvings(fit.inliers, least)) for fit in extraction.cylinders), halvings])
    pieces = []
    for points, rows, ids, residuals in labels.tiles():
        on = _are_drawn(rows, of_each[ids])
        pieces.append((rows[on], points[on], ids[on], residuals[on]))
    rows, points, ids, residuals = (np.concatenate(one) for one in zip(*pieces, strict=True))
    order = np.argsort(rows)
    scale = math.sqrt(labels.points / max(len(rows), 1))
    return Extraction(
        extraction.cylinders,
        ids[order],
        residuals[order],
        PointCloud(points[order], source=replace(extraction.sources[0], selection=extraction.selection)),
        replace(extraction.scene, spacing=extraction.scene.spacing * scale),
        extraction.stages,
        extraction.config,
        extraction.warnings,
        extraction.rejected,
        extraction.blends,
    )


def _halvings(count: int, most: int) -> int:
    """Return how many halvings leave at most so many points, but more than half of them if there are as many."""
    halvings = 0
    while count > most << halvings:
        halvings += 1
    return halvings


def _are_drawn(rows: IndexArray, halvings: NDArray[np.int64]) -> MaskArray:
    """Return which rows are left after so many halvings each."""
    shift = np.uint64(64) - np.maximum(halvings, 1).astype(np.uint64)
    return np.asarray((halvings == 0) | (hashes(rows) >> shift == 0))
