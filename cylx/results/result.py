"""The result of a run as a JSON object, `NAME.cylinders.json`: its keys, their order, their meaning.

Lengths are in the unit of the input, angles in degrees. The file holds no NaN, no times and no folder names: the same
input, configuration and seed give the same bytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import ConfigDict, Field, JsonValue, field_validator, model_validator

from cylx.config.choices import Method
from cylx.errors import InputError
from cylx.results.cylinders import ResultBlend, ResultCylinder
from cylx.results.fittings import AnyFitting, ResultAdjustment, ResultRun, fitting_of
from cylx.results.parts import Count, Input, Length, Part, drop_missing, text_of
from cylx.results.references import unknown_reference
from cylx.results.table import dataframe_of
from cylx.version import __version__
from cylx.wording import counted

if TYPE_CHECKING:
    from cylx.records import CylinderFit, Extraction, Scene, StageReport, TiledExtraction
    from cylx.records.piping import Piping


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


class Tiles(Part):
    """How a cloud was cut into tiles."""

    count: Count
    """Number of tiles."""
    size: Annotated[Length, Field(gt=0)] | None = None
    """Greatest side of a tile, scene units; absent if the number of points decided alone."""
    buffer: Length
    """Margin about each tile in which it sees the points of its neighbours, scene units."""
    most_points: Count
    """Points of the largest tile, without its margin."""
    joined: Count
    """Groups of cylinders of several tiles that were fitted together."""


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
    tiles: Tiles | None = None
    """How the cloud was cut; absent if it was not."""
    stages: list[Stage]
    """Counts per stage, in order."""
    cylinders: list[ResultCylinder]
    """The cylinders; empty if there are none."""
    blends: list[ResultBlend] | None = None
    """Arcs that go on tangentially, with the keys of a cylinder; absent if they were not looked for."""
    fittings: list[AnyFitting] | None = None
    """What joins the cylinders: elbows, tees, reducers, flanges and more; absent if they were not looked for."""
    runs: list[ResultRun] | None = None
    """The cylinders that are joined, the longest run first; absent if they were not looked for."""
    adjustments: list[ResultAdjustment] | None = None
    """What moved so that the runs are as they were built, and what was refused; absent if that was not asked for."""
    warnings: list[str]
    """What a user should know before trusting the result."""

    @field_validator("config")
    @classmethod
    def _check_config(cls, config: dict[str, Any]) -> dict[str, Any]:
        if not _is_finite(config):
            raise ValueError("holds a number that is not finite; give the file as cylx wrote it")
        return config

    @model_validator(mode="after")
    def _check_references(self) -> Result:
        unknown = unknown_reference(self.cylinders, self.fittings or (), self.runs or ())
        if unknown is not None:
            raise ValueError(f"{unknown}; give the file as cylx wrote it")
        return self

    @classmethod
    def of(cls, extraction: Extraction | TiledExtraction) -> Result:
        """Describe an extraction.

        Parameters
        ----------
        extraction : Extraction or TiledExtraction
            The output of a run.
        """
        blends, tiling = extraction.blends, getattr(extraction, "tiling", None)
        piping: Piping | None = getattr(extraction, "piping", None)
        return cls(
            cylx_version=__version__,
            input=Input.of(extraction),
            method=extraction.config.method,
            config=extraction.config.model_dump(mode="json"),
            scene=SceneScale.of(extraction.scene),
            tiles=None if tiling is None else Tiles.model_validate(asdict(tiling)),
            stages=[_stage(report) for report in extraction.stages],
            blends=None if blends is None else [ResultBlend.of(i, fit) for i, fit in enumerate(blends)],
            warnings=list(extraction.warnings),
            **cls.lists_of(extraction.cylinders, piping),
        )

    @staticmethod
    def lists_of(cylinders: Sequence[CylinderFit], piping: Piping | None) -> dict[str, Any]:
        """Return the keys of cylinders, and of their fittings and runs if these were looked for."""
        fittings = None if piping is None else [fitting_of(i, one) for i, one in enumerate(piping.fittings)]
        runs = None if piping is None else [ResultRun.of(i, run) for i, run in enumerate(piping.runs)]
        listed = [ResultCylinder.of(i, fit) for i, fit in enumerate(cylinders)]
        moved = None if piping is None else piping.adjustments
        adjusted = None if moved is None else [ResultAdjustment.of(one) for one in moved]
        return {"cylinders": listed, "fittings": fittings, "runs": runs, "adjustments": adjusted}

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
        drop_missing([content, content["scene"], content.get("tiles") or {}])
        lists: dict[str, Any] = {"input": self.input.to_object()}
        lists |= {"cylinders": [cylinder.to_object() for cylinder in self.cylinders]}
        if self.blends is not None:
            lists["blends"] = [blend.to_object() for blend in self.blends]
        if self.fittings is not None:
            lists["fittings"] = [fitting.to_object() for fitting in self.fittings]
        if self.runs is not None:
            lists["runs"] = [run.to_object() for run in self.runs]
        if self.adjustments is not None:
            lists["adjustments"] = [one.to_object() for one in self.adjustments]
        return content | lists

    def __repr__(self) -> str:
        return f"{counted(len(self.cylinders), len(self.blends or ()))} in {self.input.file!r}"

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


def _is_finite(value: object) -> bool:
    """Return whether all numbers in plain data are finite."""
    if isinstance(value, dict | list):
        return all(map(_is_finite, value.values() if isinstance(value, dict) else value))
    return not isinstance(value, float) or math.isfinite(value)


def _stage(report: StageReport) -> Stage:
    """Describe a stage's counts."""
    rejected = {reason: int(count) for reason, count in report.rejected.items()}
    return Stage(name=report.name, considered=int(report.considered), kept=int(report.kept), rejected=rejected)
