"""A stem followed from breast height upwards and downwards, section by section, across gaps by branches."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis
from cylx.stems.columns import Columns, thinned
from cylx.stems.rings import Ring, fit_ring

STEP = 0.25
"""Height between two sections, metres."""
HALF = 0.2
"""Half the height of a section: it is thicker than a step, so that neighbours have points in common."""
LONGEST_GAP = 1.5
"""A gap without sections is passed over up to this height, metres."""
LEAST_ARC = math.radians(50.0)
LEAST_CONTRAST = 0.5
"""Share of the points in and about a section that must lie on it."""
WIDEST = 0.5
"""Deviation of the points about a section, in radii, up to which it is one."""
REACH = 2.2
"""Points up to so many radii from the axis are looked at."""


class Section(NamedTuple):
    """A section: its height above the ground, its centre in the plot, the direction across which it lies, its ring."""

    height: float
    center: FloatArray
    direction: FloatArray
    ring: Ring


class Stretch:
    """The points about a stem, gathered as it is followed."""

    def __init__(self, columns: Columns, ground: float) -> None:
        self._columns, self._ground = columns, ground

    def section(
        self,
        center: FloatArray,
        direction: FloatArray,
        radius: float,
        *,
        half: float = HALF,
        drift: float = 0.35,
        shared: bool = False,
    ) -> Section | None:
        """Return the section of a stem about a place (3,) on its axis, None if it is not there."""
        reach = REACH * radius + 0.05
        points = thinned(self._columns.slab(center, direction, reach, half))
        if len(points) < 12:
            return None
        first, second = axis_basis(direction)
        offsets = points - center
        xy = np.column_stack([offsets @ first, offsets @ second])
        ring = fit_ring(xy, offsets @ direction, (0.0, 0.0, radius), drift=drift, shared=shared)
        if ring is None:
            return None
        middle = center + ring.x * first + ring.y * second
        return Section(float(middle[2] - self._ground), middle, direction, ring)

    def follow(self, start: Section, way: int, radius_drift: float = 0.25) -> list[Section]:
        """Return the sections above (`way` = 1) or below (-1) one, as far as the stem is seen."""
        out: list[Section] = []
        known = [start]
        direction, height = start.direction, start.height
        while True:
            height += way * STEP
            if height - known[-1].height > LONGEST_GAP or known[-1].height - height > LONGEST_GAP or height < 0.1:
                return out
            last = known[-1]
            radius = float(np.median([one.ring.radius for one in known[-4:]]))
            place = last.center + direction * (height - last.height) / direction[2]
            found = self.section(place, direction, radius)
            if found is None or not is_stem(found.ring) or abs(found.ring.radius / radius - 1.0) > radius_drift:
                continue
            out.append(found)
            known.append(found)
            height = found.height
            direction = _direction(known[-6:], direction)


def _direction(sections: list[Section], last: FloatArray) -> FloatArray:
    """Return the direction of the line through the centres of sections, upwards; weighed with the last one."""
    if len(sections) < 3:
        return last
    heights = np.array([one.height for one in sections])
    centers = np.stack([one.center for one in sections])
    slopes = np.polyfit(heights, centers[:, :2], 1)[0]
    out = np.array([*slopes, 1.0])
    out /= np.linalg.norm(out)
    out += last
    return np.asarray(out / np.linalg.norm(out))


def is_stem(ring: Ring) -> bool:
    """Return whether a ring is seen well enough to be the section of a stem."""
    return ring.arc >= LEAST_ARC and ring.contrast >= LEAST_CONTRAST and ring.deviation < WIDEST * ring.radius
