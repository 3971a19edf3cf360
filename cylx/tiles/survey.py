"""The first reading of a cloud: its bounds, how many points it has, and a sample of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.io.streamed_cloud import StreamedCloud
from cylx.records import Selection
from cylx.scene import rows_selected

COLORS = ("red", "green", "blue")
Kept = Callable[[int, int], NDArray[np.bool_]]
"""Tells for a first row, counted over all files, and a number of rows which of them are used."""
_MIX = (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
"""Odd numbers that mix the digits of a row's number: rows are drawn by it, whatever pieces they come in."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What is known of a cloud after one reading.

    Parameters
    ----------
    rows : tuple of int
        Of each file.
    points : int
        Finite, and selected.
    bounds : ndarray of shape (2, 3)
        Least and greatest coordinates.
    sample : ndarray of shape (n, 3)
        Some of the points, in their order.
    colored : tuple of bool
        Whether each file has colours that are not all 0.
    """

    rows: tuple[int, ...]
    points: int
    bounds: FloatArray
    sample: FloatArray
    colored: tuple[bool, ...]


def hashes(numbers: IndexArray) -> NDArray[np.uint64]:
    """Return a number without pattern for each number, evenly spread over 64 bits."""
    with np.errstate(over="ignore"):
        mixed = numbers.astype(np.uint64) * np.uint64(_MIX[0])
        mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(_MIX[1])
        mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(_MIX[2])
        return np.asarray(mixed ^ (mixed >> np.uint64(31)))


def points_of(
    clouds: Iterable[StreamedCloud],
    selection: Selection,
    look: Callable[[int, NDArray[np.void]], None] | None = None,
    kept: Kept | None = None,
) -> Iterator[tuple[FloatArray, IndexArray]]:
    """Yield the finite selected points of clouds, one after the other, and their row numbers counted over all.

    Of a box that is selected, only what it may reach is read where the files say where their points are.

    Parameters
    ----------
    clouds : iterable of StreamedCloud
    selection : Selection
        `voxel` is left to `kept`, and `scan` is ignored.
    look : callable, optional
        Is shown the number of the cloud and its rows as read.
    kept : callable, optional
        Tells which rows are used; all by default.
    """
    before = 0
    for number, cloud in enumerate(clouds):
        for start, table in cloud.reached(selection.crop):
            if look is not None:
                look(number, table)
            points = cloud.coordinates(table)
            rows = before + np.arange(start, start + len(table))
            keep = np.isfinite(points).all(axis=1)
            keep &= rows_selected(selection, points, table, rows, cloud.source.file)
            if kept is not None:
                keep &= kept(before + start, len(table))
            yield points[keep], rows[keep]
        before += cloud.rows


def survey(
    clouds: list[StreamedCloud],
    selection: Selection,
    most: int,
    advance: Callable[[int], None],
    kept: Kept | None = None,
) -> Survey:
    """Read clouds once.

    Parameters
    ----------
    clouds : list of StreamedCloud
    selection : Selection
    most : int
        Points of the sample, about; the smaller half of it is left.
    advance : callable
        Is told of the rows that were read.
    kept : callable, optional
        Tells which rows are used; all by default.

    Returns
    -------
    Survey
    """
    low, high, count = np.full(3, np.inf), np.full(3, -np.inf), 0
    shift, held, drawn_points, sampled = 0, 0, [np.empty((0, 3))], [np.empty(0, np.uint64)]
    colored = [False] * len(clouds)

    def look(number: int, table: NDArray[np.void]) -> None:
        advance(len(table))
        if not colored[number] and set(COLORS) <= set(table.dtype.names or ()):
            colored[number] = any(bool(table[color].any()) for color in COLORS)

    for points, rows in points_of(clouds, selection, look, kept):
        if not len(points):
            continue
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
        count += len(points)
        drawn = hashes(rows)
        on = drawn >> np.uint64(64 - shift) == 0 if shift else np.ones(len(rows), np.bool_)
        drawn_points.append(points[on])
        sampled.append(drawn[on])
        held += int(on.sum())
        while held > most:
            shift += 1
            everything, drawn = np.concatenate(drawn_points), np.concatenate(sampled)
            on = drawn >> np.uint64(64 - shift) == 0
            drawn_points, sampled, held = [everything[on]], [drawn[on]], int(on.sum())
    rows_of = tuple(cloud.rows for cloud in clouds)
    return Survey(rows_of, count, np.array([low, high]), np.concatenate(drawn_points), tuple(colored))
