"""One tile: its points with those in the margin, searched as a cloud of their own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cylx.config import Config
from cylx.errors import InputError
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.io.scratch import Scratch
from cylx.pipeline import Search, search_cylinders
from cylx.pipeline.assembly import fit_of
from cylx.pipeline.stage_log import StageLog
from cylx.records import Finding, IndexedCloud, PointCloud, SilentObserver, Source
from cylx.scene import Prepared, prepare
from cylx.tiles.parts import Part, in_scene
from cylx.tiles.rejected import keep_rejected

SAMPLED = 200
"""Points of a cylinder that tell where it is."""
LEAST_INSIDE = 0.2
"""Share of a cylinder's points inside a tile, below which the neighbour sees more of it, and says so."""
BEYOND_RADII, BEYOND_SPACINGS = 1.0, 10.0
"""A cylinder with less than this between it and the end of what was seen may go on there: radii, and spacings."""
WHOLE = -1
"""Number of the thinned whole, which is searched for what is larger than tiles."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What every step knows.

    Parameters
    ----------
    scratch : Scratch
        Where the tiles are.
    config : Config
        As given, but for the largest radius, which is that of the whole.
    boxes : ndarray of shape (T, 2, 3)
        Of the tiles.
    margin : float
        About each tile, scene units.
    large : float
        Radius from which a cylinder of the thinned whole counts, scene units.
    threads : int
        Of each process.
    rejected : bool
        Whether what is not accepted is kept.
    """

    scratch: Scratch
    config: Config
    boxes: FloatArray
    margin: float
    large: float
    threads: int
    rejected: bool = False

    def region(self, tile: int) -> FloatArray:
        """Return the box of what is seen in a tile, shape (2, 3)."""
        if tile == WHOLE:
            return np.array([np.full(3, -np.inf), np.full(3, np.inf)])
        return np.asarray(self.boxes[tile] + np.array([[-self.margin], [self.margin]]))


def points_name(tile: int) -> str:
    """Return the name of the points of a tile in the scratch folder."""
    return f"points-{tile}"


def margin_name(tile: int) -> str:
    """Return the name of the points about a tile in the scratch folder."""
    return f"margin-{tile}"


def rows_name(tile: int) -> str:
    """Return the name of the row numbers of a tile's points in the scratch folder."""
    return f"rows-{tile}"


def found_name(tile: int) -> str:
    """Return the name of what a tile has found in the scratch folder."""
    return f"found-{tile}.json"


def frame_name(tile: int) -> str:
    """Return the name of the frame of a tile in the scratch folder."""
    return f"frame-{tile}.npz"


def search_tile(plan: Plan, tile: int) -> int:
    """Search a tile, and keep what was found and what its points lie on; return how many cylinders there are.

    Parameters
    ----------
    plan : Plan
    tile : int
        Its number, or `WHOLE`.
    """
    scratch = plan.scratch
    if scratch.has(found_name(tile)):
        return len(scratch.read_json(found_name(tile))["parts"])
    inside = scratch.rows(points_name(tile), np.float64, 3)
    about = scratch.rows(margin_name(tile), np.float64, 3)
    points = np.concatenate([inside, about])
    log = StageLog(SilentObserver())
    parts: list[Part] = []
    scale: dict[str, float] = {}
    try:
        cloud = PointCloud(points, source=Source(f"tile {tile}", "array"))
        prepared = prepare(cloud, _config_of(plan, tile), plan.threads)
    except InputError:  # a few points, or all on one plane
        scratch.remove(frame_name(tile))
    else:
        found = search_cylinders(prepared, log)
        parts = _parts_of(plan, tile, prepared, found, len(inside))
        scale = {"spacing": prepared.scene.spacing, "noise": prepared.scene.noise}
        if tile != WHOLE:
            _keep_frame(scratch, tile, prepared, found, len(inside))
            if plan.rejected:
                keep_rejected(scratch, tile, plan.boxes[tile], prepared, found)
    content = {
        "parts": [part.to_object() for part in parts],
        "stages": [[one.name, one.considered, one.kept, dict(one.rejected)] for one in log.reports],
        "points": len(inside),
        **scale,
    }
    scratch.write_json(found_name(tile), content)
    return len(parts)


def found_in(scratch: Scratch, tile: int) -> dict[str, Any]:
    """Return what was written of a tile, with its parts as such: as plain data they take ten times the memory."""
    content: dict[str, Any] = scratch.read_json(found_name(tile))
    content["parts"] = [Part.of_object(one) for one in content["parts"]]
    return content


def _config_of(plan: Plan, tile: int) -> Config:
    """Return the configuration of a tile: with a seed of its own, and as many cylinders as there are."""
    seed = int(np.random.SeedSequence([plan.config.seed, tile + 1]).generate_state(1)[0])
    config = plan.config.model_copy(update={"seed": seed, "max_cylinders": None})
    if tile != WHOLE:
        return config
    least = max(plan.large, config.scene.radius_min or 0.0)
    return config.model_copy(update={"scene": config.scene.model_copy(update={"radius_min": least})})


def _parts_of(plan: Plan, tile: int, prepared: Prepared, found: Search, inside: int) -> list[Part]:
    """Return what was found, but for what a neighbour sees better."""
    order, region = prepared.frame.order, plan.region(tile)
    parts = []
    for finding in [*found.findings, *found.blends]:
        own = float((order[finding.points] < inside).mean()) if len(finding.points) else 0.0
        part = part_of(finding, prepared, found.indexed, own, region)
        large = part.fit.cylinder.radius >= plan.large and not finding.blend
        if large if tile == WHOLE else own >= LEAST_INSIDE:
            parts.append(part)
    return parts


def part_of(finding: Finding, prepared: Prepared, indexed: IndexedCloud, inside: float, region: FloatArray) -> Part:
    """Put a finding into scene units.

    Parameters
    ----------
    finding : Finding
    prepared : Prepared
        The cloud that it was found in.
    indexed : IndexedCloud
        The same cloud.
    inside : float
        Share of its points in the tile.
    region : ndarray of shape (2, 3)
        Box of what was seen, scene units.
    """
    frame, count = prepared.frame, len(finding.points)
    fit = fit_of(finding, 0, 0.0, prepared, indexed)
    some = finding.points[:: max(1, count // SAMPLED)]
    segment = in_scene(finding.segment, frame)
    scene = replace(
        finding,
        segment=segment,
        points=np.empty(0, np.int64),
        offset_error=finding.offset_error * frame.spacing,
    )
    clipped = _is_clipped(segment.model, segment.half, frame.spacing, region)
    sample = frame.points[some] * frame.spacing + frame.origin
    return Part(scene, fit, frame.spacing, count, inside, clipped, sample)


def _is_clipped(model: FloatArray, half: float, spacing: float, region: FloatArray) -> bool:
    """Return whether a cylinder comes near the end of what was seen."""
    beyond = max(BEYOND_RADII * float(model[6]), BEYOND_SPACINGS * spacing)
    direction = model[3:6]
    along = (half + beyond) * np.abs(direction)
    across = float(model[6]) * np.sqrt(np.maximum(1.0 - direction**2, 0.0))
    reach = along + across
    return bool((model[:3] - reach < region[0]).any() or (model[:3] + reach > region[1]).any())


def _keep_frame(scratch: Scratch, tile: int, prepared: Prepared, found: Search, inside: int) -> None:
    """Keep what the points of a tile lie on, and the noise about them, so that the frame can be made again."""
    frame, indexed, windows = prepared.frame, found.indexed, found.windows
    noise = frame.noise
    arrays: dict[str, Any] = {
        "order": frame.order.astype(np.int32),
        "codes": frame.codes,
        "flatness": indexed.flatness.astype(np.float32),
        "origin": frame.origin,
        "spacing": np.array(frame.spacing),
        "inside": np.array(inside),
        "sizes": noise.sizes,
        "deviations": noise.deviations,
        "side": np.array(noise.side),
        "cells": noise.cells,
        "factors": noise.factors,
        "patches": noise.patches,
        "models": windows.models,
        "radii": windows.windows,
        "places": windows.places,
    }
    if indexed.normals is not None:
        arrays["normals"] = indexed.normals
    scratch.write(frame_name(tile), **arrays)


def frame_points(scratch: Scratch, tile: int, held: dict[str, Any]) -> FloatArray:
    """Return the points of a tile and its margin in its frame, in its order."""
    inside = scratch.rows(points_name(tile), np.float64, 3)
    about = scratch.rows(margin_name(tile), np.float64, 3)
    points = np.concatenate([inside, about])[held["order"]]
    points -= held["origin"]
    points /= float(held["spacing"])
    return np.asarray(points, dtype=np.float64)


def inside_of(held: dict[str, Any]) -> tuple[IndexArray, IndexArray]:
    """Return the indices in the frame of the points inside a tile, and their indices in the tile."""
    order = held["order"]
    places = np.flatnonzero(order < int(held["inside"]))
    return places, np.asarray(order[places], dtype=np.int64)
