"""The header of a PLY file, checked for consistency and against the size of the file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import Input, excerpt
from cylx.io.names import coordinate_names, mended_names, missing_coordinates
from cylx.io.row_format import short_of_points

if TYPE_CHECKING:
    from collections.abc import Iterator

_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
    "bool": "u1",
    "int64": "i8",
    "uint64": "u8",
    "long": "i8",
    "ulong": "u8",
    "longlong": "i8",
    "ulonglong": "u8",
}
STANDARD = {"bool": "uchar"} | dict.fromkeys(("int64", "uint64", "long", "ulong", "longlong", "ulonglong"), "double")
"""Types of PLY with the size of those that it has not."""
_MOST_PROPERTIES = 1 << 12
_VERTEX = ("vertex", "vertices", "point", "points")
"""Names of the points, the standard one first."""
_FIRST = re.compile(rb"ply[ \t]*(\r\n|\n|\r|\Z)", re.IGNORECASE)
_BOM = b"\xef\xbb\xbf"
_MOST_HEADER = 1 << 20
_REMEDY = "export the file again as PLY 1.0"


@dataclass(frozen=True, slots=True)
class Property:
    """A property of an element, with type names of PLY; `length` is the type of a list's length, "" for a scalar."""

    name: str
    type: str
    length: str = ""


@dataclass(frozen=True, slots=True)
class Element:
    """An element and its properties."""

    name: str
    count: int
    properties: list[Property]

    @property
    def has_lists(self) -> bool:
        """Whether any of the properties is a list."""
        return any(item.length for item in self.properties)

    def least_size(self, text: bool) -> int:
        """Return the least bytes of a row: the length of a list; in text, one digit and a separator per property."""
        if text:
            return max(2 * len(self.properties), 1)
        return sum(np.dtype(TYPES[item.length or item.type]).itemsize for item in self.properties)

    def lines(self) -> list[str]:
        """Return the lines of the element in a header."""
        names = mended_names([item.name for item in self.properties])
        kinds = [STANDARD.get(item.type, item.type) for item in self.properties]
        types = [
            f"list {STANDARD.get(item.length, item.length)} {kind}" if item.length else kind
            for item, kind in zip(self.properties, kinds, strict=True)
        ]
        return [
            f"element {self.name} {self.count}",
            *(f"property {kind} {name}" for kind, name in zip(types, names, strict=True)),
        ]


@dataclass(frozen=True, slots=True)
class Header:
    """The contents of a header: format, elements up to the vertices, and where it ends, in bytes and lines."""

    format: str
    elements: list[Element]
    size: int
    lines: int

    @property
    def text(self) -> bool:
        """Whether the body is text."""
        return self.format == "ascii"

    @property
    def vertex(self) -> Element:
        """The vertex element."""
        return self.elements[-1]


def read_header(source: Input) -> Header:
    """Read the header of a PLY and check it.

    Raises
    ------
    InputError
        If this is not PLY, has no vertices with scalar x, y and z, or is shorter than its header says.
    """
    header = _read_lines(source)
    _check_vertex(header.vertex, source.place)
    _check_size(header, source)
    return header


def _read_lines(source: Input) -> Header:
    kind = ""
    elements: list[Element] = []
    number = size = 0
    for number, size, line in _header_lines(source):  # noqa: B007  (both are needed after the last line)
        where = f"{source.place}:{number}"
        keyword, *rest = line.split() or [""]
        keyword = keyword.lower()
        if keyword == "end_header":
            break
        if number == 1 or keyword in ("", "comment", "obj_info"):
            continue
        if keyword == "format":
            kind = _format(rest, where)
        elif keyword == "element":
            elements.append(_element(rest, where))
        elif keyword == "property" and elements:
            elements[-1].properties.append(_property(rest, where))
        else:
            raise InputError(where, f"{excerpt(line)} is not a line of a PLY header", _REMEDY)
    if not kind:
        raise InputError(source.place, "the PLY header has no format line", _REMEDY)
    names = [element.name.lower() for element in elements]
    name = next((name for name in _VERTEX if name in names), "")
    if not name:
        raise InputError(source.place, "the PLY header has no vertex element", "give a PLY with points")
    before, vertex = elements[: names.index(name)], elements[names.index(name)]
    return Header(kind, [*before, Element("vertex", vertex.count, vertex.properties)], size, number)


def _header_lines(source: Input) -> Iterator[tuple[int, int, str]]:
    """Yield number, end and text of each line of the header, which may end in LF, CR LF or CR."""
    head = source.head(_MOST_HEADER)
    start = len(_BOM) if head.startswith(_BOM) else 0
    first = _FIRST.match(head, start)
    if first is None:
        raise InputError(source.place, "is not PLY: it does not begin with the line 'ply'", "give it its right suffix")
    newline = b"\r" if first[1] == b"\r" else b"\n"
    number = 0
    while (stop := head.find(newline, start)) >= 0:
        number += 1
        line = head[start:stop].decode("utf-8", "backslashreplace").strip()
        start = stop + 1
        yield number, start, line
    if source.size > _MOST_HEADER:
        raise InputError(source.place, "the PLY header has no end", "export the file again")
    raise InputError(source.place, "the file ends within the PLY header", "get a complete copy of the file")


def _format(words: list[str], where: str) -> str:
    if len(words) != 2 or words[0].lower() not in _FORMATS or words[1] != "1.0":
        fault = f"unknown format {excerpt(' '.join(words))}"
        raise InputError(where, fault, f"use one of {', '.join(_FORMATS)}, version 1.0")
    return words[0].lower()


def _element(words: list[str], where: str) -> Element:
    if len(words) != 2:
        raise InputError(where, f"{excerpt(' '.join(words))} is not the name and count of an element", _REMEDY)
    if not (words[1].isascii() and words[1].isdecimal() and len(words[1]) < 19):
        raise InputError(where, f"element {excerpt(words[0])} has the impossible count {excerpt(words[1])}", _REMEDY)
    return Element(words[0], int(words[1]), [])


def _property(words: list[str], where: str) -> Property:
    *types, name = [word.lower() for word in words[:-1]] + words[-1:] or [""]
    if types in (["long", "long"], ["unsigned", "long"]):
        types = [{"long": "longlong", "unsigned": "ulong"}[types[0]]]
    if len(types) == 1 and types[0] in TYPES:
        return Property(name, types[0])
    listed = len(types) == 3 and types[0] == "list" and types[1] in TYPES and types[1] not in STANDARD
    if listed and types[2] in TYPES:
        return Property(name, types[2], types[1])
    raise InputError(where, f"{excerpt(' '.join(words))} is not a property type and name", _REMEDY)


def _check_vertex(vertex: Element, place: str) -> None:
    names = [item.name for item in vertex.properties]
    if len(names) > _MOST_PROPERTIES:
        raise InputError(place, f"expected at most {_MOST_PROPERTIES} properties, found {len(names)}", _REMEDY)
    missing = missing_coordinates(names)
    if missing:
        raise InputError(place, f"the vertex element has no property {missing}", "give a PLY with x, y and z")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(place, f"the vertex element has the property {excerpt(twice)} twice", _REMEDY)
    for item in vertex.properties:
        if item.length and item.name in coordinate_names(names):
            raise InputError(place, f"the property {item.name} is a list", "give a PLY with one x, y and z per point")
        if item.length and STANDARD.get(item.type) == "double":
            fault = f"the list property {excerpt(item.name)} is made of {item.type}"
            raise InputError(place, fault, "leave it out, or write it as int")
    if vertex.count == 0:
        raise InputError(place, "holds no points", "give a file with points")


def _check_size(header: Header, source: Input) -> None:
    """Refuse counts that do not fit into the file, before memory is allocated for them."""
    room = source.size - header.size + header.text  # the last line end may be missing
    for element in header.elements[:-1]:
        if not element.properties:
            raise InputError(source.place, f"the element {excerpt(element.name)} has no properties", _REMEDY)
        room -= element.count * element.least_size(header.text)
        if room < 0:
            fault = f"the header promises {element.count} elements {excerpt(element.name)}, the file is too short"
            raise InputError(source.place, fault, "get a complete copy of the file")
    if header.text and not header.vertex.has_lists:
        return  # these rows are counted while they are read
    held = room // header.vertex.least_size(header.text)
    if held < header.vertex.count:
        raise short_of_points(source.place, header.vertex.count, held, at_most=header.text)
