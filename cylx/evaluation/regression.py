"""Compare two results within tolerances, for regression tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np

from cylx.evaluation.differences import Difference, Kind, List, Tolerances
from cylx.evaluation.matching import (
    CylinderTable,
    PairErrors,
    match_one_to_one,
    pair_errors,
    read_cylinders,
    require_usable,
)
from cylx.evaluation.piping_changes import PipingChanges, compare_piping
from cylx.geometry.arrays import FloatArray

_DEFAULT = Tolerances()
_SAME_ANGLE_DEG = 5.0  # within these limits two cylinders count as the same, with different parameters
_SAME_OFFSET = 0.25
_SAME_RADIUS = 0.15


@dataclass(frozen=True, slots=True)
class Comparison:
    """The common cylinders and the differences of two results.

    Parameters
    ----------
    cylinders_a, cylinders_b, matched : int
        Number of cylinders in a, in b, and in both.
    differences : tuple of Difference
        Those of the cylinders and then those of the blends, in the order of a, with those only in b last; empty if the
        results are the same.
    blends_a, blends_b, blends_matched : int
        Number of blends in a, in b, and in both.
    piping : PipingChanges or None
        Numbers of fittings and runs; None if neither result has any.
    """

    cylinders_a: int
    cylinders_b: int
    matched: int
    differences: tuple[Difference, ...]
    blends_a: int = 0
    blends_b: int = 0
    blends_matched: int = 0
    piping: PipingChanges | None = None

    @property
    def same(self) -> bool:
        """Whether no difference exceeds its tolerance."""
        return not self.differences

    def to_dict(self) -> dict[str, object]:
        """Return everything as a JSON object."""
        return {
            "same": self.same,
            "cylinders_a": self.cylinders_a,
            "cylinders_b": self.cylinders_b,
            "matched": self.matched,
            "blends_a": self.blends_a,
            "blends_b": self.blends_b,
            "blends_matched": self.blends_matched,
            **({} if self.piping is None or self.piping.counts is None else self.piping.counts),
            "differences": [asdict(difference) for difference in self.differences],
        }


def compare(a: Mapping[str, object], b: Mapping[str, object], *, tolerances: Tolerances = _DEFAULT) -> Comparison:
    """Compare the cylinders of two results, in any order, and so their blends.

    A result without a list of blends counts as one without blends. If one of the results has fittings and runs, these
    are compared, too: fittings of one kind at one place, and whether the same cylinders are joined.

    Heights and inliers are compared if both results have them. A difference equal to its tolerance is allowed.

    Parameters
    ----------
    a, b : mapping
        JSON objects with a list `cylinders`, and perhaps a list `blends`.
    tolerances : Tolerances
        The allowed differences.

    Raises
    ------
    InputError
        If either is malformed, or a cylinder is not finite.
    """
    found = _compare_lists(a, b, "cylinders", tolerances)
    blends = _compare_lists(a, b, "blends", tolerances)
    piping = compare_piping(a, b, found.same, tolerances)
    differences = (*found.differences, *blends.differences, *piping.differences)
    return Comparison(*found.counts, differences, *blends.counts, piping)


class _Compared(NamedTuple):
    """The numbers of entries in a, in b and in both, the differences, and ids in b by those in a."""

    counts: tuple[int, int, int]
    differences: list[Difference]
    same: dict[int, int]


def _compare_lists(a: Mapping[str, object], b: Mapping[str, object], of: List, tolerances: Tolerances) -> _Compared:
    """Compare one list of two results."""
    left, right = read_cylinders(a, "a", of), read_cylinders(b, "b", of)
    require_usable(left, "a", of)
    require_usable(right, "b", of)
    name = of.removesuffix("s")
    errors = _mutual_errors(left, right)
    pairs = _same_cylinders(left, right, errors, tolerances)
    differences: list[Difference] = []
    for i, id_a in enumerate(left.ids):
        if i in pairs:
            differences += _differences(left, right, (i, pairs[i]), errors, tolerances)
        else:
            lost = float(left.radii[i])
            differences.append(Difference(kind="missing", id_a=id_a, id_b=None, what=name, a=lost))
    for j in sorted(set(range(len(right))) - set(pairs.values())):
        new = float(right.radii[j])
        differences.append(Difference(kind="extra", id_a=None, id_b=right.ids[j], what=name, b=new))
    same = {left.ids[i]: right.ids[j] for i, j in pairs.items()}
    return _Compared((len(left), len(right), len(pairs)), [replace(one, of=of) for one in differences], same)


def _mutual_errors(left: CylinderTable, right: CylinderTable) -> PairErrors:
    """Compute the errors of all pairs in both directions and take the larger; shifts are relative to the longer one."""
    forth, back = pair_errors(left, right), pair_errors(right, left)
    known = np.isfinite(left.heights)[:, None] & np.isfinite(right.heights)
    shift = np.maximum(forth.shift, back.shift.T) / np.maximum(_lengths(left)[:, None], _lengths(right))
    return PairErrors(
        angle_deg=forth.angle_deg,
        offset=np.maximum(forth.offset, back.offset.T),
        radius=np.maximum(forth.radius, back.radius.T),
        shift=np.where(known, shift, 0.0),
    )


def _same_cylinders(
    left: CylinderTable, right: CylinderTable, errors: PairErrors, tolerances: Tolerances
) -> dict[int, int]:
    """Return the position in b for positions in a: cylinders about the same axis and radius, side by side along it."""
    lengths = _lengths(left)[:, None], _lengths(right)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        beside = 0.5 * (1 + np.minimum(*lengths) / np.maximum(*lengths))
    limited = (
        (errors.angle_deg, max(_SAME_ANGLE_DEG, tolerances.angle_deg)),
        (errors.offset, max(_SAME_OFFSET, tolerances.offset)),
        (errors.radius, max(_SAME_RADIUS, tolerances.radius)),
        (errors.shift, np.maximum(beside, tolerances.height)),
    )
    admissible = np.all([error <= limit for error, limit in limited], axis=0)
    rows, columns = match_one_to_one(np.sum([error / limit for error, limit in limited], axis=0), admissible)
    return dict(zip(rows.tolist(), columns.tolist(), strict=True))


def _differences(
    left: CylinderTable, right: CylinderTable, pair: tuple[int, int], errors: PairErrors, tolerances: Tolerances
) -> Iterator[Difference]:
    """Yield the differences of a pair of cylinders that exceed their tolerances."""
    i, j = pair
    heights, inliers = (left.heights[i], right.heights[j]), (left.inliers[i], right.inliers[j])
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        height = abs(heights[0] - heights[1]) / max(_lengths(left)[i], _lengths(right)[j])
    count = abs(inliers[0] - inliers[1]) / max(*inliers, 1.0)
    measured: tuple[tuple[Kind, str, tuple[float, float] | None, float, float], ...] = (
        ("moved", "angle_deg", None, errors.angle_deg[pair], tolerances.angle_deg),
        ("moved", "offset", None, errors.offset[pair], tolerances.offset),
        ("moved", "shift", None, errors.shift[pair], tolerances.height),
        ("resized", "radius", (left.radii[i], right.radii[j]), errors.radius[pair], tolerances.radius),
        ("resized", "height", heights, height, tolerances.height),
        ("recounted", "inliers", inliers, count, tolerances.inliers),
    )
    for kind, what, values, difference, tolerance in measured:
        if difference > tolerance:  # false if one of the two values is unknown
            yield Difference(
                kind=kind,
                id_a=left.ids[i],
                id_b=right.ids[j],
                what=what,
                a=None if values is None else float(values[0]),
                b=None if values is None else float(values[1]),
                difference=float(difference),
                tolerance=tolerance,
            )


def _lengths(table: CylinderTable) -> FloatArray:
    """Return height plus radius, the unit of differences along the axis."""
    return np.asarray(np.nan_to_num(table.heights) + table.radii)
