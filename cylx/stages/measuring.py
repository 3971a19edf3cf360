"""Averages -> segments: the visible extent of a cylinder that is not refined, which is how the paper leaves it."""

from __future__ import annotations

import numpy as np

from cylx.geometry.cylinder import DIRECTION, POINT, cylinder_coordinates
from cylx.geometry.extent import visible_extent
from cylx.records import IndexedCloud, Segment

FIRST_REACH = 4.0
"""Points are looked for within so many times half the height or the radius, whichever is more, from the middle."""
INSIDE = 0.95
"""If an end is not within this share of what was looked at, the surface may go on: twice as much is looked at."""
DOUBLINGS = 8
SHELL_RADII, SHELL_NOISES = 0.05, 5.0
"""Half width of the shell about the surface, whichever is more; an average is off by a few hundredths of its radius."""
SHORTEST = 0.2
"""A cylinder has at least this height, in radii."""
MEDIAN_TO_DEVIATION = 1.4826
"""Standard deviation over the median of the absolute residuals, if they are Gaussian."""


def measure_extent(segment: Segment, indexed: IndexedCloud) -> Segment | str:
    """Find the visible extent of a cylinder that is left as the candidates averaged it.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud

    Returns
    -------
    Segment or str
        The same axis and radius with its own middle, height and spread, or why there is none.
    """
    model, radius = segment.model, segment.radius
    reach = max(segment.half, radius) * FIRST_REACH
    # the average is as good as its candidates, so its surface is looked for in a wider shell than a fitted one's
    width = max(SHELL_NOISES * indexed.noise_about(model, segment.half), SHELL_RADII * radius)
    half = max(segment.half, 0.5 * radius)
    low = high = 0.0
    heights = distances = np.empty(0)
    for _ in range(DOUBLINGS):
        near = indexed.cells.near_cylinder(model, -reach, reach, max(0.0, radius - width), radius + width)
        near = near[indexed.may_be_on(near, model)]
        heights, distances, angles = cylinder_coordinates(indexed.points[near], model[POINT], model[DIRECTION])
        found = visible_extent(heights, angles, half, radius)
        if found is None:
            return "too few points"
        low, high = found
        if max(-low, high) < INSIDE * reach:
            break
        reach *= 2.0
    if high - low < SHORTEST * radius:
        return "too short"
    on = (heights >= low) & (heights <= high)
    spread = MEDIAN_TO_DEVIATION * float(np.median(np.abs(distances[on] - radius)))
    moved = np.concatenate([model[POINT] + 0.5 * (low + high) * model[DIRECTION], model[3:]])
    return Segment(moved, 0.5 * (high - low), spread)
