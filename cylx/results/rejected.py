"""The rejected cylinders as a JSON object, `NAME.rejected.json`: with the reasons and the available evidence.

Units and keys are those of `cylx.results`; the same input, configuration and seed give the same bytes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import ConfigDict, Field, JsonValue

from cylx.results.cylinders import Measured
from cylx.results.parts import Input, Part, drop_missing, text_of
from cylx.version import __version__

if TYPE_CHECKING:
    from cylx.records import Extraction, RejectedFit, TiledExtraction


class Reasoned(Part):
    """A rejection."""

    reason: str
    """The strongest reason: a term of the evidence, or a limit that is exceeded."""


class RejectedCylinder(Measured, Reasoned):  # the keys of the last base class come first
    """A possible cylinder that was rejected, the reason, and the values measured before the rejection."""

    @classmethod
    def of(cls, rejected: RejectedFit) -> RejectedCylinder:
        """Describe a rejection."""
        return cls(reason=rejected.reason, **cls.keys_of(rejected.fit))


class Rejections(Part):
    """All rejected cylinders of one cloud."""

    model_config = ConfigDict(title="cylx.rejected/1")

    schema_id: Literal["cylx.rejected/1"] = Field(default="cylx.rejected/1", alias="schema")
    """Name and version of this format."""
    cylx_version: str
    """Version of cylx that wrote it."""
    input: Input
    """The input cloud."""
    config: dict[str, JsonValue]
    """The resolved configuration, every value."""
    rejected: list[RejectedCylinder]
    """The rejected cylinders, by confidence; those rejected before measuring come last."""

    @classmethod
    def of(cls, extraction: Extraction | TiledExtraction) -> Rejections:
        """Describe the rejections of an extraction.

        Parameters
        ----------
        extraction : Extraction or TiledExtraction
            The output of a run.
        """
        return cls(
            cylx_version=__version__,
            input=Input.of(extraction),
            config=extraction.config.model_dump(mode="json"),
            rejected=[RejectedCylinder.of(one) for one in extraction.rejected],
        )

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not computed is left out."""
        content = self.model_dump(mode="json", by_alias=True)
        drop_missing(content["rejected"])
        return content | {"input": self.input.to_object()}

    def to_json(self) -> str:
        """Return the text of the file, with a newline at its end."""
        return text_of(self.to_object())


def rejections_schema() -> dict[str, Any]:
    """Return the JSON schema of the file."""
    return Rejections.model_json_schema(by_alias=True)
