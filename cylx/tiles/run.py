"""A cloud of any size: cut into tiles, searched tile by tile, joined to one result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from cylx.config import Config
from cylx.errors import ConfigError, UsageError
from cylx.io.scratch import Scratch
from cylx.io.streamed_cloud import StreamedCloud
from cylx.records import Observer, Selection, TiledExtraction, Tiling
from cylx.scene import resolve
from cylx.tiles.cutting import cut, stage, survey_once, tree_of
from cylx.tiles.gather import gather_tile
from cylx.tiles.grouping import tell_tiles, write_groups
from cylx.tiles.join import join_group
from cylx.tiles.label import Labels, label_tile
from cylx.tiles.rejected import rejected_in
from cylx.tiles.results import in_order, joining_report, scene_of, stages_of, warnings_of, write_finals
from cylx.tiles.schedule import Runner
from cylx.tiles.search import WHOLE, Plan, found_in, points_name, search_tile
from cylx.tiles.thinning import thin
from cylx.tiles.tree import usual_side

BASE, A_POINT = 300_000_000, 250
"""Estimate of the peak memory of the search of a tile, and per point of it and its margin, bytes: two million points in
tiles of a plant took 830 MB."""
OVERHEAD = 1.6
"""Points of a tile with its margin over those without, at the most, usually."""
LEAST_POINTS, MOST_POINTS = 20_000, 8_000_000
"""A tile of fewer points is hardly worth its margin; more give no better tiles."""
LEAST_MEMORY = BASE + OVERHEAD * A_POINT * LEAST_POINTS
"""For the search of a tile, bytes."""
THINNED = 1 << 18
"""Points in which cylinders larger than tiles are looked for, at the most."""
LARGE = 0.25
"""A radius of so many usual sides of a tile is looked for in the thinned whole, too."""


@dataclass(frozen=True, slots=True)
class Options:
    """How to cut.

    Parameters
    ----------
    size : float or None
        Greatest side of a tile, scene units; by default the number of points alone decides.
    buffer : float or None
        Margin about each tile, scene units.
    memory : float
        For each process that searches tiles, bytes.
    threads : int
        Of each process.
    rejected : bool
        Whether what is not accepted is given, too.
    """

    size: float | None
    buffer: float | None
    memory: float
    threads: int
    rejected: bool = False


class Outcome(NamedTuple):
    """The extraction, the labels of its points, and whether each file has colours that are not all 0."""

    extraction: TiledExtraction
    labels: Labels
    colored: tuple[bool, ...]


def points_for(memory: float) -> int:
    """Return how many points a tile may have without its margin, so that its search stays within some memory.

    Raises
    ------
    UsageError
        If it is too little for any tile.
    """
    if memory < LEAST_MEMORY:
        fault = f"{memory / 1e9:.2g} GB for a tile are too little"
        raise UsageError("memory", fault, f"give at least {LEAST_MEMORY / 1e9:.2g} GB")
    return min(int((memory - BASE) / A_POINT / OVERHEAD), MOST_POINTS)


def check_method(config: Config) -> None:
    """Refuse a configuration that gives nothing that could be joined.

    Raises
    ------
    ConfigError
        If the method is another, or its cylinders are not fitted to all their points.
    """
    if config.method != "gt":
        raise ConfigError("method", f"{config.method} does not work in tiles", "use gt, or leave --tile out")
    if not (config.averaging.refine and config.averaging.merge):
        fault = "cylinders that are not fitted to their points and merged cannot be joined over tiles"
        raise ConfigError("averaging", fault, "set refine and merge to true, or leave --tile out")


def extract_in_tiles(
    clouds: list[StreamedCloud],
    selection: Selection,
    config: Config,
    options: Options,
    scratch: Scratch,
    runner: Runner,
    observer: Observer,
) -> Outcome:
    """Find the cylinders of a cloud that need not fit into memory.

    The result depends on the cloud, the configuration and the options but for threads, and not on the runner.

    Parameters
    ----------
    clouds : list of StreamedCloud
        The files of one cloud.
    selection : Selection
        Which points to use.
    config : Config
    options : Options
    scratch : Scratch
        Where what has been done before, if anything has, is gone on with.
    runner : Runner
        Who searches the tiles.
    observer : Observer
        Is told of the progress.

    Returns
    -------
    Outcome

    Raises
    ------
    ConfigError
        See `check_method`.
    InputError
        If no cylinder could be told from anything else in the cloud.
    """
    check_method(config)
    kept = thin(clouds, selection, scratch, observer)
    seen = survey_once(clouds, selection, scratch, observer, kept)
    most = points_for(options.memory)
    tree, margin = tree_of(seen, options.size, options.buffer, most)
    known = config.scene
    extent = float(np.linalg.norm(seen.bounds[1] - seen.bounds[0]))
    largest = known.radius_max or max(0.5 * extent, known.radius_min or 0.0)
    large = LARGE * usual_side(tree, seen.sample)
    of_tiles = config.model_copy(update={"scene": known.model_copy(update={"radius_max": largest})})
    plan = Plan(scratch, of_tiles, tree.boxes, margin, large, options.threads, options.rejected)
    counts = cut(clouds, selection, scratch, tree, margin, observer, kept)
    tiles = list(range(len(tree)))
    whole = [WHOLE] if len(tree) > 1 and 0.0 < large < largest else []
    if whole and not scratch.has(points_name(WHOLE)):
        few = seen.sample[:: -(-len(seen.sample) // THINNED)]  # they were drawn: any of them are spread evenly
        scratch.append(points_name(WHOLE), few)
    _run(runner, search_tile, plan, [*whole, *tiles], "tiles", observer)
    found = {tile: found_in(scratch, tile) for tile in [*tiles, *whole]}
    scene = scene_of([found[tile] for tile in tiles], extent, config)
    groups = write_groups(plan, found, scene)
    _run(runner, gather_tile, plan, tiles if groups else [], "gathering", observer)
    tell_tiles(scratch, groups, len(tree))
    _run(runner, join_group, plan, groups, "joining", observer)
    finals = write_finals(scratch, groups)
    _run(runner, label_tile, plan, tiles, "labelling", observer)
    cylinders, blends, ids = in_order(scratch, finals, len(tree), config)
    tiling = Tiling(len(tree), options.size, margin, max(counts), len(groups))
    before = sum(len(found[tile]["parts"]) for tile in found)
    joining = joining_report(before, len(finals), len(cylinders) + len(blends))
    extraction = TiledExtraction(
        tuple(cylinders),
        tuple(cloud.source for cloud in clouds),
        seen.rows,
        seen.bounds,
        replace(selection, scan=clouds[0].source.selection.scan),
        scene,
        (*stages_of([found[tile] for tile in tiles]), joining),
        resolve(config, scene),
        tiling,
        tuple(warnings_of(clouds, seen, scene, cylinders)),
        tuple(blends) if config.verification.enabled and config.verification.blends else None,
        rejected_in(scratch, len(tree)) if options.rejected else (),
    )
    return Outcome(extraction, Labels(scratch, len(tree), ids), seen.colored)


def _run(
    runner: Runner,
    work: Callable[[Plan, int], object],
    plan: Plan,
    numbers: Sequence[int],
    name: str,
    observer: Observer,
) -> None:
    """Run a step on all tiles or groups."""
    answers = runner.run(partial(_done, work, plan), numbers, lambda: observer.stage_advanced(0))
    with stage(observer, name, len(numbers)), closing(answers):  # nobody works on after an error or Ctrl-C
        for _ in answers:
            observer.stage_advanced(1)


def _done(work: Callable[[Plan, int], object], plan: Plan, number: int) -> int:
    """Do one task; what it gives is in the scratch folder."""
    work(plan, number)
    return number
