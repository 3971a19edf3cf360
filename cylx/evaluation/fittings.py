"""Score fittings: match those of a result with the true ones of the same kind by place and size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cylx.errors import InputError
from cylx.evaluation.matching import CylinderTable, match_one_to_one, read_id, read_number, read_vector
from cylx.evaluation.rates import Spread, rates, spread_of
from cylx.geometry.arrays import FloatArray, MaskArray

KINDS = ("elbow", "tee", "cross", "reducer", "flange", "inline", "cap", "joint")
"""All kinds of fittings, in the order in which they are told."""
PLACE_RADII = 1.0
"""A fitting is in its place if it is nearer than so many radii of the largest cylinder that the true one joins."""
GOOD_BEND, GOOD_ANGLE_DEG = 0.05, 1.0
"""An elbow is well measured if its bend radius is off by no more than this share, and its angle by no more degrees."""
_HALF_TURN = 1e-6  # ends that are so far from opposite each other, in bend radii, do not say where the middle is
_SQUARABLE = 1e150  # numbers beyond it, or that are none, are no measures: their squares and shares overflow
_BENDS = {"elbow": ("bend_radius", "angle_deg")}
_SIZES = {"elbow": ("radius",), "reducer": ("start_radius", "end_radius")}


@dataclass(frozen=True, slots=True)
class KindScore:
    """The score of one kind of fittings.

    Parameters
    ----------
    truth, predicted, matched : int
        Number of true fittings that must be found, of fittings in the result, and of matched pairs.
    ignored : int
        Fittings of the result in the place of true ones, of whatever kind, that need not be found, or between their
        ends; they count neither as correct nor as false.
    precision, recall, f1 : float
        In [0, 1]; all 1 if there is nothing to find and nothing was found.
    missed, false : tuple of int
        `id` of true fittings without a match, and of fittings in the result that are neither matched nor ignored.
    """

    truth: int
    predicted: int
    matched: int
    ignored: int
    precision: float
    recall: float
    f1: float
    missed: tuple[int, ...]
    false: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FittingScores:
    """The score of the fittings of a result.

    Parameters
    ----------
    kinds : dict of str to KindScore
        By kind; only kinds that the truth or the result has.
    bend_radius : Spread or None
        Error of the bend radius over matched elbows, relative to the true one; None without any.
    angle_deg : Spread or None
        Error of the angle over matched elbows, degrees.
    good_elbows : float or None
        Share of the matched elbows whose bend radius is within 5 % and whose angle is within 1 degree.
    """

    kinds: dict[str, KindScore]
    bend_radius: Spread | None
    angle_deg: Spread | None
    good_elbows: float | None


@dataclass(frozen=True, slots=True, eq=False)
class _Fitting:
    """What is compared of a fitting; the place is NaN if any number is not finite, and then it matches nothing."""

    kind: str
    id: int
    place: FloatArray
    sizes: tuple[float, ...]
    scale: float
    bend: tuple[float, ...]
    ignore: bool
    half: float
    """Half the distance of its ends, 0 if it has none."""


def score_fittings(
    truth: Mapping[str, object], result: Mapping[str, object], known: CylinderTable, radius: float
) -> FittingScores | None:
    """Match the fittings of a result with the true ones, one to one, and score them by kind.

    A pair is admissible if both are of one kind, their places differ by less than the largest radius of the cylinders
    that the true one joins, and the radii of an elbow and of both ends of a reducer are within their limit. The place
    of an elbow is the middle of its centre line, that of any other fitting its `center`, or halfway between `start` and
    `end` if it has no `center`.

    Parameters
    ----------
    truth, result : mapping
        JSON objects.
    known : CylinderTable
        The true cylinders.
    radius : float
        Limit of the relative error of a radius.

    Returns
    -------
    scores : FittingScores or None
        None unless both documents list `fittings`.

    Raises
    ------
    InputError
        If a list is malformed.
    """
    if "fittings" not in truth or "fittings" not in result:
        return None
    radii = dict(zip(known.ids, known.radii.tolist(), strict=True))
    true, found = _read(truth, "truth", radii), _read(result, "result", None)
    near = _nearness(true, found)
    reach = np.array([1 + one.half / one.scale if one.ignore else 0.0 for one in true])
    at_ignored = set(np.flatnonzero((near < reach[:, None]).any(axis=0)).tolist())
    kinds, pairs = {}, []
    for kind in KINDS:
        rows = [i for i, one in enumerate(true) if one.kind == kind and not one.ignore]
        columns = [j for j, one in enumerate(found) if one.kind == kind]
        cost = near[np.ix_(rows, columns)]
        fits = _sizes_agree([true[i].sizes for i in rows], [found[j].sizes for j in columns], radius)
        matched = match_one_to_one(cost, (cost < 1) & fits)
        pairs += [(true[rows[i]], found[columns[j]]) for i, j in zip(*matched, strict=True)]
        left = set(columns) - {columns[j] for j in matched[1]}
        free = left & at_ignored
        missed = [true[i].id for k, i in enumerate(rows) if k not in set(matched[0].tolist())]
        false = [found[j].id for j in columns if j in left - free]
        if rows or columns:
            counts = (len(rows), len(columns), len(matched[0]), len(free))
            kinds[kind] = KindScore(*counts, *rates(counts[2], len(false), len(missed)), tuple(missed), tuple(false))
    return FittingScores(kinds, *_elbow_errors([pair for pair in pairs if pair[0].kind == "elbow"]))


def _nearness(true: Sequence[_Fitting], found: Sequence[_Fitting]) -> FloatArray:
    """Return the distance of the places of all pairs over the tolerance; infinite where it is not a number."""
    places = np.array([one.place for one in found]).reshape(-1, 3)
    distances = np.empty((len(true), len(found)))
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is nowhere
        for i, one in enumerate(true):
            distances[i] = np.linalg.norm(places - one.place, axis=1) / (PLACE_RADII * one.scale)
    return np.asarray(np.where(np.isfinite(distances), distances, np.inf))


def _sizes_agree(true: Sequence[tuple[float, ...]], found: Sequence[tuple[float, ...]], limit: float) -> MaskArray:
    """Return which pairs agree in all sizes, each relative to the true one; shape (true, found)."""
    if not (true and found):
        return np.zeros((len(true), len(found)), dtype=bool)
    known, own = np.array(true, dtype=np.float64), np.array(found, dtype=np.float64)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite agrees with nothing
        return np.asarray((np.abs(own - known[:, None]) < limit * known[:, None]).all(axis=2))


def _elbow_errors(
    pairs: Sequence[tuple[_Fitting, _Fitting]],
) -> tuple[Spread | None, Spread | None, float | None]:
    bends = [abs(found.bend[0] - true.bend[0]) / true.bend[0] for true, found in pairs]
    angles = [abs(found.bend[1] - true.bend[1]) for true, found in pairs]
    good = [bend <= GOOD_BEND and angle <= GOOD_ANGLE_DEG for bend, angle in zip(bends, angles, strict=True)]
    return spread_of(bends), spread_of(angles), sum(good) / len(good) if good else None


def _read(document: Mapping[str, object], place: str, radii: Mapping[int, float] | None) -> list[_Fitting]:
    """Read the fittings of a document; with `radii`, those of its cylinders by id, they are the truth."""
    entries = document["fittings"]
    if not isinstance(entries, list | tuple):
        raise InputError(f"{place}.fittings", "is not a list", "give a list of fittings, or leave it out")
    found = []
    for index, entry in enumerate(entries):
        here = f"{place}.fittings[{index}]"
        if not isinstance(entry, Mapping):
            raise InputError(here, "is not an object", "give each fitting as an object with its keys")
        found.append(_read_one(entry, index, here, radii))
    return found


def _read_one(entry: Mapping[str, object], index: int, here: str, radii: Mapping[int, float] | None) -> _Fitting:
    kind = entry.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(f"{here}.kind", f"is not a kind of fitting: {kind!r}", f"give one of {', '.join(KINDS)}")
    between = "center" not in entry and "start" in entry and "end" in entry
    places = [np.array(read_vector(entry, key, here)) for key in (("start", "end") if between else ("center",))]
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite matches nothing
        where = np.mean(places, axis=0)
    bend, sizes = (_numbers(entry, names.get(kind, ()), here) for names in (_BENDS, _SIZES))
    if kind == "elbow":
        start, end, normal = (np.array(read_vector(entry, key, here)) for key in ("start", "end", "normal"))
        where = _middle_of_bend(where, start, end, normal)
    if not all(abs(number) < _SQUARABLE for number in (*bend, *sizes)):
        where = np.full(3, np.nan)
    scale = np.nan if radii is None else _scale_of(entry, where, (*bend, *sizes), here, radii)
    own_id, ignore = read_id(entry.get("id", index), f"{here}.id"), bool(entry.get("ignore", False))
    half = 0.0
    if "start" in entry and "end" in entry:
        with np.errstate(over="ignore", invalid="ignore"):
            ends = (np.array(read_vector(entry, key, here)) for key in ("start", "end"))
            half = 0.5 * float(np.linalg.norm(np.subtract(*ends)))
    return _Fitting(kind, own_id, where, tuple(sorted(sizes)), scale, bend, ignore, half)


def _numbers(entry: Mapping[str, object], keys: Sequence[str], here: str) -> tuple[float, ...]:
    return tuple(read_number(entry.get(key), f"{here}.{key}") for key in keys)


def _scale_of(
    entry: Mapping[str, object], where: FloatArray, sizes: Sequence[float], here: str, radii: Mapping[int, float]
) -> float:
    """Return the largest radius of the cylinders that a true fitting joins."""
    joins = entry.get("joins")
    listed = joins if isinstance(joins, list | tuple) else ()
    joined = [radii[one] for one in listed if isinstance(one, int) and one in radii]
    if not joined:
        raise InputError(f"{here}.joins", "names no cylinder of the truth", "list the ids of those it joins")
    if not (np.isfinite(where).all() and all(size > 0 for size in sizes)):
        raise InputError(here, "has no finite place or no sizes > 0", "correct its numbers, or leave it out")
    return max(joined)


def _middle_of_bend(center: FloatArray, start: FloatArray, end: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the middle of an arc of up to half a turn; of a mitre, all places are the same."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what is not finite matches nothing
        halfway, reach = 0.5 * (start + end) - center, np.linalg.norm(start - center)
        if reach == 0:
            return center
        if np.linalg.norm(halfway) < _HALF_TURN * reach:
            halfway = np.cross(normal, start - center)
        return np.asarray(center + halfway * reach / np.linalg.norm(halfway))
