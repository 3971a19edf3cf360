"""Normals of a cloud, for the methods that need them."""

from __future__ import annotations

from cylx.errors import ConfigError
from cylx.geometry.arrays import FloatArray
from cylx.optional.open3d import estimate_normals


def normals_for(method: str, points: FloatArray, neighbours: int) -> FloatArray:
    """Fit a plane to the neighbours of each point and return its normal, up to sign.

    Parameters
    ----------
    method : str
        The method that needs them.
    points : ndarray of shape (N, 3)
    neighbours : int
        Nearest points used to fit the plane of a point, the point included.

    Returns
    -------
    ndarray of shape (N, 3)
        Unit vectors.

    Raises
    ------
    ConfigError
        If open3d, which estimates them, is not installed.
    """
    try:
        return estimate_normals(points, neighbours)
    except ImportError as error:
        fault = f"needs normals, and open3d, which estimates them, cannot be imported: {error}"
        raise ConfigError(f"method {method}", fault, "install open3d, or use method gt") from None
