"""Read E57 by pye57: the points of all scans, moved by the poses of their scanners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.e57_xml import check_xml
from cylx.io.names import mended_names
from cylx.optional.extras import require

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from cylx.io.inputs import Input

    Allocate = Callable[[int, np.dtype[np.void]], NDArray[np.void]]

_CHUNK = 1 << 19  # points read at a time, at the most, ...
_BUFFER = 1 << 26  # ... and bytes
_MOST_EQUAL = 1 << 16  # points that may all be the same
_INFINITE = np.finfo(float).max  # what libE57 makes of 1e999
_MOST_SCANS = 1 << 16
_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_INVALID = ("cartesianInvalidState", "sphericalInvalidState")
_NAMES = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
_BUFFERS = ("i1", "u1", "i2", "u2", "f4", "f8")  # types that libE57 fills; other integers are read as int64
_REMEDY = "get a complete copy of the file"


@dataclass(frozen=True, slots=True)
class _Scan:
    """A scan of a file.

    Parameters
    ----------
    points : object
        The points, an object of pye57; None if there are none.
    count : int
        Number of points.
    fields : dict of str to dtype
        Type of each field.
    bits : int
        Bits that each point takes in the file, at the least.
    rotation : ndarray of shape (3, 3)
    translation : ndarray of shape (3,)
        Pose of the scanner.
    """

    points: Any
    count: int
    fields: dict[str, np.dtype[Any]]
    bits: int
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    @property
    def kept(self) -> dict[str, np.dtype[Any]]:
        """The fields that become properties of the points."""
        return {n: kind for n, kind in self.fields.items() if n not in (*_CARTESIAN, *_SPHERICAL, *_INVALID)}


_EMPTY = _Scan(None, 0, {}, 0, np.eye(3), np.zeros(3))


def read_e57(
    source: Input,
    scan: int | None = None,
    *,
    allocate: Allocate = np.empty,
) -> NDArray[np.void]:
    """Read the points of an E57 file, scan by scan.

    Parameters
    ----------
    source : Input
        A file with a name.
    scan : int, optional
        The only scan to read, from 0; by default all.
    allocate : callable
        Makes the table of a number of points and a type.

    Returns
    -------
    ndarray of shape (points,), structured
        `x`, `y`, `z` in float64, in the coordinates of the file, NaN where the file marks them as invalid; `scan`, the
        number of the scan; and all other numeric fields, 0 or NaN in scans that lack them.

    Raises
    ------
    InputError
        If this is not E57, is damaged, has no points, lacks the scan, or pye57 is not installed.
    """
    if source.head(8) != b"ASTM-E57":
        raise InputError(source.place, "is not E57: it does not begin with ASTM-E57", "give it its right suffix")
    check_xml(source)
    require("pye57", place=source.place, needed_by="", error=InputError)
    from pye57 import libe57  # noqa: PLC0415  an extra

    try:
        image = libe57.ImageFile(str(source.path), "r")
        try:
            return _read(image, source, scan, allocate)
        finally:
            image.close()
    except (InputError, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001  what pye57 raises depends on what it finds in the file
        fault = " ".join(str(error).partition("\n")[0].split())[:200] or type(error).__name__
        raise InputError(source.place, f"broken E57: {fault}", _REMEDY) from None


def _read(
    image: Any,  # noqa: ANN401  (of pye57)
    source: Input,
    scan: int | None,
    allocate: Allocate,
) -> NDArray[np.void]:
    place = source.place
    root = image.root()
    count = len(root["data3D"]) if root.isDefined("data3D") else 0
    if scan is not None and scan >= count:
        held = f"has {count} scans, from 0 to {count - 1}" if count > 1 else f"has {count or 'no'} scan"
        raise InputError(place, f"{held}, and none of number {scan}", "choose another, or leave --scan out")
    if count > _MOST_SCANS:
        raise InputError(place, f"has {count} scans", f"give a file of at most {_MOST_SCANS}")
    numbers = range(count) if scan is None else [scan]
    scans = [_describe(root["data3D"][number], number, place) for number in numbers]
    total = sum(one.count for one in scans)
    if total == 0:
        raise InputError(place, "holds no points", "give a file with points")
    _check_counts(scans, source)
    kept: dict[str, np.dtype[Any]] = {}
    for one in scans:
        for name, kind in one.kept.items():
            kept[name] = np.promote_types(kept.get(name, kind), kind)
    names = mended_names(["x", "y", "z", "scan", *(_NAMES.get(name, name) for name in kept)])
    kinds = [*(["f8"] * 3), "u2", *kept.values()]
    table = allocate(total, np.dtype(list(zip(names, kinds, strict=True))))
    columns = dict(zip(kept, names[4:], strict=True))
    done = 0
    for number, one in zip(numbers, scans, strict=True):
        part = table[done : done + one.count]
        part["scan"] = number
        _fill(image, one, part, columns, place)
        done += one.count
    return table


def _describe(node: Any, number: int, place: str) -> _Scan:  # noqa: ANN401  (of pye57)
    from pye57 import libe57  # noqa: PLC0415  an extra

    points = node["points"] if node.isDefined("points") else None
    if points is None or points.childCount() == 0:
        return _EMPTY
    prototype = libe57.StructureNode(points.prototype())
    names = [prototype.get(index).elementName() for index in range(prototype.childCount())]
    every = {name: prototype[name] for name in names}
    fields = {name: kind for name, field in every.items() if (kind := _type(field)) is not None}
    if not any(fields.keys() >= set(names) for names in (_CARTESIAN, _SPHERICAL)):
        raise InputError(place, f"scan {number} has no coordinates", "export the file again")
    return _Scan(points, points.childCount(), fields, sum(map(_bits, every.values())), *_pose(node, number, place))


def _check_counts(scans: list[_Scan], source: Input) -> None:
    """Refuse more points than the file can hold: fields that are constant take no place in it."""
    held = sum(one.count * one.bits for one in scans) // 8
    equal = sum(one.count for one in scans if one.bits == 0)
    if held > source.size or equal > _MOST_EQUAL:
        total = sum(one.count for one in scans)
        fault = f"promises {total} points, more than a file of {source.size} bytes can hold"
        raise InputError(source.place, fault, _REMEDY)


def _pose(node: Any, number: int, place: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # noqa: ANN401  pye57 has no types
    """Return rotation (3, 3) and translation (3,) of a scan; read by name, as the order in the file is not fixed."""
    rotation, translation = np.eye(3), np.zeros(3)
    try:
        pose = node["pose"] if node.isDefined("pose") else None
        if pose is not None and pose.isDefined("translation"):
            translation = np.array([_number(pose["translation"][axis]) for axis in "xyz"])
        if pose is not None and pose.isDefined("rotation"):
            rotation = _rotation(np.array([_number(pose["rotation"][part]) for part in "wxyz"]))
    except Exception:  # noqa: BLE001  nodes of other types fail in ways of their own
        raise InputError(place, f"broken E57: scan {number} has a pose that is none", _REMEDY) from None
    if not (np.abs(translation) < _INFINITE).all() or not np.isfinite(rotation).all():
        raise InputError(place, f"broken E57: scan {number} has a pose that is not finite", _REMEDY)
    return rotation, translation


def _rotation(whole: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix of a quaternion of any length; 0 0 0 0, as some programs write it, turns nothing."""
    largest = np.abs(whole).max()
    if largest == 0:
        return np.eye(3)
    with np.errstate(invalid="ignore"):
        whole = whole / largest
        w, x, y, z = whole / np.linalg.norm(whole)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _number(node: Any) -> float:  # noqa: ANN401  (of pye57)
    """Return the value of a node that is a number."""
    from pye57 import libe57  # noqa: PLC0415  an extra

    if isinstance(node, libe57.ScaledIntegerNode):
        return float(node.scaledValue())
    if not isinstance(node, libe57.FloatNode | libe57.IntegerNode):
        raise TypeError("no number")
    return float(node.value())


def _bits(node: Any) -> int:  # noqa: ANN401  (of pye57)
    """Return the number of bits that a field takes for each point, at the least."""
    from pye57 import libe57  # noqa: PLC0415  an extra

    if isinstance(node, libe57.FloatNode):
        return 32 if node.precision() == libe57.E57_SINGLE else 64
    if isinstance(node, libe57.ScaledIntegerNode | libe57.IntegerNode):
        return int(node.maximum() - node.minimum()).bit_length()
    return 8


def _type(node: Any) -> np.dtype[Any] | None:  # noqa: ANN401  (of pye57)
    """Return the smallest type that holds all values of a field; None if it is not numeric."""
    from pye57 import libe57  # noqa: PLC0415  an extra

    if isinstance(node, libe57.FloatNode):
        return np.dtype("f4" if node.precision() == libe57.E57_SINGLE else "f8")
    if isinstance(node, libe57.ScaledIntegerNode):
        return np.dtype("f8")
    if isinstance(node, libe57.IntegerNode):
        low, high = node.minimum(), node.maximum()
        kinds = ("u1", "u2", "u4", "i8") if low >= 0 else ("i1", "i2", "i4", "i8")
        return next(np.dtype(k) for k in kinds if np.iinfo(k).min <= low and high <= np.iinfo(k).max)
    return None


def _fill(
    image: Any,  # noqa: ANN401  (of pye57)
    scan: _Scan,
    table: NDArray[np.void],
    columns: dict[str, str],
    place: str,
) -> None:
    """Read the points of a scan into its part of the table."""
    from pye57 import libe57  # noqa: PLC0415  an extra

    for name, column in columns.items():
        if name not in scan.fields:
            table[column] = np.nan if table.dtype[column].kind == "f" else 0
    if scan.count == 0:
        return
    capacity = min(_CHUNK, scan.count, max(_BUFFER // (8 * len(scan.fields)), 1))
    buffers, values = libe57.VectorSourceDestBuffer(), {}
    for name, kind in scan.fields.items():
        exact = name in (*_CARTESIAN, *_SPHERICAL)
        buffer = np.empty(capacity, "f8" if exact else kind if kind.str[1:] in _BUFFERS else "i8")
        values[name] = buffer
        buffers.append(libe57.SourceDestBuffer(image, name, buffer, capacity, True, True))
    reader = scan.points.reader(buffers)
    done = 0
    try:
        while done < scan.count and (count := reader.read()):
            part = table[done : done + count]
            done += count
            read = {name: buffer[:count] for name, buffer in values.items()}
            points = _coordinates(read) @ scan.rotation.T + scan.translation
            for axis, coordinates in zip("xyz", points.T, strict=True):
                part[axis] = coordinates
            for name in scan.kept:
                part[columns[name]] = read[name]
    finally:
        reader.close()
    if done < scan.count:
        fault = f"a scan promises {scan.count} points, the file holds {done}"
        raise InputError(place, fault, _REMEDY)


def _coordinates(read: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Return the coordinates in the frame of the scanner, (n, 3); NaN where they are invalid."""
    if read.keys() >= set(_CARTESIAN):
        points = np.column_stack([read[name] for name in _CARTESIAN])
        invalid = read.get(_INVALID[0])
    else:
        reach, azimuth, elevation = (read[name] for name in _SPHERICAL)
        level = reach * np.cos(elevation)
        points = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), reach * np.sin(elevation)])
        invalid = read.get(_INVALID[1])
    if invalid is not None:
        points[invalid != 0] = np.nan
    return points
