"""The stems of a plot: where each stands, and its diameter at breast height."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

from cylx.api.clouds import chosen_cloud
from cylx.errors import InputError, UsageError
from cylx.records import Crop, PointCloud
from cylx.records.stems import StemPlot
from cylx.stems import find_stems as find_stems_in
from cylx.stems.ground import GroundBy
from cylx.units import METRES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

WIDEST, HIGHEST = 5000.0, 1000.0
"""A larger cloud is no plot in this unit, metres: its ground would be a grid of too many cells."""


def find_stems(
    points_or_path: ArrayLike | PointCloud | str | PathLike[str],
    *,
    units: str | None = None,
    ground: GroundBy | None = None,
    min_dbh: float = 0.05,
    crop: Crop | None = None,
    voxel: float | None = None,
    every: int | None = None,
    classes: Sequence[int] | None = None,
    scan: int | None = None,
) -> StemPlot:
    """Find and measure the stems of a plot of a forest; the same as `cylx stems`. z points upwards.

    Parameters
    ----------
    points_or_path : array_like of shape (N, 3), PointCloud, str or Path
        Coordinates, or a file that holds them.
    units : str, optional
        Unit of the coordinates, such as `m`, `mm` or `us-ft`; by default what the file says, or metres.
    ground : {"classes", "cloth", "lowest"}, optional
        How the ground is found: from points of class 2, by a cloth, or by the lowest points. By default from class 2 if
        there is any, or else by a cloth if its library is installed.
    min_dbh : float
        Least diameter at breast height, metres.
    crop, voxel, every, classes, scan
        As for `extract`.

    Returns
    -------
    StemPlot
        Diameters and heights in metres, places in the unit of the points.

    Raises
    ------
    InputError
        If the file cannot be read, or the cloud is too large for a plot in this unit.
    UsageError
        If the unit is unknown.
    ValueError
        If the shape of the array is not (N, 3), or the selection of points is impossible.

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> made = cylx.synthetic.forest(3, side=8.0, spacing=0.02)
    >>> plot = cylx.find_stems(made.points, ground="lowest")
    >>> thick = sum(stem.dbh > 0.1 for stem in made.stems)
    >>> len(plot.stems) == thick
    True
    """
    if units is not None and units not in METRES:
        raise UsageError("units", f"{units!r} is no unit of length", f"choose one of {', '.join(METRES)}")
    cloud = chosen_cloud(points_or_path, units, crop=crop, voxel=voxel, every=every, classes=classes, scan=scan)
    unit = METRES[units or cloud.source.units or "m"]
    size = (cloud.points.max(axis=0) - cloud.points.min(axis=0)) * unit
    if float(size[:2].max()) > WIDEST or float(size[2]) > HIGHEST:
        fault = f"is {size[0]:.3g} m by {size[1]:.3g} m and {size[2]:.3g} m high, too large for a plot"
        raise InputError(cloud.source.file, fault, "give its unit by --units, or a part of it by --crop")
    return find_stems_in(cloud, unit=unit, ground=ground, min_dbh=min_dbh)
