"""Frame -> slices: random planes through the cloud, and the points close to each (section 3.2)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.config import SlicingConfig
from cylx.geometry.plane import Plane, random_directions
from cylx.records import Frame, Slice

FloatArray = NDArray[np.float64]


def draw_planes(frame: Frame, config: SlicingConfig, seed: int) -> list[Plane]:
    """Draw N planes: normals evenly from the sphere, each through a point of the cloud.

    The paper says no more than "random center and normal"; a centre drawn from the points cuts where there is something
    to cut, however large the box about the cloud.

    Parameters
    ----------
    frame : Frame
    config : SlicingConfig
    seed : int

    Returns
    -------
    list of Plane
    """
    rng = np.random.default_rng([seed, 2])
    normals = random_directions(config.planes, rng)
    centers = frame.points[rng.integers(len(frame.points), size=config.planes)]
    return [Plane(center, normal) for center, normal in zip(centers, normals, strict=True)]


def cut_slice(points: FloatArray, plane: Plane, thickness: float) -> Slice:
    """Collect the points within half the thickness of a plane, projected along its normal.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    plane : Plane
    thickness : float
        Full thickness, frame units.

    Returns
    -------
    Slice
    """
    close = np.empty(len(points), np.int64)
    n = _find_close(points, plane.normal, float(plane.point @ plane.normal), 0.5 * thickness, close)
    return Slice(plane, plane.project(points[close[:n]]))


@njit(cache=True, nogil=True)
def _find_close(points: FloatArray, normal: FloatArray, offset: float, width: float, close: NDArray[np.int64]) -> int:
    """Fill in the indices of the points near a plane; count them."""
    n = 0
    for i in range(len(points)):
        height = points[i, 0] * normal[0] + points[i, 1] * normal[1] + points[i, 2] * normal[2] - offset
        if abs(height) < width:
            close[n] = i
            n += 1
    return n
