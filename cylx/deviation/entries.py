"""One cylinder of a design in the JSON of a comparison: its keys, their order, their meaning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import degrees
from typing import Annotated, Any, Literal

from pydantic import Field

from cylx.deviation.measure import Deviation, Measured
from cylx.deviation.surface import Patch
from cylx.deviation.verdict import Check, overall
from cylx.results.cylinders import Uncertainty
from cylx.results.parts import Count, Length, Number, Part, Vector, drop_missing, plain_numbers

Verdict = Literal["pass", "fail", "undecided"]
Positive = Annotated[Number, Field(gt=0)]


class DesignShape(Part):
    """A cylinder as it was designed, in the unit of the scan."""

    start: Vector
    """One end of its axis."""
    end: Vector
    """The other end."""
    radius: Positive
    """Its radius."""


class AsBuilt(Part):
    """The cylinder that fits the points, between the ends of these."""

    axis_point: Vector
    """Middle of what was seen, on the axis."""
    axis_direction: Vector
    """Unit vector; its largest component is positive."""
    radius: Positive
    """Its radius."""
    height: Length
    """Length of what was seen."""
    rmse: Length
    """Root mean square distance of its points from it."""
    coverage_deg: Annotated[Number, Field(ge=0, le=360)]
    """Angle about the axis that was seen, degrees."""
    uncertainty: Uncertainty
    """Standard deviations, with the form of the surface in them."""


class Difference(Part):
    """How far the cylinder is off its design."""

    offset: Length
    """Distance of the axis from that of the design, at the middle of what was seen."""
    offset_sd: Length
    """Its standard deviation, in the least certain direction."""
    shift: Vector
    """The same as a vector from the design axis, across it."""
    tilt_deg: Annotated[Number, Field(ge=0, le=180)]
    """Angle between the axes, degrees."""
    tilt_sd_deg: Length
    """Its standard deviation, in the least certain direction, degrees."""
    radius: Number
    """Radius minus that of the design."""
    radius_sd: Length
    """Its standard deviation."""


class FormValues(Part):
    """The form of the surface, of the medians of its cells."""

    cylindricity: Length
    """Least distance of two coaxial cylinders that hold the surface between them: ISO 1101, minimum zone."""
    cylindricity_least_squares: Length
    """The same about the axis of least squares."""
    cylindricity_noise: Length
    """What the noise alone may make of it."""
    ovality: Length | None = None
    """Largest diameter minus smallest, of the second harmonic; absent if less than 200 degrees were seen."""
    ovality_sd: Length | None = None
    """Its standard deviation."""
    taper: Number
    """Change of the diameter per length along the axis."""
    taper_sd: Length
    """Its standard deviation."""
    cells: Count
    """Number of cells with points."""
    cell: Positive
    """Side of a cell."""
    noise: Length
    """Standard deviation of the points about their cell."""


class PatchValues(Part):
    """A dent or a bulge."""

    kind: Literal["dent", "bulge"]
    """Inwards, or outwards."""
    depth: Length
    """Largest distance from the shape of the rest, of a surface smoothed over two cells."""
    depth_sd: Length
    """Its standard deviation."""
    area: Length
    """Area of the cells that are off."""
    volume: Length
    """Volume between them and the shape of the rest."""
    around: Length
    """Size about the axis."""
    along: Length
    """Size along the axis."""
    place: Vector
    """Its middle, on the cylinder."""
    height: Number
    """Its middle along the axis, from `axis_point`."""

    @classmethod
    def of(cls, patch: Patch, measured: Measured) -> PatchValues:
        """Describe a patch."""
        names = ("depth", "depth_sd", "area", "volume", "around", "along", "height")
        values = {name: float(getattr(patch, name)) for name in names}
        return cls.model_validate({"kind": patch.kind, **values, "place": plain_numbers(measured.place_of(patch))})


class CheckValues(Part):
    """A value against its tolerance."""

    of: Literal["found", "offset", "tilt_deg", "radius", "cylindricity", "ovality", "taper", "dent"]
    """What is checked; `found` is whether there is a cylinder at all."""
    value: Length | None = None
    """Its size; absent if it could not be measured."""
    uncertainty: Length | None = None
    """Two standard deviations; of the cylindricity what the noise may make of it."""
    tolerance: Length | None = None
    """What is allowed."""
    verdict: Verdict
    """`undecided` if the uncertainty leaves both possible."""


class DeviationEntry(Part):
    """A design cylinder, and what was found of it."""

    id: Count
    """Position in the list."""
    name: str
    """Its name in the design, or its number."""
    design: DesignShape
    """As it was designed."""
    points: Count
    """Number of points near its surface."""
    fault: str | None = None
    """Why it was not found; absent if it was."""
    built: AsBuilt | None = None
    """As it was built; absent if it was not found."""
    difference: Difference | None = None
    """How far that is off; absent if it was not found."""
    form: FormValues | None = None
    """The form of its surface; absent if there are too few points."""
    patches: list[PatchValues]
    """Dents and bulges, the deepest first."""
    checks: list[CheckValues]
    """Each tolerance with its verdict."""
    verdict: Verdict
    """The worst of them."""

    @classmethod
    def of(cls, number: int, name: str, deviation: Deviation, checks: Sequence[Check]) -> DeviationEntry:
        """Describe a deviation."""
        measured, design = deviation.measured, deviation.design
        return cls(
            id=number,
            name=name,
            design=DesignShape(
                start=plain_numbers(design.start), end=plain_numbers(design.end), radius=float(design.radius)
            ),
            points=deviation.points,
            fault=deviation.fault or None,
            built=None if measured is None else _built(measured),
            difference=None if measured is None else _difference(measured),
            form=None if measured is None else _form(measured),
            patches=[] if measured is None else [PatchValues.of(one, measured) for one in measured.patches],
            checks=[CheckValues.model_validate(asdict(one)) for one in checks],
            verdict=overall(checks),
        )

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not measured is left out."""
        content = self.model_dump(mode="json")
        drop_missing([content, content.get("form") or {}, *content["checks"]])
        return content


def _built(measured: Measured) -> AsBuilt:
    fit = measured.fit
    assert fit.covariance is not None
    return AsBuilt.model_validate(
        {
            "axis_point": plain_numbers(fit.cylinder.point),
            "axis_direction": plain_numbers(fit.cylinder.direction),
            "radius": fit.cylinder.radius,
            "height": fit.cylinder.height,
            "rmse": fit.rmse,
            "coverage_deg": min(degrees(fit.coverage), 360.0),
            "uncertainty": Uncertainty.keys_of(fit.covariance),
        }
    )


def _difference(measured: Measured) -> Difference:
    return Difference(
        offset=measured.offset,
        offset_sd=measured.offset_sd,
        shift=plain_numbers(measured.shift),
        tilt_deg=degrees(measured.tilt),
        tilt_sd_deg=degrees(measured.tilt_sd),
        radius=float(measured.radius),
        radius_sd=measured.radius_sd,
    )


def _form(measured: Measured) -> FormValues | None:
    form, cells = measured.form, measured.cells
    if form is None:
        return None
    return FormValues(
        cylindricity=form.minimum_zone,
        cylindricity_least_squares=form.least_squares,
        cylindricity_noise=form.noise,
        ovality=form.ovality,
        ovality_sd=form.ovality_sd,
        taper=form.taper,
        taper_sd=form.taper_sd,
        cells=len(cells.cells),
        cell=float((cells.width * cells.length) ** 0.5),
        noise=cells.noise,
    )
