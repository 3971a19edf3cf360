"""Common parts of the JSON files: the input cloud, number types, and text format."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cylx.config import describe_fault
from cylx.errors import InputError
from cylx.harmless import visible

if TYPE_CHECKING:
    from cylx.records import Extraction, PointCloud, Selection, Source, TiledExtraction

Number = Annotated[float, Field(allow_inf_nan=False)]
Length = Annotated[Number, Field(ge=0)]
Count = Annotated[int, Field(ge=0)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Corner = Annotated[list[Number | None], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Annotated[list[Number], Field(min_length=5, max_length=5)]], Field(min_length=5, max_length=5)]

AnyPart = TypeVar("AnyPart", bound="Part")


class Part(BaseModel):
    """A part of the result: unknown keys, wrong types and numbers that are not finite are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)

    @classmethod
    def parse(cls: type[AnyPart], mapping: Mapping[str, Any], place: str) -> AnyPart:
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
            If it is not as this version of the format has it.
        """
        try:
            return cls.model_validate(mapping)
        except ValidationError as error:
            path, fault, remedy = describe_fault(error, cls)
            raise InputError(": ".join(filter(None, [place, ".".join(path)])), fault, remedy) from None


class Bounds(Part):
    """The smallest box along the coordinate axes that holds all points used."""

    min: Vector
    """Smallest coordinates, scene units."""
    max: Vector
    """Largest coordinates, scene units."""


class Crop(Part):
    """A box along the coordinate axes; `null` sets no bound."""

    min: Corner
    """Smallest coordinates, scene units."""
    max: Corner
    """Largest coordinates, scene units."""


class InputCrs(Part):
    """A coordinate reference system."""

    name: str
    """Its name."""
    wkt: str | None = None
    """Its definition as WKT; absent if only its code is known."""
    epsg: Annotated[int, Field(ge=1)] | None = None
    """Code of EPSG of the whole, or of its horizontal part; absent if it is not known."""

    @classmethod
    def of(cls, sources: Sequence[Source]) -> InputCrs | None:
        """Describe the CRS of the files of a cloud; None if there is none, or more than one."""
        first = sources[0].crs
        if first is None or any(source.crs != first for source in sources):
            return None
        return cls(name=first.name, wkt=first.wkt, epsg=first.epsg)


class InputFile(Part):
    """One of several files that are one cloud."""

    file: str
    """Name of the file without its folder."""
    format: str
    """`ply`, `pcd`, `xyz`, `las`, `e57`, `npy` or `ptx`."""
    points: Count
    """Number of points, including those without finite coordinates and those not used."""
    sha256: str | None = None
    """Digest of the bytes read; absent for an array."""


class Input(Part):
    """The input cloud, and the selection of its points."""

    file: str
    """Name of the file without its folder; `-` for standard input, `<array>` for an array."""
    format: str
    """`ply`, `pcd`, `xyz`, `las`, `e57`, `npy`, `ptx` or `array`."""
    points: Count
    """Number of points, including those without finite coordinates and those not used."""
    sha256: str | None = None
    """Digest of the bytes read; absent for an array."""
    files: list[InputFile] | None = None
    """All files of the cloud, if there are several; `file`, `format` and `sha256` are those of the first."""
    scan: Count | None = None
    """Number of the scan that was read, from 0; absent if all were read."""
    crop: Crop | None = None
    """The box of the points used; absent if there was none."""
    classes: list[Count] | None = None
    """The classes of the points used; absent if all were used."""
    every: Annotated[int, Field(ge=1)] | None = None
    """Only the first of this many rows was used; absent if all were used."""
    voxel: Annotated[Number, Field(gt=0)] | None = None
    """Only one point was used in each cell of this side, scene units; absent if all were used."""
    bounds: Bounds
    """Bounding box of the points used."""
    units: Literal["m", "mm", "cm", "in", "ft", "us-ft"] | None = None
    """Unit of all lengths, from the file or from `--units`; absent if unknown."""
    crs: InputCrs | None = None
    """Coordinate reference system of the points; absent if the file says none."""

    @staticmethod
    def keys_of(selection: Selection) -> dict[str, Any]:
        """Return the keys of a selection of points."""
        corners = None if selection.crop is None else [list(corner) for corner in selection.crop]
        return {
            "scan": selection.scan,
            "crop": None if corners is None else Crop(min=corners[0], max=corners[1]),
            "classes": None if selection.classes is None else list(selection.classes),
            "every": selection.every,
            "voxel": selection.voxel,
        }

    def is_of(self, selection: Selection) -> bool:
        """Return whether exactly this selection of points was used."""
        return all(getattr(self, name) == value for name, value in self.keys_of(selection).items())

    @classmethod
    def of(cls, extraction: Extraction | TiledExtraction) -> Input:
        """Describe the input of an extraction."""
        from cylx.records import TiledExtraction  # noqa: PLC0415  records bring numba

        if isinstance(extraction, TiledExtraction):
            return cls._of_tiled(extraction)
        return cls.of_cloud(extraction.cloud)

    @classmethod
    def of_cloud(cls, cloud: PointCloud) -> Input:
        """Describe the points of a cloud."""
        return cls(
            file=_name_of(cloud.source),
            format=cloud.source.format,
            points=cloud.rows,
            sha256=cloud.source.sha256,
            **cls.keys_of(cloud.source.selection),
            bounds=Bounds(min=plain_numbers(cloud.points.min(axis=0)), max=plain_numbers(cloud.points.max(axis=0))),
            **cls._lengths_of([cloud.source]),
        )

    @classmethod
    def _of_tiled(cls, extraction: TiledExtraction) -> Input:
        """Describe the files of a cloud in tiles."""
        files = [
            InputFile(file=_name_of(source), format=source.format, points=rows, sha256=source.sha256)
            for source, rows in zip(extraction.sources, extraction.rows, strict=True)
        ]
        low, high = (plain_numbers(corner) for corner in extraction.bounds)
        return cls(
            file=files[0].file,
            format=files[0].format,
            points=sum(extraction.rows),
            sha256=files[0].sha256,
            files=files if len(files) > 1 else None,
            **cls.keys_of(extraction.selection),
            bounds=Bounds(min=low, max=high),
            **cls._lengths_of(extraction.sources),
        )

    @staticmethod
    def _lengths_of(sources: Sequence[Source]) -> dict[str, Any]:
        """Return the unit and the CRS of the files of a cloud, where they have the same."""
        units = {source.units for source in sources}
        return {"units": units.pop() if len(units) == 1 else None, "crs": InputCrs.of(sources)}

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what is not known is left out."""
        content = self.model_dump(mode="json")
        drop_missing([content, content["crs"] or {}])
        return content


def _name_of(source: Source) -> str:
    """Return the name of a source without its folder, in valid UTF-8."""
    name = source.file if source.format == "array" else Path(source.file).name
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


def drop_missing(parts: Iterable[dict[str, Any]]) -> None:
    """Remove values that were not computed from parts of a JSON object."""
    for part in parts:
        for key in [key for key, value in part.items() if value is None]:
            del part[key]


def plain_numbers(vector: Iterable[float]) -> list[float]:
    """Convert a vector to plain floats, without negative zeros."""
    return [float(x) + 0.0 for x in vector]


def text_of(content: Mapping[str, Any]) -> str:
    """Return the text of a JSON file, with a newline at its end; characters that do not print are escaped."""
    return visible(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False), keep="\n") + "\n"
