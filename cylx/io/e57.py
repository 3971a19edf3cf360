"""Read E57 by pye57: the points of all scans, moved by the poses of their scanners."""

from __future__ import annotations

import shutil
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.names import mended_names
from cylx.optional.extras import require

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from cylx.io.inputs import Input

_CHUNK = 1 << 19  # points read at a time
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
        The points, an object of pye57.
    count : int
        Number of points.
    fields : dict of str to dtype
        Type of each field.
    rotation : ndarray of shape (3, 3)
    translation : ndarray of shape (3,)
        Pose of the scanner.
    """

    points: Any
    count: int
    fields: dict[str, np.dtype[Any]]
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    @property
    def kept(self) -> dict[str, np.dtype[Any]]:
        """The fields that become properties of the points."""
        return {n: kind for n, kind in self.fields.items() if n not in (*_CARTESIAN, *_SPHERICAL, *_INVALID)}


def read_e57(source: Input, scan: int | None = None) -> NDArray[np.void]:
    """Read the points of an E57 file, scan by scan.

    Parameters
    ----------
    source : Input
    scan : int, optional
        The only scan to read, from 0; by default all.

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
    require("pye57", place=source.place, needed_by="", error=InputError)
    from pye57 import E57, libe57  # noqa: PLC0415  an extra

    try:
        with _named(source) as path, E57(str(path)) as file:
            return _read(file, source.place, scan)
    except (libe57.E57Exception, ValueError, OverflowError) as error:
        fault = str(error).partition("\n")[0].strip()
        raise InputError(source.place, f"broken E57: {fault}", _REMEDY) from None


@contextmanager
def _named(source: Input) -> Iterator[Path]:
    """Yield a file name for libE57; an input without a name is copied to a temporary file."""
    if source.path is not None:
        yield source.path
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.e57"
        source.file.seek(0)
        with path.open("wb") as copy:
            shutil.copyfileobj(source.file, copy)
        yield path


def _read(file: Any, place: str, scan: int | None) -> NDArray[np.void]:  # noqa: ANN401  (of pye57)
    count = file.scan_count
    if scan is not None and scan >= count:
        held = f"has {count} scans, from 0 to {count - 1}" if count > 1 else f"has {count or 'no'} scan"
        raise InputError(place, f"{held}, and none of number {scan}", "choose another, or leave --scan out")
    if count > _MOST_SCANS:
        raise InputError(place, f"has {count} scans", f"give a file of at most {_MOST_SCANS}")
    numbers = range(count) if scan is None else [scan]
    scans = [_describe(file, number, place) for number in numbers]
    total = sum(one.count for one in scans)
    if total == 0:
        raise InputError(place, "holds no points", "give a file with points")
    kept: dict[str, np.dtype[Any]] = {}
    for one in scans:
        for name, kind in one.kept.items():
            kept[name] = np.promote_types(kept.get(name, kind), kind)
    names = mended_names(["x", "y", "z", "scan", *(_NAMES.get(name, name) for name in kept)])
    kinds = [*(["f8"] * 3), "u2", *kept.values()]
    table = np.empty(total, np.dtype(list(zip(names, kinds, strict=True))))
    columns = dict(zip(kept, names[4:], strict=True))
    done = 0
    for number, one in zip(numbers, scans, strict=True):
        part = table[done : done + one.count]
        part["scan"] = number
        _fill(file, one, part, columns, place)
        done += one.count
    return table


def _describe(file: Any, number: int, place: str) -> _Scan:  # noqa: ANN401  (of pye57)
    from pye57 import libe57  # noqa: PLC0415  an extra

    header = file.get_header(number)
    prototype = libe57.StructureNode(header.points.prototype())
    fields = {name: kind for name in header.point_fields if (kind := _type(prototype[name])) is not None}
    if not any(fields.keys() >= set(names) for names in (_CARTESIAN, _SPHERICAL)):
        raise InputError(place, f"scan {number} has no coordinates", "export the file again")
    return _Scan(header.points, header.point_count, fields, *_pose(header.node))


def _pose(node: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # noqa: ANN401  (of pye57)
    """Return rotation (3, 3) and translation (3,) of a scan; read by name, as the order in the file is not fixed."""
    rotation, translation = np.eye(3), np.zeros(3)
    if not node.isDefined("pose"):
        return rotation, translation
    pose = node["pose"]
    if pose.isDefined("translation"):
        translation = np.array([pose["translation"][axis].value() for axis in "xyz"], dtype=np.float64)
    if pose.isDefined("rotation"):
        whole = np.array([pose["rotation"][part].value() for part in "wxyz"], dtype=np.float64)
        length = np.linalg.norm(whole)
        if not (0 < length < np.inf):
            raise ValueError("the rotation of a pose is invalid")
        w, x, y, z = whole / length
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
    return rotation, translation


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
    file: Any,  # noqa: ANN401  (of pye57)
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
    capacity = min(_CHUNK, scan.count)
    buffers, values = libe57.VectorSourceDestBuffer(), {}
    for name, kind in scan.fields.items():
        exact = name in (*_CARTESIAN, *_SPHERICAL)
        buffer = np.empty(capacity, "f8" if exact else kind if kind.str[1:] in _BUFFERS else "i8")
        values[name] = buffer
        buffers.append(libe57.SourceDestBuffer(file.image_file, name, buffer, capacity, True, True))
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
