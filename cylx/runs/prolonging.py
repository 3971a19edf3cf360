"""A pipe that was found along a run, as far as its points go: what finds it looks ahead no farther than some radii."""

from __future__ import annotations

import numpy as np

from cylx.runs.pipes import End, Pipe, Surroundings
from cylx.runs.refitting import differs, refit
from cylx.runs.stretches import SHELL, gains

AHEAD, MOST = 14.0, 12
"""How far ahead is looked at a time, in radii, and how often."""
LEAST = 0.5
"""A pipe that would get longer by less, in radii, is as long as it is."""
LONGEST_HOLE = 3.0
"""It ends at a hole of so many radii."""


def prolonged(pipe: Pipe, end: End, near: Surroundings) -> Pipe:
    """Return a pipe with an end where its points end.

    Parameters
    ----------
    pipe : Pipe
    end : {'start', 'end'}
        The one that may be too near.
    near : Surroundings
    """
    for _ in range(MOST):
        more = _length_ahead(pipe, end, near)
        if more < LEAST * pipe.radius:
            break
        longer = pipe.with_end(end, pipe.at(end) + more * pipe.outward(end))
        fitted = refit(longer, near.points[near.on(longer)])
        pipe = longer if fitted is None or differs(fitted, longer) else fitted
    return pipe


def _length_ahead(pipe: Pipe, end: End, near: Surroundings) -> float:
    """Return up to how far ahead of an end the points speak for a pipe, those near it that are off it against it."""
    place, axis, radius = pipe.at(end), pipe.outward(end), pipe.radius
    indices = near.about(place, axis, 0.0, AHEAD * radius, (1.0 + 2.0 * SHELL) * radius)
    indices = indices[near.free(indices, (pipe.label,))]
    if not len(indices):
        return 0.0
    points = near.points[indices]
    _, scores = gains(pipe, points)
    heights = (points - place) @ axis
    counted = scores != 0.0
    order = np.argsort(heights[counted], kind="stable")
    heights, scores = heights[counted][order], scores[counted][order]
    holes = np.flatnonzero(np.diff(np.concatenate([[0.0], heights])) > LONGEST_HOLE * radius)
    total = np.cumsum(scores[: int(holes[0]) if len(holes) else None])
    if not len(total) or total.max() <= 0.0:
        return 0.0
    return float(heights[int(total.argmax())])
