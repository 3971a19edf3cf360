"""Coordinates of a map in degrees of WGS 84, and its CRS as other programs read it, by pyproj."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cylx.errors import OutputError, UsageError
from cylx.optional.extras import is_found, require

_WGS84 = 4326
_PLACES = 9
"""Decimal places of degrees: a tenth of a millimetre."""


def crs_of(text: str, place: str) -> tuple[str | None, int | None]:
    """Return the WKT and the code of a CRS that a user names.

    Parameters
    ----------
    text : str
        `EPSG:25832`, a WKT, or what else pyproj knows.
    place : str
        Name of the option in an error.

    Raises
    ------
    UsageError
        If it is none, or pyproj is not installed.
    """
    require("pyproj", place=place)
    from pyproj import CRS  # noqa: PLC0415  an extra
    from pyproj.exceptions import ProjError  # noqa: PLC0415  an extra

    try:
        crs = CRS.from_user_input(text)
        code = crs.to_epsg() or _level(crs.to_wkt(), None).to_epsg()
    except ProjError as error:
        fault = " ".join(str(error).split())[:200]
        raise UsageError(place, f"is no CRS: {fault}", "give one as EPSG:25832, or its WKT") from None
    return str(crs.to_wkt()), None if code is None else int(code)


def to_degrees(
    points: Sequence[Sequence[float]], wkt: str | None, epsg: int | None, metres: float, place: str
) -> list[list[float]]:
    """Return points as longitude, latitude and, if they have it, height.

    Parameters
    ----------
    points : sequence of (x, y) or (x, y, z)
        Coordinates in the CRS, east before north.
    wkt : str or None
    epsg : int or None
        Of the CRS; one of them is known.
    metres : float
        Length of the unit of the heights, metres.
    place : str
        Name of the output in an error.

    Returns
    -------
    list of list of float
        Degrees of WGS 84, and metres. Heights keep the zero that they have in the scan.

    Raises
    ------
    OutputError
        If the CRS has no conversion to degrees, or the points are where it has none.
    UsageError
        If pyproj is not installed.
    """
    if not points:
        return []
    array = np.array([point[:2] for point in points], dtype=np.float64)
    if epsg != _WGS84:
        require("pyproj", place=place, needed_by="GeoJSON of a projected CRS")
        array = np.column_stack(_turned(array, wkt, epsg, place))
    if not np.isfinite(array).all():
        remedy = "check the CRS of the scan, or give another by --crs"
        raise OutputError(place, "there is a cylinder where the CRS has no longitude and latitude", remedy)
    rest = [[round(height * metres, 4) + 0.0 for height in point[2:]] for point in points]
    return [[*(round(x, _PLACES) for x in pair), *z] for pair, z in zip(array.tolist(), rest, strict=True)]


def wkt_for_maps(wkt: str | None, epsg: int | None) -> str | None:
    """Return a CRS as WKT 1, as a GeoPackage has it, without its heights; None if it is not known.

    Without pyproj, or if that does not know the CRS, it is what is given.
    """
    if not is_found("pyproj"):
        return wkt
    from pyproj.exceptions import ProjError  # noqa: PLC0415  an extra

    try:
        return str(_level(wkt, epsg).to_wkt("WKT1_GDAL"))
    except ProjError:
        return wkt


def _turned(array: Any, wkt: str | None, epsg: int | None, place: str) -> Any:  # noqa: ANN401  pyproj has few types
    from pyproj import Transformer  # noqa: PLC0415  an extra
    from pyproj.exceptions import ProjError  # noqa: PLC0415  an extra

    try:
        transformer = Transformer.from_crs(_level(wkt, epsg), _WGS84, always_xy=True)
        return transformer.transform(array[:, 0], array[:, 1])
    except ProjError as error:
        fault = " ".join(str(error).split())[:200]
        raise OutputError(place, f"its CRS cannot be converted to degrees: {fault}", "write .gpkg") from None


def _level(wkt: str | None, epsg: int | None) -> Any:  # noqa: ANN401  pyproj has few types
    """Return the CRS without its heights."""
    from pyproj import CRS  # noqa: PLC0415  an extra

    crs = CRS.from_wkt(wkt) if wkt is not None else CRS.from_epsg(epsg)
    if crs.is_bound and crs.source_crs is not None:
        crs = crs.source_crs
    return crs.sub_crs_list[0] if crs.is_compound else crs
