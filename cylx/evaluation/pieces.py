"""True cylinders that something interrupts may be found in pieces, and true ones in line as one that goes through."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cylx.errors import InputError
from cylx.evaluation.matching import CylinderTable
from cylx.geometry.arrays import MaskArray

_MOST_OVERLAP = 0.5  # of the shorter one: two that overlap more are one piece twice
_LEAST_COVERED = 0.5  # of a true cylinder: one that is in line with it and covers less has not found it


def read_pieces(truth: Mapping[str, object], place: str) -> list[int]:
    """Return the number of pieces of each true cylinder: the length of its list `pieces`, 0 without it.

    Parameters
    ----------
    truth : mapping
        With a list `cylinders` of objects.
    place : str
        Name of the truth in errors.

    Raises
    ------
    InputError
        If `pieces` is not a list.
    """
    counts = []
    entries = truth["cylinders"]
    assert isinstance(entries, list | tuple)
    for index, entry in enumerate(entries):
        pieces = entry.get("pieces")
        if pieces is None:
            counts.append(0)
            continue
        if not isinstance(pieces, list | tuple):
            where = f"{place}.cylinders[{index}].pieces"
            raise InputError(where, "is not a list", "give a list of pairs of points, or leave it out")
        counts.append(max(1, len(pieces)))
    return counts


def further_pieces(
    known: CylinderTable, found: CylinderTable, pieces: list[int], admissible: MaskArray, matched: Mapping[int, int]
) -> dict[int, int]:
    """Return the cylinders found on another piece of a true one that is matched already.

    Parameters
    ----------
    known, found : CylinderTable
        The truth and the result.
    pieces : list of int
        Number of pieces of each true cylinder: at most so many cylinders are found on it.
    admissible : ndarray of shape (known, found), bool
        Which pairs are near enough.
    matched : mapping of int to int
        Row of `known` by row of `found`.

    Returns
    -------
    further : dict of int to int
        Row of `known` by row of `found`, for cylinders that overlap with none of the others on the same true one.
    """
    further: dict[int, int] = {}
    for j, i in matched.items():
        if pieces[i] < 2:
            continue
        taken = [_stretch(known, i, found, j)]
        others = [int(k) for k in np.flatnonzero(admissible[i]) if int(k) not in matched and int(k) not in further]
        for k in sorted(others, key=lambda k: -np.nan_to_num(found.heights[k])):
            stretch = _stretch(known, i, found, k)
            if len(taken) < pieces[i] and all(_are_apart(stretch, one) for one in taken):
                taken.append(stretch)
                further[k] = i
    return further


def passed_through(
    known: CylinderTable, found: CylinderTable, pieces: list[int], admissible: MaskArray, matched: Mapping[int, int]
) -> MaskArray:
    """Return which true cylinders with `pieces` are covered by a cylinder that matches another one in line with them.

    Such are the two branches of a cross: nobody sees whether one pipe goes through. The parameters are those of
    `further_pieces`.

    Returns
    -------
    passed : ndarray of shape (known,), bool
        Only true cylinders without a match of their own.
    """
    passed, own = np.zeros(len(known), dtype=bool), set(matched.values())
    for i in range(len(known)):
        if not pieces[i] or i in own:
            continue
        half = 0.5 * float(known.heights[i])
        for j in np.flatnonzero(admissible[i]):
            low, high = _stretch(known, i, found, int(j))
            if int(j) in matched and min(high, half) - max(low, -half) >= _LEAST_COVERED * 2 * half:
                passed[i] = True
    return passed


def in_line_on_ignored(known: CylinderTable, found: CylinderTable, admissible: MaskArray) -> MaskArray:
    """Return which found cylinders are on a true one that need not be found, and only in line with others.

    Limits of angle, offset and radius do not say where along its axis a cylinder is: behind a reducer of one step there
    is another pipe in line.

    Parameters
    ----------
    known, found : CylinderTable
        The truth and the result.
    admissible : ndarray of shape (known, found), bool
        Which pairs are near enough.

    Returns
    -------
    on_ignored : ndarray of shape (found,), bool
        Those whose middle is between the ends of an ignored true one, and of no other that is near enough.
    """
    out = np.zeros(len(found), dtype=bool)
    for j in np.flatnonzero(admissible[known.ignore].any(axis=0)):
        between = [int(i) for i in np.flatnonzero(admissible[:, j]) if _holds_middle(known, int(i), found, int(j))]
        out[j] = bool(between) and all(bool(known.ignore[i]) for i in between)
    return out


def _holds_middle(known: CylinderTable, i: int, found: CylinderTable, j: int) -> bool:
    """Return whether the middle of a found cylinder is between the ends of a true one; false if these are unknown."""
    low, high = _stretch(known, i, found, j)
    return abs(0.5 * (low + high)) <= 0.5 * float(known.heights[i])


def _stretch(known: CylinderTable, i: int, found: CylinderTable, j: int) -> tuple[float, float]:
    """Return from where to where a found cylinder reaches along a true one's axis; NaN if its height is unknown."""
    middle = float((found.points[j] - known.points[i]) @ known.directions[i])
    return middle - 0.5 * float(found.heights[j]), middle + 0.5 * float(found.heights[j])


def _are_apart(one: tuple[float, float], other: tuple[float, float]) -> bool:
    overlap = min(one[1], other[1]) - max(one[0], other[0])
    return overlap <= _MOST_OVERLAP * min(one[1] - one[0], other[1] - other[0])  # false if any of them is NaN
