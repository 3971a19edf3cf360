"""Findings -> walls about the axes that are known: steps, counterbores, flanges, the other side of a tube.

What is turned or drilled has many walls about one axis. The window of a short one sees the plane it stands on and the
wall beside it, and shows no curvature; but seen about an axis that is known, its points all have one distance.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import POINT, RADIUS, coordinates_of
from cylx.geometry.kernels import njit
from cylx.records import Finding, IndexedCloud, Segment

OUT_RADII, ALONG_RADII = 4.0, 3.0
"""Walls are looked for up to so many radii from the axis, and so many beyond the ends."""
WIDTH, LEAST_WIDTH = 2.5, 0.05
"""Half the thickness of a wall, in deviations of the noise and of the axis; it is never less, in spacings."""
MOST_WIDTH = 0.25
"""An axis that is known no better than this, in radii over that thickness, tells nothing."""
HEIGHT = 1.5
"""Points this far above and below a place, in spacings, speak for a wall there."""
LEAST_ON, TIMES = 15, 3.0
"""Points that make a wall, and how many times denser they are than those beside it."""
SECTORS, CLOSED = 24, 0.6
"""Sectors about the axis, and the share of those that so many points would fill."""
MOST_WALLS = 6
"""Walls that are proposed about one axis."""
MOST_POINTS, MOST_PLACES = 30000, 3000
"""Points about an axis that suffice, and places where a wall is looked for."""
ENDED = 0.3
"""A wall ends where its density falls below this share."""
HELD_DEVIATION = math.radians(0.5)
"""Standard deviation of the tilt of an axis that was held to the normal of a plane."""


def walls_about(finding: Finding, indexed: IndexedCloud, free: MaskArray) -> list[Segment]:
    """Propose further walls about the axis of a cylinder.

    Parameters
    ----------
    finding : Finding
        A cylinder whose axis is known.
    indexed : IndexedCloud
    free : ndarray of shape (N,), bool
        Points that no cylinder has explained.

    Returns
    -------
    list of Segment
        Not fitted; the walls that most speaks for come first.
    """
    segment = finding.segment
    tilt = HELD_DEVIATION if segment.upright else finding.tilt_error
    noise = indexed.noise_about(segment.model, segment.half)
    width = WIDTH * max(math.hypot(noise, finding.offset_error + tilt * segment.half), LEAST_WIDTH)
    if width > MOST_WIDTH * segment.radius:
        return []
    reach = segment.half + ALONG_RADII * segment.radius
    near = indexed.cells.near_cylinder(segment.model, -reach, reach, 0.0, OUT_RADII * segment.radius)
    near = near[free[near]]
    near = near[:: 1 + len(near) // MOST_POINTS]
    if len(near) < LEAST_ON:
        return []
    heights, residuals, angles = coordinates_of(indexed.points, near, segment.model)
    order = np.argsort(heights, kind="stable")
    heights, distances, angles = heights[order], residuals[order] + segment.radius, angles[order]
    places = np.arange(0, len(near), 1 + len(near) // MOST_PLACES)
    places = np.ascontiguousarray(places[distances[places] > 2.0 * width])
    counts = np.zeros((len(places), 3), np.int64)
    sectors = ((angles / (2.0 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
    _count(heights, distances, sectors, places, width, counts)
    return _best_walls(segment, heights, distances, places, counts, width)


def _best_walls(
    segment: Segment,
    heights: FloatArray,
    distances: FloatArray,
    places: IndexArray,
    counts: IndexArray,
    width: float,
) -> list[Segment]:
    """Return the walls through the places that most points speak for, each once."""
    on, beside, filled = counts.T
    seen = CLOSED * SECTORS * (1.0 - np.exp(-on / SECTORS))
    good = (on >= LEAST_ON) & (on > 0.5 * TIMES * beside) & (filled >= seen)
    places, gain = places[good], (on - 0.5 * beside)[good]
    walls: list[Segment] = []
    while len(places) and len(walls) < MOST_WALLS:
        best = places[int(np.argmax(gain))]
        alike = np.abs(distances - distances[best]) < width
        distance = float(np.median(distances[alike & (np.abs(heights - heights[best]) < HEIGHT)]))
        low, high = _ends_about(heights[np.abs(distances - distance) < width], heights[best])
        model = segment.model.copy()
        model[POINT] += 0.5 * (low + high) * segment.direction
        model[RADIUS] = distance
        walls.append(Segment(model, 0.5 * (high - low), width / WIDTH))
        inside = (heights[places] > low - HEIGHT) & (heights[places] < high + HEIGHT)
        left = ~(inside & (np.abs(distances[places] - distance) < 2.0 * width))
        left &= places != best
        places, gain = places[left], gain[left]
    return walls


def _ends_about(heights: FloatArray, height: float) -> tuple[float, float]:
    """Return how far points go on below and above a height as densely as about it, in slices of a spacing."""
    slices = np.floor(heights - height + 0.5).astype(np.int64)
    low, high = int(min(slices.min(), -1)), int(max(slices.max(), 1))
    counts = np.bincount(slices - low, minlength=high - low + 1)
    least = ENDED * float(counts[-low - 1 : -low + 2].max())
    ends = []
    for step, most in ((-1, -low), (1, high)):
        at = 0
        while at < most and counts[step * (at + 1) - low] > least:
            at += 1
        ends.append(step * (at + 0.5))
    return height + ends[0], height + ends[1]


@njit(cache=True, nogil=True)
def _count(
    heights: FloatArray,
    distances: FloatArray,
    sectors: IndexArray,
    places: IndexArray,
    width: float,
    counts: IndexArray,
) -> None:
    """Count the points on the wall through each place, those beside it, and the sectors that the former fill."""
    first = 0
    for s in range(len(places)):
        i = places[s]
        while heights[first] < heights[i] - HEIGHT:
            first += 1
        mask, j = 0, first
        while j < len(heights) and heights[j] <= heights[i] + HEIGHT:
            off = abs(distances[j] - distances[i])
            if off < width:
                counts[s, 0] += 1
                mask |= 1 << sectors[j]
            elif off < 3.0 * width:
                counts[s, 1] += 1
            j += 1
        while mask:
            counts[s, 2] += mask & 1
            mask >>= 1
