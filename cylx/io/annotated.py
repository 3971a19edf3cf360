"""The annotated PLY: the cloud as it came, and what was found in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.io.names import mended_names
from cylx.io.outputs import open_output
from cylx.io.ply import BLOCK, ply_type, write_ply
from cylx.palette import cylinder_colors

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from cylx.records import Extraction, PointCloud

_OURS = {"cylinder_id": "<i4", "residual": "<f4", "red": "u1", "green": "u1", "blue": "u1"}


def write_annotated(path: str | Path, extraction: Extraction, *, overwrite: bool = False) -> None:
    """Write all points of the input with all their properties, and the cylinder of each.

    Every row of the input is there, in its order, as it was read: points without finite coordinates too. To its
    properties come `cylinder_id` (int, -1 for none), `residual` (float, the signed distance to that cylinder's surface,
    + is outside, scene units, NaN for none), and `red`, `green`, `blue` (uchar) by cylinder, grey for none. Properties
    of the input with these names, and the `alpha` of its colours, are kept as `orig_red` and so on. Names that PLY
    cannot hold are mended; integers of 8 bytes, which PLY does not have, become double. Other elements of a PLY, such
    as faces, are dropped. The file is a binary little endian PLY.

    Parameters
    ----------
    path : str or Path
        A file, or `-` for standard output.
    extraction : Extraction
        What was found, and in which cloud.
    overwrite : bool
        Whether a file that is there already may be replaced.

    Raises
    ------
    OutputError
        If the file exists and may not be replaced, or cannot be written.
    """
    cloud = extraction.cloud
    kept = _kept(cloud)
    dtype = np.dtype([*((new, kind) for new, kind in kept.values()), *_OURS.items()])
    with open_output(path, overwrite=overwrite) as file:
        write_ply(file, dtype, cloud.rows, _blocks(extraction, kept, dtype))


def _kept(cloud: PointCloud) -> dict[str, tuple[str, np.dtype[Any]]]:
    """Say under which name and type each property of the input is kept, by the name it has there."""
    if cloud.table is None:
        return {axis: (axis, np.dtype("<f8")) for axis in "xyz"}
    names = cloud.table.dtype.names or ()
    mended = mended_names(names)
    taken = {*mended, *_OURS}
    colored = {"red", "green", "blue"} <= set(mended)
    kept = {}
    for name, new in zip(names, mended, strict=True):
        renamed = new
        if new in _OURS or (new == "alpha" and colored):
            while renamed in taken:
                renamed = f"orig_{renamed}"
            taken.add(renamed)
        kept[name] = (renamed, ply_type(cloud.table.dtype[name]))
    return kept


def _columns(cloud: PointCloud) -> Mapping[str, NDArray[Any]] | NDArray[np.void]:
    """Give what the input says of its rows, by name; the rows that an array of points had in excess are NaN."""
    if cloud.table is not None:
        return cloud.table
    return {axis: cloud.spread(cloud.points[:, place], np.nan) for place, axis in enumerate("xyz")}


def _blocks(
    extraction: Extraction, kept: dict[str, tuple[str, np.dtype[Any]]], dtype: np.dtype[np.void]
) -> Iterator[NDArray[np.void]]:
    cloud = extraction.cloud
    columns = _columns(cloud)
    labels = cloud.spread(extraction.labels, -1)
    residuals = cloud.spread(extraction.residuals, np.nan)
    for start in range(0, cloud.rows, BLOCK):
        part = slice(start, start + BLOCK)
        ids = labels[part]
        block = np.empty(len(ids), dtype)
        for name, (new, _) in kept.items():
            block[new] = columns[name][part]
        block["cylinder_id"] = ids
        block["residual"] = np.where(ids < 0, np.nan, residuals[part])
        for name, values in zip(("red", "green", "blue"), cylinder_colors(ids).T, strict=True):
            block[name] = values
        yield block
