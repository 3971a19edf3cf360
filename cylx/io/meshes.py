"""Read the triangles of a PLY file that is a mesh."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from plyfile import PlyData, PlyListProperty, PlyParseError

from cylx.errors import InputError
from cylx.io.clouds import read_cloud
from cylx.io.existing import has_file
from cylx.io.inputs import printable

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NAMES = ("vertex_indices", "vertex_index")


def read_object(path: str | Path) -> tuple[NDArray[np.float64], NDArray[np.int64] | None]:
    """Read the scan of an object: its points, and its triangles if it is a mesh.

    Parameters
    ----------
    path : str or Path
        Any supported cloud; a PLY may be a mesh.

    Returns
    -------
    points : ndarray of shape (N, 3)
    faces : ndarray of shape (M, 3), int64, or None
        Indices of points; None if there are no faces.

    Raises
    ------
    InputError
        If the file cannot be read, its faces are not triangles, or they refer to missing points.
    """
    cloud = read_cloud(path)
    if cloud.source.format != "ply":
        return cloud.points, None
    if not has_file(path):
        raise InputError(printable(path), "is not a file, and a mesh has to be read twice", "save it to a file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about empty lists
            elements = PlyData.read(str(path))
    except (PlyParseError, ValueError, OverflowError, MemoryError) as error:
        raise InputError(printable(path), f"its faces cannot be read: {error}", "save the mesh again") from None
    faces = next((element for element in elements if element.name == "face" and element.count), None)
    name = next((name for name in _NAMES if faces is not None and name in faces), None)
    if faces is None or name is None:
        return cloud.points, None
    kind = faces.ply_property(name)
    if not isinstance(kind, PlyListProperty) or kind.val_dtype[0] not in "iu":
        raise InputError(printable(path), f"the property {name} is not a list of integers", "save the mesh again")
    rows = faces[name]
    if any(len(row) != 3 for row in rows):
        raise InputError(printable(path), "has faces that are not triangles", "triangulate the mesh")
    triangles = np.array([np.asarray(row) for row in rows], dtype=np.int64)
    if cloud.valid is not None or triangles.min() < 0 or triangles.max() >= len(cloud.points):
        raise InputError(printable(path), "has faces that refer to missing points", "save the mesh again")
    return cloud.points, triangles
