"""The source of a cloud, and the selection of its points."""

from __future__ import annotations

import math
from dataclasses import dataclass

Corner = tuple[float | None, float | None, float | None]
Crop = tuple[Corner, Corner]


@dataclass(frozen=True, slots=True)
class Selection:
    """The selection of points to use; None means all.

    Parameters
    ----------
    crop : pair of triples of float or None
        The smallest and the largest coordinates, scene units; None sets no bound.
    voxel : float or None
        Side of the cells in which only one point is used, scene units.
    every : int or None
        Use only the first of this many rows of the file.
    classes : tuple of int or None
        Use only points of these classes, ascending.
    scan : int or None
        Number of the scan to read in a file of several, from 0.
    """

    crop: Crop | None = None
    voxel: float | None = None
    every: int | None = None
    classes: tuple[int, ...] | None = None
    scan: int | None = None

    def __post_init__(self) -> None:
        if self.crop is not None:
            _check_crop(self.crop)
        if self.voxel is not None and not 0 < self.voxel < math.inf:
            raise ValueError(f"voxel must be > 0 and finite, not {self.voxel}")
        if self.every is not None and self.every < 1:
            raise ValueError(f"every must be at least 1, not {self.every}")
        if self.scan is not None and self.scan < 0:
            raise ValueError(f"scan must be at least 0, not {self.scan}")
        if self.classes is not None:
            if not self.classes or min(self.classes) < 0:
                raise ValueError(f"classes must be one or several numbers from 0, not {self.classes}")
            object.__setattr__(self, "classes", tuple(sorted(set(self.classes))))

    @property
    def narrows(self) -> bool:
        """Whether points that were read are left out."""
        return any(one is not None for one in (self.crop, self.voxel, self.every, self.classes))


@dataclass(frozen=True, slots=True)
class Crs:
    """A coordinate reference system.

    Parameters
    ----------
    name : str
        Its name.
    wkt : str or None
        Its definition; None if only its code is known.
    epsg : int or None
        Code of EPSG of the whole, or of its horizontal part.
    """

    name: str
    wkt: str | None = None
    epsg: int | None = None


@dataclass(frozen=True, slots=True)
class Source:
    """The source of a cloud.

    Parameters
    ----------
    file : str
        The name as the user gave it, `-` for standard input, `<array>` for an array.
    format : str
        `ply`, `pcd`, `xyz`, `las`, `e57`, `npy`, `ptx` or `array`.
    sha256 : str or None
        Digest of the bytes read; None for an array.
    selection : Selection
        Which of its points are used.
    header : bytes or None
        The parts of a LAS file besides the points, so that it can be written again.
    notes : tuple of str
        What a reader should know about how the file was read, one line each.
    doubts : tuple of (str, str)
        What may have been read wrongly, and the remedy.
    units : str or None
        Unit of length of the coordinates, a key of `cylx.units.METRES`; None if unknown.
    crs : Crs or None
        Their coordinate reference system; None if the file says none.
    stations : tuple of (float, float, float) or None
        Places of the scanners of its scans, by their numbers; None where it is unknown.
    """

    file: str
    format: str
    sha256: str | None = None
    selection: Selection = Selection()
    header: bytes | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[tuple[str, str], ...] = ()
    units: str | None = None
    crs: Crs | None = None
    stations: tuple[tuple[float, float, float] | None, ...] = ()


ARRAY = Source("<array>", "array")
"""The source of a cloud that is not from a file."""


def _check_crop(crop: Crop) -> None:
    if len(crop) != 2 or any(len(corner) != 3 for corner in crop):
        raise ValueError(f"crop must be two corners of three coordinates, not {crop}")
    for axis, low, high in zip("xyz", *crop, strict=True):
        if any(side is not None and not math.isfinite(side) for side in (low, high)):
            raise ValueError(f"crop must be finite in {axis}; None sets no bound")
        if low is not None and high is not None and low > high:
            raise ValueError(f"crop has its smallest {axis}, {low:g}, above its largest, {high:g}")
