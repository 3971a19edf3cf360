"""Records of the stems of a plot, and of the ground they stand on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.records.clouds import PointCloud


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The ground under a cloud.

    Parameters
    ----------
    corner : ndarray of shape (2,)
        Corner of the grid, metres.
    cell : float
        Side of a cell, metres.
    heights : ndarray of shape (n, m)
        At the middles of the cells, metres.
    by : str
        How it was found: `classes`, `cloth` or `lowest`.
    """

    corner: FloatArray
    cell: float
    heights: FloatArray
    by: str

    def at(self, xy: FloatArray) -> FloatArray:
        """Return the height of the ground at places (n, 2), between the middles of the cells; shape (n,)."""
        n, m = self.heights.shape
        place = (xy - self.corner) / self.cell - 0.5
        i = np.clip(place[:, 0], 0.0, n - 1.0)
        j = np.clip(place[:, 1], 0.0, m - 1.0)
        i0, j0 = np.minimum(i.astype(np.int64), max(n - 2, 0)), np.minimum(j.astype(np.int64), max(m - 2, 0))
        i1, j1 = np.minimum(i0 + 1, n - 1), np.minimum(j0 + 1, m - 1)
        di, dj = i - i0, j - j0
        h = self.heights
        low = h[i0, j0] * (1.0 - dj) + h[i0, j1] * dj
        return np.asarray(low * (1.0 - di) + (h[i1, j0] * (1.0 - dj) + h[i1, j1] * dj) * di)


@dataclass(frozen=True, slots=True, eq=False)
class StemSection:
    """A section across a stem.

    Parameters
    ----------
    height : float
        Above the ground at the stem, metres.
    center : ndarray of shape (3,)
        On the axis, scene units.
    diameter, sd : float
        Mean diameter and its standard deviation, metres.
    arc : float
        Angle about the axis that points cover, radians.
    roundness : float
        Least over greatest diameter of the ellipse that fits best, in (0, 1]; NaN if less than 3/4 of it are seen.
    """

    height: float
    center: FloatArray
    diameter: float
    sd: float
    arc: float
    roundness: float


@dataclass(frozen=True, slots=True, eq=False)
class Stem:
    """A stem of a plot.

    Parameters
    ----------
    foot : ndarray of shape (3,)
        Where its axis meets the ground, scene units.
    breast : ndarray of shape (3,)
        Its axis at breast height.
    dbh, dbh_sd : float
        Diameter across the axis at breast height and its standard deviation, metres.
    dbh_from : str
        `measured` on points about breast height, or `taper` if sections above or below tell it.
    direction : ndarray of shape (3,)
        Of the axis at breast height, upwards.
    lean : float
        Angle between it and the vertical, radians.
    taper : float
        Loss of diameter per length, metres a metre; NaN if too little is seen.
    roundness : float
        That at breast height, see `StemSection`.
    arc : float
        Angle about the axis of which points about breast height are seen, radians.
    lowest, highest : float
        Heights above the ground between which the stem was followed, metres.
    quality : float
        In [0, 1]: see `cylx.stems.quality`.
    flags : tuple of str
        What a reader should know: `not round`, `half seen`, `thin for its noise`, `few sections`, `taper`.
    sections : tuple of StemSection
        From the lowest upwards.
    points : int
        Number of points on it.
    """

    foot: FloatArray
    breast: FloatArray
    dbh: float
    dbh_sd: float
    dbh_from: str
    direction: FloatArray
    lean: float
    taper: float
    roundness: float
    arc: float
    lowest: float
    highest: float
    quality: float
    flags: tuple[str, ...]
    sections: tuple[StemSection, ...]
    points: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class StemPlot:
    """The stems of a cloud.

    Parameters
    ----------
    cloud : PointCloud
    stems : tuple of Stem
        From north to south in strips, so that their order does not depend on that of the points.
    labels : ndarray of shape (N,)
        Index of the stem of each point of the cloud, -1 for none.
    ground : Ground
    unit : float
        Metres of a scene unit.
    """

    cloud: PointCloud
    stems: tuple[Stem, ...]
    labels: NDArray[np.int32]
    ground: Ground
    unit: float
