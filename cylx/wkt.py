"""What a coordinate reference system written as WKT says: its name, its code, and its units of length.

Versions 1 and 2 of WKT (OGC 01-009 and 18-010) are read, as far as is needed to know the unit; nothing is converted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

Kind = Literal["projected", "geographic", "local", "geocentric", "other"]
LONGEST = 1 << 16
"""Letters of a WKT, at the most."""
_DEEPEST = 32
_TOKEN = re.compile(r'\s*(?:"((?:[^"]|"")*)"|([A-Za-z_][A-Za-z0-9_]*)|([-+]?[0-9.][0-9.eE+-]*)|([\[\](),]))')
_KINDS: dict[str, Kind] = {
    **dict.fromkeys(("PROJCS", "PROJCRS", "PROJECTEDCRS"), "projected"),
    **dict.fromkeys(("GEOGCS", "GEOGCRS", "GEOGRAPHICCRS"), "geographic"),
    **dict.fromkeys(("LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"), "local"),
    "GEOCCS": "geocentric",
}
_COMPOUND = ("COMPD_CS", "COMPOUNDCRS")
_VERTICAL = ("VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS")
_BOUND = ("BOUNDCRS", "SOURCECRS")
_UNITS = ("UNIT", "LENGTHUNIT")


class _Node(NamedTuple):
    """A keyword with what is in its brackets."""

    word: str
    values: list[_Node | str | float]

    def parts(self, *words: str) -> Iterator[_Node]:
        """Yield the nodes directly in it that have one of these keywords."""
        return (one for one in self.values if isinstance(one, _Node) and one.word in words)


@dataclass(frozen=True, slots=True)
class CrsFacts:
    """What a WKT says.

    Parameters
    ----------
    name : str
        Its name; empty if it has none.
    kind : {"projected", "geographic", "local", "geocentric", "other"}
        Of its horizontal part.
    epsg : int or None
        Code of EPSG of the whole, or else of its horizontal part.
    metres : float or None
        Length of the unit of x and y, metres; None if there is none, as in degrees.
    vertical_metres : float or None
        Length of the unit of the heights, metres; None if it is not said.
    """

    name: str
    kind: Kind
    epsg: int | None
    metres: float | None
    vertical_metres: float | None


def facts_of(wkt: str) -> CrsFacts | None:
    """Return what a WKT says; None if it is no WKT of a CRS.

    Parameters
    ----------
    wkt : str

    Examples
    --------
    >>> facts_of('LOCAL_CS["site",UNIT["foot",0.3048]]').metres
    0.3048
    >>> facts_of("site grid") is None
    True
    """
    try:
        root = _parsed(wkt)
    except (ValueError, IndexError):
        return None
    return None if root is None else _facts(root)


def _facts(root: _Node) -> CrsFacts | None:
    level, upright = root, None
    if root.word in _COMPOUND:
        inner = [one for one in root.values if isinstance(one, _Node)]
        upright = next(root.parts(*_VERTICAL), None)
        level = next((one for one in inner if _bare(one).word in _KINDS or _kind(_bare(one)) != "other"), root)
    level = _bare(level)
    kind = _kind(level)
    if kind == "other" and root.word not in {*_COMPOUND, *_VERTICAL}:
        return None
    metres = _unit(level) if kind in {"projected", "local", "geocentric"} else None
    heights = None if upright is None else _unit(upright)
    if upright is None and kind == "projected" and sum(1 for _ in level.parts("AXIS")) > 2:
        heights = metres
    first = root.values[0] if root.values else ""
    name = first if isinstance(first, str) else ""
    return CrsFacts(name, kind, _code(root) or _code(level), metres, heights)


def _bare(node: _Node) -> _Node:
    """Return the CRS within one that is bound to another."""
    while node.word in _BOUND:
        inner = next((one for one in node.values if isinstance(one, _Node)), None)
        if inner is None:
            break
        node = inner
    return node


def _kind(node: _Node) -> Kind:
    if node.word in {"GEODCRS", "GEODETICCRS"}:
        system = next(node.parts("CS"), None)
        cartesian = system is not None and system.values[:1] and str(system.values[0]).lower() == "cartesian"
        return "geocentric" if cartesian else "geographic"
    return _KINDS.get(node.word, "other")


def _unit(node: _Node) -> float | None:
    """Return the length of the unit of a CRS, metres: its own, or else that of its first axis."""
    own = list(node.parts(*_UNITS)) or [unit for axis in node.parts("AXIS") for unit in axis.parts(*_UNITS)][:1]
    length = own[-1].values[1] if own and len(own[-1].values) > 1 else None
    return length if isinstance(length, float) and 0.0 < length < math.inf else None


def _code(node: _Node) -> int | None:
    """Return the code of EPSG that a CRS has for itself."""
    for own in node.parts("AUTHORITY", "ID"):
        if len(own.values) > 1 and str(own.values[0]).upper() == "EPSG":
            text = str(own.values[1]).removesuffix(".0")
            if text.isascii() and text.isdigit() and 0 < int(text[:9]) < 10**6:
                return int(text[:9])
    return None


def _parsed(wkt: str) -> _Node | None:
    """Return the root of a WKT.

    Raises
    ------
    ValueError, IndexError
        If it is none.
    """
    if len(wkt) > LONGEST:
        return None
    stack: list[_Node] = [_Node("", [])]
    word, place, text = None, 0, wkt.strip().rstrip("\0").strip()
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            return None
        place = found.end()
        quoted, name, number, mark = found.groups()
        if mark in {"[", "("}:
            node = _Node((word or "").upper(), [])
            stack[-1].values.append(node)
            stack.append(node)
            if word is None or len(stack) > _DEEPEST:
                return None
        elif word is not None:
            stack[-1].values.append(word)
        word = name
        if mark in {"]", ")"}:
            stack.pop()
        elif quoted is not None:
            stack[-1].values.append(quoted.replace('""', '"'))
        elif number is not None:
            stack[-1].values.append(float(number))
    roots = [one for one in stack[0].values if isinstance(one, _Node)]
    if len(stack) != 1 or len(roots) != len(stack[0].values) or not 0 < len(roots) < 3:
        return None
    if len(roots) == 1:
        return roots[0]
    return _Node(_COMPOUND[0], [roots[0].values[0], *roots]) if roots[0].values else None  # as ESRI writes it
