"""Stems of a plot: the ground, circles in layers above it, axes through them, and each stem followed and measured.

Everything is local: a part of a plot gives the stems that the whole gives there. The quality of a stem is the product
of five shares: of the points in and about its sections that lie on them, of half a turn that is seen, of the
sections found between the lowest and the highest, of two metres over which it is followed, and of the precision of its
diameter.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import PointCloud
from cylx.records.stems import Ground, Stem, StemPlot
from cylx.stems.axes import find_axes
from cylx.stems.circles import find_circles
from cylx.stems.columns import Columns
from cylx.stems.ground import GroundBy, choose_ground, find_ground
from cylx.stems.labels import label_stems
from cylx.stems.measuring import measure_stem

if TYPE_CHECKING:
    from numpy.typing import NDArray

LAYERS = tuple(0.6 + 0.4 * k for k in range(8))
"""Heights of the layers above the ground, metres."""
LAYER_HALF = 0.15
LARGEST = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Greatest diameters of the ranges in which circles are searched, metres."""
ANCHOR = 8.0
"""The origin is a multiple of this, metres: of all cells, so that they lie alike in a plot and in a part of it."""
LEAST_QUALITY = 0.24
"""Circles that leaves and twigs happen to make have less; stems of which 90 degrees are seen have more."""


def find_stems(
    cloud: PointCloud, *, unit: float = 1.0, ground: GroundBy | None = None, min_dbh: float = 0.05
) -> StemPlot:
    """Find and measure the stems of a cloud; z points upwards.

    Parameters
    ----------
    cloud : PointCloud
    unit : float
        Metres of a unit of the cloud.
    ground : {"classes", "cloth", "lowest"}, optional
        How the ground is found. By default from points of class 2, or else by a cloth if its library is installed.
    min_dbh : float
        Least diameter, metres.

    Returns
    -------
    StemPlot
    """
    origin = np.floor(cloud.points.min(axis=0) * unit / ANCHOR) * ANCHOR
    points = cloud.points * unit - origin
    classes = _classes(cloud)
    by = ground or choose_ground(classes)
    terrain = find_ground(points, classes, by)
    axes = find_axes(*_circles(points, points[:, 2] - terrain.at(points[:, :2])))
    columns = Columns(points)
    stems = _measured(axes, columns, terrain, min_dbh)
    labels = label_stems(stems, columns)
    counts = np.bincount(labels[labels >= 0], minlength=len(stems))
    out = tuple(_in_scene(replace(stem, points=int(n)), origin, unit) for stem, n in zip(stems, counts, strict=True))
    return StemPlot(cloud, out, labels, _ground_in_scene(terrain, origin), unit)


def _classes(cloud: PointCloud) -> NDArray[np.uint8] | None:
    """Return the classes of the points, if the file has them."""
    table = cloud.table
    if table is None or "classification" not in (table.dtype.names or ()):
        return None
    return np.asarray(table["classification"][slice(None) if cloud.valid is None else cloud.valid])


def _circles(points: FloatArray, heights: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the circles of all layers, (k, 5), and the layer of each."""
    circles, layers = [np.empty((0, 5))], [np.empty(0, np.int64)]
    for k, height in enumerate(LAYERS):
        xy = points[np.abs(heights - height) < LAYER_HALF, :2]
        for largest in LARGEST:
            found = find_circles(xy, largest)
            circles.append(np.column_stack([found[:, :2], np.full(len(found), height), found[:, 2:]]))
            layers.append(np.full(len(found), k))
    return np.concatenate(circles), np.concatenate(layers)


def _measured(axes: FloatArray, columns: Columns, ground: Ground, least: float) -> list[Stem]:
    """Measure the stems about axes, the best first; an axis within a stem that is there already is left out."""
    taken: dict[tuple[int, int], list[Stem]] = {}
    out: list[Stem] = []
    for axis in axes:
        place = axis[:2] + 1.3 * axis[2:4]
        if _within(place, 0.5 * float(axis[4]), taken):
            continue
        stem = measure_stem(axis, columns, ground)
        if stem is None or stem.dbh < least or stem.quality < LEAST_QUALITY:
            continue
        if _within(stem.breast[:2], 0.5 * stem.dbh, taken):
            continue
        out.append(stem)
        cell = (math.floor(stem.breast[0]), math.floor(stem.breast[1]))
        taken.setdefault(cell, []).append(stem)
    return sorted(out, key=lambda stem: (math.floor(stem.foot[0]), stem.foot[1], stem.foot[0]))


def _within(place: FloatArray, radius: float, taken: dict[tuple[int, int], list[Stem]]) -> bool:
    """Return whether a circle overlaps a stem that was found."""
    i, j = math.floor(place[0]), math.floor(place[1])
    near = [stem for a in (-1, 0, 1) for b in (-1, 0, 1) for stem in taken.get((i + a, j + b), ())]
    return any(
        math.hypot(*(stem.breast[:2] - place)) < max(0.5 * stem.dbh + 0.5 * radius, radius, 0.1) for stem in near
    )


def _in_scene(stem: Stem, origin: FloatArray, unit: float) -> Stem:
    sections = tuple(replace(one, center=(one.center + origin) / unit) for one in stem.sections)
    return replace(stem, foot=(stem.foot + origin) / unit, breast=(stem.breast + origin) / unit, sections=sections)


def _ground_in_scene(ground: Ground, origin: FloatArray) -> Ground:
    return Ground(ground.corner + origin[:2], ground.cell, ground.heights + origin[2], ground.by)
