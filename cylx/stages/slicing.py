"""Frame -> slices: random planes through the cloud, and the points close to each (section 3.2)."""

from __future__ import annotations

import numpy as np
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


def cut_slice(frame: Frame, plane: Plane, thickness: float, eligible: NDArray[np.bool_] | None) -> Slice:
    """Collect the points within half the thickness of a plane, projected along its normal.

    Parameters
    ----------
    frame : Frame
    plane : Plane
    thickness : float
        Full thickness, frame units.
    eligible : ndarray of shape (N,), bool, or None
        Points that may be taken; all by default.

    Returns
    -------
    Slice
    """
    close = np.abs(frame.points @ plane.normal - plane.point @ plane.normal) < 0.5 * thickness
    if eligible is not None:
        close &= eligible
    return Slice(plane, plane.project(frame.points[close]))
