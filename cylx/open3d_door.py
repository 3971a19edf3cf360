"""The only place that imports open3d."""

from __future__ import annotations

import contextlib
import ctypes
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_HEADER = """\
VERSION 0.7
FIELDS {fields}
SIZE {ones}
TYPE {kinds}
COUNT {ones}
WIDTH {points}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {points}
DATA binary_compressed
"""


def import_open3d() -> Any:  # noqa: ANN401  (it has no types)
    """Import open3d, on a fresh Linux machine too.

    There the library libusb, which open3d is linked with, is missing; the copy in `libusb_package` takes its place.

    Raises
    ------
    ImportError
        If open3d is not installed, or does not run here.
    """
    with contextlib.suppress(ImportError, OSError):
        import libusb_package  # noqa: PLC0415  not everywhere

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import open3d  # noqa: PLC0415  takes a second
    return open3d


def unpack_columns(body: bytes, points: int, width: int) -> NDArray[np.uint8] | None:
    """Unpack the body of a binary_compressed PCD: all values of the first field, then all of the second, and so on.

    The header given to open3d makes a field of every byte. With the header of the file, open3d 0.20 drops the alpha of
    rgba and all but the first value of fields with several, and writes past its arrays for normals in float64, for
    padding and for repeated names.

    Parameters
    ----------
    body : bytes
        What stands behind the header: two sizes, checked by the caller, and the packed values.
    points : int
        Number of points.
    width : int
        Bytes a point, at least 3.

    Returns
    -------
    ndarray of shape (points * width,), uint8, or None
        None if the body is damaged.

    Raises
    ------
    ImportError
        If open3d is not installed, or does not run here.
    """
    open3d = import_open3d()
    names = ["x", "y", "z", *(f"byte_{place}" for place in range(3, width))]
    header = _HEADER.format(
        fields=" ".join(names), ones=" ".join("1" * width), kinds=" ".join("U" * width), points=points
    )
    with tempfile.TemporaryDirectory(prefix="cylx-") as folder:
        path = Path(folder) / "body.pcd"
        with path.open("wb") as file:
            file.write(header.encode())
            file.write(body)
        with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
            cloud = open3d.t.io.read_point_cloud(str(path), format="pcd", remove_nan_points=False)
    if "positions" not in cloud.point or len(cloud.point.positions) != points:
        return None
    columns = np.empty((width, points), dtype=np.uint8)
    columns[:3] = cloud.point.positions.numpy().T
    for place in range(3, width):
        columns[place] = cloud.point[names[place]].numpy()[:, 0]
    return columns.reshape(-1)


def estimate_normals(points: NDArray[np.float64], neighbours: int) -> NDArray[np.float64]:
    """Give the normal of the plane through the nearest neighbours of each point.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    neighbours : int
        Nearest points, itself included.

    Returns
    -------
    ndarray of shape (N, 3)
        Unit vectors, either way.

    Raises
    ------
    ImportError
        If open3d is not installed, or does not run here.
    """
    open3d = import_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.ascontiguousarray(points)))
    nearest = open3d.geometry.KDTreeSearchParamKNN(knn=neighbours)
    cloud.estimate_normals(nearest, fast_normal_computation=False)
    return np.array(cloud.normals)
