"""The limits a user sets for all cylinders, whatever method finds them."""

from __future__ import annotations

import math

from cylx.config import SceneConfig
from cylx.geometry.lines import are_along
from cylx.records import Segment


def out_of_range(segment: Segment, radii: tuple[float, float], scene: SceneConfig) -> str:
    """Name the limit that a segment does not keep, or nothing.

    Parameters
    ----------
    segment : Segment
    radii : tuple of float
        Least and greatest radius, frame units.
    scene : SceneConfig
    """
    if not radii[0] <= segment.model[6] <= radii[1]:
        return "radius out of range"
    tolerance = math.radians(scene.axis_tolerance_deg)
    astray = scene.axis is not None and not are_along(segment.model[3:6], scene.axis, tolerance)
    return "axis out of range" if astray else ""
