"""A cloud is read and cut: each point goes into its tile on the disk, and into the margins it lies in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from cylx.errors import InputError
from cylx.io.scratch import Scratch
from cylx.io.streamed_cloud import StreamedCloud
from cylx.records import Observer, Selection
from cylx.scene import check_usable
from cylx.tiles.search import margin_name, points_name, rows_name
from cylx.tiles.survey import Kept, Survey, points_of, survey
from cylx.tiles.tree import Tree, grow_tree, usual_side

SAMPLED = 1 << 20
"""Points of the sample that tells where to cut, at the most."""
BUFFER = 0.1
"""Margin, in usual sides of a tile."""
FLUSHED = 1 << 20
"""Points that wait to be written into tiles."""


@contextmanager
def stage(observer: Observer, name: str, total: int | None = None) -> Iterator[None]:
    """Time a step for an observer."""
    started = perf_counter()
    observer.stage_started(name, total)
    yield
    observer.stage_finished(name, perf_counter() - started)


def survey_once(
    clouds: list[StreamedCloud], selection: Selection, scratch: Scratch, observer: Observer, kept: Kept | None = None
) -> Survey:
    """Read the cloud once, or what was kept of it before."""
    if not scratch.has("survey.npz"):
        with stage(observer, "reading", sum(cloud.rows for cloud in clouds)):
            seen = survey(clouds, selection, SAMPLED, observer.stage_advanced, kept)
        if not seen.points:
            raise InputError(clouds[0].source.file, "no point is selected", "select more")
        scratch.write(
            "survey.npz",
            rows=np.array(seen.rows),
            points=np.array(seen.points),
            bounds=seen.bounds,
            sample=seen.sample,
            colored=np.array(seen.colored),
        )
    held = scratch.read("survey.npz")
    rows, colored = tuple(map(int, held["rows"])), tuple(map(bool, held["colored"]))
    check_usable(held["sample"], clouds[0].source.file)
    return Survey(rows, int(held["points"]), held["bounds"], held["sample"], colored)


def tree_of(seen: Survey, size: float | None, buffer: float | None, most: int) -> tuple[Tree, float]:
    """Return the tiles of a cloud and their margin.

    Parameters
    ----------
    seen : Survey
    size : float or None
        Greatest side of a tile, scene units.
    buffer : float or None
        The margin, if it is given, scene units.
    most : int
        Points that a tile may hold.
    """
    share = len(seen.sample) / seen.points
    corner = seen.bounds[0]
    tree = grow_tree(seen.sample, most * share, size=size, corner=corner, margin=buffer)
    margin = buffer if buffer is not None else BUFFER * usual_side(tree, seen.sample)
    return tree, float(margin)


def cut(
    clouds: list[StreamedCloud],
    selection: Selection,
    scratch: Scratch,
    tree: Tree,
    margin: float,
    observer: Observer,
    kept: Kept | None = None,
) -> list[int]:
    """Write each point into its tile, and into the margins it lies in; return the points of each tile."""
    if scratch.has("cut.json"):
        return list(scratch.read_json("cut.json"))
    for tile in range(len(tree)):  # of a run that was killed
        for name in (points_name(tile), rows_name(tile), margin_name(tile)):
            scratch.remove(name)
    counts = [0] * len(tree)
    waiting: dict[str, list[np.ndarray[Any, Any]]] = {}
    held = 0
    with stage(observer, "cutting", sum(cloud.rows for cloud in clouds)):
        for points, rows in points_of(clouds, selection, lambda _, table: observer.stage_advanced(len(table)), kept):
            for tile, inside, beside in tree.spread(points, margin):
                counts[tile] += len(inside)
                held += len(inside) + len(beside)
                if len(inside):
                    waiting.setdefault(points_name(tile), []).append(points[inside])
                    waiting.setdefault(rows_name(tile), []).append(rows[inside])
                if len(beside):
                    waiting.setdefault(margin_name(tile), []).append(points[beside])
            if held > FLUSHED:
                _flush(scratch, waiting)
                held = 0
        _flush(scratch, waiting)
    scratch.write_json("cut.json", counts)
    return counts


def _flush(scratch: Scratch, waiting: dict[str, list[np.ndarray[Any, Any]]]) -> None:
    for name, pieces in waiting.items():
        scratch.append(name, np.concatenate(pieces))
    waiting.clear()
