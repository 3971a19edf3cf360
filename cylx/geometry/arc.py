"""Distances of points from a centre line that is a straight, an arc that touches it, and a straight that goes on."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit


@njit(cache=True, nogil=True)
def arc_place(px: float, py: float, pz: float, frame: FloatArray, radius: float, angle: float) -> tuple[float, float]:
    """Return how far along the centre line a point is, and how far from it; see `fill_arc_coordinates`."""
    half = 0.5 * angle
    p = (px, py, pz)
    x, y, z = 0.0, 0.0, 0.0
    for d in range(3):
        away = p[d] - frame[0, d]
        x, y, z = x + away * frame[1, d], y + away * frame[2, d], z + away * frame[3, d]
    # the middle of the arc is at zero, so that what lies behind the centre is cut in half
    turn = math.atan2(x, y) - half
    if turn > math.pi:
        turn -= 2.0 * math.pi
    elif turn < -math.pi:
        turn += 2.0 * math.pi
    if turn < -half:
        return x, math.sqrt((y - radius) ** 2 + z * z)
    if turn > half:
        # the end is where the second straight begins, whatever the angle says of a point
        further, square = 0.0, 0.0
        for d in range(3):
            beyond = p[d] - frame[4, d]
            further, square = further + beyond * frame[5, d], square + beyond * beyond
        return radius * angle + further, math.sqrt(max(square - further * further, 0.0))
    out = math.sqrt(x * x + y * y) - radius
    return radius * (turn + half), math.sqrt(out * out + z * z)


@njit(cache=True, nogil=True)
def fill_arc_coordinates(
    points: FloatArray, frame: FloatArray, radius: float, angle: float, along: FloatArray, distances: FloatArray
) -> None:
    """Fill in how far along the centre line points are, and how far from it.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    frame : ndarray of shape (6, 3)
        Centre of the arc, unit direction into it, the one outward from its centre at its beginning, its normal; its
        end, and the unit direction out of it.
    radius, angle : float
        Of the arc; the angle in radians.
    along, distances : ndarray of shape (N,)
        To be filled; 0 along at the beginning of the arc, negative before it.
    """
    for i in range(len(points)):
        along[i], distances[i] = arc_place(points[i, 0], points[i, 1], points[i, 2], frame, radius, angle)


def arc_coordinates(
    points: FloatArray, frame: FloatArray, radius: float, angle: float
) -> tuple[FloatArray, FloatArray]:
    """Return how far along a centre line points are, and how far from it; see `fill_arc_coordinates`."""
    along, distances = np.empty(len(points)), np.empty(len(points))
    fill_arc_coordinates(np.ascontiguousarray(points), frame, radius, angle, along, distances)
    return along, distances
