"""Tile by tile: the points about each group of parts, with what they lie on, brought together for the joint fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS
from cylx.tiles.parts import Part
from cylx.tiles.search import Plan, frame_name, frame_points, inside_of, rows_name
from cylx.tiles.survey import hashes

AROUND_RADII, AROUND_SPREADS = 1.6, 30.0
"""Points are gathered up to this distance from the axis, in radii, and so many spreads more: what verification sees."""
ON_RADII, ON_HALVES = 4.0, 1.0
"""And so far beyond the ends: radii, or halves of the height if that is more."""
MOST_POINTS = 1_000_000
"""Points on the surfaces of a group that suffice; of more every second, fourth, eighth … is taken."""


def corridors_of(parts: Sequence[Part]) -> list[list[float]]:
    """Return the cylinders that hold all points of interest about a group: rows of model and half height."""
    rows = [_corridor(part.finding.segment.model, part.finding.segment.half, part) for part in parts]
    longest = max(parts, key=lambda part: part.finding.segment.half).finding.segment
    if len(parts) > 1:  # what lies in the gaps between the parts
        heights = [
            float((part.finding.segment.point - longest.point) @ longest.direction) + sign * part.finding.segment.half
            for part in parts
            for sign in (-1.0, 1.0)
        ]
        low, high = min(heights), max(heights)
        model = longest.model.copy()
        model[POINT] += 0.5 * (low + high) * model[DIRECTION]
        rows.append(_corridor(model, 0.5 * (high - low), parts[0]))
    return rows


def _corridor(model: FloatArray, half: float, part: Part) -> list[float]:
    radius = float(model[RADIUS])
    outer = AROUND_RADII * radius + AROUND_SPREADS * part.finding.segment.spread
    return [*model[:RADIUS].tolist(), outer, half + max(ON_RADII * radius, ON_HALVES * half)]


def thinning_of(parts: Sequence[Part]) -> int:
    """Return how many halvings leave as many points of a group as suffice."""
    total, halvings = sum(part.inliers for part in parts), 0
    while total > MOST_POINTS << halvings:
        halvings += 1
    return halvings


def touches(rows: FloatArray, box: FloatArray) -> bool:
    """Return whether any corridor may reach into a box."""
    along = rows[:, 7, None] * np.abs(rows[:, DIRECTION])
    across = rows[:, RADIUS, None] * np.sqrt(np.maximum(1.0 - rows[:, DIRECTION] ** 2, 0.0))
    reach = along + across
    over = (rows[:, POINT] + reach >= box[0]) & (rows[:, POINT] - reach <= box[1])
    return bool(over.all(axis=1).any())


def gathered_name(group: int, tile: int) -> str:
    """Return the name of the points about a group from a tile in the scratch folder."""
    return f"about-{group}-{tile}.npz"


def gather_tile(plan: Plan, tile: int) -> list[int]:
    """Write the points of a tile about each group that reaches into it; return these groups.

    Parameters
    ----------
    plan : Plan
    tile : int
    """
    scratch, done = plan.scratch, f"gathered-{tile}.json"
    if scratch.has(done):
        return list(scratch.read_json(done))
    groups: Mapping[str, Any] = scratch.read_json("groups.json")
    reaching = {
        int(group): (np.array(about["corridors"]), int(about["halvings"]))
        for group, about in groups.items()
        if touches(np.array(about["corridors"]), plan.boxes[tile])
    }
    filled: list[int] = []
    if reaching and scratch.has(frame_name(tile)):
        held = scratch.read(frame_name(tile))
        points = frame_points(scratch, tile, held)
        cells = Cells(points, held["codes"])
        inside = np.zeros(len(points), np.bool_)
        places, in_tile = inside_of(held)
        inside[places] = True
        rows = np.zeros(len(points), np.int64)
        rows[places] = scratch.rows(rows_name(tile), np.int64)[in_tile]
        for group, (corridors, halvings) in reaching.items():
            near = np.unique(np.concatenate([_near(cells, row, held) for row in corridors]))
            near = near[inside[near]]
            if halvings:
                near = near[hashes(rows[near]) >> np.uint64(64 - halvings) == 0]
            if len(near):
                _write(plan, group, tile, held, points, near, corridors)
                filled.append(group)
    scratch.write_json(done, filled)
    return filled


def _near(cells: Cells, row: FloatArray, held: dict[str, Any]) -> IndexArray:
    spacing = float(held["spacing"])
    model = row[:7].copy()
    model[POINT] = (model[POINT] - held["origin"]) / spacing
    half, outer = float(row[7]) / spacing, float(row[6]) / spacing
    return cells.near_cylinder(model, -half, half, 0.0, outer)


def _write(
    plan: Plan,
    group: int,
    tile: int,
    held: dict[str, Any],
    points: FloatArray,
    near: IndexArray,
    corridors: FloatArray,
) -> None:
    """Write points in scene units, what they lie on, and the windows and the noise about them."""
    spacing, origin = float(held["spacing"]), held["origin"]
    windows = _windows_about(held, corridors, plan.boxes[tile])
    patches = held["patches"].copy()
    patches[:, :3] = patches[:, :3] * spacing + origin
    patches[:, 3] *= spacing
    patches = patches[_inside(patches[:, :3], plan.boxes[tile])]
    arrays = {
        "points": points[near] * spacing + origin,
        "flatness": held["flatness"][near] * np.float32(spacing),
        "spacing": np.array(spacing),
        "sizes": held["sizes"] * spacing,
        "deviations": held["deviations"] * spacing,
        "patches": patches,
        **windows,
    }
    if "normals" in held:
        arrays["normals"] = held["normals"][near]
    plan.scratch.write(gathered_name(group, tile), **arrays)


def _windows_about(held: dict[str, Any], corridors: FloatArray, box: FloatArray) -> dict[str, FloatArray]:
    """Return the windows near a group, scene units."""
    spacing, origin = float(held["spacing"]), held["origin"]
    models, radii, places = held["models"].copy(), held["radii"] * spacing, held["places"] * spacing + origin
    models[:, POINT] = models[:, POINT] * spacing + origin
    models[:, RADIUS] *= spacing
    near = np.zeros(len(models), np.bool_)
    for row in corridors:
        offsets = models[:, POINT] - row[POINT]
        heights = offsets @ row[DIRECTION]
        apart = np.linalg.norm(offsets - heights[:, None] * row[DIRECTION], axis=1)
        near |= (np.abs(heights) <= row[7]) & (apart <= 1.5 * row[RADIUS])
    at = np.where(np.isnan(places), models[:, POINT], places)
    near &= _inside(at, box)  # those in the margin are the neighbour's
    return {"models": models[near], "radii": radii[near], "places": places[near]}


def _inside(points: FloatArray, box: FloatArray) -> MaskArray:
    return np.asarray(((points >= box[0]) & (points < box[1])).all(axis=1))
