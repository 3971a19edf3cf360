"""An IFC file under construction: its units, its contexts, and its entities with identifiers made of the content."""

from __future__ import annotations

import hashlib
import uuid
from math import floor
from typing import Any

from cylx.export.drawing import Drawing
from cylx.harmless import visible
from cylx.units import METRES, unit_of
from cylx.version import __version__
from cylx.wkt import facts_of

_PREFIXES = {"m": None, "mm": "MILLI", "cm": "CENTI"}
_NAMES = {"in": "INCH", "ft": "FOOT", "us-ft": "US SURVEY FOOT"}
_NO_TIME = "1970-01-01T00:00:00"
Color = tuple[int, int, int]


class Model:
    """A file under construction.

    Parameters
    ----------
    drawing : Drawing
        What it will hold: its unit, and the source of the identifiers.
    """

    def __init__(self, drawing: Drawing) -> None:
        import ifcopenshell  # noqa: PLC0415  an extra
        from ifcopenshell import guid  # noqa: PLC0415  an extra

        self.compress = guid.compress
        self.file = ifcopenshell.file(schema="IFC4")
        content = "".join(cylinder.model_dump_json() for cylinder in drawing.cylinders)
        if drawing.piping is not None:
            parts = (part.fitting for part in drawing.piping.parts if part.fitting is not None)
            content += "".join(fitting.model_dump_json() for fitting in parts)
        self.seed = uuid.UUID(hashlib.sha256(f"{drawing.unit}{content}".encode()).hexdigest()[:32])
        unit = drawing.unit or "m"
        here = self.make("IfcAxis2Placement3D", self.point((0.0, 0.0, 0.0)))
        context = self.make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, here)
        self.body = self.make(
            "IfcGeometricRepresentationSubContext",
            ContextIdentifier="Body", ContextType="Model", ParentContext=context, TargetView="MODEL_VIEW",
        )  # fmt: skip
        self.origin = self._add_map(drawing, context)
        units = self.make("IfcUnitAssignment", [self.length(unit), self.make_unit("PLANEANGLEUNIT", "RADIAN")])
        project = self.root("IfcProject", "cylx", RepresentationContexts=[context], UnitsInContext=units)
        building = self.root("IfcBuilding", "scan", ObjectPlacement=self.make("IfcLocalPlacement", None, here))
        self.root("IfcRelAggregates", "project", RelatingObject=project, RelatedObjects=[building])
        self.context, self.building = context, building

    def _add_map(self, drawing: Drawing, context: object) -> tuple[float, float, float]:
        """Say where the coordinates are on a map, and return the place from which they count; zero without a map.

        The place is that of the least coordinates, in whole hundreds of units, so that the numbers in the file are
        small: programs that draw in single precision show no steps.
        """
        crs = drawing.crs
        facts = None if crs is None or crs.wkt is None else facts_of(crs.wkt)
        if crs is None or (facts is not None and facts.kind != "projected"):
            return 0.0, 0.0, 0.0
        ends = [end for one in drawing.cylinders for end in (one.start, one.end)] or [[0.0] * 3]
        least = [100.0 * floor(min(end[d] for end in ends) / 100.0) for d in range(3)]
        factor = METRES[drawing.unit or "m"] / crs.metres
        scale = 1.0 if abs(factor - 1.0) < 1e-9 else factor
        name = visible(crs.name) if crs.epsg is None else f"EPSG:{crs.epsg}"
        unit = None if scale == 1.0 else self.length(unit_of(crs.metres) or "m")
        system = self.make("IfcProjectedCRS", Name=name, Description=visible(crs.name), MapUnit=unit)
        self.make("IfcMapConversion", context, system, *(x * scale for x in least), 1.0, 0.0, scale)
        return least[0], least[1], least[2]

    def place(self, coordinates: Any) -> Any:  # noqa: ANN401  has no types
        """Make a point of a place in the scan."""
        return self.point([float(x) - begin for x, begin in zip(coordinates, self.origin, strict=True)])

    def contain(self, products: list[Any]) -> None:
        """Put products into the scan."""
        if products:
            self.root(
                "IfcRelContainedInSpatialStructure", "scan", RelatedElements=products, RelatingStructure=self.building
            )

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

    def paint(self, solid: object, name: str, rgb: Color) -> None:
        """Set the colour of a solid."""
        color = self.make("IfcColourRgb", None, *(part / 255 for part in rgb))
        shading = self.make("IfcSurfaceStyleShading", color, 0.0)
        style = self.make("IfcSurfaceStyle", name, "BOTH", [shading])
        self.make("IfcStyledItem", solid, [style])

    def properties(self, product: object, name: str, values: dict[str, tuple[str, object]]) -> None:
        """Add values as properties of a product: each a type and a number."""
        properties = [
            self.make("IfcPropertySingleValue", key, None, self.make(kind, value), None)
            for key, (kind, value) in values.items()
        ]
        own = self.make(
            "IfcPropertySet", GlobalId=self.compress(uuid.uuid5(self.seed, f"properties {name}").hex),
            Name="cylx", HasProperties=properties,
        )  # fmt: skip
        self.root("IfcRelDefinesByProperties", name, RelatedObjects=[product], RelatingPropertyDefinition=own)
