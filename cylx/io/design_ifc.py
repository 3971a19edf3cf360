"""The cylinders of an IFC file: circles swept along a straight line, by ifcopenshell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from cylx.errors import InputError
from cylx.io.design_parts import design_cylinder
from cylx.io.inputs import Input
from cylx.records.designs import Design, DesignCylinder
from cylx.units import unit_of

_DEEPEST = 16
_STRAIGHT = 1e-6
"""A circle that is swept askew by more than this makes no right cylinder."""
_SAME = 1e-9


def read_ifc(source: Input) -> Design:
    """Read the circles that are swept along straight lines in the bodies of the products of an IFC file.

    Of hollow profiles the outer circle counts. With an `IfcMapConversion`, the coordinates are those of the map.

    Parameters
    ----------
    source : Input

    Raises
    ------
    InputError
        If it is no IFC, or a cylinder has no size.
    """
    import ifcopenshell  # noqa: PLC0415  an extra
    from ifcopenshell.util.placement import get_local_placement  # noqa: PLC0415  an extra
    from ifcopenshell.util.unit import calculate_unit_scale  # noqa: PLC0415  an extra

    place = source.place
    text = source.head(source.size).decode("utf-8", "replace")
    if not text.lstrip().startswith("ISO-10303-21"):
        raise InputError(place, "is not IFC: it does not begin with ISO-10303-21", "give it its right suffix")
    try:
        file = ifcopenshell.file.from_string(text)
        metres = float(calculate_unit_scale(file))
        to_map, map_metres = _map(file, metres)
        found: list[DesignCylinder] = []
        for product in file.by_type("IfcProduct"):
            if product.Representation is None:
                continue
            there = np.eye(4) if product.ObjectPlacement is None else get_local_placement(product.ObjectPlacement)
            name = str(product.Name or product.GlobalId)
            bodies = [one for one in product.Representation.Representations if one.RepresentationIdentifier != "Axis"]
            rods = [rod for body in bodies for item in body.Items for rod in _rods(item, to_map @ there, 0)]
            for number, (start, end, radius) in enumerate(rods):
                called = name if len(rods) == 1 else f"{name} {number}"
                found.append(design_cylinder(called, start, end, radius, f"{place}: {called}"))
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001  what ifcopenshell raises depends on what it finds in the file
        fault = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(place, f"broken IFC: {fault}", "export the file again") from None
    return Design("ifc", unit_of(map_metres), map_metres, tuple(found))


def _map(file: Any, metres: float) -> tuple[Any, float]:  # noqa: ANN401  has no types
    """Return the matrix from the coordinates of the file to those of its map, and the length of the unit there."""
    conversions = file.by_type("IfcMapConversion") if file.schema != "IFC2X3" else []
    if not conversions:
        return np.eye(4), metres
    one = conversions[0]
    scale = float(one.Scale or 1.0)
    across, along = float(one.XAxisAbscissa or 0.0), float(one.XAxisOrdinate or 0.0)
    if not across and not along:  # both may be left out
        across = 1.0
    length = math.hypot(across, along)
    matrix = np.eye(4)
    matrix[:2, :2] = np.array([[across, -along], [along, across]]) / length
    matrix[:3, :3] *= scale
    matrix[:3, 3] = one.Eastings, one.Northings, one.OrthogonalHeight
    return matrix, metres / scale


def _rods(item: Any, matrix: Any, depth: int) -> Iterator[tuple[Any, Any, float]]:  # noqa: ANN401  has no types
    """Yield start, end and radius of the rods that an item of a body is made of."""
    from ifcopenshell.util.placement import get_axis2placement, get_mappeditem_transformation  # noqa: PLC0415  an extra

    if depth > _DEEPEST:
        return
    if item.is_a("IfcMappedItem"):
        inner = matrix @ get_mappeditem_transformation(item)
        for one in item.MappingSource.MappedRepresentation.Items:
            yield from _rods(one, inner, depth + 1)
    elif item.is_a("IfcBooleanResult"):
        yield from _rods(item.FirstOperand, matrix, depth + 1)
    elif item.is_a("IfcCsgSolid"):
        yield from _rods(item.TreeRootExpression, matrix, depth + 1)
    elif item.is_a("IfcRightCircularCylinder"):
        inner = matrix @ get_axis2placement(item.Position)
        yield _ends(inner, np.zeros(3), np.array([0.0, 0.0, item.Height]), item.Radius)
    elif item.is_a("IfcSweptDiskSolid"):
        places = _polyline(item.Directrix)
        if len(places) == 2:
            yield _ends(matrix, places[0], places[1], item.Radius)
    elif item.is_a("IfcExtrudedAreaSolid") and not item.is_a("IfcExtrudedAreaSolidTapered"):
        profile = item.SweptArea
        way = np.array(item.ExtrudedDirection.DirectionRatios, dtype=float)
        way /= np.linalg.norm(way)
        if not profile.is_a("IfcCircleProfileDef") or abs(abs(way[2]) - 1.0) > _STRAIGHT:
            return
        inner = matrix if item.Position is None else matrix @ get_axis2placement(item.Position)
        begin = np.zeros(3)
        if profile.Position is not None:
            begin[:2] = profile.Position.Location.Coordinates[:2]
        yield _ends(inner, begin, begin + item.Depth * way, profile.Radius)


def _polyline(curve: Any) -> list[Any]:  # noqa: ANN401  has no types
    """Return the places that a curve of straight lines goes through; none if it is another."""
    if curve.is_a("IfcPolyline"):
        return [np.array(point.Coordinates, dtype=float) for point in curve.Points]
    if curve.is_a("IfcIndexedPolyCurve") and not any(one.is_a("IfcArcIndex") for one in curve.Segments or ()):
        return [np.array(place, dtype=float) for place in curve.Points.CoordList]
    return []


def _ends(matrix: Any, start: Any, end: Any, radius: float) -> tuple[Any, Any, float]:  # noqa: ANN401  ifcopenshell has none
    """Return a rod where a matrix puts it."""
    scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
    first, last = (matrix[:3, :3] @ one + matrix[:3, 3] for one in (start, end))
    return first, last, float(radius) * (1.0 if abs(scale - 1.0) < _SAME else scale)
