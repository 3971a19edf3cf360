"""Between which heights along its axis the points about a pipe bear it out, and where they speak against it."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.runs.pipes import ON_SURFACE, Pipe

SHELL = 0.3
"""Points within so many radii of the surface, but not on it, say that the pipe is not there."""
HOLE = 12.0
"""Log-likelihood ratio against a pipe, within it, from which it may be two pipes."""


def gains(pipe: Pipe, points: FloatArray, foreign: MaskArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Return heights of points from the middle of a pipe, and the log-likelihood ratio of each for it.

    That is of a point on the surface against one anywhere in the shell about it; 0 for points further away.
    """
    away = points - pipe.middle
    heights = away @ pipe.direction
    square = np.einsum("ij,ij->i", away, away) - heights**2
    errors = np.abs(np.sqrt(np.maximum(square, 0.0)) - pipe.radius)
    shell = max(SHELL * pipe.radius, 2.0 * ON_SURFACE * pipe.spread)
    ratio = math.log(2.0 * shell / (math.sqrt(2.0 * math.pi) * pipe.spread))
    scores = np.where(errors < shell, np.maximum(ratio - 0.5 * (errors / pipe.spread) ** 2, -ratio), 0.0)
    if foreign is not None:
        scores[foreign] = np.minimum(scores[foreign], 0.0)
    return heights, scores


def hole_in(pipe: Pipe, points: FloatArray, foreign: MaskArray) -> tuple[float, float] | None:
    """Return between which heights the points speak most against a pipe, if they do so clearly; None if not."""
    heights, scores = gains(pipe, points, foreign)
    order = np.argsort(heights, kind="stable")
    heights, total = heights[order], np.concatenate([[0.0], np.cumsum(scores[order])])
    highest = np.maximum.accumulate(total)
    last = int(np.argmin(total - highest))
    first = int(np.argmax(total[: last + 1]))
    if last <= first or total[last] - total[first] > -HOLE:
        return None
    return float(heights[first]), float(heights[last - 1])


def stretch(pipe: Pipe, points: FloatArray, foreign: MaskArray | None = None) -> tuple[float, float, float]:
    """Return between which heights from its middle a pipe is borne out by the points about it, and by how much.

    Points on its surface speak for it, those near it against it; the stretch has the largest sum.

    Parameters
    ----------
    pipe : Pipe
    points : ndarray of shape (N, 3)
    foreign : ndarray of shape (N,), bool, optional
        Points of other pipes: they speak against it, but where they are on its surface as well.
    """
    half = 0.5 * pipe.length
    heights, scores = gains(pipe, points, foreign)
    inside = np.abs(heights) <= half
    counted = np.flatnonzero(inside & (scores != 0.0))
    if not len(counted):
        return 0.0, 0.0, 0.0
    order = counted[np.argsort(heights[counted], kind="stable")]
    total = np.concatenate([[0.0], np.cumsum(scores[order])])
    lowest = np.minimum.accumulate(total)
    last = int(np.argmax(total - lowest))
    first = int(np.argmin(total[: last + 1]))
    if last <= first:
        return 0.0, 0.0, 0.0
    low, high = float(heights[order[first]]), float(heights[order[last - 1]])
    # ends that lose nothing stay where they were
    slack = 0.3 * pipe.radius
    gain = float(total[last] - total[first])
    return (-half if low + half < slack else low), (half if half - high < slack else high), gain
