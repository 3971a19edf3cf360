"""Whether a prism explains what a cylinder does not: beams are taken for pipes where noise hides their faces."""

from __future__ import annotations

import math

import numpy as np

from cylx.evidence.measures import Shell
from cylx.geometry.arrays import FloatArray

SIDES, PHASES, REFINED, ENOUGH_FOR_PRISM = (4, 5, 6, 8), 16, 4, 1200
"""Sides of the prisms that a surface is compared with, turns of each, how often the step between them is halved about
the best, and points that suffice for it."""
MOST_LEFT, LEAST_SHARE = 2.0, 0.8
"""A surface is a prism if its points deviate from that by no more than this, as mean square in squared deviations, and
if it explains so much: what is rough is more like one of many prisms than like a cylinder, too."""
MIDDLE, ABOUT, CLIPPED, EXPECTED = 0.9, 0.45, 4.0, 1.2
"""It is compared over this share of the height, within so many radii of the surface; residuals count up to so many
deviations; and no more than this is to be expected of a square of noise, some points being others'."""


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
    if excess <= 0.0:
        return 0.0

    def turned(phase: float, wide: float) -> float:
        slant = np.cos((angles - phase) % wide - 0.5 * wide)  # of the distance, to that from the side
        heights = distances * slant
        return misfit(heights - np.median(heights))

    best = round_
    for sides in SIDES:
        wide = 2.0 * math.pi / sides
        step = wide / PHASES
        least, phase = min((turned(step * k, wide), step * k) for k in range(PHASES))
        for _ in range(REFINED):
            step /= 2.0
            least, phase = min((least, phase), *((turned(near, wide), near) for near in (phase - step, phase + step)))
        best = min(best, least)
    share = min(1.0, max(0.0, (round_ - best) / excess))
    return share if best <= MOST_LEFT * len(about) and share >= LEAST_SHARE else 0.0
