"""The side from which each cylinder was seen, where the scan says the places of its scanners.

A point of a pin lies on the side that faces its scanner, and one of a bore on the side that faces away. Some programs
write other things as the place of a scanner, such as the zero of a map. Then the points of many cylinders lie on both
sides, and no place is believed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import CylinderFit, Extraction, PointCloud

LEAST_POINTS = 50
ALL_BUT = 0.05
"""Share of the points of a cylinder that may be on the other side, as where it is dented, or two are taken for one."""
BELIEVED = 0.9
"""Of the cylinders, this share must have their points on one side."""


def with_sides(extraction: Extraction) -> Extraction:
    """Return an extraction whose cylinders have the sides that their scanners saw, as far as these are known.

    Parameters
    ----------
    extraction : Extraction
    """
    scanners = scanners_of(extraction.cloud)
    if scanners is None:
        return extraction
    shares = [_facing(k, fit, extraction, scanners) for k, fit in enumerate(extraction.cylinders)]
    known = [share for share in shares if share is not None]
    certain = [share for share in known if min(share, 1.0 - share) <= ALL_BUT]
    if not known or len(certain) < BELIEVED * len(known):
        return extraction
    fits = tuple(
        fit
        if share is None or fit.side is None or ALL_BUT < share < 1.0 - ALL_BUT
        else replace(fit, side="convex" if share > 0.5 else "concave")
        for fit, share in zip(extraction.cylinders, shares, strict=True)
    )
    return replace(extraction, cylinders=fits)


def scanners_of(cloud: PointCloud) -> FloatArray | None:
    """Return the place of the scanner of each point, shape (N, 3), NaN where it is unknown; None if all are.

    Parameters
    ----------
    cloud : PointCloud
    """
    places, table = cloud.source.stations, cloud.table
    if table is None or "scan" not in (table.dtype.names or ()) or all(place is None for place in places):
        return None
    known = np.array([(np.nan,) * 3 if place is None else place for place in (*places, None)])
    numbers = table["scan"] if cloud.valid is None else table["scan"][cloud.valid]
    return np.asarray(known[np.minimum(numbers, len(known) - 1)])


def _facing(number: int, fit: CylinderFit, extraction: Extraction, scanners: FloatArray) -> float | None:
    """Return the share of a cylinder's points that are on the side of their scanner; None if there are too few."""
    own = np.flatnonzero(extraction.labels == number)
    own = own[np.isfinite(scanners[own, 0])]
    if len(own) < LEAST_POINTS:
        return None
    shape = fit.cylinder
    away = extraction.cloud.points[own] - shape.point
    outwards = away - np.outer(away @ shape.direction, shape.direction)
    to_scanner = scanners[own] - extraction.cloud.points[own]
    return float(np.mean(np.einsum("ij,ij->i", outwards, to_scanner) > 0.0))
