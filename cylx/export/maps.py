"""Maps of the cylinders: their centre lines with all values of the result, as GeoPackage and GeoJSON."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, radians
from typing import Any

import numpy as np

from cylx.export.drawing import Drawing, Exported
from cylx.export.geo import Feature, Layer, geojson, geopackage
from cylx.export.parts import Part
from cylx.export.solids import Bend, radius_of
from cylx.results.table import table_of
from cylx.units import METRES

_STEP = radians(5.0)
"""Arcs are drawn as chords of at most this angle."""


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write a map with a line from end to end of each cylinder, and the columns of the table as its attributes.

    Fittings, if there are any, are a layer of their own, with the lines from port to port. Coordinates are in the CRS
    of the scan, in degrees for GeoJSON; the attributes are in the unit of the scan.

    Parameters
    ----------
    drawing : Drawing
    suffix : str
        `.gpkg` or `.geojson`.
    """
    scale = 1.0
    if drawing.crs is not None and drawing.unit is not None:
        ratio = METRES[drawing.unit] / drawing.crs.metres
        scale = 1.0 if abs(ratio - 1.0) < 1e-9 else ratio
    said = "" if drawing.unit is None else f", lengths in {drawing.unit}"
    table = table_of([cylinder.to_object() for cylinder in drawing.cylinders])
    rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
    found = [
        Feature([_scaled(one.start, scale), _scaled(one.end, scale)], row)
        for one, row in zip(drawing.cylinders, rows, strict=True)
    ]
    layers = [Layer("cylinders", "LINESTRING", found, f"centre lines of cylinders{said}")]
    if drawing.piping is not None:
        fittings = [one for part in drawing.piping.parts for one in _fitting(part, scale)]
        layers.append(Layer("fittings", "MULTILINESTRING", fittings, f"centre lines of fittings{said}"))
    if suffix == ".gpkg":
        return Exported(geopackage(layers, drawing.crs))
    return Exported(geojson(layers, drawing.crs, f"the {suffix} file"))


def _scaled(place: Any, scale: float) -> list[float]:  # noqa: ANN401  a list or an array
    return [float(x) if scale == 1.0 else float(x) * scale for x in place]


def _fitting(part: Part, scale: float) -> Iterator[Feature]:
    """Yield the lines of a fitting, if that is what the part is."""
    if part.fitting is None:
        return
    arcs = [solid for solid in part.solids if isinstance(solid, Bend)]
    lines = [_arc(arc, scale) for arc in arcs]
    if not arcs:
        lines = [[_scaled(place, scale) for place in path] for path in part.lines]
        lines = [line for line in lines if any(place != line[0] for place in line)]
    if not lines:
        return
    one = part.fitting
    radius = max(map(radius_of, part.solids), default=max(port.radius for port in part.ports))
    values: dict[str, Any] = {
        "id": one.id,
        "kind": one.kind,
        "radius": radius,
        "confidence": one.confidence,
        "inliers": one.inliers,
    }
    for name in ("angle_deg", "bend_radius"):
        values[name] = getattr(one, name, None)
    yield Feature(lines, values)


def _arc(bend: Bend, scale: float) -> list[list[float]]:
    steps = max(1, ceil(bend.angle / _STEP))
    return [_scaled(bend.at(float(angle)), scale) for angle in np.linspace(0.0, bend.angle, steps + 1)]
