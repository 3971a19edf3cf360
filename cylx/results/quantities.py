"""The bill of quantities of a result: lengths of pipe by size, and fittings by what they are."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from cylx.harmless import cell
from cylx.wording import number

if TYPE_CHECKING:
    from cylx.results.cylinders import ResultCylinder
    from cylx.results.fittings import AnyFitting
    from cylx.results.result import Result

COLUMNS = ("item", "size", "to_size", "angle_deg", "bend_radius", "count", "length", "assumed")
ONE_SIZE = 1.03
"""Without a catalogue, radii up to this factor apart are one size."""
SAME_BEND = 4.0
"""Bend radii are counted together by the nearest quarter of the diameter."""


def quantities_of(result: Result) -> list[dict[str, Any]]:
    """Return the rows of the bill of quantities.

    Parameters
    ----------
    result : Result
        With fittings and runs.

    Returns
    -------
    list of dict
        `item` (`pipe`, or the kind of a fitting), `size` and `to_size` (names in the catalogue, or diameters), rounded
        `angle_deg`, mean `bend_radius`, `count`, `length` (of pipes between fittings, and of gaps; scene units) and
        `assumed` (whether nothing was seen of it). Sorted by item and size; None for what an item does not have.
    """
    sizes = _sizes(result)
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for key, bend, long in [*_pipes(result, sizes), *(_entry(one, sizes) for one in result.fittings or ())]:
        row = rows.setdefault(key, {"count": 0, "length": 0.0, "bends": []})
        row["count"] += 1
        row["length"] += long
        row["bends"] += [] if bend is None else [bend]
    out = []
    for (item, size, to_size, angle, _, assumed), row in rows.items():
        values = (item, size[1], None if to_size is None else to_size[1], angle)
        mean = sum(row["bends"]) / len(row["bends"]) if row["bends"] else None
        length = row["length"] if item in ("pipe", "joint") else None
        out.append(dict(zip(COLUMNS, (*values, mean, row["count"], length, assumed), strict=True)) | {"_": size[0]})
    order = ("pipe", "elbow", "tee", "cross", "reducer", "flange", "inline", "cap", "joint")
    out.sort(key=lambda row: (order.index(row["item"]), row.pop("_"), str(row["to_size"]), row["angle_deg"] or 0.0))
    return out


def quantities_csv(result: Result) -> str:
    """Return the bill of quantities as CSV with a header line; what an item does not have is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in quantities_of(result):
        numbers = {key: number(row[key], 6) for key in ("angle_deg", "bend_radius", "length") if row[key] is not None}
        said = {"assumed": "yes" if row["assumed"] else "no"}
        writer.writerow([cell("" if value is None else value) for value in (row | numbers | said).values()])
    return text.getvalue()


def _sizes(result: Result) -> dict[int, tuple[float, str]]:
    """Return diameter and name of the size of each cylinder: nominal, or the mean of all that are nearly equal."""
    named: dict[int, str] = {}
    for run in result.runs or ():
        for size in run.sizes:
            if size.nominal is not None:
                named.update(dict.fromkeys(size.cylinders, size.nominal))
    groups: dict[str | int, list[ResultCylinder]] = {}
    last = None
    for one in sorted(result.cylinders, key=lambda one: (one.radius, one.id)):
        if one.id in named:
            groups.setdefault(named[one.id], []).append(one)
            continue
        if last is None or one.radius > ONE_SIZE * groups[last][0].radius:
            last = one.id
        groups.setdefault(last, []).append(one)
    out: dict[int, tuple[float, str]] = {}
    for key, members in groups.items():
        length = sum(one.height for one in members)
        weights = [one.height / length if length > 0 else 1.0 / len(members) for one in members]
        diameter = 2.0 * sum(weight * one.radius for weight, one in zip(weights, members, strict=True))
        name = key if isinstance(key, str) else number(diameter, 4)
        out.update({one.id: (diameter, name) for one in members})
    return out


def _pipes(
    result: Result, sizes: dict[int, tuple[float, str]]
) -> Iterator[tuple[tuple[Any, ...], float | None, float]]:
    for one in result.cylinders:
        yield ("pipe", sizes[one.id], None, None, None, False), None, one.height


def _entry(fitting: AnyFitting, sizes: dict[int, tuple[float, str]]) -> tuple[tuple[Any, ...], float | None, float]:
    """Return what a fitting is counted under, its bend radius, and its length."""
    content = fitting.model_dump()
    size = max(sizes[number] for number in content["joins"])
    to_size, angle, bend, steps = None, None, None, None
    if fitting.kind in ("tee", "cross"):
        size, to_size = sizes[content["main"][0]], sizes[content["branches"][0]]
        angle = float(round(content["angle_deg"]))
    elif fitting.kind == "reducer":
        to_size = min(sizes[number] for number in content["joins"])
    elif fitting.kind == "elbow":
        angle, bend = float(round(content["angle_deg"])), content["bend_radius"]
        steps = round(SAME_BEND * bend / size[0])
    assumed = bool(content.get("assumed", False))
    return (fitting.kind, size, to_size, angle, steps, assumed), bend, float(content.get("length", 0.0))
