"""Compare the fittings and runs of two results: what is there, where, how large, and what it joins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cylx.errors import InputError
from cylx.evaluation.differences import Difference, Tolerances
from cylx.evaluation.matching import match_one_to_one, read_id, read_number, read_vector
from cylx.geometry.arrays import FloatArray

SAME_PLACE = 1.0
"""Fittings of one kind within this distance, in their size, are the same one."""
SIZES = ("bend_radius", "radius", "start_radius", "end_radius", "thickness")


@dataclass(frozen=True, slots=True)
class PipingChanges:
    """The numbers of fittings and runs in two results and in both, and the differences.

    Parameters
    ----------
    counts : dict of str to int, or None
        `fittings_a`, `fittings_b`, `fittings_matched`, `runs_a` and `runs_b`; None if neither result has any.
    differences : tuple of Difference
    """

    counts: dict[str, int] | None = None
    differences: tuple[Difference, ...] = field(default=())


def compare_piping(
    a: Mapping[str, object], b: Mapping[str, object], same: Mapping[int, int], tolerances: Tolerances
) -> PipingChanges:
    """Compare the fittings and runs of two results.

    Parameters
    ----------
    a, b : mapping
        JSON objects, perhaps with lists `fittings` and `runs`; without them they count as having none.
    same : mapping of int to int
        `id` of the cylinder in b that is the same, by the `id` in a.
    tolerances : Tolerances
        Positions of fittings may differ by `offset` in their size, sizes by `radius`, angles by `angle_deg`, lengths of
        runs by `height`.

    Raises
    ------
    InputError
        If a list is malformed.
    """
    if not any(key in document for document in (a, b) for key in ("fittings", "runs")):
        return PipingChanges()
    left, right = _read(a, "a", "fittings"), _read(b, "b", "fittings")
    pairs = _matched(left, right)
    differences = [*_fitting_changes(left, right, pairs, tolerances)]
    before, after = _read(a, "a", "runs"), _read(b, "b", "runs")
    differences += _run_changes(before, after, same, tolerances)
    counts = {
        "fittings_a": len(left),
        "fittings_b": len(right),
        "fittings_matched": len(pairs),
        "runs_a": len(before),
        "runs_b": len(after),
    }
    return PipingChanges(counts, tuple(differences))


def _read(document: Mapping[str, object], place: str, key: str) -> list[dict[str, Any]]:
    """Return the entries of a list with what is compared of them."""
    entries = document.get(key, [])
    if not isinstance(entries, list):
        raise InputError(f"{place}.{key}", "is not a list", "give a result as cylx writes it")
    out = []
    for index, entry in enumerate(entries):
        here = f"{place}.{key}[{index}]"
        if not isinstance(entry, dict):
            raise InputError(here, "is not an object", "give a result as cylx writes it")
        out.append(_fitting(entry, index, here) if key == "fittings" else _run(entry, index, here))
    return out


def _fitting(entry: Mapping[str, object], index: int, here: str) -> dict[str, Any]:
    place = (
        np.array(read_vector(entry, "center", here))
        if "center" in entry
        else 0.5 * (np.array(read_vector(entry, "start", here)) + np.array(read_vector(entry, "end", here)))
    )
    sizes = {name: read_number(entry[name], f"{here}.{name}") for name in SIZES if name in entry}
    ends = "start" in entry and "end" in entry
    length = (
        float(np.linalg.norm(np.array(read_vector(entry, "start", here)) - np.array(read_vector(entry, "end", here))))
        if ends
        else 0.0
    )
    return {
        "id": read_id(entry.get("id", index), f"{here}.id"),
        "kind": str(entry.get("kind")),
        "place": place,
        "sizes": sizes,
        "angle_deg": read_number(entry["angle_deg"], f"{here}.angle_deg") if "angle_deg" in entry else None,
        "size": max([*sizes.values(), length], default=0.0),
    }


def _run(entry: Mapping[str, object], index: int, here: str) -> dict[str, Any]:
    members = entry.get("cylinders")
    if not isinstance(members, list):
        raise InputError(f"{here}.cylinders", "is not a list", "give a result as cylx writes it")
    return {
        "id": read_id(entry.get("id", index), f"{here}.id"),
        "cylinders": [read_id(one, f"{here}.cylinders") for one in members],
        "length": read_number(entry.get("length", 0.0), f"{here}.length"),
    }


def _matched(left: list[dict[str, Any]], right: list[dict[str, Any]]) -> dict[int, int]:
    """Return the positions in b of the fittings in a: of one kind, at one place."""
    if not left or not right:
        return {}
    places = [np.array([one["place"] for one in listed]) for listed in (left, right)]
    apart: FloatArray = np.linalg.norm(places[0][:, None] - places[1], axis=2)
    sizes = np.maximum(np.array([one["size"] for one in left])[:, None], [one["size"] for one in right])
    kinds = np.array([[one["kind"] == other["kind"] for other in right] for one in left])
    near = np.where(sizes > 0, apart / np.where(sizes > 0, sizes, 1.0), np.where(apart > 0, np.inf, 0.0))
    # tees have no size of their own: those that are nearest to each other are the same
    bare = sizes <= 0
    scale = float(np.median(apart[bare])) if bare.any() else 1.0
    near = np.where(bare, apart / max(0.1 * scale, 1e-300), near)
    rows, columns = match_one_to_one(near, kinds & (near <= SAME_PLACE))
    return dict(zip(rows.tolist(), columns.tolist(), strict=True))


def _fitting_changes(
    left: list[dict[str, Any]], right: list[dict[str, Any]], pairs: Mapping[int, int], tolerances: Tolerances
) -> Iterator[Difference]:
    for i, one in enumerate(left):
        if i not in pairs:
            yield Difference(kind="missing", id_a=one["id"], id_b=None, what=one["kind"], of="fittings")
            continue
        yield from _changes(one, right[pairs[i]], tolerances)
    for j in sorted(set(range(len(right))) - set(pairs.values())):
        yield Difference(kind="extra", id_a=None, id_b=right[j]["id"], what=right[j]["kind"], of="fittings")


def _changes(one: dict[str, Any], other: dict[str, Any], tolerances: Tolerances) -> Iterator[Difference]:
    """Yield what of one fitting is different by more than is allowed."""
    ids = one["id"], other["id"]
    size = max(one["size"], other["size"])
    apart = float(np.linalg.norm(one["place"] - other["place"])) / size if size > 0 else 0.0
    if apart > tolerances.height:
        yield Difference(
            kind="moved",
            id_a=ids[0],
            id_b=ids[1],
            what="center",
            difference=apart,
            tolerance=tolerances.height,
            of="fittings",
        )
    measured = [(name, one["sizes"][name], other["sizes"].get(name), tolerances.height) for name in one["sizes"]]
    for name, before, after, tolerance in measured:
        if after is None:
            continue
        difference = abs(before - after) / max(abs(before), abs(after), 1e-300)
        if difference > tolerance:
            yield Difference(
                kind="resized",
                id_a=ids[0],
                id_b=ids[1],
                what=name,
                a=before,
                b=after,
                difference=difference,
                tolerance=tolerance,
                of="fittings",
            )
    before, after = one["angle_deg"], other["angle_deg"]
    if before is not None and after is not None and abs(before - after) > tolerances.angle_deg:
        yield Difference(
            kind="moved",
            id_a=ids[0],
            id_b=ids[1],
            what="angle_deg",
            a=before,
            b=after,
            difference=abs(before - after),
            tolerance=tolerances.angle_deg,
            of="fittings",
        )


def _run_changes(
    before: list[dict[str, Any]], after: list[dict[str, Any]], same: Mapping[int, int], tolerances: Tolerances
) -> Iterator[Difference]:
    """Yield the runs that are apart in the other result, or that are joined there, and those of another length."""
    home = {member: run["id"] for run in after for member in run["cylinders"]}
    back = {member: run["id"] for run in before for member in run["cylinders"]}
    known = {theirs: ours for ours, theirs in same.items()}
    by_id = {run["id"]: run for run in after}
    for run in before:
        there = sorted({home[same[member]] for member in run["cylinders"] if same.get(member) in home})
        for other in there[1:]:
            yield Difference(kind="parted", id_a=run["id"], id_b=other, what="run", of="runs")
        if len(there) == 1:
            lengths = run["length"], by_id[there[0]]["length"]
            whole = {known.get(member) for member in by_id[there[0]]["cylinders"]} <= {*run["cylinders"], None}
            difference = abs(lengths[0] - lengths[1]) / max(*lengths, 1e-300)
            if whole and difference > tolerances.height:
                yield Difference(
                    kind="resized",
                    id_a=run["id"],
                    id_b=there[0],
                    what="length",
                    a=lengths[0],
                    b=lengths[1],
                    difference=difference,
                    tolerance=tolerances.height,
                    of="runs",
                )
    for run in after:
        here = sorted({back[known[member]] for member in run["cylinders"] if known.get(member) in back})
        for other in here[1:]:
            yield Difference(kind="joined", id_a=other, id_b=run["id"], what="run", of="runs")
