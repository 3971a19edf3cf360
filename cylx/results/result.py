"""The result of a run as a JSON object, `NAME.cylinders.json`: its keys, their order, their meaning.

Lengths are in the unit of the input, angles in degrees. The file holds no NaN, no times and no folder names: the same
input, configuration and seed give the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import degrees, isfinite
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, JsonValue, ValidationError

from cylx.config import describe_fault
from cylx.config.choices import Method
from cylx.errors import InputError
from cylx.results.parts import Count, Input, Length, Matrix, Number, Part, Vector, drop_missing, plain_numbers, text_of
from cylx.results.table import dataframe_of
from cylx.version import __version__

if TYPE_CHECKING:
    from cylx.records import CylinderFit, Extraction, Scene, StageReport


class SceneScale(Part):
    """The scale of the cloud."""

    spacing: Length
    """Typical distance of neighbouring points on a surface, scene units."""
    noise: Length
    """Standard deviation of the points about their surface, scene units."""
    given: list[Literal["spacing", "noise"]] | None = None
    """Which of them the configuration gave; absent if both were measured."""

    @classmethod
    def of(cls, scene: Scene) -> SceneScale:
        """Describe the scale of a scene."""
        given = [name for name in ("spacing", "noise") if name in scene.given]
        return cls.model_validate(
            {"spacing": float(scene.spacing), "noise": float(scene.noise), "given": given or None}
        )


class Stage(Part):
    """What came into a stage, what it kept, and why it rejected the rest."""

    name: str
    """The name of the stage."""
    considered: Count
    """Number of inputs."""
    kept: Count
    """Number of outputs."""
    rejected: dict[str, Count]
    """Rejected inputs: count by reason."""


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
    """Probability that this is a cylinder of the scene; absent if it was not computed."""
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
            "uncertainty": None if fit.covariance is None else Uncertainty.keys_of(fit.covariance),
            "evidence": evidence or None,
        }


class ResultCylinder(Measured, Numbered):  # the keys of the last base class come first
    """A cylinder and the evidence for it."""

    catalogue: CatalogueMatch | None = None
    """Its entry of the catalogue; absent without a catalogue, or if its uncertainty was not computed."""

    @classmethod
    def of(cls, index: int, fit: CylinderFit) -> ResultCylinder:
        """Describe cylinder number `index` of an extraction."""
        match = None if fit.nominal is None else CatalogueMatch.model_validate(fit.nominal, from_attributes=True)
        return cls(id=index, **cls.keys_of(fit), catalogue=match)

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not computed is left out."""
        content = self.model_dump(mode="json")
        drop_missing([content, content["catalogue"] or {}])
        return content


class Result(Part):
    """The cylinders of one cloud, with the method and the settings that found them."""

    model_config = ConfigDict(title="cylx.cylinders/1")

    schema_id: Literal["cylx.cylinders/1"] = Field(default="cylx.cylinders/1", alias="schema")
    """Name and version of this format."""
    cylx_version: str
    """Version of cylx that wrote it."""
    input: Input
    """The input cloud."""
    method: Method = "gt"
    """The method; `gt` is the clustering game."""
    config: dict[str, JsonValue]
    """The resolved configuration, every value."""
    scene: SceneScale
    """Scale and noise of the cloud."""
    stages: list[Stage]
    """Counts per stage, in order."""
    cylinders: list[ResultCylinder]
    """The cylinders; empty if there are none."""
    warnings: list[str]
    """What a user should know before trusting the result."""

    @classmethod
    def of(cls, extraction: Extraction) -> Result:
        """Describe an extraction.

        Parameters
        ----------
        extraction : Extraction
            The output of a run.
        """
        return cls(
            cylx_version=__version__,
            input=Input.of(extraction),
            method=extraction.config.method,
            config=extraction.config.model_dump(mode="json"),
            scene=SceneScale.of(extraction.scene),
            stages=[_stage(report) for report in extraction.stages],
            cylinders=[ResultCylinder.of(i, fit) for i, fit in enumerate(extraction.cylinders)],
            warnings=list(extraction.warnings),
        )

    @classmethod
    def parse(cls, mapping: Mapping[str, Any], place: str) -> Result:
        """Parse a JSON object.

        Parameters
        ----------
        mapping : mapping
            The object.
        place : str
            Its name in errors, such as the file.

        Raises
        ------
        InputError
            If it is not a result of this version of the format.
        """
        try:
            return cls.model_validate(mapping)
        except ValidationError as error:
            path, fault, remedy = describe_fault(error, cls)
            raise InputError(": ".join(filter(None, [place, ".".join(path)])), fault, remedy) from None

    @classmethod
    def from_json(cls, text: str) -> Result:
        """Parse the text of the file, as returned by `to_json`.

        Parameters
        ----------
        text : str

        Raises
        ------
        InputError
            If it is not a JSON object, or not a result of this version of the format.
        """
        remedy = "give the text of a JSON file as cylx writes it"
        try:
            mapping = json.loads(text)
        except (ValueError, RecursionError) as error:
            fault = "nested too deeply" if isinstance(error, RecursionError) else str(error)
            raise InputError("the text", f"not JSON: {fault}", remedy) from None
        if not isinstance(mapping, dict):
            raise InputError("the text", "is not a JSON object", remedy)
        return cls.parse(mapping, "the text")

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not computed is left out."""
        content = self.model_dump(mode="json", by_alias=True)
        drop_missing([content["input"], content["scene"]])
        return content | {"cylinders": [cylinder.to_object() for cylinder in self.cylinders]}

    def __repr__(self) -> str:
        count = len(self.cylinders)
        return f"{count} cylinder{'' if count == 1 else 's'} in {self.input.file!r}"

    def _repr_html_(self) -> str:
        from cylx.records.shown import html_in_notebook  # noqa: PLC0415  records bring numba

        return html_in_notebook(self)

    def to_dataframe(self) -> Any:  # noqa: ANN401  pandas is an extra
        """Return the cylinders as a pandas data frame with the columns of `cylx.results.table.table_of`."""
        return dataframe_of([cylinder.to_object() for cylinder in self.cylinders])

    def to_json(self) -> str:
        """Return the text of the file, with a newline at its end."""
        return text_of(self.to_object())


def result_schema() -> dict[str, Any]:
    """Return the JSON schema of the result file."""
    return Result.model_json_schema(by_alias=True)


def _stage(report: StageReport) -> Stage:
    """Describe a stage's counts."""
    rejected = {reason: int(count) for reason, count in report.rejected.items()}
    return Stage(name=report.name, considered=int(report.considered), kept=int(report.kept), rejected=rejected)
