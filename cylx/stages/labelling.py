"""Cloud, cylinders -> labels and residuals: the cylinder of each point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import cylinder_coordinates
from cylx.records import IndexedCloud, Segment


def label_points(segments: list[Segment], indexed: IndexedCloud) -> tuple[NDArray[np.int32], FloatArray]:
    """Assign each point to the cylinder with the nearest surface, within three standard deviations.

    Parameters
    ----------
    segments : list of Segment
    indexed : IndexedCloud
        The cloud; points on surfaces much flatter than a cylinder do not belong to it.

    Returns
    -------
    labels : ndarray of shape (N,), int32
        Index of the segment, -1 for none.
    residuals : ndarray of shape (N,)
        Signed distance to that segment's surface, + is outside; NaN for none.
    """
    labels = np.full(len(indexed.points), -1, np.int32)
    residuals = np.full(len(indexed.points), np.nan)
    nearest = np.full(len(indexed.points), np.inf)
    for index, segment in enumerate(segments):
        near, offset, _ = surface_points(segment, indexed)
        closer = np.abs(offset) < nearest[near]
        near, offset = near[closer], offset[closer]
        labels[near], residuals[near], nearest[near] = index, offset, np.abs(offset)
    return labels, residuals


def surface_points(segment: Segment, indexed: IndexedCloud) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Return the points within three standard deviations of a segment's surface that may belong to it.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud

    Returns
    -------
    indices : ndarray of shape (n,)
    residuals : ndarray of shape (n,)
        Signed distances to the surface, + is outside.
    angles : ndarray of shape (n,)
        About the axis, in (-pi, pi].
    """
    radius = segment.radius
    reach = 3.0 * max(segment.spread, indexed.noise_about(segment.model, segment.half))
    near = indexed.cells.near_cylinder(
        segment.model, -segment.half, segment.half, max(0.0, radius - reach), radius + reach
    )
    near = near[indexed.may_be_on(near, segment.model, segment.flat_share)]
    _, distances, angles = cylinder_coordinates(indexed.points[near], segment.point, segment.direction)
    return near, distances - radius, angles
