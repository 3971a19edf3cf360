"""Piping in IFC: segments and fittings with bodies and axes, ports that are connected, and a system for each run."""

from __future__ import annotations

from typing import Any

import numpy as np

from cylx.export.ifc_model import Model
from cylx.export.layout import Port
from cylx.export.parts import Part, Piping
from cylx.export.solids import Bend, Cone, Mitre, Solid
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.results import ResultCylinder
from cylx.results.fittings import AnyFitting

KINDS = {
    "elbow": "BEND", "tee": "JUNCTION", "cross": "JUNCTION", "reducer": "TRANSITION", "flange": "CONNECTOR",
    "joint": "CONNECTOR", "cap": "OBSTRUCTION", "inline": "NOTDEFINED",
}  # fmt: skip
"""Predefined type of each kind of fitting; `ObjectType` has the kind itself."""


def add_piping(model: Model, piping: Piping) -> None:
    """Add an `IfcPipeSegment` for each straight and an `IfcPipeFitting` for each fitting.

    Each has a `Body` and an `Axis`. Its ends are `IfcDistributionPort`s with their z axis outwards; those that are
    joined coincide, and an `IfcRelConnectsPorts` says so. Each run is an `IfcDistributionSystem`.

    Parameters
    ----------
    model : Model
    piping : Piping
    """
    axes = model.make(
        "IfcGeometricRepresentationSubContext",
        ContextIdentifier="Axis", ContextType="Model", ParentContext=model.context, TargetView="GRAPH_VIEW",
    )  # fmt: skip
    products = [_product(model, part, axes) for part in piping.parts]
    model.contain(products)
    ports: dict[tuple[int, int], Any] = {}
    for number, (part, product) in enumerate(zip(piping.parts, products, strict=True)):
        own = [_port(model, f"{part.name} port {k}", port) for k, port in enumerate(part.ports)]
        ports |= {(number, k): port for k, port in enumerate(own)}
        model.root("IfcRelNests", f"ports of {part.name}", RelatingObject=product, RelatedObjects=own)
    for one, other in piping.links:
        name = f"{ports[one].Name} to {ports[other].Name}"
        model.root("IfcRelConnectsPorts", name, RelatingPort=ports[one], RelatedPort=ports[other])
    for name, members in zip(piping.names, piping.systems, strict=True):
        system = model.root("IfcDistributionSystem", name, PredefinedType="NOTDEFINED")
        model.root("IfcRelAssignsToGroup", name, RelatedObjects=[products[k] for k in members], RelatingGroup=system)


def values_of(found: ResultCylinder) -> dict[str, tuple[str, object]]:
    """Return the values of a cylinder's result as properties."""
    values: dict[str, tuple[str, object]] = {
        "id": ("IfcInteger", found.id),
        "radius": ("IfcPositiveLengthMeasure", found.radius),
        "inliers": ("IfcInteger", found.inliers),
        "rmse": ("IfcLengthMeasure", found.rmse),
        "coverage_deg": ("IfcReal", found.coverage_deg),
    }
    if found.confidence is not None:
        values["confidence"] = ("IfcReal", found.confidence)
    if found.uncertainty is not None:
        values["uncertainty_radius"] = ("IfcLengthMeasure", found.uncertainty.radius)
    return values


def _values_of_fitting(fitting: AnyFitting) -> dict[str, tuple[str, object]]:
    """Return the values of a fitting's result as properties."""
    values: dict[str, tuple[str, object]] = {
        "id": ("IfcInteger", fitting.id),
        "inliers": ("IfcInteger", fitting.inliers),
        "rms": ("IfcLengthMeasure", fitting.rms),
        "coverage": ("IfcReal", fitting.coverage),
        "confidence": ("IfcReal", fitting.confidence),
    }
    for name in ("radius", "bend_radius", "thickness", "start_radius", "end_radius", "offset"):
        if hasattr(fitting, name):
            values[name] = ("IfcLengthMeasure", getattr(fitting, name))
    if hasattr(fitting, "angle_deg"):
        values["angle_deg"] = ("IfcReal", fitting.angle_deg)
    return values


def _product(model: Model, part: Part, axes: object) -> Any:  # noqa: ANN401  has no types
    """Make the segment or the fitting of a part, at the first of its ports."""
    origin = part.ports[0].place
    body = _body(model, part, origin)
    curves = [_curve(model, part, path, origin) for path in _paths(part)]
    shapes = [model.make("IfcShapeRepresentation", axes, "Axis", "Curve3D", curves)] if curves else []
    if body is not None:
        kind, solids = body
        for solid in solids:
            model.paint(solid, part.name, part.color)
        shapes.append(model.make("IfcShapeRepresentation", model.body, "Body", kind, solids))
    attributes = {
        "ObjectPlacement": _placement(model, origin),
        "Representation": model.make("IfcProductDefinitionShape", None, None, shapes) if shapes else None,
    }
    if part.fitting is None:
        product = model.root("IfcPipeSegment", part.name, PredefinedType="RIGIDSEGMENT", **attributes)
    else:
        kind = part.fitting.kind
        form = KINDS["elbow"] if kind == "joint" and len(part.lines[0]) > len(part.ports) else KINDS[kind]
        product = model.root("IfcPipeFitting", part.name, ObjectType=kind, PredefinedType=form, **attributes)
    values = {} if part.cylinder is None else values_of(part.cylinder)
    if part.fitting is not None:
        values = _values_of_fitting(part.fitting)
    model.properties(product, part.name, values)
    return product


def _port(model: Model, name: str, port: Port) -> Any:  # noqa: ANN401  has no types
    """Make a port, with its z axis out of its part."""
    across, _ = axis_basis(port.outward)
    return model.root(
        "IfcDistributionPort",
        name,
        ObjectPlacement=_placement(model, port.place, port.outward, across),
        FlowDirection="NOTDEFINED",
        PredefinedType="PIPE",
        SystemType="NOTDEFINED",
    )


def _placement(model: Model, place: FloatArray, *axes: FloatArray) -> Any:  # noqa: ANN401  has no types
    """Make a placement in the scan."""
    there = model.make("IfcAxis2Placement3D", model.place(place), *map(model.direction, axes))
    return model.make("IfcLocalPlacement", model.building.ObjectPlacement, there)


def _axes(model: Model, place: FloatArray, *axes: FloatArray) -> Any:  # noqa: ANN401  has no types
    """Make a set of axes at a place: the z axis and the x axis, or those of the scan."""
    return model.make("IfcAxis2Placement3D", model.point(place), *map(model.direction, axes))


def _paths(part: Part) -> list[tuple[FloatArray, ...]]:
    """Return the centre lines of a part that have a length."""
    return [path for path in part.lines if any((place != path[0]).any() for place in path)]


def _curve(model: Model, part: Part, path: tuple[FloatArray, ...], origin: FloatArray) -> Any:  # noqa: ANN401  an entity of the library, which has no types
    """Make a centre line: the arc of a bend, or straight lines."""
    (solid,) = part.solids if len(part.solids) == 1 else (None,)
    if isinstance(solid, Bend):
        return _arc(model, solid, origin)
    places = [place for k, place in enumerate(path) if k == 0 or (place != path[k - 1]).any()]
    return model.make("IfcPolyline", [model.point(place - origin) for place in places])


def _arc(model: Model, bend: Bend, origin: FloatArray) -> Any:  # noqa: ANN401  has no types
    """Make the arc of a bend, by its angle in radians."""
    circle = model.make("IfcCircle", _axes(model, bend.center - origin, bend.normal, bend.radial), bend.bend_radius)
    bounds = [[model.make("IfcParameterValue", angle)] for angle in (0.0, bend.angle)]
    return model.make("IfcTrimmedCurve", circle, *bounds, True, "PARAMETER")


def _body(model: Model, part: Part, origin: FloatArray) -> tuple[str, list[Any]] | None:
    """Make the body of a part as one solid or several, with the type of its representation; None if it has none."""
    if len(part.solids) == 1 and isinstance(part.solids[0], Mitre):
        return "Clipping", _mitre(model, part.solids[0], origin)
    made = [_solid(model, solid, origin) for solid in part.solids]
    if len(made) > 1:
        whole = made[0][1]
        for _, other in made[1:]:
            whole = model.make("IfcBooleanResult", "UNION", whole, other)
        return "CSG", [whole]
    return (made[0][0], [made[0][1]]) if made else None


def _solid(model: Model, solid: Solid, origin: FloatArray) -> tuple[str, Any]:
    """Make a solid, with the type of its representation."""
    if isinstance(solid, Cylinder):
        return "SweptSolid", _rod(model, solid.start - origin, solid.direction, solid.radius, solid.height)
    if isinstance(solid, Bend):
        return "AdvancedSweptSolid", model.make("IfcSweptDiskSolid", _arc(model, solid, origin), solid.radius)
    if isinstance(solid, Cone):
        return _cone(model, solid, origin)
    raise TypeError("a mitre is more than one solid")


def _rod(model: Model, start: FloatArray, along: FloatArray, radius: float, length: float) -> Any:  # noqa: ANN401  an entity of the library, which has no types
    """Make a rod."""
    place = _axes(model, start, along, axis_basis(along)[0])
    up = model.direction((0.0, 0.0, 1.0))
    return model.make("IfcExtrudedAreaSolid", _circle(model, radius), place, up, length)


def _mitre(model: Model, mitre: Mitre, origin: FloatArray) -> list[Any]:
    """Make two rods, each longer than it is and clipped by the plane between them."""
    out = []
    for begin, normal in ((mitre.start, mitre.cut), (mitre.end, -mitre.cut)):
        away = mitre.corner - begin
        length = float(np.linalg.norm(away))
        along = away / length
        beyond = mitre.radius * float(np.linalg.norm(along - (along @ normal) * normal)) / float(along @ normal)
        rod = _rod(model, begin - origin, along, mitre.radius, length + 1.1 * beyond)
        plane = model.make("IfcPlane", _axes(model, mitre.corner - origin, normal, axis_basis(normal)[0]))
        # it keeps what is behind the plane
        half = model.make("IfcHalfSpaceSolid", plane, False)
        out.append(model.make("IfcBooleanClippingResult", "DIFFERENCE", rod, half))
    return out


def _circle(model: Model, radius: float, at: tuple[float, float] = (0.0, 0.0)) -> Any:  # noqa: ANN401  an entity of the library, which has no types
    """Make a disc in the plane of a solid."""
    center = model.make("IfcAxis2Placement2D", model.point(at))
    return model.make("IfcCircleProfileDef", "AREA", None, center, radius)


def _cone(model: Model, cone: Cone, origin: FloatArray) -> tuple[str, Any]:
    """Make the solid between two discs."""
    across, other = axis_basis(cone.axis)
    place = _axes(model, cone.start - origin, cone.axis, across)
    aside = float(cone.shift @ across), float(cone.shift @ other)
    begin, end = _circle(model, cone.start_radius), _circle(model, cone.end_radius, aside)
    along = model.direction(np.array([0.0, 0.0, 1.0]))
    return "AdvancedSweptSolid", model.make("IfcExtrudedAreaSolidTapered", begin, place, along, cone.height, end)
