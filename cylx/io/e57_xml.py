"""The XML of an E57 file, checked before libE57 parses it.

Its parser opens the files and addresses that the XML names, in a DOCTYPE or as the place of a schema, and expands
entities without end. Deep elements, and elements of many parts, cost it minutes. An E57 file needs none of them.
"""

from __future__ import annotations

import re
import struct
from contextlib import suppress
from math import isfinite
from typing import TYPE_CHECKING
from xml.parsers import expat

from cylx.errors import InputError
from cylx.wkt import LONGEST

if TYPE_CHECKING:
    from cylx.io.inputs import Input

_PAGE, _PAYLOAD = 1024, 1020  # bytes of a page, the last four of which are a checksum
_HEADER = 48
_DECLARATION = re.compile(rb"[ \t\r\n]*<\?xml[ \t\r\n]")
_ENCODING = re.compile(rb"\bencoding\s*=\s*[\"']([^\"']*)[\"']")
_ENCODINGS = ("utf-8", "utf8", "us-ascii", "ascii", "iso-8859-1")  # a byte of ASCII means the same in each
_APART = {b"<?": b"?>", b"<!--": b"-->", b"<![CDATA[": b"]]>"}
_OPENING = re.compile(rb"<\?|<!--|<!\[CDATA\[")
_DTD = re.compile(rb"<!\s*(?:DOCTYPE|ENTITY|ELEMENT|ATTLIST|NOTATION)", re.IGNORECASE)
_SCHEMA = re.compile(rb"schemaLocation\s*=", re.IGNORECASE)
_SCANS = ["e57Root", "data3D"]
_DEEPEST = 100
"""Elements within one another: the standard has about ten."""
_MOST_PARTS = 1 << 12
"""Parts of an element with names of their own: libE57 compares each with all before it."""
_REMEDY = "get a complete copy of the file"
_MISTRUST = "do not trust the file; export it again with other software"


def check_xml(source: Input) -> None:
    """Refuse XML that has a DOCTYPE or an entity, names a schema, is nested deeply, or is in bytes that could hide it.

    Parameters
    ----------
    source : Input
        An E57 file.

    Raises
    ------
    InputError
    """
    xml = _xml(source).removeprefix(b"\xef\xbb\xbf")
    encoding = _encoding(xml)
    if xml.lstrip(b" \t\r\n")[:1] != b"<" or not _is_text(xml, encoding):
        raise InputError(source.place, "broken E57: its XML is no text in UTF-8", _REMEDY)
    markup = _without_comments(xml)
    if markup.lstrip()[:2] == b"<!" or _DTD.search(markup):
        raise InputError(source.place, "its XML has a DOCTYPE or an entity, which E57 does not use", _MISTRUST)
    if _SCHEMA.search(markup):
        raise InputError(source.place, "its XML names the place of a schema, which E57 does not use", _MISTRUST)
    try:
        _check_shape(xml, encoding)
    except expat.ExpatError as error:
        fault = f"broken E57: its XML is not well-formed, {error}"
        raise InputError(source.place, fault, _REMEDY) from None
    except _ExtremeError as error:
        raise InputError(source.place, f"its XML has {error}, which E57 does not use", _MISTRUST) from None


def coordinate_metadata(source: Input) -> str:
    """Return what an E57 file says of its coordinate reference system, as a rule WKT; empty if it says nothing.

    Parameters
    ----------
    source : Input
        A file whose XML was checked.
    """
    found: list[str] = []
    path: list[str] = []
    parser = expat.ParserCreate()

    def down(name: str, _attributes: dict[str, str]) -> None:
        path.append(name)

    def up(_name: str) -> None:
        path.pop()

    def text(part: str) -> None:
        if path == ["e57Root", "coordinateMetadata"] and len(found) <= LONGEST:
            found.append(part)

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = down, up, text
    try:
        parser.Parse(_xml(source).removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n"), True)
    except (expat.ExpatError, LookupError):
        return ""
    return "".join(found)[:LONGEST]


def scanner_places(source: Input) -> tuple[tuple[float, float, float] | None, ...]:
    """Return the places of the scanners of an E57 file: the translations of the poses of its scans.

    Parameters
    ----------
    source : Input
        A file that was read.

    Returns
    -------
    tuple of (float, float, float) or None
        One for each scan; None for one without a pose, or whose pose moves nothing: its points may be those of several.
    """
    poses: list[dict[str, float]] = []
    path: list[str] = []
    scaling = [1.0, 0.0]

    def down(name: str, attributes: dict[str, str]) -> None:
        path.append(name)
        if path == [*_SCANS, "vectorChild"]:
            poses.append({})
        with suppress(ValueError):
            scaled = attributes.get("type") == "ScaledInteger"
            scaling[:] = [float(attributes.get("scale", 1)), float(attributes.get("offset", 0))] if scaled else [1, 0]
        if path[:-1] == [*_SCANS, "vectorChild", "pose", "translation"]:
            poses[-1][name] = 0.0  # what an element without a text says

    def up(_name: str) -> None:
        path.pop()

    def text(part: str) -> None:
        if path[:-1] == [*_SCANS, "vectorChild", "pose", "translation"]:
            with suppress(ValueError):
                poses[-1][path[-1]] = float(part) * scaling[0] + scaling[1]

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = down, up, text
    try:
        parser.Parse(_xml(source).removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n"), True)
    except (expat.ExpatError, LookupError):
        return ()
    places = [tuple(pose.get(axis, 0.0) for axis in "xyz") for pose in poses]
    return tuple((x, y, z) if any((x, y, z)) and all(map(isfinite, (x, y, z))) else None for x, y, z in places)


class _ExtremeError(Exception):
    """Elements are nested too deeply, or one has too many parts."""


def _check_shape(xml: bytes, encoding: str) -> None:
    """Parse the XML by a parser that neither opens anything nor calls itself, and stop where it is too deep or wide."""
    open_elements: list[list[int]] = []  # for each, how many parts it may still have

    def down(_name: str, attributes: dict[str, str]) -> None:
        if open_elements:
            open_elements[-1][0] -= 1
            if open_elements[-1][0] < 0:
                raise _ExtremeError(f"an element of more than {_MOST_PARTS} parts")
        if len(open_elements) == _DEEPEST:
            raise _ExtremeError(f"more than {_DEEPEST} elements within one another")
        open_elements.append([len(xml) if attributes.get("type") == "Vector" else _MOST_PARTS])

    def up(_name: str) -> None:
        open_elements.pop()

    parser = expat.ParserCreate("utf-8" if encoding == "utf8" else encoding)
    parser.StartElementHandler, parser.EndElementHandler = down, up
    parser.Parse(xml.lstrip(b" \t\r\n"), True)


def _xml(source: Input) -> bytes:
    """Return the bytes of the XML: those of its pages without their checksums."""
    head = source.head(_HEADER)
    if len(head) < _HEADER:
        raise InputError(source.place, "broken E57: the file ends within its header", _REMEDY)
    start, length, page = struct.unpack_from("<3Q", head, 24)
    if page != _PAGE:
        raise InputError(source.place, f"broken E57: its pages have {page} bytes, not {_PAGE}", _REMEDY)
    if not _HEADER <= start < source.size or not 0 < length <= source.size:
        raise InputError(source.place, "broken E57: its XML is not within the file", _REMEDY)
    first = start // _PAGE
    skipped = min(start - first * _PAGE, _PAYLOAD)
    source.file.seek(first * _PAGE)
    pages = source.file.read(-(-(skipped + length) // _PAYLOAD) * _PAGE)
    logical = b"".join(pages[place : place + _PAYLOAD] for place in range(0, len(pages), _PAGE))
    return logical[skipped : skipped + length]


def _encoding(xml: bytes) -> str:
    """Return the encoding that the XML declares; an empty text if it may not be used, or cannot be told for certain."""
    declaration = xml[: xml.find(b"?>")] if _DECLARATION.match(xml) else b""
    found = [name.strip().lower().decode("ascii", "replace") for name in _ENCODING.findall(declaration)]
    if declaration.lower().count(b"encoding") != len(found) or any(name not in _ENCODINGS for name in found):
        return ""
    return found[0] if found else "utf-8"


def _is_text(xml: bytes, encoding: str) -> bool:
    try:
        return bool(encoding) and "\0" not in xml.decode(encoding)
    except UnicodeDecodeError:
        return False


def _without_comments(xml: bytes) -> bytes:
    """Return the XML without its comments, instructions and CDATA.

    They are found in the order of the text, as the parser does: one that begins within another is a part of it, and one
    that does not end stays.
    """
    kept: list[bytes] = []
    place = 0
    while (found := _OPENING.search(xml, place)) is not None:
        end = xml.find(_APART[found[0]], found.end())
        if end < 0:
            break
        kept.append(xml[place : found.start()])
        place = end + len(_APART[found[0]])
    kept.append(xml[place:])
    return b" ".join(kept)
