"""Read cylinders from JSON objects, compute the errors of all pairs, and find the best one-to-one matching."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.errors import InputError
from cylx.geometry.arrays import FloatArray, MaskArray

IndexArray = NDArray[np.intp]

_NO_MATCH = 1e6  # far above the cost of any admissible pair


@dataclass(frozen=True, slots=True, eq=False)
class CylinderTable:
    """The cylinders of a JSON object, as arrays.

    Parameters
    ----------
    ids : tuple of int
        As given, or the position in the list.
    points, directions : ndarray of shape (N, 3)
        Axis; the directions are of unit length, NaN if they were not finite or zero.
    radii, heights, inliers : ndarray of shape (N,)
        Scene units; NaN where unknown.
    ignore : ndarray of shape (N,), bool
        Cylinders that need not be found.
    """

    ids: tuple[int, ...]
    points: FloatArray
    directions: FloatArray
    radii: FloatArray
    heights: FloatArray
    inliers: FloatArray
    ignore: MaskArray

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def usable(self) -> MaskArray:
        """Which of them have a finite axis and radius; shape (N,)."""
        finite = np.isfinite(self.points).all(axis=1) & np.isfinite(self.directions).all(axis=1)
        return np.asarray(finite & np.isfinite(self.radii))

    def subset(self, chosen: MaskArray) -> CylinderTable:
        """Return the chosen cylinders."""
        ids = tuple(id_ for id_, wanted in zip(self.ids, chosen, strict=True) if wanted)
        return CylinderTable(
            ids=ids,
            points=self.points[chosen],
            directions=self.directions[chosen],
            radii=self.radii[chosen],
            heights=self.heights[chosen],
            inliers=self.inliers[chosen],
            ignore=self.ignore[chosen],
        )


@dataclass(frozen=True, slots=True, eq=False)
class PairErrors:
    """The errors of each cylinder b relative to each cylinder a.

    Parameters
    ----------
    angle_deg : ndarray of shape (A, B)
        Angle between the axes, degrees, in [0, 90].
    offset : ndarray of shape (A, B)
        Distance of a's point from b's axis line, in radii of a.
    radius : ndarray of shape (A, B)
        Difference of the radii, relative to a's.
    shift : ndarray of shape (A, B)
        Distance of the two points along a's axis, scene units.
    """

    angle_deg: FloatArray
    offset: FloatArray
    radius: FloatArray
    shift: FloatArray


def read_cylinders(document: Mapping[str, object], place: str, key: str = "cylinders") -> CylinderTable:
    """Read the cylinders of a JSON object.

    Parameters
    ----------
    document : mapping
        With a list of objects.
    place : str
        Name of the document in errors.
    key : str
        Key of the list; only `cylinders` must be there.

    Raises
    ------
    InputError
        If a key is missing or has a value of the wrong kind; the place is dotted, as in `truth.cylinders[3].radius`.
    """
    entries = document.get(key, None if key == "cylinders" else ()) if isinstance(document, Mapping) else None
    if not isinstance(entries, list | tuple):
        raise InputError(place, f"has no list '{key}'", "give a result of 'cylx extract', or a truth in its form")
    n = len(entries)
    vectors, numbers, ids = np.full((2, n, 3), np.nan), np.full((3, n), np.nan), []
    ignore = np.zeros(n, dtype=bool)
    for i, entry in enumerate(entries):
        here = f"{place}.{key}[{i}]"
        if not isinstance(entry, Mapping):
            raise InputError(here, "is not an object", "give each cylinder as an object with its keys")
        vectors[0, i] = read_vector(entry, "axis_point", here)
        vectors[1, i] = read_vector(entry, "axis_direction", here)
        numbers[0, i] = read_number(entry.get("radius"), f"{here}.radius")
        for row, name in ((1, "height"), (2, "inliers")):
            if entry.get(name) is not None:
                numbers[row, i] = read_number(entry[name], f"{here}.{name}")
        ids.append(read_id(entry.get("id", i), f"{here}.id"))
        ignore[i] = bool(entry.get("ignore", False))
    with np.errstate(over="ignore", invalid="ignore"):  # a direction that is too long is unusable
        lengths = np.linalg.norm(vectors[1], axis=1, keepdims=True)
    directions = np.divide(vectors[1], lengths, out=np.full((n, 3), np.nan), where=np.isfinite(lengths) & (lengths > 0))
    return CylinderTable(tuple(ids), vectors[0], directions, numbers[0], numbers[1], numbers[2], ignore)


def require_usable(table: CylinderTable, place: str, key: str = "cylinders") -> None:
    """Raise an InputError unless all cylinders have a finite axis and a radius > 0."""
    bad = ~(table.usable & (table.radii > 0))
    if bad.any():
        here = f"{place}.{key}[{int(bad.argmax())}]"
        raise InputError(here, "has no finite axis or no radius > 0", "correct its numbers, or leave it out")


def pair_errors(a: CylinderTable, b: CylinderTable) -> PairErrors:
    """Compute the errors of all pairs, row by row, which keeps the precision far from the origin and saves memory."""
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # numbers near the largest: what is infinitely far matches nothing
        return _pair_errors(a, b)


def _pair_errors(a: CylinderTable, b: CylinderTable) -> PairErrors:
    angle, offset, shift = np.empty((3, len(a), len(b)))
    for i in range(len(a)):
        sine = np.linalg.norm(np.cross(a.directions[i], b.directions), axis=1)
        angle[i] = np.degrees(np.arctan2(sine, np.abs(b.directions @ a.directions[i])))
        between = a.points[i] - b.points
        along = np.einsum("ij,ij->i", between, b.directions)
        offset[i] = np.linalg.norm(between - along[:, None] * b.directions, axis=1) / a.radii[i]
        shift[i] = np.abs(between @ a.directions[i])
    return PairErrors(angle, offset, np.abs(b.radii - a.radii[:, None]) / a.radii[:, None], shift)


def match_one_to_one(cost: FloatArray, admissible: MaskArray) -> tuple[IndexArray, IndexArray]:
    """Find the largest number of admissible pairs, at the least total cost.

    Parameters
    ----------
    cost : ndarray of shape (A, B)
        Of order one for admissible pairs.
    admissible : ndarray of shape (A, B), bool

    Returns
    -------
    rows, columns : ndarray of shape (matched,)
        Ascending in the rows.
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - a slow import

    rows, columns = linear_sum_assignment(np.where(admissible, cost, _NO_MATCH))
    kept = admissible[rows, columns]
    return rows[kept], columns[kept]


def read_vector(entry: Mapping[str, object], key: str, here: str) -> list[float]:
    """Return the three numbers of a key; an InputError names the place."""
    value = entry.get(key)
    if not isinstance(value, list | tuple) or len(value) != 3:
        fault = "is missing" if key not in entry else "is not a list of three numbers"
        raise InputError(f"{here}.{key}", fault, "give three numbers")
    return [read_number(component, f"{here}.{key}[{i}]") for i, component in enumerate(value)]


def read_number(value: object, place: str) -> float:
    """Return a number, infinite if it is too large for one; an InputError names the place."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(place, "is missing" if value is None else f"is not a number: {value!r}", "give a number")
    return float(value) if abs(value) < 1e300 or not isinstance(value, int) else math.inf


def read_id(value: object, place: str) -> int:
    """Return a whole number; an InputError names the place."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(place, f"is not a whole number: {value!r}", "give a whole number, or leave it out")
    return value
