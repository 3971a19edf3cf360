"""Maps: features with attributes as GeoPackage, and as GeoJSON; needs no extra but for GeoJSON of a projected CRS.

A GeoPackage is a database of SQLite whose tables the OGC has fixed (OGC 12-128r18). What is written here is its core:
features with attributes, without a spatial index and without extensions.
"""

from __future__ import annotations

import json
import math
import sqlite3
import struct
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from cylx.errors import OutputError
from cylx.export.reproject import to_degrees, wkt_for_maps
from cylx.harmless import visible

Kind = Literal["POINT", "LINESTRING", "MULTILINESTRING", "POLYGON"]
Place = Sequence[float]
_CODES = {"POINT": 1, "LINESTRING": 2, "POLYGON": 3, "MULTILINESTRING": 5}
_JSON = {"POINT": "Point", "LINESTRING": "LineString", "POLYGON": "Polygon", "MULTILINESTRING": "MultiLineString"}
_TYPES: dict[type, str] = {bool: "BOOLEAN", int: "INTEGER", float: "DOUBLE", str: "TEXT"}
_OWN_CRS = 100_000
"""Number of a CRS that has no code of EPSG; those of EPSG end before."""
_UNDEFINED = -1
_NO_TIME = "1970-01-01T00:00:00.000Z"
_APPLICATION, _VERSION = 0x47504B47, 10300  # "GPKG", 1.3
_WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
    'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],'
    'UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]'
)
_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
 organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
 description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
 min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
 CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
 geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
 CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name),
 CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
 CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
"""


@dataclass(frozen=True, slots=True)
class MapCrs:
    """The coordinate reference system of features.

    Parameters
    ----------
    wkt : str or None
        Its definition as WKT; None if only the code is known.
    epsg : int or None
        Its code.
    name : str
        What to call it.
    metres : float
        Length of the unit of the coordinates, metres.
    """

    wkt: str | None
    epsg: int | None
    name: str = "unknown"
    metres: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """Something on a map.

    Parameters
    ----------
    places : sequence
        Coordinates (x, y) or (x, y, z): one for a point, several for a line, a list of lines for several lines, or a
        list of rings for a polygon. All features of a layer have as many coordinates.
    values : mapping of str to str, int, float, bool or None
        Its attributes.
    """

    places: Any
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """Features of one kind.

    Parameters
    ----------
    name : str
        Of the table: letters, digits and `_`.
    kind : {"POINT", "LINESTRING", "MULTILINESTRING", "POLYGON"}
    features : sequence of Feature
    description : str
        For the reader of the map.
    """

    name: str
    kind: Kind
    features: Sequence[Feature]
    description: str = ""

    @property
    def columns(self) -> dict[str, str]:
        """The type of each attribute in SQL, in the order in which they come."""
        found: dict[str, str] = {}
        for feature in self.features:
            for name, value in feature.values.items():
                kind = _TYPES.get(type(value))
                if kind is not None and found.get(name) in {None, "", kind}:
                    found[name] = kind
                elif kind is not None:
                    found[name] = "DOUBLE" if {kind, found[name]} == {"INTEGER", "DOUBLE"} else "TEXT"
                else:
                    found.setdefault(name, "")
        return {name: kind or "TEXT" for name, kind in found.items()}

    @property
    def flat(self) -> bool:
        """Whether the places have two coordinates."""
        return all(len(place) == 2 for feature in self.features for place in _places(self.kind, feature.places))


def geopackage(layers: Sequence[Layer], crs: MapCrs | None) -> bytes:
    """Write layers as a GeoPackage; the same layers give the same bytes with the same SQLite.

    Parameters
    ----------
    layers : sequence of Layer
        Their names differ.
    crs : MapCrs or None
        Of all coordinates; None if unknown: then the map has none, and a program will ask.

    Returns
    -------
    bytes
        The file.
    """
    with tempfile.TemporaryDirectory(prefix="cylx-") as folder:
        path = Path(folder) / "map.gpkg"
        with closing(sqlite3.connect(path)) as base, base:
            base.execute(f"PRAGMA application_id = {_APPLICATION}")
            base.execute(f"PRAGMA user_version = {_VERSION}")
            base.executescript(_TABLES)
            number = _add_crs(base, crs)
            for layer in layers:
                _add_layer(base, layer, number)
        return path.read_bytes()


def geojson(layers: Sequence[Layer], crs: MapCrs | None, place: str) -> bytes:
    """Write layers as GeoJSON (RFC 7946): in degrees of WGS 84, heights in metres as they are in the scan.

    Parameters
    ----------
    layers : sequence of Layer
        All features are in one collection; `layer` says which is from which if there are several.
    crs : MapCrs or None
        Of all coordinates.
    place : str
        Name of the output in an error.

    Raises
    ------
    OutputError
        If the CRS is unknown, or cannot be converted to degrees.
    UsageError
        If pyproj is not installed.
    """
    every = [(layer, feature) for layer in layers for feature in layer.features]
    points = [list(map(float, p)) for layer, feature in every for p in _places(layer.kind, feature.places)]
    if crs is None:
        remedy = "give the CRS by --crs EPSG:NUMBER, or write .gpkg"
        raise OutputError(place, "GeoJSON is in degrees of WGS 84, and the scan says no CRS", remedy)
    turned = iter(to_degrees(points, crs.wkt, crs.epsg, crs.metres, place))
    features = []
    for layer, feature in every:
        named = {"layer": layer.name} if len(layers) > 1 else {}
        properties = named | {name: _plain(value) for name, value in feature.values.items()}
        shape = {"type": _JSON[layer.kind], "coordinates": _same(layer.kind, feature.places, turned)}
        features.append({"type": "Feature", "geometry": shape, "properties": properties})
    text = json.dumps({"type": "FeatureCollection", "features": features}, indent=1, ensure_ascii=False)
    return visible(text, keep="\n").encode() + b"\n"


def _add_crs(base: sqlite3.Connection, crs: MapCrs | None) -> int:
    """Write the reference systems that a GeoPackage must have, and that of the features; return its number."""
    rows = [
        ("Undefined Cartesian SRS", _UNDEFINED, "NONE", _UNDEFINED, "undefined", "unknown, with lengths"),
        ("Undefined geographic SRS", 0, "NONE", 0, "undefined", "unknown, in degrees"),
        ("WGS 84 geodetic", 4326, "EPSG", 4326, _WGS84, "longitude and latitude in degrees"),
    ]
    number = _UNDEFINED
    if crs is not None:
        number = crs.epsg or _OWN_CRS
        wkt = wkt_for_maps(crs.wkt, crs.epsg) or "undefined"
        if number != 4326:
            rows.append((visible(crs.name), number, "EPSG" if crs.epsg else "NONE", number, wkt, ""))
    base.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?,?,?,?,?,?)", rows)
    return number


def _add_layer(base: sqlite3.Connection, layer: Layer, number: int) -> None:
    """Write a table of features, and what the tables of the standard say of it."""
    columns, table, flat = layer.columns, _quoted(layer.name), layer.flat
    taken = {"fid", "geom"}
    names = [name if name.lower() not in taken else f"{name}_" for name in columns]
    said = "".join(f", {_quoted(name)} {kind}" for name, kind in zip(names, columns.values(), strict=True))
    base.execute(f"CREATE TABLE {table} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom {layer.kind}{said})")
    points = [p for feature in layer.features for p in _places(layer.kind, feature.places)]
    box = (None,) * 4 if not points else (*_least(points), *_most(points))
    about = (layer.name, "features", layer.name, visible(layer.description), _NO_TIME, *box, number)
    base.execute("INSERT INTO gpkg_contents VALUES (?,?,?,?,?,?,?,?,?,?)", about)
    kind = (layer.name, "geom", layer.kind, number, int(not flat), 0)
    base.execute("INSERT INTO gpkg_geometry_columns VALUES (?,?,?,?,?,?)", kind)
    marks = ",".join("?" * (len(columns) + 1))
    named = ", ".join(["geom", *map(_quoted, names)])
    rows = (
        (_blob(layer.kind, feature.places, number, flat), *(_plain(feature.values.get(name)) for name in columns))
        for feature in layer.features
    )
    base.executemany(f"INSERT INTO {table} ({named}) VALUES ({marks})", rows)


def _quoted(name: str) -> str:
    """Return the name of a table or a column as SQL has it."""
    return '"' + visible(name).replace('"', '""') + '"'


def _plain(value: Any) -> Any:  # noqa: ANN401  whatever a table holds
    """Return the value of an attribute: None for numbers that are not finite."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return visible(value) if isinstance(value, str) else value


def _least(points: Sequence[Place]) -> tuple[float, float]:
    return min(float(p[0]) for p in points), min(float(p[1]) for p in points)


def _most(points: Sequence[Place]) -> tuple[float, float]:
    return max(float(p[0]) for p in points), max(float(p[1]) for p in points)


def _lines(kind: Kind, places: Any) -> list[list[Place]]:  # noqa: ANN401  by the kind
    """Return the places of a feature as a list of lines."""
    if kind == "POINT":
        return [[places]]
    return [list(places)] if kind == "LINESTRING" else [list(line) for line in places]


def _places(kind: Kind, places: Any) -> Iterable[Place]:  # noqa: ANN401  by the kind
    return (place for line in _lines(kind, places) for place in line)


def _same(kind: Kind, places: Any, turned: Iterator[list[float]]) -> Any:  # noqa: ANN401  by the kind
    """Return places in the same lists, each the next of those that were turned."""
    lines = [[next(turned) for _ in line] for line in _lines(kind, places)]
    if kind == "POINT":
        return lines[0][0]
    return lines[0] if kind == "LINESTRING" else lines


def _blob(kind: Kind, places: Any, number: int, flat: bool) -> bytes:  # noqa: ANN401  by the kind
    """Return a geometry as a GeoPackage has it: a header with the bounds, and the WKB of ISO."""
    lines = _lines(kind, places)
    points = [place for line in lines for place in line]
    size = 2 if flat else 3
    sides = [side for d in range(size) for side in (min(p[d] for p in points), max(p[d] for p in points))]
    envelope = 1 if flat else 2
    head = struct.pack(f"<2sBBi{len(sides)}d", b"GP", 0, envelope << 1 | 1, number, *map(float, sides))
    shift = 0 if flat else 1000
    bodies = [b"".join(struct.pack(f"<{size}d", *map(float, place)) for place in line) for line in lines]
    counted = [struct.pack("<I", len(line)) + body for line, body in zip(lines, bodies, strict=True)]
    begin = struct.pack("<BI", 1, _CODES[kind] + shift)
    if kind == "POINT":
        return head + begin + bodies[0]
    if kind == "LINESTRING":
        return head + begin + counted[0]
    inner = struct.pack("<BI", 1, _CODES["LINESTRING"] + shift) if kind == "MULTILINESTRING" else b""
    return head + begin + struct.pack("<I", len(lines)) + b"".join(inner + one for one in counted)
