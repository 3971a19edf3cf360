"""Whether a prism explains what a cylinder does not: beams are taken for pipes where noise hides their faces."""

from __future__ import annotations

import math

import numpy as np

from cylx.evidence.measures import Shell
from cylx.geometry.arrays import FloatArray, IndexArray

SIDES, PHASES, REFINED, ENOUGH_FOR_PRISM = (4, 5, 6, 8), 16, 4, 1200
"""Sides of the prisms that a surface is compared with, turns of each, how often the step between them is halved about
the best, and points that suffice for it."""
MOST_LEFT, LEAST_SHARE = 2.0, 0.8
"""A surface is a prism if its points deviate from that by no more than this, as mean square in squared deviations, and
if it explains so much: what is rough is more like one of many prisms than like a cylinder, too."""
MIDDLE, ABOUT, CLIPPED, EXPECTED = 0.9, 0.45, 4.0, 1.2
"""It is compared over this share of the height, within so many radii of the surface; residuals count up to so many
deviations; and no more than this is to be expected of a square of noise, some points being others'."""
LEAST_SMALLER, WHITE, LESS_WHITE = 0.2, 1.8, 1.5
"""Where few points lie on a side, what they scatter about their neighbours holds the form of the sides, too. Then a
surface is a prism if its points deviate from that by a mean square so much smaller, without structure (chi-square per
cell up to the second), of which they have this many times as much about the cylinder."""
SECTORS, ROWS = 24, 4
"""Cells about the axis and along it, in which structure is looked for."""


def prism_share(shell: Shell, radius: float, deviation: float) -> float:
    """Return the share of what points deviate from a cylinder that a regular prism explains, corners included.

    The corners of a beam are too far off for the surface of a cylinder in it, and so its residuals do not show them.

    Parameters
    ----------
    shell : Shell
    radius : float
        Frame units.
    deviation : float
        Standard deviation of the surface's own points about it, without its form, frame units.

    Returns
    -------
    float
        In [0, 1]; 0 if the points deviate no more than their noise, or if it is less than `LEAST_SHARE`.
    """
    about = np.flatnonzero((np.abs(shell.heights) < MIDDLE) & (np.abs(shell.residuals) < ABOUT * radius))
    about = about[:: 1 + len(about) // ENOUGH_FOR_PRISM]
    if len(about) == 0:
        return 0.0
    distances, angles = shell.residuals[about] + radius, shell.angles[about]
    scale = max(deviation, 1e-9 * radius)

    def misfit(residuals: FloatArray) -> float:
        return float((np.minimum(np.abs(residuals) / scale, CLIPPED) ** 2).sum())

    round_ = misfit(distances - radius)
    excess = round_ - EXPECTED * len(about)

    def heights_over(sides: int, phase: float) -> FloatArray:
        wide = 2.0 * math.pi / sides
        slant = np.cos((angles - phase) % wide - 0.5 * wide)  # of the distance, to that from the side
        heights = distances * slant
        return np.asarray(heights - np.median(heights))

    def turned(sides: int, phase: float) -> float:
        return misfit(heights_over(sides, phase))

    best, found = round_, (SIDES[0], 0.0)
    for sides in SIDES:
        step = 2.0 * math.pi / sides / PHASES
        least, phase = min((turned(sides, step * k), step * k) for k in range(PHASES))
        for _ in range(REFINED):
            step /= 2.0
            least, phase = min((least, phase), *((turned(sides, near), near) for near in (phase - step, phase + step)))
        if least < best:
            best, found = least, (sides, phase)
    share = min(1.0, max(0.0, (round_ - best) / excess)) if excess > 0.0 else 0.0
    if best <= MOST_LEFT * len(about) and share >= LEAST_SHARE:
        return share
    cells = _cells(angles, shell.heights[about])
    return float(_is_whiter(distances - radius, heights_over(*found), cells, CLIPPED * scale))


def _cells(angles: FloatArray, heights: FloatArray) -> IndexArray:
    """Return the cell of each point about the axis and along it."""
    sector = ((angles / (2.0 * math.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
    row = np.clip(((heights / MIDDLE + 1.0) / 2.0 * ROWS).astype(np.int64), 0, ROWS - 1)
    return np.asarray(sector * ROWS + row)


def _is_whiter(about_cylinder: FloatArray, about_prism: FloatArray, cells: IndexArray, most: float) -> bool:
    """Return whether residuals about a prism are smaller than those about a cylinder and have not their form."""
    near = (np.abs(about_cylinder) < most) & (np.abs(about_prism) < most)
    counts = np.bincount(cells[near], minlength=SECTORS * ROWS)
    full = counts >= 3
    if np.count_nonzero(near) < 5 * SECTORS or np.count_nonzero(full) < SECTORS:
        return False
    variance = float((about_prism[near] ** 2).mean())
    if variance > (1.0 - LEAST_SMALLER) * float((about_cylinder[near] ** 2).mean()) or variance == 0.0:
        return False
    structure = [
        float((np.bincount(cells[near], one[near], minlength=SECTORS * ROWS)[full] ** 2 / counts[full]).mean())
        / variance
        for one in (about_cylinder, about_prism)
    ]
    return structure[1] < WHITE and structure[0] > LESS_WHITE * structure[1]
