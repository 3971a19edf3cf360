"""The cloud that was given, in whatever form, and the part of it that was chosen."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from cylx.io import read_cloud
from cylx.records import Crop, PointCloud, Selection
from cylx.scene import select

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def chosen_cloud(
    given: ArrayLike | PointCloud | str | PathLike[str],
    units: str | None = None,
    *,
    crop: Crop | None = None,
    voxel: float | None = None,
    every: int | None = None,
    classes: Sequence[int] | None = None,
    scan: int | None = None,
) -> PointCloud:
    """Return the chosen points of what was given: a cloud, an array of shape (N, 3), or a file.

    Parameters
    ----------
    given : array_like of shape (N, 3), PointCloud, str or Path
    units : str, optional
        Unit of a file; by default what it says.
    crop, voxel, every, classes, scan
        As for `cylx.extract`.

    Raises
    ------
    InputError
        If the file cannot be read.
    ValueError
        If the shape of the array is not (N, 3), or the selection of points is impossible.
    """
    chosen = None if classes is None else tuple(classes)
    selection = Selection(crop=crop, voxel=voxel, every=every, classes=chosen, scan=scan)
    if isinstance(given, str | PathLike):
        return select(read_cloud(Path(given), scan=scan, units=units), selection)
    if scan is not None:
        raise ValueError("scan needs a file, and an array was given")
    return select(given if isinstance(given, PointCloud) else PointCloud.from_array(given), selection)
