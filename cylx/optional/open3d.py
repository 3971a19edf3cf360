"""The only module that imports open3d."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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


class NoDisplayError(Exception):
    """There is no display for a window."""


def import_open3d() -> Any:  # noqa: ANN401  (it has no types)
    """Import open3d, even if Linux lacks libusb.

    open3d is linked with libusb, which a fresh Linux machine lacks; the copy in `libusb_package` is loaded instead.

    Raises
    ------
    ImportError
        If open3d is not installed, or does not run here.
    """
    if not _is_somewhere():
        os.chdir(os.sep)  # a library of open3d ends the process where the working folder has been removed
    with contextlib.suppress(ImportError, OSError):
        import libusb_package  # noqa: PLC0415  not everywhere

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import open3d  # noqa: PLC0415  takes a second
    return open3d


def _is_somewhere() -> bool:
    try:
        return bool(Path.cwd())
    except FileNotFoundError:
        return False


def unpack_columns(body: bytes, points: int, width: int) -> NDArray[np.uint8] | None:
    """Unpack the body of a binary_compressed PCD: all values of the first field, then all of the second, and so on.

    The header given to open3d declares every byte as a field. With the header of the file, open3d 0.20 drops the alpha
    of rgba and all but the first value of fields with several, and writes past its arrays for normals in float64, for
    padding and for repeated names.

    Parameters
    ----------
    body : bytes
        The bytes after the header: two sizes, checked by the caller, and the packed values.
    points : int
        Number of points.
    width : int
        Bytes per point, at least 3.

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
    silent = open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error)
    with _file_of(header.encode(), body) as path, silent:
        cloud = open3d.t.io.read_point_cloud(str(path), format="pcd", remove_nan_points=False)
    if "positions" not in cloud.point or len(cloud.point.positions) != points:
        return None
    columns = np.empty((width, points), dtype=np.uint8)
    columns[:3] = cloud.point.positions.numpy().T
    for place in range(3, width):
        columns[place] = cloud.point[names[place]].numpy()[:, 0]
    return columns.reshape(-1)


@contextmanager
def _file_of(*parts: bytes) -> Iterator[Path]:
    """Yield the path of a file for the time being: in memory on Linux, so that nothing is left if this is killed."""
    with contextlib.ExitStack() as stack:
        if hasattr(os, "memfd_create"):
            file = stack.enter_context(os.fdopen(os.memfd_create("body"), "wb"))
            path = Path(f"/proc/self/fd/{file.fileno()}")
        else:
            path = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="cylx-"))) / "body.pcd"
            file = stack.enter_context(path.open("wb"))
        for part in parts:
            file.write(part)
        file.flush()
        yield path


def estimate_normals(points: NDArray[np.float64], neighbours: int) -> NDArray[np.float64]:
    """Return the normal of the plane through the nearest neighbours of each point.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    neighbours : int
        Nearest points, itself included.

    Returns
    -------
    ndarray of shape (N, 3)
        Unit vectors, up to sign.

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


def show_scene(
    points: NDArray[np.float64],
    colors: NDArray[np.uint8],
    cylinders: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], float]],
    tints: NDArray[np.uint8],
    title: str,
) -> None:
    """Open a window with a cloud and cylinders, until the user closes it.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    colors : ndarray of shape (N, 3), uint8
    cylinders : sequence of tuple
        Start and end of the axis, and the radius, of each.
    tints : ndarray of shape (number of cylinders, 3), uint8
        Their colours.
    title : str
        Title of the window.

    Raises
    ------
    NoDisplayError
        If there is no display.
    ImportError
        If open3d is not installed, or does not run here.
    """
    if not _has_display():
        raise NoDisplayError
    open3d = import_open3d()
    middle = points.mean(axis=0) if len(points) else np.zeros(3)  # open3d draws in single precision
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points - middle))
    cloud.colors = open3d.utility.Vector3dVector(colors / 255.0)
    meshes = [
        _tube(open3d, start - middle, end - middle, radius, tint / 255.0)
        for (start, end, radius), tint in zip(cylinders, tints, strict=True)
    ]
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        window = open3d.visualization.Visualizer()
        if not window.create_window(window_name=title, width=1280, height=900):
            raise NoDisplayError
        for one in (cloud, *meshes):
            window.add_geometry(one)
        window.get_render_option().mesh_show_back_face = True
        window.run()
        window.destroy_window()


def _has_display() -> bool:
    """Return whether a window would be visible; without a display open3d opens one in memory and waits for ever."""
    if not sys.platform.startswith("linux") or os.environ.get("WAYLAND_DISPLAY"):
        return True
    if not os.environ.get("DISPLAY"):
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    library.XOpenDisplay.restype = ctypes.c_void_p
    library.XCloseDisplay.argtypes = [ctypes.c_void_p]
    display = library.XOpenDisplay(None)
    if display is not None:
        library.XCloseDisplay(display)
    return display is not None


def _tube(
    open3d: Any,  # noqa: ANN401  (it has no types)
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    radius: float,
    tint: NDArray[np.float64],
) -> Any:  # noqa: ANN401  open3d has no types
    """Make a tube without caps, as a mesh."""
    axis = end - start
    direction = axis / (np.linalg.norm(axis) or 1.0)
    across = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
    across /= np.linalg.norm(across) or 1.0
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = radius * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), np.cross(direction, across)))
    here, then = np.arange(48), (np.arange(48) + 1) % 48
    triangles = np.vstack([np.column_stack([here, then, here + 48]), np.column_stack([then, then + 48, here + 48])])
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(np.vstack([start + ring, end + ring])),
        open3d.utility.Vector3iVector(triangles.astype(np.int32)),
    )
    mesh.compute_vertex_normals()
    mesh.paint_uniform_color(tint)
    return mesh
