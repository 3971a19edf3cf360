"""Spacing and noise of a cloud: the usual ones, and where and over what sizes they differ."""

from cylx.noise.surface import Patches, measure_surface
from cylx.noise.variation import noise_by_place, noise_by_size

__all__ = ["Patches", "measure_surface", "noise_by_place", "noise_by_size"]
