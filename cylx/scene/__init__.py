"""The scene: the frame of a cloud, its noise, and the resolved configuration."""

from cylx.scene.frame import canonical_order, cell_cube, check_usable, make_frame, measure_scene
from cylx.scene.noise import Patches, measure_surface
from cylx.scene.noise_variation import noise_by_place, noise_by_size
from cylx.scene.prepare import Prepared, prepare
from cylx.scene.priors import catalogue_of, known_of, out_of_range, radius_range
from cylx.scene.resolve import resolve, thinnest
from cylx.scene.selection import check_voxel, one_a_voxel, rows_selected, select

__all__ = [
    "Patches",
    "Prepared",
    "canonical_order",
    "catalogue_of",
    "cell_cube",
    "check_usable",
    "check_voxel",
    "known_of",
    "make_frame",
    "measure_scene",
    "measure_surface",
    "noise_by_place",
    "noise_by_size",
    "one_a_voxel",
    "out_of_range",
    "prepare",
    "radius_range",
    "resolve",
    "rows_selected",
    "select",
    "thinnest",
]
