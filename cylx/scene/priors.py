"""Prior knowledge of all cylinders, for every method: limits, priors and a catalogue, in frame units."""

from __future__ import annotations

import math

import numpy as np

from cylx.config import Config, SceneConfig
from cylx.fits.likelihood import Prior
from cylx.fits.nominal_radius import Catalogue
from cylx.geometry.lines import are_along
from cylx.records import Frame, Segment


def out_of_range(segment: Segment, radii: tuple[float, float], scene: SceneConfig) -> str:
    """Return the limit that a segment exceeds, or an empty text.

    Parameters
    ----------
    segment : Segment
    radii : tuple of float
        Least and greatest radius, frame units.
    scene : SceneConfig
    """
    if not radii[0] <= segment.radius <= radii[1]:
        return "radius out of range"
    tolerance = math.radians(scene.axis_tolerance_deg)
    astray = scene.axis is not None and not are_along(segment.direction, scene.axis, tolerance)
    return "axis out of range" if astray else ""


def radius_range(config: Config, frame: Frame) -> tuple[float, float]:
    """Return the least and the greatest radius to find, in frame units, from a resolved configuration."""
    low, high = config.scene.radius_min, config.scene.radius_max
    return (low or 0.0) / frame.spacing, (high or math.inf) / frame.spacing


def known_of(config: Config, frame: Frame) -> Prior | None:
    """Return the prior of each cylinder in frame units, from a resolved configuration; None without one."""
    scene = config.scene
    drawn = scene.axis is not None and scene.axis_sd_deg is not None
    if scene.known_radius is None and not drawn:
        return None
    radius = None if scene.known_radius is None else scene.known_radius / frame.spacing
    deviation = (scene.known_radius_sd or math.inf) / frame.spacing
    axis = np.array(scene.axis, dtype=np.float64) if drawn else None
    return Prior(
        radius, deviation, None if axis is None else axis / np.linalg.norm(axis), math.radians(scene.axis_sd_deg or 0.0)
    )


def catalogue_of(config: Config, frame: Frame) -> Catalogue | None:
    """Return the nominal radii in frame units, from a resolved configuration; None without a catalogue."""
    entries = config.scene.catalogue
    if entries is None:
        return None
    radii = tuple(entry.radius / frame.spacing for entry in entries)
    return Catalogue(radii, tuple(entry.spread / frame.spacing for entry in entries))
