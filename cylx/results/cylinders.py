"""The cylinders and blends of a result: the keys of one, and their meaning."""

from __future__ import annotations

from math import atan2, degrees, isfinite, radians
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from cylx.results.parts import Count, Length, Matrix, Number, Part, Vector, drop_missing, plain_numbers

if TYPE_CHECKING:
    from cylx.geometry.cylinder import Cylinder
    from cylx.records import CylinderFit

Listed = TypeVar("Listed", bound="ResultCylinder")


class Uncertainty(Part):
    """Standard deviations of a cylinder's parameters."""

    radius: Length
    """Of the radius, scene units."""
    axis_angle_deg: Length
    """Of the direction of the axis, degrees."""
    axis_offset: Length
    """Of the position of the axis at its middle, scene units."""
    covariance: Matrix
    """Of two offsets of the axis, its two tilts and the radius; scene units and radians."""

    @staticmethod
    def keys_of(covariance: NDArray[np.float64]) -> dict[str, Any]:
        """Return the keys of a covariance."""
        variances = np.maximum(np.diag(covariance), 0.0)
        return {
            "radius": float(np.sqrt(variances[4])),
            "axis_angle_deg": degrees(float(np.sqrt(variances[2] + variances[3]))),
            "axis_offset": float(np.sqrt(variances[0] + variances[1])),
            "covariance": covariance.tolist(),
        }


class CatalogueMatch(Part):
    """The most likely entry of the catalogue for a cylinder, and whether the cylinder was fitted with its radius."""

    decision: Literal["snapped", "ambiguous", "none"]
    """`snapped`: fitted again with its radius; `ambiguous`: it may be this entry; `none`: it is no entry."""
    name: str | None = None
    """Name of the entry; absent if it has none."""
    nominal_radius: Annotated[Number, Field(gt=0)]
    """Radius of the entry, scene units."""
    likelihood_ratio: Annotated[Number, Field(gt=0)]
    """Of the entry to the stronger of its rivals, the second entry or no entry; from 1e-9 to 1e9."""
    free_radius: Annotated[Number, Field(gt=0)]
    """Radius without the catalogue, scene units."""
    free_radius_sd: Length
    """Its standard deviation, scene units."""


class MeasuredShape(Part):
    """The shape of a cylinder as it was measured, before it was moved to fit its run."""

    start: Vector
    """Lower end, scene units."""
    end: Vector
    """Upper end, scene units."""
    radius: Annotated[Number, Field(gt=0)]
    """Scene units."""
    shift: Length
    """How far the middle of the cylinder was moved, scene units."""
    turn_deg: Annotated[Number, Field(ge=0, le=180)]
    """By how much its axis was turned, degrees."""

    @classmethod
    def of(cls, before: Cylinder, after: Cylinder) -> MeasuredShape:
        """Describe a cylinder before it was moved."""
        along = float((before.point - after.point) @ after.direction)
        shift = float(np.linalg.norm(before.point - after.point - along * after.direction))
        sine = float(np.linalg.norm(np.cross(before.direction, after.direction)))
        return cls(
            start=plain_numbers(before.start),
            end=plain_numbers(before.end),
            radius=before.radius,
            shift=shift,
            turn_deg=degrees(atan2(sine, abs(float(before.direction @ after.direction)))),
        )


class Numbered(Part):
    """An object with a number."""

    id: Count
    """Position in the list; `cylinder_id` of its points in the annotated PLY."""


class Measured(Part):
    """The shape of a cylinder and its measured values."""

    axis_point: Vector
    """Middle of the visible extent, on the axis, scene units."""
    axis_direction: Vector
    """Unit vector; its largest component is positive."""
    radius: Annotated[Number, Field(gt=0)]
    """Scene units."""
    height: Length
    """Length of the visible extent, scene units."""
    start: Vector
    """Lower end of the visible extent, on the axis, scene units."""
    end: Vector
    """Upper end of the visible extent, on the axis, scene units."""
    inliers: Count
    """Points of its surface; in a result, those with its `id`."""
    rmse: Length
    """Root mean square distance of the inliers to the surface, scene units."""
    coverage_deg: Annotated[Number, Field(ge=0, le=360)]
    """Angle about the axis that the inliers cover, degrees."""
    support: Count
    """Candidates in its cluster; for the other methods, hypotheses that led to it."""
    payoff: Number | None = None
    """Mean payoff of its cluster, 0 to 1; absent if no game was played."""
    confidence: Annotated[Number, Field(ge=0, le=1)] | None = None
    """Probability that this is a cylinder of the scene, or a blend; absent if it was not computed."""
    form: Length | None = None
    """Deviation of the surface from a cylinder that neighbouring points share, scene units; absent if not measured."""
    side: Literal["convex", "concave", "unknown"] | None = None
    """`convex` for a pin, `concave` for a bore, `unknown` if neither can be told; absent if not measured."""
    uncertainty: Uncertainty | None = None
    """Standard deviations of the parameters; absent if they were not computed."""
    evidence: dict[str, Number] | None = None
    """The measures of the verification, by name; absent if nothing was measured."""

    @staticmethod
    def keys_of(fit: CylinderFit) -> dict[str, Any]:
        """Return the keys of a fit."""
        shape = fit.cylinder
        evidence = {name: float(value) for name, value in fit.evidence.items() if isfinite(value)}
        return {
            "axis_point": plain_numbers(shape.point),
            "axis_direction": plain_numbers(shape.direction),
            "radius": shape.radius,
            "height": shape.height,
            "start": plain_numbers(shape.start),
            "end": plain_numbers(shape.end),
            "inliers": int(fit.inliers),
            "rmse": float(fit.rmse),
            "coverage_deg": min(degrees(fit.coverage), 360.0),
            "support": int(fit.support),
            "payoff": None if fit.payoff is None else float(fit.payoff),
            "confidence": fit.confidence,
            "form": fit.form,
            "side": fit.side,
            "uncertainty": None if fit.covariance is None else Uncertainty.keys_of(fit.covariance),
            "evidence": evidence or None,
        }


class ResultCylinder(Measured, Numbered):  # the keys of the last base class come first
    """A cylinder and the evidence for it."""

    catalogue: CatalogueMatch | None = None
    """Its entry of the catalogue; absent without a catalogue, or if its uncertainty was not computed."""
    measured: MeasuredShape | None = None
    """The shape as it was measured; absent if it was not moved to fit its run."""

    @classmethod
    def of(cls: type[Listed], index: int, fit: CylinderFit) -> Listed:
        """Describe number `index` of a list of cylinders."""
        match = None if fit.nominal is None else CatalogueMatch.model_validate(fit.nominal, from_attributes=True)
        before = None if fit.measured is None else MeasuredShape.of(fit.measured, fit.cylinder)
        return cls(id=index, **cls.keys_of(fit), catalogue=match, measured=before)

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not computed is left out."""
        content = self.model_dump(mode="json")
        drop_missing([content, content["catalogue"] or {}])
        return content

    def to_fit(self) -> CylinderFit:
        """Return the cylinder as it was before it was written."""
        from cylx.geometry.cylinder import Cylinder, cylinder_between  # noqa: PLC0415  brings numba
        from cylx.records import CylinderFit, NominalRadius  # noqa: PLC0415  bring numba

        match, before = self.catalogue, self.measured
        return CylinderFit(
            Cylinder(np.array(self.axis_point), np.array(self.axis_direction), self.radius, self.height),
            self.inliers,
            self.rmse,
            radians(self.coverage_deg),
            self.support,
            self.payoff,
            self.confidence,
            dict(self.evidence or {}),
            None if self.uncertainty is None else np.array(self.uncertainty.covariance),
            None if match is None else NominalRadius(**match.model_dump()),
            self.form,
            self.side,
            None if before is None else cylinder_between(before.start, before.end, before.radius),
        )


class ResultBlend(ResultCylinder):
    """An arc that goes on tangentially, such as a round, a fillet or a slot end, and the evidence for it."""

    id: Count
    """Position in the list of blends; the annotated cloud has no labels of blends."""
