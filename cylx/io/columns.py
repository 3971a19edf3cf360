"""Find the coordinates among the columns of a text by their names, in the words that programs and surveyors use."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylx.io.names import coordinate_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_UNITS = _words(
    "m mm cm dm km um ft feet foot usft us survey in inch inches yd yards meter meters metre metres millimeter "
    "millimeters millimetre millimetres centimeter centimeters centimetre centimetres kilometer kilometers"
)
_FILLERS = _words(
    "pos position positions point points pt pts coord coords coordinate coordinates koord koordinate koordinaten "
    "coordonnee coordenada coordinata location loc vertex cartesian xyz world global local utm map geo grid value "
    "val wert projected scan field"
)
_INDEXED = _words("pos position positions point points coord coords coordinate coordinates xyz location")
_HEIGHT_FILLERS = _words("ellipsoidal ellipsoid orthometric ortho mean msl asl sea level ground gps")
_FAMILIES = (
    (frozenset("x"), frozenset("y")),
    (
        _words("easting eastings east e este leste oost ost ostwert rechtswert rechts rw"),
        _words("northing northings north n norte noord norr nord nordwert hochwert hoch hw"),
    ),
    (_words("est"), _words("nord")),
    (_words("longitude lon long lng"), _words("latitude lat")),
)
"""Names of the two horizontal axes: as x and y, on a map, and in degrees."""
_DEGREES = 3
_LONGEST_NAME = 200
_HEIGHTS = _words(
    "elevation elevations elev height heights h alt altitude hohe hoehe hoogte hojd rl cota quota altura altezza "
    "hauteur elevacion"
)
_ALONG = _words("easting east northing north elevation elev height altitude up right forward")
"""Words that may stand beside x, y or z, which count."""
_NO_PLACES = _words(
    "normal normals n nn velocity vel v speed acc accel acceleration force gyro mag rot rotation angle angular euler q "
    "quat orientation direction dir gradient origin sensor scanner station sd std stdev sigma error err var rms min "
    "max size width scale offset d delta diff residual"
)
"""Words beside x, y or z that make something else of it."""
_OTHERS = _words(
    "intensity reflectance reflectivity amplitude remission red green blue rgb rgba alpha nx ny nz normal normals "
    "curvature time timestamp gps class classification label ring laser return returns azimuth range distance angle "
    "pitch yaw roll quality confidence temperature"
)
"""Words that name something else, whatever stands beside them."""


@dataclass(frozen=True, slots=True)
class Coordinates:
    """Which columns are x, y and z.

    Parameters
    ----------
    places : tuple of int
        Indices of the columns.
    doubt : tuple of str
        A fault and a remedy if the names leave a doubt; otherwise empty.
    note : str
        What was taken, if the names are unusual; otherwise empty.
    """

    places: tuple[int, int, int]
    doubt: tuple[str, ...] = ()
    note: str = ""


def named_coordinates(names: Sequence[str]) -> Coordinates | None:
    """Find x, y and z by the names of the columns.

    Parameters
    ----------
    names : sequence of str
        As they are in the file, without quotes.

    Returns
    -------
    Coordinates or None
        None if the names do not tell.

    Examples
    --------
    >>> named_coordinates(["id", "Northing (m)", "Easting (m)", "Elevation"]).places
    (2, 1, 3)
    >>> named_coordinates(["Points:0", "Points:1", "Points:2"]).places
    (0, 1, 2)
    >>> named_coordinates(["a", "b", "c"]) is None
    True
    """
    exact = coordinate_names(names)
    if len(exact) == 3:
        x, y, z = (names.index(name) for name in exact)
        again = any(names.count(name) > 1 for name in exact) or {*names} >= set("xyzXYZ")
        return Coordinates((x, y, z), _several(names, (x, y, z)) if again else ())
    read = [_read_name(name) for name in names]
    return _grouped(names, read) or _paired(names, read) or _alike(names)


def named_axes(names: Sequence[str]) -> dict[str, int]:
    """Return the columns of those axes that are named by one column alone.

    Examples
    --------
    >>> named_axes(["id", "X", "Y [m]", "depth"])
    {'x': 1, 'y': 2}
    """
    axes: dict[str, list[int]] = {}
    for place, (axis, _) in enumerate(map(_read_name, names)):
        if axis in ("x", "y", "z"):
            axes.setdefault(axis, []).append(place)
    return {axis: places[0] for axis, places in axes.items() if len(places) == 1}


def is_other(name: str) -> bool:
    """Return whether a name says that its column is no coordinate.

    Examples
    --------
    >>> is_other("Intensity"), is_other("laser_id"), is_other("vel_x"), is_other("a")
    (True, True, True, False)
    """
    words = _words_of(name) if len(name) <= _LONGEST_NAME else []
    beside = not {"x", "y", "z"}.isdisjoint(words) and not _NO_PLACES.isdisjoint(words)
    return beside or not _OTHERS.isdisjoint(words)


def _read_name(name: str) -> tuple[str, tuple[str, ...]]:
    """Return the word of a name that says an axis, "" if none does, and its other words; units are left out."""
    words = _words_of(name) if len(name) <= _LONGEST_NAME else []
    spare = [word for word in words if word not in _UNITS]
    axes = [word for word in spare if word in ("x", "y", "z")]
    rest = tuple(word for word in spare if word not in axes)
    if len(axes) == 1 and (_FILLERS | _ALONG).issuperset(rest):
        return axes[0], rest
    places = [word for word in spare if word in ("0", "1", "2")]
    rest = tuple(word for word in spare if word not in places)
    if len(places) == 1 and rest and _INDEXED.issuperset(rest):
        return "xyz"[int(places[0])], ("indexed", *rest)
    said = [word for word in spare if word in _HEIGHTS or any(word in side for pair in _FAMILIES for side in pair)]
    rest = tuple(word for word in spare if word not in said)
    if len(said) == 1 and (_FILLERS | _HEIGHT_FILLERS).issuperset(rest):
        return said[0], rest
    return "", tuple(words)


def _words_of(name: str) -> list[str]:
    text = re.sub(r"\\x([0-9a-f]{2})", lambda found: chr(int(found[1], 16)), name)  # a letter in Latin-1
    text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    text = re.sub(r"\[\s*([0-2])\s*\]", r" \1 ", text)
    text = re.sub(r"\([^)]*\)|\[[^\]]*\]|\{[^}]*\}|<[^>]*>", " ", text)
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?=\d)|(?<=^[xyz])(?=[A-Z])", " ", text)
    return re.findall(r"[^\W\d_]+|\d+", text.lower())


def _grouped(names: Sequence[str], read: Sequence[tuple[str, tuple[str, ...]]]) -> Coordinates | None:
    """Find x, y and z that are named alike, such as pos_x, pos_y, pos_z; the shortest names win."""
    groups: dict[tuple[str, ...], dict[str, list[int]]] = {}
    for place, (axis, rest) in enumerate(read):
        if axis in ("x", "y", "z"):
            groups.setdefault(rest, {}).setdefault(axis, []).append(place)
    whole = sorted((rest for rest in groups if len(groups[rest]) == 3), key=len)
    if not whole:
        return None
    places = groups[whole[0]]
    x, y, z = (places[axis][0] for axis in "xyz")
    several = any(len(found) > 1 for found in places.values()) or (len(whole) > 1 and len(whole[0]) == len(whole[1]))
    return Coordinates((x, y, z), _several(names, (x, y, z)) if several else ())


def _alike(names: Sequence[str]) -> Coordinates | None:
    """Find x, y and z beside an unknown word, such as cam_x, cam_y, cam_z, if there is one such triple."""
    groups: dict[tuple[str, ...], dict[str, int]] = {}
    for place, name in enumerate(names):
        words = [word for word in _words_of(name) if word not in _UNITS] if len(name) <= _LONGEST_NAME else []
        axes = [word for word in words if word in ("x", "y", "z")]
        if len(axes) == 1 and _NO_PLACES.isdisjoint(words):
            groups.setdefault(tuple(word for word in words if word not in axes), {})[axes[0]] = place
    whole = [axes for axes in groups.values() if len(axes) == 3]
    if len(whole) != 1:
        return None
    x, y, z = (whole[0][axis] for axis in "xyz")
    return Coordinates((x, y, z), note=f"x, y, z are {_taken(names, (x, y, z))}")


def _paired(names: Sequence[str], read: Sequence[tuple[str, tuple[str, ...]]]) -> Coordinates | None:
    """Find two horizontal axes of one family and a height."""
    heights = _those(read, frozenset("z")) or _those(read, _HEIGHTS)
    if not heights:
        return None
    for number, (eastward, northward) in enumerate(_FAMILIES):
        east, north = _those(read, eastward), _those(read, northward)
        if not east or not north:
            continue
        places = (east[0], north[0], heights[0])
        if number == _DEGREES:
            fault = f"x and y are {_quoted(names[places[0]])} and {_quoted(names[places[1]])}, degrees beside lengths"
            return Coordinates(places, (fault, "project it to metres first"))
        several = any(_tied(read, found) for found in (east, north, heights))
        return Coordinates(places, _several(names, places) if several else ())
    return None


def _those(read: Sequence[tuple[str, tuple[str, ...]]], words: frozenset[str]) -> list[int]:
    """Return the columns that one of the words names, the shortest names first."""
    found = [place for place, (word, _) in enumerate(read) if word in words]
    return sorted(found, key=lambda place: len(read[place][1]))


def _tied(read: Sequence[tuple[str, tuple[str, ...]]], found: Sequence[int]) -> bool:
    return len(found) > 1 and len(read[found[0]][1]) == len(read[found[1]][1])


def _several(names: Sequence[str], places: Iterable[int]) -> tuple[str, str]:
    fault = f"several columns may be the coordinates; x, y, z are {_taken(names, places)}"
    return fault, "call the right ones x, y and z"


def _taken(names: Sequence[str], places: Iterable[int]) -> str:
    return ", ".join(_quoted(names[place]) for place in places)


def _quoted(name: str) -> str:
    return ascii(name if len(name) <= 40 else name[:37] + "...")
