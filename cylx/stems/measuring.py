"""An axis -> a stem: its diameter at breast height, its form, and how far it can be believed."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records.stems import Ground, Stem, StemSection
from cylx.stems.columns import Columns
from cylx.stems.following import Section, Stretch, is_stem

BREAST_HEIGHT = 1.3
BREAST_HALF = 0.4
"""Half the height of the section at breast height, metres."""
GROUND_SD = 0.05
"""Standard deviation of the height of the ground, and so of the height at which a diameter is measured, metres."""
ROUND = 0.85
"""A section whose least diameter is a smaller share of the greatest is not round."""
LEAST_LENGTH = 1.0
"""A stem is followed over at least this height, metres."""
LEAST_FILLED = 0.5
"""And over this share of the steps between its lowest and highest section."""
HALF_SEEN = math.radians(150.0)
NOISY = 0.2
"""Deviation of the points in radii, from which a stem is thin for its noise."""
TAPER_FROM, TAPER_TO = 0.9, 8.0
"""Heights between which taper is measured: above the swell of the roots."""
LEAST_OF_TAPER = 4
MOST = 1.8
"""Thicker stems are none that were searched for, metres."""
WORST_SD = 0.15
"""Standard deviation of the diameter, in diameters, from which it says nothing."""


def measure_stem(axis: FloatArray, columns: Columns, ground: Ground) -> Stem | None:
    """Return the stem about an axis, None if there is none.

    Parameters
    ----------
    axis : ndarray of shape (8,)
        As `find_axes` gives it, in metres from the origin of the points.
    columns : Columns
    ground : Ground
    """
    direction = np.array([axis[2], axis[3], 1.0]) / math.sqrt(1.0 + axis[2] ** 2 + axis[3] ** 2)
    foot = float(ground.at((axis[:2])[None])[0])
    stretch = Stretch(columns, foot)
    start = _start(stretch, axis, direction, foot)
    if start is None:
        return None
    below, above = stretch.follow(start, -1), stretch.follow(start, 1)
    sections = [*reversed(below), start, *above]
    length = sections[-1].height - sections[0].height
    steps = round(length / 0.25) + 1
    if length < LEAST_LENGTH or len(sections) < LEAST_FILLED * steps:
        return None
    foot_xy = _at(sections, 0.0)
    foot = float(ground.at(foot_xy[None, :2])[0])
    return _described(stretch, sections, foot, len(sections) / steps)


def _start(stretch: Stretch, axis: FloatArray, direction: FloatArray, foot: float) -> Section | None:
    """Return the first section: at breast height, or as near to it as there is one."""
    middle = 0.5 * (axis[6] + axis[7])
    for height in (BREAST_HEIGHT, middle):
        center = np.array([*(axis[:2] + height * axis[2:4]), foot + height])
        found = stretch.section(center, direction, float(axis[4]), half=0.3)
        if found is not None and is_stem(found.ring):
            return found
    return None


def _at(sections: list[Section], height: float) -> FloatArray:
    """Return the place (3,) of the axis at a height: between the sections, or beyond the nearest ones in a line."""
    heights = np.array([one.height for one in sections])
    centers = np.stack([one.center for one in sections])
    near = np.argsort(np.abs(heights - height), kind="stable")[:6]
    slopes, offsets = np.polyfit(heights[near] - height, centers[near, :2], 1)
    ground = float(np.median(centers[:, 2] - heights))
    return np.array([*offsets, ground + height]) if np.isfinite(slopes).all() else centers[near[0]]


def _direction_at(sections: list[Section], height: float) -> FloatArray:
    heights = np.array([one.height for one in sections])
    centers = np.stack([one.center for one in sections])
    near = np.argsort(np.abs(heights - height), kind="stable")[:7]
    slopes = np.polyfit(heights[near], centers[near, :2], 1)[0]
    out = np.array([*slopes, 1.0])
    return np.asarray(out / np.linalg.norm(out))


def _described(stretch: Stretch, sections: list[Section], foot: float, filled: float) -> Stem | None:
    shift = float(np.median([one.center[2] - one.height for one in sections])) - foot  # the first foot was a guess
    sections = [one._replace(height=one.height + shift) for one in sections]
    taper = _taper(sections)
    direction = _direction_at(sections, BREAST_HEIGHT)
    place = _at(sections, BREAST_HEIGHT)
    nearest = min(sections, key=lambda one: abs(one.height - BREAST_HEIGHT))
    breast = stretch.section(place, direction, nearest.ring.radius, half=BREAST_HALF, drift=0.2, shared=True)
    measured = breast is not None and is_stem(breast.ring) and abs(nearest.height - BREAST_HEIGHT) < 0.3
    if not measured:
        nearest = stretch.section(nearest.center, nearest.direction, nearest.ring.radius, shared=True) or nearest
    known = breast if breast is not None and measured else nearest
    ring, dbh, sd = known.ring, 2.0 * known.ring.radius, 2.0 * known.ring.radius_sd
    if not measured:
        rise = known.height - BREAST_HEIGHT
        dbh += (0.0 if math.isnan(taper) else taper) * rise
        sd = math.hypot(sd, 0.01 * rise)
    if not math.isnan(taper):
        sd = math.hypot(sd, taper * GROUND_SD)
    if not 0.0 < dbh < MOST or sd > WORST_SD * dbh:
        return None
    quality = _quality(known, sections, filled, sd / dbh)
    flags = _flags(known, measured=measured, filled=filled, count=len(sections))
    out = tuple(_as_record(one) for one in sections)
    lean = math.acos(min(1.0, float(direction[2])))
    start = place - direction * BREAST_HEIGHT / direction[2]
    return Stem(
        start, place, dbh, sd, "measured" if measured else "taper", direction, lean, taper, ring.roundness, ring.arc,
        sections[0].height, sections[-1].height, quality, flags, out,
    )  # fmt: skip


def _taper(sections: list[Section]) -> float:
    """Return the loss of diameter per height: the median of the slopes between all pairs (Theil and Sen)."""
    chosen = [one for one in sections if TAPER_FROM <= one.height <= TAPER_TO]
    if len(chosen) < LEAST_OF_TAPER:
        return math.nan
    heights = np.array([one.height for one in chosen])
    diameters = np.array([2.0 * one.ring.radius for one in chosen])
    i, j = np.triu_indices(len(chosen), 1)
    apart = heights[j] - heights[i]
    far = np.abs(apart) >= 0.5
    return -float(np.median((diameters[j] - diameters[i])[far] / apart[far])) if far.any() else math.nan


def _quality(known: Section, sections: list[Section], filled: float, relative: float) -> float:
    """Return the product of four shares: see `cylx.stems`."""
    contrast = float(np.median([one.ring.contrast for one in sections]))
    seen = min(1.0, known.ring.arc / math.pi)
    length = min(1.0, (sections[-1].height - sections[0].height) / 2.0)
    return float(contrast * seen * filled * length * (1.0 - relative / WORST_SD))


def _flags(known: Section, *, measured: bool, filled: float, count: int) -> tuple[str, ...]:
    ring = known.ring
    said = {
        "not round": ring.roundness < ROUND,
        "half seen": ring.arc < HALF_SEEN,
        "thin for its noise": ring.deviation > NOISY * ring.radius,
        "few sections": filled < 0.7 or count < 6,
        "taper": not measured,
    }
    return tuple(flag for flag, holds in said.items() if holds)


def _as_record(one: Section) -> StemSection:
    ring = one.ring
    return StemSection(one.height, one.center, 2.0 * ring.radius, 2.0 * ring.radius_sd, ring.arc, ring.roundness)
