"""The stems of a plot on a map: a point at the foot of each, and the line along its sections."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylx.export.geo import Feature, Layer, MapCrs, geojson, geopackage

if TYPE_CHECKING:
    from cylx.results.stems import Stems


def stems_map(stems: Stems, crs: MapCrs | None, name: str, scale: float = 1.0) -> bytes:
    """Write the stems as a GeoPackage or as GeoJSON, with the columns of the table as attributes.

    Parameters
    ----------
    stems : Stems
    crs : MapCrs or None
        Of the coordinates; None if unknown.
    name : str
        Of the output; `.geojson` at its end is GeoJSON, anything else a GeoPackage.
    scale : float
        Units of the CRS in a unit of the scene.

    Raises
    ------
    OutputError
        If it is GeoJSON, and the CRS is unknown or cannot be converted to degrees.
    """
    rows = stems.rows()
    feet = [[scale * x for x in (stem.x, stem.y, stem.ground)] for stem in stems.stems]
    lines = [[[scale * x for x in one.center] for one in stem.sections] for stem in stems.stems]
    layers = [
        Layer("stems", "POINT", [Feature(*pair) for pair in zip(feet, rows, strict=True)], "feet of stems, metres"),
        Layer(
            "axes", "LINESTRING", [Feature(*pair) for pair in zip(lines, rows, strict=True)], "axes of stems, metres"
        ),
    ]
    if name.lower().endswith(".geojson"):
        return geojson(layers, crs, name)
    return geopackage(layers, crs)
