"""Tile by tile: the cylinder of each point, and how many points each cylinder has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cells import Cells
from cylx.io.scratch import Scratch
from cylx.pipeline.joining import label_part
from cylx.records import IndexedCloud, Noise
from cylx.tiles.gather import touches
from cylx.tiles.parts import Part, in_frame
from cylx.tiles.search import Plan, frame_name, frame_points, inside_of, points_name, rows_name

FINAL = "final.json"
"""Name of the list of all cylinders and blends in the scratch folder."""


class Counts(NamedTuple):
    """The points of each cylinder, and the sum of their squared distances from the surface, scene units."""

    inliers: IndexArray
    squares: FloatArray


def label_tile(plan: Plan, tile: int) -> int:
    """Label the points of a tile; return how many have a label.

    Parameters
    ----------
    plan : Plan
    tile : int
    """
    scratch, done = plan.scratch, f"labels-{tile}.npz"
    if scratch.has(done):
        return len(scratch.read(done)["rows"])
    finals = [Part.of_object(one) for one in scratch.read_json(FINAL)]
    count = len(finals)
    inliers, squares = np.zeros(count, np.int64), np.zeros(count)
    here = [i for i, part in enumerate(finals) if touches(_tube(part), plan.boxes[tile])]
    rows, ids, residuals = np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, np.float32)
    if here and scratch.has(frame_name(tile)):
        held = scratch.read(frame_name(tile))
        spacing, origin = float(held["spacing"]), held["origin"]
        points = frame_points(scratch, tile, held)
        noise = Noise(
            held["sizes"], held["deviations"], float(held["side"]), held["cells"], held["factors"], held["patches"]
        )
        cells, flatness = Cells(points, held["codes"]), held["flatness"].astype(np.float64)
        indexed = IndexedCloud(cells, flatness, noise, held.get("normals"))
        places, in_tile = inside_of(held)
        groups = [i for i in here if not finals[i].finding.blend], [i for i in here if finals[i].finding.blend]
        segments = [[in_frame(finals[i].finding.segment, origin, spacing) for i in group] for group in groups]
        labelled = label_part(segments[0], segments[1], indexed)
        for (labels, distances), group in zip(labelled, groups, strict=True):
            own, far = labels[places], distances[places] * spacing
            on = own >= 0
            numbers = np.array(group, np.int64)[own[on]]
            inliers += np.bincount(numbers, minlength=count)
            squares += np.bincount(numbers, far[on] ** 2, minlength=count)
            if group is groups[0]:
                by_row = np.argsort(in_tile[on])
                rows = scratch.rows(rows_name(tile), np.int64)[in_tile[on][by_row]]
                ids, residuals = numbers[by_row].astype(np.int32), far[on][by_row].astype(np.float32)
    scratch.write(done, rows=rows, ids=ids, residuals=residuals, inliers=inliers, squares=squares)
    return len(rows)


def _tube(part: Part) -> FloatArray:
    """Return a cylinder and what may be on its surface as a corridor of one row."""
    segment = part.finding.segment
    width = segment.radius + 10.0 * segment.spread
    return np.array([[*segment.model[:6], width + 0.1 * segment.radius, segment.half]])


def counts_of(scratch: Scratch, tiles: int, count: int) -> Counts:
    """Add up the counts of all tiles."""
    inliers, squares = np.zeros(count, np.int64), np.zeros(count)
    for tile in range(tiles):
        held = scratch.read(f"labels-{tile}.npz")
        inliers += held["inliers"]
        squares += held["squares"]
    return Counts(inliers, squares)


class Labels:
    """The labels of all points, by the rows of the input.

    Parameters
    ----------
    scratch : Scratch
    tiles : int
        Number of tiles.
    ids : ndarray of shape (M,)
        The final number of each cylinder of the list; -1 for one that is left out.
    """

    def __init__(self, scratch: Scratch, tiles: int, ids: NDArray[np.int32]) -> None:
        self._scratch = scratch
        self._ids = np.append(ids, np.int32(-1))
        self._rows: list[NDArray[np.int64]] = []
        for tile in range(tiles):
            held = scratch.read(f"labels-{tile}.npz")
            # without a header, so that a piece of it can be read
            for name, values in (("row", held["rows"]), ("id", held["ids"]), ("residual", held["residuals"])):
                scratch.remove(f"{name}-of-{tile}")
                scratch.append(f"{name}-of-{tile}", values)
            # mapped: a search in it touches few of its pages
            self._rows.append(scratch.mapped(f"row-of-{tile}", np.int64))

    @property
    def points(self) -> int:
        """Number of points that were used."""
        return sum(self._scratch.size(rows_name(tile), np.int64) for tile in range(len(self._rows)))

    def tiles(self) -> Iterator[tuple[FloatArray, IndexArray, NDArray[np.int32], NDArray[np.float32]]]:
        """Yield points, row numbers, labels and residuals of each tile; without a label the residual is NaN."""
        for tile, labelled in enumerate(self._rows):
            rows = self._scratch.rows(rows_name(tile), np.int64)
            points = self._scratch.rows(points_name(tile), np.float64, 3)
            ids, residuals = np.full(len(rows), -1, np.int32), np.full(len(rows), np.nan, np.float32)
            count = len(labelled)
            own = self._ids[self._scratch.part(f"id-of-{tile}", np.int32, 0, count)]
            distances = self._scratch.part(f"residual-of-{tile}", np.float32, 0, count)
            places = np.searchsorted(rows, labelled)  # as they were read, so ascending
            ids[places], residuals[places] = own, np.where(own >= 0, distances, np.float32(np.nan))
            yield points, rows, ids, residuals

    def pieces(self, start: int, count: int, size: int) -> Iterator[tuple[NDArray[np.int32], NDArray[np.float32]]]:
        """Yield label and residual of the rows from one on, in pieces of a size."""
        at = [int(np.searchsorted(rows, start)) for rows in self._rows]
        for first in range(start, start + count, size):
            yield self._piece(first, min(size, start + count - first), at)

    def _piece(self, start: int, size: int, at: list[int]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        labels, residuals = np.full(size, -1, np.int32), np.full(size, np.nan, np.float32)
        for tile, rows in enumerate(self._rows):
            first = at[tile]
            stop = first + int(np.searchsorted(rows[first:], start + size))
            if stop == first:
                continue
            at[tile] = stop
            places, count = np.array(rows[first:stop]) - start, stop - first
            ids = self._ids[self._scratch.part(f"id-of-{tile}", np.int32, first, count)]
            labels[places] = ids
            distances = self._scratch.part(f"residual-of-{tile}", np.float32, first, count)
            residuals[places] = np.where(ids >= 0, distances, np.float32(np.nan))
        return labels, residuals
