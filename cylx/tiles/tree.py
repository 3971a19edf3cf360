"""The boxes of the tiles: a tree of planes along the axes, so that dense places get small tiles and empty ones none."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray

MOST_TILES = 100_000
"""More are a mistake in the size of a tile."""
DEEPEST = 60
"""Cuts from the whole to a tile; points that lie on one place cannot be told apart by cuts."""
LEFT_OUT = 0.01
"""Share of the points on either side that do not count for how wide a box is: a few are far from all others."""
NARROWEST = 4.0
"""A tile is not cut narrower than so many margins."""


class Cut(NamedTuple):
    """A plane across an axis, and the numbers of the nodes on either side: those from the first tile on are tiles."""

    axis: int
    place: float
    below: int
    above: int


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A box cut into tiles.

    Parameters
    ----------
    cuts : tuple of Cut
        The first is of the whole. A negative number of a side is that of a tile, -1 for tile 0.
    boxes : ndarray of shape (T, 2, 3)
        Least and greatest coordinates of each tile, infinite where nothing adjoins.
    """

    cuts: tuple[Cut, ...]
    boxes: FloatArray

    def __len__(self) -> int:
        return len(self.boxes)

    def spread(self, points: FloatArray, margin: float) -> Iterator[tuple[int, IndexArray, IndexArray]]:
        """Yield the tiles that points fall into, with the indices of those inside and of those in the margin.

        Parameters
        ----------
        points : ndarray of shape (n, 3)
        margin : float
            Distance from a tile, along an axis, up to which a point belongs to its margin.
        """
        todo = [(0 if self.cuts else -1, np.arange(len(points)), np.empty(0, np.int64))]
        while todo:
            node, inside, beside = todo.pop()
            if not len(inside) and not len(beside):
                continue
            if node < 0:
                yield -1 - node, inside, beside
                continue
            cut = self.cuts[node]
            at, near = points[inside, cut.axis], points[beside, cut.axis]
            below = at < cut.place
            over = inside[~below & (at < cut.place + margin)], inside[below & (at >= cut.place - margin)]
            lower = np.concatenate([beside[near < cut.place + margin], over[0]])
            upper = np.concatenate([beside[near >= cut.place - margin], over[1]])
            todo.append((cut.above, inside[~below], upper))
            todo.append((cut.below, inside[below], lower))


class _Box(NamedTuple):
    """A box with the sampled points in it."""

    points: FloatArray
    low: FloatArray
    high: FloatArray
    depth: int


def grow_tree(
    sample: FloatArray, most: float, *, size: float | None, corner: FloatArray, margin: float | None = None
) -> Tree:
    """Cut a cloud into tiles.

    A box with too many points is cut across its longest side, into shares for half of the tiles that it needs each: at
    the median if that number is even. With a size given, boxes are first cut at multiples of it from the corner of the
    cloud.

    Parameters
    ----------
    sample : ndarray of shape (n, 3)
        Points drawn evenly from the cloud.
    most : float
        Sampled points that a tile may hold.
    size : float or None
        Greatest side of a tile, scene units.
    corner : ndarray of shape (3,)
        Least coordinates of the cloud.
    margin : float, optional
        Of the tiles, if it is known.

    Returns
    -------
    Tree
    """
    cuts: list[Cut] = []
    boxes: list[FloatArray] = []
    everywhere = np.full(3, math.inf)

    def grow(box: _Box) -> int:
        found = _cut_of(box, most, size, corner, NARROWEST * (margin or 0.0)) if len(boxes) < MOST_TILES else None
        if found is None:
            boxes.append(np.array([box.low, box.high]))
            return -len(boxes)
        axis, place = found
        here = len(cuts)
        cuts.append(Cut(axis, place, 0, 0))
        below = box.points[:, axis] < place
        middle_high, middle_low = box.high.copy(), box.low.copy()
        middle_high[axis] = middle_low[axis] = place
        lower = grow(_Box(box.points[below], box.low, middle_high, box.depth + 1))
        upper = grow(_Box(box.points[~below], middle_low, box.high, box.depth + 1))
        cuts[here] = Cut(axis, place, lower, upper)
        return here

    grow(_Box(sample, -everywhere, everywhere, 0))
    return Tree(tuple(cuts), np.array(boxes))


def usual_side(tree: Tree, sample: FloatArray) -> float:
    """Return the median over the tiles of their longest side, as far as there are points in them."""
    sides = []
    for _, inside, _ in tree.spread(sample, 0.0):
        widths = _widths(sample[inside])
        if widths.any():
            sides.append(float(widths.max()))
    return float(np.median(sides)) if sides else 0.0


def _widths(points: FloatArray) -> FloatArray:
    """Return how wide points are spread along each axis, but for a few of them."""
    if not len(points):
        return np.zeros(3)
    low, high = np.quantile(points, [LEFT_OUT, 1.0 - LEFT_OUT], axis=0)
    return np.asarray(high - low)


def _cut_of(
    box: _Box, most: float, size: float | None, corner: FloatArray, narrowest: float
) -> tuple[int, float] | None:
    """Return the axis and the place of the next cut; None if the box is a tile."""
    if len(box.points) < 2 or box.depth >= DEEPEST:
        return None
    if size is not None:
        # a few points beyond the last multiple, such as noise has, are no reason for another tile
        low, high = np.quantile(box.points, [LEFT_OUT, 1.0 - LEFT_OUT], axis=0)
        first, last = np.floor((low - corner) / size), np.floor((high - corner) / size)
        if (last > first).any():
            axis = int((last - first).argmax())
            return axis, float(corner[axis] + size * math.ceil(0.5 * (first[axis] + last[axis] + 1.0)))
    if len(box.points) <= most:
        return None
    widths = _widths(box.points)
    needed = math.ceil(len(box.points) / most)
    share = (needed // 2) / needed
    for axis in np.argsort(-widths, kind="stable"):
        values = box.points[:, axis]
        place = float(np.quantile(values, share))
        if widths[axis] > narrowest and values.min() < place:
            return int(axis), place
    return None
