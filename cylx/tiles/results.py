"""What the tiles have found and counted -> the lists of the result."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from cylx.config import Config
from cylx.errors import InputError
from cylx.geometry.arrays import FloatArray
from cylx.io.scratch import Scratch
from cylx.io.streamed_cloud import StreamedCloud
from cylx.records import CylinderFit, PointCloud, Scene, Source, StageReport
from cylx.scene.cautions import damage
from cylx.tiles.join import joined_name
from cylx.tiles.label import FINAL, counts_of
from cylx.tiles.parts import Part
from cylx.tiles.survey import Survey


def scene_of(found: list[dict[str, Any]], extent: float, config: Config) -> Scene:
    """Return the scale of the whole: the medians over the tiles, weighed by their points."""
    usable = [one for one in found if "spacing" in one]
    if not usable:
        raise InputError("--tile", "no tile has enough points off one plane", "make the tiles larger")
    weights = np.array([one["points"] for one in usable], np.float64)
    spacing, noise = (_median([one[name] for one in usable], weights) for name in ("spacing", "noise"))
    return Scene(config.scene.spacing or spacing, config.scene.noise or noise, extent, config.scene.given)


def _median(values: list[float], weights: FloatArray) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[int(np.searchsorted(total, 0.5 * total[-1]))]])


def write_finals(scratch: Scratch, groups: list[int]) -> list[Part]:
    """Return all cylinders and blends, those of one tile first, and write them down for the labelling."""
    objects = [*scratch.read_json("alone.json")]
    for group in groups:
        objects += scratch.read_json(joined_name(group))
    for one in objects:
        one["sample"] = []
    scratch.write_json(FINAL, objects)
    return [Part.of_object(one) for one in objects]


def in_order(
    scratch: Scratch, finals: list[Part], tiles: int, config: Config
) -> tuple[list[CylinderFit], list[CylinderFit], np.ndarray[Any, np.dtype[np.int32]]]:
    """Return the cylinders and the blends by confidence and inliers, and the number of each final part."""
    counts = counts_of(scratch, tiles, len(finals))
    ids = np.full(len(finals), -1, np.int32)
    order = sorted(
        (i for i in range(len(finals)) if counts.inliers[i] > 0),
        key=lambda i: (-(finals[i].fit.confidence or 0.0), -int(counts.inliers[i]), i),
    )
    lists: tuple[list[CylinderFit], list[CylinderFit]] = ([], [])
    for i in order:
        blend, count = finals[i].finding.blend, int(counts.inliers[i])
        if not blend:
            if config.max_cylinders and len(lists[0]) >= config.max_cylinders:
                continue
            ids[i] = len(lists[0])
        rmse = float(np.sqrt(counts.squares[i] / count))
        lists[blend].append(replace(finals[i].fit, inliers=count, rmse=rmse))
    return *lists, ids


def stages_of(found: list[dict[str, Any]]) -> list[StageReport]:
    """Add up the counts of the tiles."""
    considered: Counter[str] = Counter()
    kept: Counter[str] = Counter()
    rejected: dict[str, Counter[str]] = {}
    for one in found:
        for name, first, last, reasons in one["stages"]:
            considered[name] += first
            kept[name] += last
            rejected.setdefault(name, Counter()).update(reasons)
    return [StageReport(name, considered[name], kept[name], dict(sorted(rejected[name].items()))) for name in rejected]


def joining_report(before: int, after: int, counted: int) -> StageReport:
    """Report how many parts came from the tiles, and how many cylinders and blends are left of them."""
    rejected = {"joined or claimed": before - after, "without points": after - counted}
    return StageReport("joining", before, counted, {name: n for name, n in rejected.items() if n})


def warnings_of(clouds: list[StreamedCloud], seen: Survey, scene: Scene, fits: list[CylinderFit]) -> list[str]:
    """Say what a user should know before trusting the result; copies of points cannot be told from a sample."""
    doubts = tuple(doubt for cloud in clouds for doubt in cloud.source.doubts)
    sample = PointCloud(seen.sample, source=Source(clouds[0].source.file, clouds[0].source.format, doubts=doubts))
    out = [str(caution) for caution in damage(sample, scene) if caution.kind not in ("copies", "zeros")]
    thin = sum(1 for fit in fits if fit.coverage < np.radians(60.0))
    if thin:
        out.append(f"{thin} cylinder{'s' if thin > 1 else ''} covered by less than 60 degrees: the radius is uncertain")
    return out
