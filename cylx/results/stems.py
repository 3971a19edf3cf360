"""The stems of a plot as a JSON object, `NAME.stems.json`, and as a table: their keys, their order, their meaning.

Places are in scene units, all other lengths in metres. The same input gives the same bytes.
"""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import ConfigDict, Field

from cylx.harmless import cell
from cylx.results.parts import Count, Input, Number, Part, Vector, drop_missing, plain_numbers, text_of
from cylx.version import __version__

if TYPE_CHECKING:
    from cylx.records.stems import Stem, StemPlot, StemSection

Share = Annotated[Number, Field(ge=0, le=1)]
Metres = Annotated[Number, Field(ge=0)]


class ResultSection(Part):
    """A section across a stem."""

    height: Number
    """Height above the ground at the stem, metres."""
    center: Vector
    """Its centre, scene units."""
    diameter: Metres
    """Mean diameter across the axis, metres."""
    diameter_sd: Metres
    """Its standard deviation from the scatter of the points alone, metres."""
    arc_deg: Number
    """Angle about the axis that points cover, degrees."""
    roundness: Share | None = None
    """Least over greatest diameter; absent if less than three quarters of it are seen."""

    @classmethod
    def of(cls, one: StemSection) -> ResultSection:
        """Describe a section."""
        return cls(
            height=one.height,
            center=plain_numbers(one.center),
            diameter=one.diameter,
            diameter_sd=one.sd,
            arc_deg=math.degrees(one.arc),
            roundness=_known(one.roundness),
        )


class ResultStem(Part):
    """A stem."""

    id: Annotated[int, Field(ge=1)]
    """Number of the tree, from 1: the `treeID` of the annotated cloud."""
    x: Number
    """Where the axis meets the ground, scene units."""
    y: Number
    """Where the axis meets the ground, scene units."""
    ground: Number
    """Height of the ground there, scene units."""
    dbh: Metres
    """Mean diameter across the axis at 1.3 m above the ground, metres."""
    dbh_sd: Metres
    """Its standard deviation, with the form of the bark in it, metres."""
    dbh_from: Literal["measured", "taper"]
    """`measured` at breast height, or `taper` if sections elsewhere tell it."""
    roundness: Share | None = None
    """Least over greatest diameter at breast height; absent if less than three quarters of it are seen."""
    lean_deg: Metres
    """Angle between the axis at breast height and the vertical, degrees."""
    lean_azimuth_deg: Metres
    """Where it leans to, degrees clockwise from the direction of y."""
    taper: Number | None = None
    """Loss of diameter per height, metres a metre; absent if too little is seen."""
    lowest: Number
    """Lowest section of the stem, metres above the ground."""
    highest: Number
    """Highest section up to which it was followed, metres above the ground."""
    arc_deg: Metres
    """Angle about the axis at breast height that points cover, degrees."""
    points: Count
    """Number of points on it."""
    quality: Share
    """How far it can be believed: a product of shares, see the page on forests."""
    flags: list[str]
    """`not round`, `half seen`, `thin for its noise`, `few sections`, `taper`."""
    sections: list[ResultSection]
    """The sections, from the lowest upwards."""

    @classmethod
    def of(cls, number: int, stem: Stem) -> ResultStem:
        """Describe a stem."""
        x, y, ground = plain_numbers(stem.foot)
        return cls(
            id=number,
            x=x,
            y=y,
            ground=ground,
            dbh=stem.dbh,
            dbh_sd=stem.dbh_sd,
            dbh_from="measured" if stem.dbh_from == "measured" else "taper",
            roundness=_known(stem.roundness),
            lean_deg=math.degrees(stem.lean),
            lean_azimuth_deg=math.degrees(math.atan2(stem.direction[0], stem.direction[1])) % 360.0,
            taper=_known(stem.taper),
            lowest=stem.lowest,
            highest=stem.highest,
            arc_deg=math.degrees(stem.arc),
            points=stem.points,
            quality=stem.quality,
            flags=list(stem.flags),
            sections=[ResultSection.of(one) for one in stem.sections],
        )


class Stems(Part):
    """All stems of a cloud."""

    model_config = ConfigDict(title="cylx.stems/1")

    schema_id: Literal["cylx.stems/1"] = Field(default="cylx.stems/1", alias="schema")
    """Name and version of this format."""
    cylx_version: str
    """Version of cylx that wrote it."""
    input: Input
    """The input cloud."""
    units: str
    """Unit of the scene, in which places are."""
    ground_by: Literal["classes", "cloth", "lowest"]
    """How the ground was found: by points of class 2, by a cloth, or by the lowest points."""
    stems: list[ResultStem]
    """The stems, in strips of a metre of x, by y within each."""

    @classmethod
    def of(cls, plot: StemPlot, units: str) -> Stems:
        """Describe the stems of a cloud.

        Parameters
        ----------
        plot : StemPlot
        units : str
            Unit of the scene.
        """
        by: Any = plot.ground.by
        return cls(
            cylx_version=__version__,
            input=Input.of_cloud(plot.cloud),
            units=units,
            ground_by=by,
            stems=[ResultStem.of(number, stem) for number, stem in enumerate(plot.stems, 1)],
        )

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not measured is left out."""
        content = self.model_dump(mode="json", by_alias=True)
        content["input"] = self.input.to_object()
        drop_missing(content["stems"])
        drop_missing(section for stem in content["stems"] for section in stem["sections"])
        return content

    def to_json(self) -> str:
        """Return the text of the file, with a newline at its end."""
        return text_of(self.to_object())

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each stem, without its sections; None for what was not measured."""
        out = []
        for stem in self.stems:
            row = stem.model_dump(mode="json", exclude={"sections"})
            out.append(row | {"flags": "; ".join(stem.flags)})
        return out

    def to_csv(self) -> str:
        """Return the rows as CSV with a header line; what was not measured is empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in self.rows():
            writer.writerow([_cell(name, row[name]) for name in COLUMNS])
        return text.getvalue()


COLUMNS = tuple(name for name in ResultStem.model_fields if name != "sections")
"""The columns of the table."""


def stems_schema() -> dict[str, Any]:
    """Return the JSON schema of the file."""
    return Stems.model_json_schema(by_alias=True)


def _known(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


def _cell(name: str, value: Any) -> str:  # noqa: ANN401  a value of a row
    """Return a value as text: places to the tenth of a millimetre of metres, the rest to six digits."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.4f}" if name in {"x", "y", "ground"} else f"{value:.6g}"
    return str(cell(str(value)))
