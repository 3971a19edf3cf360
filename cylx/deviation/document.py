"""The JSON of a comparison with a design, `NAME.deviation.json`: its keys, their order, their meaning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import ConfigDict, Field

from cylx.deviation.entries import DeviationEntry, Positive, Verdict
from cylx.deviation.verdict import Tolerances
from cylx.results.parts import Input, Length, Part, drop_missing, text_of
from cylx.version import __version__


class DesignFile(Part):
    """The file of the design."""

    file: str
    """Its name without its folder."""
    format: Literal["json", "csv", "step", "ifc"]
    """Its format."""
    scale: Positive
    """What its lengths were multiplied by, to be in the unit of the scan."""


class Allowed(Part):
    """The tolerances; those that were not given are absent."""

    offset: Length | None = None
    """Distance of the axes."""
    tilt_deg: Length | None = None
    """Angle of the axes, degrees."""
    radius: Length | None = None
    """Difference of the radius, either way."""
    cylindricity: Length | None = None
    """Of the minimum zone."""
    ovality: Length | None = None
    """Largest diameter minus smallest."""
    taper: Length | None = None
    """Change of the diameter per length, either way."""
    dent: Length | None = None
    """Depth of the deepest dent or bulge."""


class Deviations(Part):
    """A scan against the cylinders of a design."""

    model_config = ConfigDict(title="cylx.deviation/1")

    schema_id: Literal["cylx.deviation/1"] = Field(default="cylx.deviation/1", alias="schema")
    """Name and version of this format."""
    cylx_version: str
    """Version of cylx that wrote it."""
    input: Input
    """The scan."""
    design: DesignFile
    """The design."""
    tolerances: Allowed
    """What is allowed."""
    cylinders: list[DeviationEntry]
    """The cylinders of the design, in its order."""
    verdict: Verdict
    """The worst of theirs."""

    @classmethod
    def of(
        cls, about: Input, design: DesignFile, tolerances: Tolerances, entries: Sequence[DeviationEntry]
    ) -> Deviations:
        """Put the parts together."""
        verdicts = {entry.verdict for entry in entries}
        worst: Verdict = "fail" if "fail" in verdicts else "undecided" if "undecided" in verdicts else "pass"
        return cls(
            cylx_version=__version__,
            input=about,
            design=design,
            tolerances=Allowed.model_validate({name: getattr(tolerances, name) for name in Allowed.model_fields}),
            cylinders=list(entries),
            verdict=worst,
        )

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not measured is left out."""
        content = self.model_dump(mode="json", by_alias=True)
        drop_missing([content["tolerances"]])
        return content | {
            "input": self.input.to_object(),
            "cylinders": [entry.to_object() for entry in self.cylinders],
        }

    def to_json(self) -> str:
        """Return the text of the file, with a newline at its end."""
        return text_of(self.to_object())


def deviation_schema() -> dict[str, Any]:
    """Return the JSON schema of the file."""
    return Deviations.model_json_schema(by_alias=True)
