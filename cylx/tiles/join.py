"""Group by group: one fit to the points of all parts, by the code that joins the pieces of a cloud in one piece."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.morton import BITS, morton_codes
from cylx.pipeline.joining import join_findings
from cylx.records import (
    Candidates,
    Finding,
    Frame,
    IndexedCloud,
    Noise,
    PointCloud,
    Scene,
    Source,
    cell_keys,
)
from cylx.scene import Prepared, catalogue_of, known_of, noise_by_place, radius_range, resolve
from cylx.tiles.gather import gathered_name
from cylx.tiles.parts import Part, in_frame
from cylx.tiles.search import WHOLE, Plan, part_of

EVERYWHERE = np.array([np.full(3, -np.inf), np.full(3, np.inf)])


REACHED = "reached.json"
"""Name of the list of the tiles that have points about each group in the scratch folder."""


def group_name(group: int) -> str:
    """Return the name of the parts of a group in the scratch folder."""
    return f"group-{group}.json"


def joined_name(group: int) -> str:
    """Return the name of what a group was joined to in the scratch folder."""
    return f"joined-{group}.json"


def join_group(plan: Plan, group: int) -> int:
    """Join the parts of a group; return how many cylinders and blends are left of them.

    Parameters
    ----------
    plan : Plan
    group : int
    """
    scratch = plan.scratch
    if scratch.has(joined_name(group)):
        return len(scratch.read_json(joined_name(group)))
    about, reached = scratch.read_json(group_name(group)), scratch.read_json(REACHED)[str(group)]
    parts = [Part.of_object(one) for one in about["parts"]]
    held = [scratch.read(gathered_name(group, tile)) for tile in reached]
    left = parts
    if held:
        prepared, indexed, windows = _brought_together(plan, held, int(about["halvings"]), Scene(*about["scene"]))
        left = _joined(parts, about["found_in"], prepared, indexed, windows)
    scratch.write_json(joined_name(group), [part.to_object() for part in left])
    return len(left)


def _joined(
    parts: list[Part], tiles: list[int], prepared: Prepared, indexed: IndexedCloud, windows: Candidates
) -> list[Part]:
    """Return what the parts were joined to; what nothing was joined to stays as it was."""
    findings = [_in_frame(part.finding, prepared.frame) for part in parts]
    doubtful = {i for i, tile in enumerate(tiles) if tile == WHOLE}
    joined = join_findings(prepared, indexed, windows, findings, doubtful)
    return [part_of(one, prepared, indexed, 1.0, EVERYWHERE) if i is None else parts[i] for i, one in joined]


def _in_frame(one: Finding, frame: Frame) -> Finding:
    """Return a finding in a frame."""
    segment = in_frame(one.segment, frame.origin, frame.spacing)
    return replace(one, segment=segment, offset_error=one.offset_error / frame.spacing)


def _brought_together(
    plan: Plan, held: list[dict[str, Any]], halvings: int, whole: Scene
) -> tuple[Prepared, IndexedCloud, Candidates]:
    """Make one frame of the points from several tiles."""
    weights = np.array([float(len(one["points"])) for one in held])
    shares = weights / weights.sum()
    spacing = math.exp(float(shares @ np.log([float(one["spacing"]) for one in held]))) * math.sqrt(2.0**halvings)
    points = np.concatenate([one["points"] for one in held])
    origin = points.min(axis=0)
    inside = (points - origin) / spacing
    side = float(inside.max()) or 1.0
    unit = side / (2.0**BITS - 2)
    codes = morton_codes(inside, unit, side)
    order = np.argsort(codes, kind="stable")
    inside, codes = np.ascontiguousarray(inside[order]), codes[order]
    flatness = np.concatenate([one["flatness"] for one in held])[order].astype(np.float64) / spacing
    normals = None
    if all("normals" in one for one in held):
        normals = np.ascontiguousarray(np.concatenate([one["normals"] for one in held])[order])
    noise = _noise_of(held, shares, origin, spacing, side)
    frame = Frame(inside, order, codes, unit, 0, 1.0, noise, origin, spacing)
    scene = Scene(spacing, noise.least * spacing, whole.extent, whole.given)
    config = resolve(plan.config, scene)
    cloud = PointCloud(points, source=Source("the points of a group", "array"))
    prepared = Prepared(
        cloud,
        frame,
        scene,
        config,
        radius_range(config, frame),
        known_of(config, frame),
        catalogue_of(config, frame),
        plan.threads,
    )
    indexed = IndexedCloud.of(frame, flatness, normals)
    return prepared, indexed, _windows_of(held, origin, spacing)


def _noise_of(held: list[dict[str, Any]], shares: FloatArray, origin: FloatArray, spacing: float, side: float) -> Noise:
    """Return the noise of a group: the mean of its tiles' by size, by place that of all of their patches."""
    tables = [Noise(one["sizes"], one["deviations"]) for one in held]
    sizes = np.unique(np.concatenate([table.sizes for table in tables]))
    logs = np.log([[table.at(float(size)) for size in sizes] for table in tables])
    deviations = np.maximum.accumulate(np.exp(shares @ logs))
    patches = []
    for one, table in zip(held, tables, strict=True):
        own = one["patches"].copy()
        # as multiples of what is usual in the group rather than in the tile
        own[:, 4] *= table.least / float(deviations[0])
        own[:, :3] = (own[:, :3] - origin) / spacing
        own[:, 3] /= spacing
        patches.append(own[((own[:, :3] >= 0.0) & (own[:, :3] <= side)).all(axis=1)])
    together = np.concatenate(patches)
    usual = Noise(sizes / spacing, deviations / spacing)
    if not len(together):
        return usual
    cell, cells, factors = noise_by_place(together[:, :3], together[:, 4], side)
    keys = cell_keys(cells)
    by_key = np.argsort(keys)
    return replace(usual, side=cell, cells=keys[by_key], factors=factors[by_key], patches=together)


def _windows_of(held: list[dict[str, Any]], origin: FloatArray, spacing: float) -> Candidates:
    """Return the windows of all tiles about a group, in its frame."""
    models = np.concatenate([one["models"] for one in held])
    models[:, :3] = (models[:, :3] - origin) / spacing
    models[:, 6] /= spacing
    radii = np.concatenate([one["radii"] for one in held]) / spacing
    places = (np.concatenate([one["places"] for one in held]) - origin) / spacing
    count = len(models)
    return Candidates(models, np.arange(count), np.zeros(count), np.zeros(count, np.int64), radii, places)
