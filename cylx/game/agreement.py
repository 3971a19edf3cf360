"""Agreement of the candidates with a cylinder: how many of the nearby candidates agree."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import RADIUS, UX, UY, UZ
from cylx.geometry.kernels import njit
from cylx.records import Candidates, Segment

LEAST_TELLING_SHARE = 0.1
"""Windows below this many radii see dents and rims of real objects rather than the cylinder. Short cylinders need
smaller windows."""
CONCENTRIC = 0.85
"""A candidate on the same axis outside this ratio of radii belongs to another surface."""
LIKE_RADIUS = 0.4
"""A candidate outside this ratio of radii belongs to another object, or to a detail: a rim, a dent, an edge."""
LARGEST, ENOUGH_WINDOWS, SCALES = 0.9, 20, 8
"""A window of this size in radii always tells; a scale must have so many windows to be looked at by itself; and windows
are sorted into so many scales, each twice as large, the first being the smallest that can tell."""
BLUR, SHARP = 2.0, 0.08
"""The curvature that n points of a round window of radius w show has a standard deviation of `BLUR` deviations of the
points over w² √n (least squares, points spread evenly). A window can tell a radius if that is no more than this share
of the curvature, or if the window has the size `LARGEST`."""
BESIDE = 0.15
"""A window within this many radii of a rough average was laid on its surface."""
OTHER_WALL, OTHER_WALL_DEVIATIONS = 0.03, 5.0
"""Of a fitted surface a window further off than this share of the radius, and than so many deviations, was laid on
another wall."""
TOUCHING = 0.25
"""The axis of a window on a cylinder lies within this many radii of where the radius of the window puts it."""
AGREEING = 0.15, math.cos(math.radians(6.0)), 0.1
"""A candidate agrees with a cylinder within this offset in radii, cosine, and relative difference of radii."""


class Neighbourhood:
    """Spatial index of candidates: finds those along a cylinder without testing all.

    Parameters
    ----------
    candidates : Candidates
    """

    def __init__(self, candidates: Candidates) -> None:
        self._order = np.argsort(candidates.models[:, 0], kind="stable")
        self._models = np.ascontiguousarray(candidates.models[self._order])
        self._windows = candidates.windows[self._order]
        self._sharpness = self._windows**2 * np.sqrt(np.maximum(candidates.inliers[self._order], 1))
        self._places = np.ascontiguousarray(candidates.places[self._order])

    def agreement(self, segment: Segment) -> tuple[int, int]:
        """Count the windows inside a cylinder that agree with it, and all windows inside it, at the best of the scales.

        At the edge of a beam a few candidates agree by chance; on a pipe nearly all do, at one scale at least. Small
        windows see the noise, and the dents and seams of real objects; large ones see what is beside a surface as well,
        such as the other wall of a tube.

        Parameters
        ----------
        segment : Segment

        Returns
        -------
        consistent, near : int
        """
        part = self._beside(segment, segment.half)
        beside = BESIDE * segment.radius
        if segment.spread > 0.0:
            beside = min(beside, max(OTHER_WALL * segment.radius, OTHER_WALL_DEVIATIONS * segment.spread))
        counts = np.zeros((SCALES, 2), np.int64)
        _count_agreeing(
            self._models[part],
            self._windows[part],
            self._sharpness[part],
            self._places[part],
            segment.model,
            segment.half,
            LEAST_TELLING_SHARE * min(segment.radius, 1.2 * segment.half),
            LARGEST * segment.radius,
            BLUR * segment.spread * segment.radius / SHARP,
            beside,
            *AGREEING,
            counts,
        )
        best = max((c for c in counts.tolist() if c[1] >= ENOUGH_WINDOWS), key=_share, default=None)
        consistent, near = best or counts.sum(axis=0).tolist()
        return consistent, near

    def agreeing(
        self, segment: Segment, alive: MaskArray, offset: float, angle_deg: float, radius: float
    ) -> IndexArray:
        """Return the remaining candidates that agree with a cylinder, up to a radius beyond its ends."""
        reach = segment.half + segment.radius
        part = self._beside(segment, reach)
        found = np.empty(part.stop - part.start, np.int64)
        cosine = math.cos(math.radians(angle_deg))
        n = _pick_agreeing(
            self._models[part], self._order[part], alive, segment.model, reach, offset, cosine, radius, found
        )
        return found[:n]

    def _beside(self, segment: Segment, reach: float) -> slice:
        """Return the candidates within reach of a cylinder of this length."""
        x, width = float(segment.point[0]), abs(float(segment.direction[0])) * reach + segment.radius
        first, last = np.searchsorted(self._models[:, 0], [x - width, x + width])
        return slice(int(first), int(last))


def is_contradicted(counts: tuple[int, int]) -> bool:
    """Return whether so many windows disagree that a fit would be pointless, from the counts of `agreement`.

    For true cylinders nearly all windows agree, and at least a third; a fifth does not occur by chance.
    """
    consistent, near = counts
    return near >= 12 and consistent + math.sqrt(max(consistent, 1.0)) < 0.2 * near


def _share(counts: list[int]) -> float:
    return (counts[0] + 1.0) / (counts[1] + 2.0)


@njit(cache=True, nogil=True)
def _agrees(row: FloatArray, model: FloatArray, reach: float, offset: float, cosine: float, radius: float) -> int:
    """Return 1 if a candidate lies in a cylinder and has a similar radius, 2 if it also agrees, otherwise 0.

    The limits are the offset in the cylinder's radii, the cosine of the angle, and the relative radius.
    """
    dx, dy, dz = row[0] - model[0], row[1] - model[1], row[2] - model[2]
    height = dx * model[UX] + dy * model[UY] + dz * model[UZ]
    square = dx * dx + dy * dy + dz * dz - height * height
    if abs(height) >= reach or square >= model[RADIUS] * model[RADIUS]:
        return 0
    turn, ratio = row[UX] * model[UX] + row[UY] * model[UY] + row[UZ] * model[UZ], row[RADIUS] / model[RADIUS]
    if abs(math.sqrt(max(square, 0.0)) - abs(row[RADIUS] - model[RADIUS])) > TOUCHING * model[RADIUS]:
        return 0  # it belongs to something else inside: axes of surfaces that touch lie as far apart as radii differ
    if square >= (offset * model[RADIUS]) ** 2 or abs(turn) <= cosine:
        return 1 if LIKE_RADIUS < ratio < 1.0 / LIKE_RADIUS else 0
    if abs(ratio - 1.0) < radius:
        return 2
    return 1 if CONCENTRIC < ratio < 1.0 / CONCENTRIC else 0  # a pipe within a pipe is a separate object


@njit(cache=True, nogil=True)
def _is_off(place: FloatArray, model: FloatArray, reach: float, beside: float) -> bool:
    """Return whether a window was laid elsewhere than on the surface of a cylinder; not if its place is unknown."""
    if math.isnan(place[0]):
        return False
    dx, dy, dz = place[0] - model[0], place[1] - model[1], place[2] - model[2]
    height = dx * model[3] + dy * model[4] + dz * model[5]
    distance = math.sqrt(max(0.0, dx * dx + dy * dy + dz * dz - height * height))
    return bool(abs(height) > reach or abs(distance - model[6]) > beside)


@njit(cache=True, nogil=True)
def _count_agreeing(
    models: FloatArray,
    windows: FloatArray,
    sharpness: FloatArray,
    places: FloatArray,
    model: FloatArray,
    reach: float,
    seen: float,
    large: float,
    sharp: float,
    beside: float,
    offset: float,
    cosine: float,
    radius: float,
    counts: IndexArray,
) -> None:
    """Count, for each scale, the windows that agree, and all."""
    for i in range(len(models)):
        telling = windows[i] > seen and (windows[i] >= large or sharpness[i] >= sharp)
        if telling and not _is_off(places[i], model, reach, beside):
            level = _agrees(models[i], model, reach, offset, cosine, radius)
            scale = min(SCALES - 1, max(0, int(math.log2(windows[i] / seen))))
            counts[scale, 1] += 1 if level > 0 else 0
            counts[scale, 0] += 1 if level > 1 else 0


@njit(cache=True, nogil=True)
def _pick_agreeing(
    models: FloatArray,
    order: IndexArray,
    alive: MaskArray,
    model: FloatArray,
    reach: float,
    offset: float,
    cosine: float,
    radius: float,
    found: IndexArray,
) -> int:
    n = 0
    for i in range(len(models)):
        if alive[order[i]] and _agrees(models[i], model, reach, offset, cosine, radius) > 1:
            found[n] = order[i]
            n += 1
    return n
