"""Score a result: precision, recall and errors against a truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from cylx.errors import UsageError
from cylx.evaluation.fittings import FittingScores, score_fittings
from cylx.evaluation.matching import match_one_to_one, pair_errors, read_cylinders, require_usable
from cylx.evaluation.pieces import further_pieces, in_line_on_ignored, passed_through, read_pieces
from cylx.evaluation.rates import Spread, rates, spread_of
from cylx.evaluation.runs import RunScore, score_runs
from cylx.geometry.arrays import MaskArray


@dataclass(frozen=True, slots=True)
class Match:
    """A true cylinder and the one found for it.

    Parameters
    ----------
    truth_id, result_id : int
        Their `id`, or their position in the list if they have none.
    angle_deg : float
        Angle between the axes, degrees.
    offset : float
        Distance of the true mid-point from the found axis, in true radii.
    radius : float
        Difference of the radii, relative to the true one, >= 0.
    """

    truth_id: int
    result_id: int
    angle_deg: float
    offset: float
    radius: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The score of a result.

    Parameters
    ----------
    truth, predicted, matched : int
        Number of true cylinders that must be found, of cylinders in the result, and of matched pairs.
    duplicates : int
        Further cylinders of the result on a true one that is matched already; they count as false. One in line with
        it that is on a true one that need not be found is none.
    ignored : int
        Cylinders of the result on true ones that need not be found, and further pieces of a true one that something
        interrupts; they count neither as correct nor as false.
    unusable : int
        Entries of the result that are not cylinders (not finite, no direction); they are left out.
    precision, recall, f1 : float
        In [0, 1]; all 1 if there is nothing to find and nothing was found.
    angle_deg, offset, radius : Spread or None
        Errors of the matches, as in `Match`; None without a match.
    pairs : tuple of Match
        In the order of the truth.
    missed : tuple of int
        `id` of true cylinders without a match.
    false : tuple of int
        `id` of cylinders in the result without a match, duplicates included.
    fittings : FittingScores or None
        None unless both the truth and the result list `fittings`.
    runs : RunScore or None
        None unless both list `runs`.
    """

    truth: int
    predicted: int
    matched: int
    duplicates: int
    ignored: int
    unusable: int
    precision: float
    recall: float
    f1: float
    angle_deg: Spread | None
    offset: Spread | None
    radius: Spread | None
    pairs: tuple[Match, ...]
    missed: tuple[int, ...]
    false: tuple[int, ...]
    fittings: FittingScores | None = None
    runs: RunScore | None = None

    def to_dict(self) -> dict[str, object]:
        """Return everything as a JSON object, keys in the order above; `fittings` and `runs` only if they are known."""
        told = asdict(self)
        for name in ("fittings", "runs"):
            if told[name] is None:
                del told[name]
        return {key: list(value) if isinstance(value, tuple) else value for key, value in told.items()}


def evaluate(
    truth: Mapping[str, object],
    result: Mapping[str, object],
    *,
    angle_deg: float = 5.0,
    offset: float = 0.25,
    radius: float = 0.15,
) -> Evaluation:
    """Match a result with a truth, one to one, and score it.

    A pair is admissible if its errors (see `Match`) are all below the given limits. The largest possible number of
    admissible pairs is matched, at the least sum of errors over limits. True cylinders marked `ignore` need not be
    found. If both list `fittings`, these are scored, too (see `FittingScores`), and so are `runs` (see `RunScore`).

    Parameters
    ----------
    truth, result : mapping
        JSON objects with a list `cylinders`.
    angle_deg : float
        Limit of the axis angle, degrees.
    offset : float
        Limit of the distance from the axis, in true radii.
    radius : float
        Limit of the relative radius error.

    Raises
    ------
    InputError
        If either is malformed, or a true cylinder is not finite.
    UsageError
        If a limit is not positive.
    """
    for name, limit in (("angle_deg", angle_deg), ("offset", offset), ("radius", radius)):
        if not limit > 0:
            raise UsageError(f"limit {name}", f"must be > 0, not {limit}", "give a number > 0")
    known = read_cylinders(truth, "truth")
    require_usable(known, "truth")
    given = read_cylinders(result, "result")
    found = given.subset(given.usable)

    errors = pair_errors(known, found)
    admissible = (errors.angle_deg < angle_deg) & (errors.offset < offset) & (errors.radius < radius)
    asked = ~known.ignore
    cost = errors.angle_deg / angle_deg + errors.offset / offset + errors.radius / radius
    rows, columns = match_one_to_one(cost, admissible & asked[:, None])

    unmatched = np.ones(len(found), dtype=bool)
    unmatched[columns] = False
    on_true = dict(zip(columns.tolist(), rows.tolist(), strict=True))
    pieces, near = read_pieces(truth, "truth"), admissible & asked[:, None]
    asked &= ~passed_through(known, found, pieces, near, on_true)
    further = further_pieces(known, found, pieces, near, on_true)
    on_true |= further
    unmatched[list(further)] = False
    duplicate = unmatched & admissible[asked].any(axis=0) & ~in_line_on_ignored(known, found, admissible)
    ignored = unmatched & ~duplicate & admissible[known.ignore].any(axis=0)
    missed = asked.copy()
    missed[rows] = False
    false = unmatched & ~ignored
    pairs = tuple(
        Match(known.ids[i], found.ids[j], *(float(e[i, j]) for e in (errors.angle_deg, errors.offset, errors.radius)))
        for i, j in zip(rows, columns, strict=True)
    )
    precision, recall, f1 = rates(len(pairs), int(false.sum()), int(missed.sum()))
    return Evaluation(
        truth=int(asked.sum()),
        predicted=len(found),
        matched=len(pairs),
        duplicates=int(duplicate.sum()),
        ignored=int(ignored.sum()) + len(further),
        unusable=len(given) - len(found),
        precision=precision,
        recall=recall,
        f1=f1,
        angle_deg=spread_of([pair.angle_deg for pair in pairs]),
        offset=spread_of([pair.offset for pair in pairs]),
        radius=spread_of([pair.radius for pair in pairs]),
        pairs=pairs,
        missed=_chosen(known.ids, missed),
        false=_chosen(found.ids, false),
        fittings=score_fittings(truth, result, known, radius),
        runs=score_runs(truth, result, {found.ids[j]: known.ids[i] for j, i in on_true.items()}),
    )


def _chosen(ids: tuple[int, ...], mask: MaskArray) -> tuple[int, ...]:
    return tuple(id_ for id_, wanted in zip(ids, mask, strict=True) if wanted)
