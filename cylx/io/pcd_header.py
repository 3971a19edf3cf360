"""The header of a PCD file, checked for consistency."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile

from cylx.errors import InputError
from cylx.io.inputs import Input, excerpt
from cylx.io.names import coordinate_names, mended_names, missing_coordinates

_TYPES = {
    **{("F", size): f"<f{size}" for size in (4, 8)},
    **{(kind, size): f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)},
}
_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_ALIASES = {"COLUMNS": "FIELDS"}
_BOM = b"\xef\xbb\xbf"
_BODIES = ("ascii", "binary", "binary_compressed")
_MOST_HEADER = 1 << 20
_MOST_COLUMNS = 1 << 12
_REMEDY = "export the file again as PCD 0.7"
_SUFFIX_REMEDY = "give it its right suffix"


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a point: `count` values of one type, starting at byte `offset`."""

    name: str
    type: str
    count: int
    offset: int

    @property
    def width(self) -> int:
        """Bytes of its values."""
        return self.count * int(self.type[2:])

    @property
    def padding(self) -> bool:
        """Whether it holds nothing."""
        return self.name == "_"

    def names(self) -> list[str]:
        """Return the names of the values."""
        return [self.name] if self.count == 1 else [f"{self.name}_{place}" for place in range(self.count)]


@dataclass(frozen=True, slots=True)
class Header:
    """The contents of a header, and where it ends, in bytes and lines."""

    fields: list[Field]
    points: int
    body: str
    size: int
    lines: int

    @property
    def width(self) -> int:
        """Bytes per point."""
        return sum(field.width for field in self.fields)

    def columns(self) -> list[tuple[str, str, Field, int]]:
        """Return the name, type and field of each value of a point, and its index in the field, without padding."""
        kept = [
            (name, field, place)
            for field in self.fields
            if not field.padding
            for place, name in enumerate(field.names())
        ]
        names = mended_names([name for name, _, _ in kept])
        return [(name, field.type, field, place) for name, (_, field, place) in zip(names, kept, strict=True)]


def read_pcd_header(source: Input) -> Header:
    """Read the lines up to DATA and check them against each other; keys in small letters and unknown ones are fine."""
    head = source.head(_MOST_HEADER)
    said: dict[str, list[str]] = {}
    start = len(_BOM) if head.startswith(_BOM) else 0
    number = 0
    while "DATA" not in said:
        stop = head.find(b"\n", start)
        if stop < 0:
            raise _unfinished(source, said)
        number += 1
        line = head[start:stop].decode("utf-8", "backslashreplace").strip()
        start = stop + 1
        words = line.split()
        if not words or line.startswith("#"):
            continue
        key = _ALIASES.get(words[0].upper(), words[0].upper())
        if key in _KEYS:
            said[key] = words[1:] if key == "FIELDS" else line.partition("#")[0].split()[1:]
        elif not said:
            raise InputError(source.place, "is not PCD: it does not begin with its header", _SUFFIX_REMEDY)
        elif not words[0].isidentifier() or (len(words) < 2 and not words[0].isupper()):
            fault = f"{excerpt(' '.join(words))} is not a line of a PCD header"
            raise InputError(f"{source.place}:{number}", fault, _REMEDY)
    body = " ".join(said["DATA"]).lower()
    if body not in _BODIES:
        raise InputError(
            f"{source.place}:{number}", f"unknown DATA {excerpt(body)}", f"use one of {', '.join(_BODIES)}"
        )
    return Header(_fields(said, source.place), _points(said, source.place), body, start, number)


def _unfinished(source: Input, said: dict[str, list[str]]) -> InputError:
    if not said:
        return InputError(source.place, "is not PCD: it does not begin with its header", _SUFFIX_REMEDY)
    if source.size > _MOST_HEADER:
        return InputError(source.place, "the PCD header has no end", _REMEDY)
    return InputError(source.place, "the file ends within the PCD header", "get a complete copy of the file")


def _fields(said: dict[str, list[str]], place: str) -> list[Field]:
    names = said.get("FIELDS", [])
    if len(names) != len(said.get("SIZE", names)):  # a `#` may begin a comment, or belong to a name
        names = list(takewhile(lambda name: not name.startswith("#"), names))
    missing = missing_coordinates(names)
    if missing:
        raise InputError(place, f"FIELDS has no {missing}", "give a PCD with x, y and z")
    kinds = said.get("TYPE", [])
    sizes = _numbers(said, "SIZE", place)
    counts = _numbers(said, "COUNT", place) if "COUNT" in said else [1] * len(names)
    for key, values in (("SIZE", sizes), ("TYPE", kinds), ("COUNT", counts)):
        if len(values) != len(names):
            raise InputError(place, f"{len(names)} FIELDS, but {key} has {len(values)}", _REMEDY)
    most = max(sum(counts), len(names))
    if most > _MOST_COLUMNS:
        raise InputError(place, f"expected at most {_MOST_COLUMNS} values per point, found {most}", _REMEDY)
    coordinates = coordinate_names(names)
    fields: list[Field] = []
    offset = 0
    for name, kind, size, count in zip(names, kinds, sizes, counts, strict=True):
        if (kind.upper(), size) not in _TYPES:
            raise InputError(
                place, f"field {excerpt(name)} has the unknown type {excerpt(kind)} of size {size}", _REMEDY
            )
        if name in coordinates and count != 1:
            raise InputError(place, f"field {name} has {count} values", "give a PCD with one x, y and z per point")
        fields.append(Field(name, _TYPES[kind.upper(), size], count, offset))
        offset += fields[-1].width
    return fields


def _points(said: dict[str, list[str]], place: str) -> int:
    counts = [_numbers(said, key, place) for key in ("WIDTH", "HEIGHT", "POINTS") if key in said]
    if any(len(count) != 1 for count in counts) or not ("POINTS" in said or len(counts) == 2):
        raise InputError(place, "the PCD header does not say how many POINTS there are", _REMEDY)
    *grid, last = (count[0] for count in counts)
    points = last if "POINTS" in said else grid[0] * last
    if len(grid) == 2 and grid[0] * grid[1] != points:
        raise InputError(place, f"WIDTH x HEIGHT is {grid[0] * grid[1]}, but POINTS is {points}", _REMEDY)
    if points == 0:
        raise InputError(place, "holds no points", "give a file with points")
    return points


def _numbers(said: dict[str, list[str]], key: str, place: str) -> list[int]:
    words = said.get(key, [])
    for word in words:
        if not (word.isascii() and word.isdecimal() and len(word) < 19):
            raise InputError(place, f"{key} is {excerpt(' '.join(words))}, not made of counts", _REMEDY)
    return [int(word) for word in words]
