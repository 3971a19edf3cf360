"""Frame -> slices: random planes through the cloud, and the points close to each (section 3.2)."""

from __future__ import annotations

import numpy as np

from cylx.config import SlicingConfig
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import canonical_direction
from cylx.geometry.kernels import njit
from cylx.geometry.plane import Plane, random_directions
from cylx.records import Frame, Slice, stream


def draw_planes(frame: Frame, config: SlicingConfig, seed: int, axis: list[float] | None = None) -> list[Plane]:
    """Draw N planes: normals evenly from the sphere, each through a point of the cloud.

    The paper says only "random center and normal". A centre drawn from the points cuts through points, however large
    the bounding box of the cloud.

    Parameters
    ----------
    frame : Frame
    config : SlicingConfig
    seed : int
    axis : list of float, optional
        The axis that `inclination_deg` refers to; ignored if `inclination_deg` is null.

    Returns
    -------
    list of Plane
    """
    rng = stream(seed, "planes")
    normals = random_directions(config.planes, rng)
    if config.inclination_deg is not None and axis is not None:
        normals = _inclined(normals, canonical_direction(axis), config.inclination_deg, rng)
    centers = frame.points[rng.integers(len(frame.points), size=config.planes)]
    return [Plane(center, normal) for center, normal in zip(centers, normals, strict=True)]


def _inclined(normals: FloatArray, axis: FloatArray, limits: list[float], rng: np.random.Generator) -> FloatArray:
    """Rotate normals (n, 3) to angles from an axis between two limits, evenly over that part of the sphere."""
    low, high = np.cos(np.radians(limits))
    cosines = rng.uniform(high, low, len(normals))
    across = normals - (normals @ axis)[:, None] * axis
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(cosines[:, None] * axis + np.sqrt(1.0 - cosines**2)[:, None] * across)


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
def _find_close(points: FloatArray, normal: FloatArray, offset: float, width: float, close: IndexArray) -> int:
    """Fill in the indices of the points near a plane; return their number."""
    n = 0
    for i in range(len(points)):
        height = points[i, 0] * normal[0] + points[i, 1] * normal[1] + points[i, 2] * normal[2] - offset
        if abs(height) < width:
            close[n] = i
            n += 1
    return n
