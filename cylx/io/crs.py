"""The unit and the coordinate reference system that a file says of its points."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from cylx.harmless import visible
from cylx.io.e57_xml import coordinate_metadata, scanner_places
from cylx.optional.extras import is_found
from cylx.records.sources import Crs
from cylx.units import METRES, unit_of
from cylx.wkt import CrsFacts, facts_of

if TYPE_CHECKING:
    from cylx.io.inputs import Input
    from cylx.io.las_header import LasFacts

_VLR, _EVLR = 54, 60  # bytes in front of the data of each record of a LAS
_WKT, _KEYS, _DOUBLES = 2112, 34735, 34736
_GEOGRAPHIC, _PROJECTED, _UNIT, _UNIT_SIZE, _VERTICAL, _VERTICAL_UNIT = 2048, 3072, 3076, 3077, 4096, 4099
_OWN = 32767  # a CRS or a unit of the writer's own
_LENGTHS = {9001: 1.0, 9002: METRES["ft"], 9003: METRES["us-ft"], 1025: 0.001, 1033: 0.01}
"""Length of units by their codes of EPSG, metres."""
_SAME = "convert the heights to the unit of x and y"


def crs_facts(wkt: str) -> dict[str, Any]:
    """Return the keys of a `Source` for a CRS that is written as WKT.

    Parameters
    ----------
    wkt : str
        Anything else than WKT says nothing.

    Returns
    -------
    dict
        `units`, `crs` and `doubts`, as far as they are known.
    """
    text = wkt.strip().rstrip("\0").strip()
    facts = facts_of(text)
    if facts is None:
        return {}
    crs = Crs(visible(facts.name), text, facts.epsg or _identified(text))
    return {"crs": crs, **_lengths(facts, facts.metres, facts.vertical_metres)}


def las_crs(header: bytes) -> dict[str, Any]:
    """Return the keys of a `Source` for the CRS that the records of a LAS say, as WKT or as GeoTIFF keys.

    Parameters
    ----------
    header : bytes
        As `kept_header` returns it.
    """
    records = dict(_records(header))
    if _WKT in records:
        found = crs_facts(records[_WKT].decode("utf-8", "replace"))
        if found:
            return found
    return _of_keys(_geo_keys(records.get(_KEYS, b""), records.get(_DOUBLES, b"")))


def las_source(header: bytes, facts: LasFacts) -> dict[str, Any]:
    """Return the keys of a `Source` for a LAS: its header, its unit and CRS, and what is in doubt."""
    found = las_crs(header)
    return {**found, "header": header, "doubts": (*facts.doubts, *found.get("doubts", ()))}


def e57_source(source: Input) -> dict[str, Any]:
    """Return the keys of a `Source` for an E57 that was read, which is in metres: unit, CRS, places of scanners."""
    found = crs_facts(coordinate_metadata(source))
    facts: dict[str, Any] = {"units": "m", "stations": scanner_places(source)}
    return facts | ({"crs": found["crs"]} if "crs" in found else {})


def _records(header: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield numbers and data of the records about the CRS."""
    size, start, count = struct.unpack_from("<HII", header, 94)
    place = size
    for _ in range(count):
        if place + _VLR > min(start, len(header)):
            break
        number, length = struct.unpack_from("<HH", header, place + 18)
        if header[place + 2 : place + 18].rstrip(b"\0") == b"LASF_Projection":
            yield number, header[place + _VLR : place + _VLR + length]
        place += _VLR + length
    place = start
    while place + _EVLR <= len(header):  # what is kept behind the others
        number, length = struct.unpack_from("<HQ", header, place + 18)
        if header[place + 2 : place + 18].rstrip(b"\0") == b"LASF_Projection":
            yield number, header[place + _EVLR : place + _EVLR + length]
        place += _EVLR + length


def _geo_keys(directory: bytes, doubles: bytes) -> dict[int, float]:
    """Return the numbers among GeoTIFF keys."""
    out: dict[int, float] = {}
    shorts = struct.unpack(f"<{len(directory) // 2}H", directory[: len(directory) // 2 * 2])
    for place in range(4, len(shorts) - 3, 4):
        key, where, _, value = shorts[place : place + 4]
        if where == 0:
            out[key] = value
        elif where == _DOUBLES and 8 * value + 8 <= len(doubles):
            out[key] = struct.unpack_from("<d", doubles, 8 * value)[0]
    return out


def _of_keys(keys: dict[int, float]) -> dict[str, Any]:
    code = next((int(keys[k]) for k in (_PROJECTED, _GEOGRAPHIC) if 1000 < keys.get(k, 0) < _OWN), None)
    above = int(keys[_VERTICAL]) if 3000 < keys.get(_VERTICAL, 0) < _OWN else None
    metres = keys.get(_UNIT_SIZE) or _LENGTHS.get(int(keys.get(_UNIT, 0)))
    heights = _LENGTHS.get(int(keys.get(_VERTICAL_UNIT, 0)))
    wkt = None if code is None else _wkt_of(code, above)
    facts = None if wkt is None else facts_of(wkt)
    if facts is not None:
        if facts.kind == "projected":  # what the keys say is about the numbers in the file
            metres = metres or facts.metres
        heights = heights or facts.vertical_metres
    if code is None and metres is None:
        return {}
    crs = None if code is None else Crs(facts.name if facts else f"EPSG:{code}", wkt, code)
    projected = facts.kind != "geographic" if facts else _PROJECTED in keys or code is None
    return {"crs": crs, **_lengths(facts, metres if projected else None, heights)}


def _lengths(facts: CrsFacts | None, metres: float | None, heights: float | None) -> dict[str, Any]:
    """Return the unit of a scan with these lengths of the units of x and y, and of z."""
    if metres is None:
        return {}
    unit = unit_of(metres)
    if unit is None:
        fault = f"its unit is {metres:.10g} m long, which is none that cylx knows"
        return {"doubts": ((fault, "give the unit by --units, if it is another"),)}
    if heights is not None and unit_of(heights) != unit:
        fault = f"heights are in {unit_of(heights) or f'units of {heights:.10g} m'}, but x and y in {unit}"
        off = abs(heights / metres - 1.0)
        return {"units": unit} if off < 1e-4 else {"doubts": ((f"{fault}: nothing upright is round", _SAME),)}
    return {"units": unit}


def _wkt_of(code: int, above: int | None) -> str | None:
    """Return a CRS of EPSG, with one of heights or without, as WKT; None without pyproj, or if it is unknown."""
    if not is_found("pyproj"):
        return None
    from pyproj import CRS  # noqa: PLC0415  an extra
    from pyproj.crs import CompoundCRS  # noqa: PLC0415  an extra
    from pyproj.exceptions import ProjError  # noqa: PLC0415  an extra

    try:
        crs = level = CRS.from_epsg(code)
    except ProjError:
        return None
    if above is not None:
        try:
            vertical = CRS.from_epsg(above)
            crs = CompoundCRS(f"{level.name} + {vertical.name}", [level, vertical])
        except ProjError:
            pass
    for form in ("WKT1_GDAL", "WKT2_2019"):  # the first changes less from one version of PROJ to the next
        try:
            return str(crs.to_wkt(form))
        except ProjError:
            continue
    return None


def _identified(wkt: str) -> int | None:
    """Return the code of EPSG of a CRS that does not say it; None without pyproj, or if there is none."""
    if not is_found("pyproj"):
        return None
    from pyproj import CRS  # noqa: PLC0415  an extra
    from pyproj.exceptions import ProjError  # noqa: PLC0415  an extra

    try:
        crs = CRS.from_wkt(wkt)
        level = crs.sub_crs_list[0] if crs.is_compound else crs
        code = level.to_epsg(min_confidence=90)
    except ProjError:
        return None
    return None if code is None else int(code)
