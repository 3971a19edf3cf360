"""Whether a format can hold the points of a cloud: known before anything is computed for it."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylx.errors import OutputError
from cylx.io.annotated_columns import OF_RUNS, OURS
from cylx.io.formats import LAS_SUFFIXES
from cylx.io.inputs import excerpt
from cylx.io.staging import known_name

if TYPE_CHECKING:
    from cylx.records import PointCloud

_TRIED = 3
_MOST_STEPS = 4.0
"""A coordinate in double precision may be off by this many steps of its file."""


def check_annotated(path: str | Path, cloud: PointCloud) -> None:
    """Refuse a format that cannot hold the points of a cloud, before anything is computed for it.

    Parameters
    ----------
    path : str or Path
        Name of the annotated cloud.
    cloud : PointCloud

    Raises
    ------
    OutputError
        If it is LAS or LAZ and the cloud is from neither, or PCD and a property is a list.
    """
    suffix = Path(path).suffix.lower()
    if suffix in LAS_SUFFIXES and (cloud.source.header is None or cloud.table is None):
        raise OutputError(known_name(path), "the input is neither LAS nor LAZ", "choose a name that ends in .ply")
    obstacle = las_obstacle(path, cloud)
    if obstacle:
        raise OutputError(known_name(path), obstacle, "choose a name that ends in .ply")
    if suffix == ".pcd" and cloud.table is not None:
        dtype = cloud.table.dtype
        lists = [name for name in dtype.names or () if dtype[name].kind == "O"]
        if lists:
            fault = f"PCD cannot hold the list property {excerpt(lists[0])}"
            raise OutputError(known_name(path), fault, "choose a name that ends in .ply")


def las_obstacle(path: str | Path, cloud: PointCloud) -> str:
    """Return why a cloud from LAS or LAZ cannot be written as such again: tried with its first points.

    Parameters
    ----------
    path : str or Path
        Name of the annotated cloud.
    cloud : PointCloud

    Returns
    -------
    str
        Empty if it can, or if it is to be written in another format, or is from neither.
    """
    header, table, suffix = cloud.source.header, cloud.table, Path(path).suffix.lower()
    if suffix not in LAS_SUFFIXES or header is None or table is None:
        return ""
    from cylx.io.las_annotated import has_colors, write_las  # noqa: PLC0415  needs an extra, or for this alone

    scales, offsets = struct.unpack_from("<3d", header, 131), struct.unpack_from("<3d", header, 155)
    for axis, scale, offset in zip("xyz", scales, offsets, strict=True):
        if np.spacing(max(np.abs(table[axis]).max(), abs(offset))) > _MOST_STEPS * abs(scale):
            return f"the steps of {axis}, {scale:g}, are lost so far from the origin"
    few = table[:_TRIED]
    ours = {name: np.zeros(len(few), kind) for name, kind in (OURS | OF_RUNS).items()}
    compressed, colored = suffix == ".laz", has_colors(few)
    try:
        write_las(io.BytesIO(), header, len(few), [(few, ours)], colored=colored, compressed=compressed, runs=True)
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001  laspy raises whatever it meets
        fault = " ".join(str(error).split()) or type(error).__name__
        return f"laspy cannot write this file again: {excerpt(fault, 100)}"
    return ""
