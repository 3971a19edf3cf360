"""IFC: pipe segments, circles swept along their axes, by ifcopenshell."""

from __future__ import annotations

import hashlib
import uuid
from typing import Any

from cylx.export.drawing import Drawing, Exported, Piece
from cylx.export.formats import METRES
from cylx.geometry.cylinder import axis_basis
from cylx.version import __version__

_PREFIXES = {"m": None, "mm": "MILLI", "cm": "CENTI"}
_NAMES = {"in": "INCH", "ft": "FOOT"}
_NO_TIME = "1970-01-01T00:00:00"


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write an IFC4 file with an `IfcPipeSegment` for each cylinder, in the unit of the scan.

    Each is placed at the start of its cylinder, with its z axis along the cylinder. The property set `cylx` has its
    number, its radius, and its confidence and uncertainty. Identifiers are made of the content.

    Parameters
    ----------
    drawing : Drawing
        With a unit.
    suffix : str
        `.ifc`.
    """
    return Exported(_Model(drawing).text().encode())


class _Model:
    """A file under construction.

    Parameters
    ----------
    drawing : Drawing
    """

    def __init__(self, drawing: Drawing) -> None:
        import ifcopenshell  # noqa: PLC0415  an extra
        from ifcopenshell import guid  # noqa: PLC0415  an extra

        self.compress = guid.compress
        self.file = ifcopenshell.file(schema="IFC4")
        content = "".join(cylinder.model_dump_json() for cylinder in drawing.cylinders)
        self.seed = uuid.UUID(hashlib.sha256(f"{drawing.unit}{content}".encode()).hexdigest()[:32])
        unit = drawing.unit or "m"
        here = self.make("IfcAxis2Placement3D", self.point((0.0, 0.0, 0.0)))
        context = self.make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, here)
        self.body = self.make(
            "IfcGeometricRepresentationSubContext",
            ContextIdentifier="Body", ContextType="Model", ParentContext=context, TargetView="MODEL_VIEW",
        )  # fmt: skip
        units = self.make("IfcUnitAssignment", [self.length(unit), self.make_unit("PLANEANGLEUNIT", "RADIAN")])
        project = self.root("IfcProject", "cylx", RepresentationContexts=[context], UnitsInContext=units)
        building = self.root("IfcBuilding", "scan", ObjectPlacement=self.make("IfcLocalPlacement", None, here))
        self.root("IfcRelAggregates", "project", RelatingObject=project, RelatedObjects=[building])
        segments = [self.segment(piece, building.ObjectPlacement) for piece in drawing.pieces]
        if segments:
            self.root("IfcRelContainedInSpatialStructure", "scan", RelatedElements=segments, RelatingStructure=building)

    def text(self) -> str:
        """Return the file, without the time of writing."""
        header = self.file.header
        header.file_description.description = ("ViewDefinition [ReferenceView]",)
        header.file_name.name = "cylx"
        header.file_name.time_stamp = _NO_TIME
        header.file_name.originating_system = f"cylx {__version__}"
        return str(self.file.to_string())

    def make(self, kind: str, *values: object, **attributes: object) -> Any:  # noqa: ANN401  has no types
        """Make an entity."""
        return self.file.create_entity(kind, *values, **attributes)

    def root(self, kind: str, name: str, **attributes: object) -> Any:  # noqa: ANN401  has no types
        """Make an entity that has an identifier and a name."""
        identifier = self.compress(uuid.uuid5(self.seed, f"{kind} {name}").hex)
        return self.make(kind, GlobalId=identifier, Name=name, **attributes)

    def point(self, coordinates: Any) -> Any:  # noqa: ANN401  has no types
        """Make a point."""
        return self.make("IfcCartesianPoint", tuple(float(x) for x in coordinates))

    def direction(self, ratios: Any) -> Any:  # noqa: ANN401  has no types
        """Make a direction."""
        return self.make("IfcDirection", tuple(float(x) for x in ratios))

    def make_unit(self, kind: str, name: str, prefix: str | None = None) -> Any:  # noqa: ANN401  has no types
        """Make a unit of the SI."""
        return self.make("IfcSIUnit", UnitType=kind, Prefix=prefix, Name=name)

    def length(self, unit: str) -> Any:  # noqa: ANN401  has no types
        """Make the unit of length."""
        metre = self.make_unit("LENGTHUNIT", "METRE", _PREFIXES.get(unit))
        if unit in _PREFIXES:
            return metre
        factor = self.make("IfcMeasureWithUnit", self.make("IfcLengthMeasure", METRES[unit]), metre)
        powers = self.make("IfcDimensionalExponents", 1, 0, 0, 0, 0, 0, 0)
        return self.make("IfcConversionBasedUnit", powers, "LENGTHUNIT", _NAMES[unit], factor)

    def segment(self, piece: Piece, scene: object) -> Any:  # noqa: ANN401  has no types
        """Make the pipe segment of a cylinder."""
        shape = piece.shape
        across, _ = axis_basis(shape.direction)
        place = self.make(
            "IfcAxis2Placement3D", self.point(shape.start), self.direction(shape.direction), self.direction(across)
        )
        center = self.make("IfcAxis2Placement2D", self.point((0.0, 0.0)))
        circle = self.make("IfcCircleProfileDef", "AREA", piece.name, center, shape.radius)
        here = self.make("IfcAxis2Placement3D", self.point((0.0, 0.0, 0.0)))
        solid = self.make("IfcExtrudedAreaSolid", circle, here, self.direction((0.0, 0.0, 1.0)), shape.height)
        self.paint(solid, piece)
        body = self.make("IfcShapeRepresentation", self.body, "Body", "SweptSolid", [solid])
        segment = self.root(
            "IfcPipeSegment",
            piece.name,
            ObjectPlacement=self.make("IfcLocalPlacement", scene, place),
            Representation=self.make("IfcProductDefinitionShape", None, None, [body]),
            PredefinedType="NOTDEFINED",
        )
        self.describe(segment, piece)
        return segment

    def paint(self, solid: object, piece: Piece) -> None:
        """Set the colour of a solid."""
        color = self.make("IfcColourRgb", None, *(part / 255 for part in piece.color))
        shading = self.make("IfcSurfaceStyleShading", color, 0.0)
        style = self.make("IfcSurfaceStyle", piece.name, "BOTH", [shading])
        self.make("IfcStyledItem", solid, [style])

    def describe(self, segment: object, piece: Piece) -> None:
        """Add the values of a cylinder's result as properties."""
        found = piece.found
        values: dict[str, tuple[str, object]] = {
            "id": ("IfcInteger", piece.id),
            "radius": ("IfcPositiveLengthMeasure", found.radius),
            "inliers": ("IfcInteger", found.inliers),
            "rmse": ("IfcLengthMeasure", found.rmse),
            "coverage_deg": ("IfcReal", found.coverage_deg),
        }
        if found.confidence is not None:
            values["confidence"] = ("IfcReal", found.confidence)
        if found.uncertainty is not None:
            values["uncertainty_radius"] = ("IfcLengthMeasure", found.uncertainty.radius)
        properties = [
            self.make("IfcPropertySingleValue", name, None, self.make(kind, value), None)
            for name, (kind, value) in values.items()
        ]
        own = self.make(
            "IfcPropertySet", GlobalId=self.compress(uuid.uuid5(self.seed, f"properties {piece.name}").hex),
            Name="cylx", HasProperties=properties,
        )  # fmt: skip
        self.root("IfcRelDefinesByProperties", piece.name, RelatedObjects=[segment], RelatingPropertyDefinition=own)
