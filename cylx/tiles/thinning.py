"""One point of each voxel of a cloud that does not fit into memory: the same points as of one that does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.io.scratch import Scratch
from cylx.io.streamed_cloud import StreamedCloud
from cylx.records import Observer, Selection
from cylx.scene import check_voxel, one_a_voxel
from cylx.tiles.cutting import stage
from cylx.tiles.survey import Kept, hashes, points_of

A_SHARE = 1 << 20
"""Rows of the cloud for each share of its voxels that is looked at by itself."""
A_RANGE = 1 << 24
"""Rows that are marked together."""
FLUSHED = 1 << 20
"""Points that wait to be written."""
THINNED, DONE = "thinned", "thinned.json"
"""Names in the scratch folder: a byte a row, which tells whether it is used, and the number of rows used."""


def thin(clouds: list[StreamedCloud], selection: Selection, scratch: Scratch, observer: Observer) -> Kept | None:
    """Choose one point of each voxel, as `one_a_voxel` does; return what tells which rows are used.

    Of each piece of the cloud one point a voxel is left at once. What is left goes into shares on the disk by the
    voxels, each small enough to be looked at by itself, and so the choice does not depend on the pieces.

    Parameters
    ----------
    clouds : list of StreamedCloud
    selection : Selection
    scratch : Scratch
    observer : Observer

    Returns
    -------
    callable or None
        Gives for a first row and a number of rows whether each is used; None if all are, without voxels.
    """
    if selection.voxel is None:
        return None
    rows = sum(cloud.rows for cloud in clouds)
    if not scratch.has(DONE):
        shares, ranges = max(1, -(-rows // A_SHARE)), -(-rows // A_RANGE)
        for name in (THINNED, *map(_points_of_share, range(shares)), *map(_rows_of_share, range(shares))):
            scratch.remove(name)  # of a run that was killed
        for number in range(ranges):
            scratch.remove(_range(number))
        with stage(observer, "thinning", rows):
            _share_out(clouds, selection, selection.voxel, scratch, shares, observer.stage_advanced)
            for share in range(shares):
                observer.stage_advanced(0)
                _choose(scratch, share, selection.voxel)
            used = _mark(scratch, rows)
        scratch.write_json(DONE, used)
    return lambda start, count: scratch.part(THINNED, np.bool_, start, count)


def _points_of_share(share: int) -> str:
    return f"voxel-points-{share}"


def _rows_of_share(share: int) -> str:
    return f"voxel-rows-{share}"


def _range(number: int) -> str:
    return f"voxel-range-{number}"


def _share_out(
    clouds: list[StreamedCloud],
    selection: Selection,
    side: float,
    scratch: Scratch,
    shares: int,
    advance: Callable[[int], None],
) -> None:
    """Write each point into the share of its voxel, but for those that another one of its piece is better than."""
    waiting: dict[int, list[tuple[FloatArray, IndexArray]]] = {}
    held = 0
    for points, rows in points_of(clouds, selection, lambda _, table: advance(len(table))):
        if not len(points):
            continue
        check_voxel(points, side, clouds[0].source.file)
        left = one_a_voxel(points, side)
        share_of = _shares_of(points[left], side, shares)
        order = np.argsort(share_of, kind="stable")
        numbers, starts = np.unique(share_of[order], return_index=True)
        for share, members in zip(numbers.tolist(), np.split(left[order], starts[1:]), strict=True):
            waiting.setdefault(share, []).append((points[members], rows[members]))
        held += len(left)
        if held > FLUSHED:
            _flush(scratch, waiting)
            held = 0
    _flush(scratch, waiting)


def _shares_of(points: FloatArray, side: float, shares: int) -> IndexArray:
    """Return the number of the share of each point: voxels are spread evenly over them, whatever the cloud."""
    cells = np.floor(points / side).astype(np.int64)
    mixed = np.zeros(len(points), np.uint64)
    for axis in range(3):
        mixed = hashes((mixed ^ cells[:, axis].astype(np.uint64)).astype(np.int64))
    return np.asarray((mixed % np.uint64(shares)).astype(np.int64))


def _flush(scratch: Scratch, waiting: dict[int, list[tuple[FloatArray, IndexArray]]]) -> None:
    for share, pieces in waiting.items():
        scratch.append(_points_of_share(share), np.concatenate([points for points, _ in pieces]))
        scratch.append(_rows_of_share(share), np.concatenate([rows for _, rows in pieces]))
    waiting.clear()


def _choose(scratch: Scratch, share: int, side: float) -> None:
    """Choose the points of a share, and write their rows by the ranges that they lie in."""
    points = scratch.rows(_points_of_share(share), np.float64, 3)
    rows = scratch.rows(_rows_of_share(share), np.int64)
    if len(points):
        chosen = rows[one_a_voxel(points, side)]
        for number in np.unique(chosen // A_RANGE).tolist():
            scratch.append(_range(number), chosen[chosen // A_RANGE == number])
    scratch.remove(_points_of_share(share))
    scratch.remove(_rows_of_share(share))


def _mark(scratch: Scratch, rows: int) -> int:
    """Write for each row whether it is used; return how many are."""
    used = 0
    for number, first in enumerate(range(0, rows, A_RANGE)):
        marks: NDArray[np.bool_] = np.zeros(min(A_RANGE, rows - first), np.bool_)
        marks[scratch.rows(_range(number), np.int64) - first] = True
        scratch.append(THINNED, marks)
        scratch.remove(_range(number))
        used += int(marks.sum())
    return used
