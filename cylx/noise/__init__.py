"""Spacing and noise of a cloud: the usual ones, and where and over what sizes they differ."""

from cylx.scene import Patches, measure_surface, noise_by_place, noise_by_size

__all__ = ["Patches", "measure_surface", "noise_by_place", "noise_by_size"]
