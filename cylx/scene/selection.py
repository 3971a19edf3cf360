"""Select some of the points: those in a box or of some classes, every n-th row, or one per voxel."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylx.errors import InputError
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.records import Crop, PointCloud, Selection

_MOST_CELLS = float(1 << 52)  # along an axis; double precision cannot distinguish more
_CLASSES = "classification"


def select(cloud: PointCloud, selection: Selection) -> PointCloud:
    """Select some of a cloud's points for use; its table keeps all rows.

    A point is kept if it is in the box, of one of the classes, and in the first of every `every` rows of the file. Of
    the points kept so far, one per voxel is kept.

    Parameters
    ----------
    cloud : PointCloud
    selection : Selection
        `scan` is ignored, as it is applied while reading.

    Returns
    -------
    PointCloud
        The same cloud if nothing has to be left out, or if this selection has been applied to it already.

    Raises
    ------
    InputError
        If no point is left, the points have no classes, or the voxels are too small for the coordinates.
    ValueError
        If another selection has been applied to the cloud: the order would matter and would not be recorded.
    """
    selection = replace(selection, scan=cloud.source.selection.scan)
    if not selection.narrows or selection == cloud.source.selection:
        return cloud
    if cloud.source.selection.narrows:
        raise ValueError("the cloud is a selection already; select from the whole cloud")
    rows = np.arange(cloud.rows) if cloud.valid is None else np.flatnonzero(cloud.valid)
    keep = np.ones(len(rows), dtype=np.bool_)
    if selection.crop is not None:
        keep &= inside_box(cloud.points, selection.crop)
    if selection.classes is not None:
        keep &= np.isin(_classes_of(cloud)[rows], selection.classes)
    if selection.every is not None:
        keep &= rows % min(selection.every, cloud.rows) == 0
    if not keep.any():
        low, high = (_corner(corner) for corner in (cloud.points.min(axis=0), cloud.points.max(axis=0)))
        raise InputError(cloud.source.file, "no point is selected", f"select more; the points lie from {low} to {high}")
    if selection.voxel is not None:
        chosen = np.flatnonzero(keep)
        check_voxel(cloud.points, selection.voxel, cloud.source.file)
        keep[:] = False
        keep[chosen[one_a_voxel(cloud.points[chosen], selection.voxel)]] = True
    valid = np.zeros(cloud.rows, dtype=np.bool_)
    valid[rows[keep]] = True
    source = replace(cloud.source, selection=selection)
    return PointCloud(cloud.points[keep], _whole_table(cloud), None if valid.all() else valid, source)


def rows_selected(
    selection: Selection, points: FloatArray, table: NDArray[np.void], rows: IndexArray, place: str
) -> MaskArray:
    """Return which rows of a part of a cloud are selected, but for `voxel`, which needs all of them.

    Parameters
    ----------
    selection : Selection
    points : ndarray of shape (n, 3)
        Coordinates of the rows.
    table : ndarray of shape (n,), structured
    rows : ndarray of shape (n,)
        Numbers of the rows.
    place : str
        The cloud, for errors.

    Returns
    -------
    ndarray of shape (n,), bool

    Raises
    ------
    InputError
        If classes are asked for, and the points have none.
    """
    keep = np.ones(len(points), dtype=np.bool_)
    if selection.crop is not None:
        keep &= inside_box(points, selection.crop)
    if selection.classes is not None:
        if _CLASSES not in (table.dtype.names or ()):
            raise InputError(place, f"its points have no {_CLASSES}", "give a LAS or LAZ file that has it")
        keep &= np.isin(table[_CLASSES], selection.classes)
    if selection.every is not None:
        keep &= rows % selection.every == 0
    return keep


def inside_box(points: FloatArray, crop: Crop) -> MaskArray:
    """Return which points are in a box along the axes, sides included.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    crop : pair of triples of float or None
        Smallest and largest coordinates; None sets no bound.

    Returns
    -------
    ndarray of shape (N,), bool

    Examples
    --------
    >>> inside_box(np.array([[0.0, 0, 0], [0, 0, 9]]), ((None, None, None), (None, None, 5.0)))
    array([ True, False])
    """
    inside = np.ones(len(points), dtype=np.bool_)
    for axis, low, high in zip(range(3), *crop, strict=True):
        if low is not None:
            inside &= points[:, axis] >= low
        if high is not None:
            inside &= points[:, axis] <= high
    return inside


def one_a_voxel(points: FloatArray, side: float) -> IndexArray:
    """Choose in each voxel the point nearest to its middle.

    The voxels are cubes, and the origin of the coordinates is a corner of one of them. Hence the choice depends neither
    on the order of the points nor on the rest of the cloud. Of points equally near, the one with the smallest
    coordinates is chosen.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Coordinates of less than 2**52 sides.
    side : float
        Side of a voxel, scene units.

    Returns
    -------
    ndarray of shape (n,), int64
        Indices, ascending.
    """
    cells = np.floor(points / side)
    offsets = points / side - cells - 0.5
    distances = np.einsum("ij,ij->i", offsets, offsets)
    voxels, order = _grouped(cells)
    starts = np.flatnonzero(np.diff(voxels, prepend=-1))
    nearest = np.repeat(np.minimum.reduceat(distances[order], starts), np.diff(starts, append=len(order)))
    best = distances[order] == nearest
    order, voxels = order[best], voxels[best]
    ties = np.lexsort((*points[order].T[::-1], voxels))
    order, voxels = order[ties], voxels[ties]
    return np.sort(order[np.flatnonzero(np.diff(voxels, prepend=-1))])


def check_voxel(points: FloatArray, side: float, place: str) -> None:
    """Refuse voxels that the coordinates cannot tell apart.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        At least one.
    side : float
        Side of a voxel, scene units.
    place : str
        The cloud, for the error.

    Raises
    ------
    InputError
        If a coordinate is 2**52 sides or more.
    """
    with np.errstate(over="ignore"):
        if np.abs(points).max() / np.float64(side) >= _MOST_CELLS:
            fault = f"voxels of {side:g} are too small for these coordinates"
            raise InputError(place, fault, "use larger ones")


def _grouped(cells: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return an order that groups the points by voxel, and the number of the voxel of each point."""
    low = cells.min(axis=0)
    counts = cells.max(axis=0) - low + 1.0
    if counts.prod() < 2.0**62:
        step = cells - low
        keys = (step[:, 0].astype(np.int64) * int(counts[1]) + step[:, 1].astype(np.int64)) * int(counts[2])
        keys += step[:, 2].astype(np.int64)
        order = np.argsort(keys, kind="stable")
        return keys[order], order
    order = np.lexsort(cells.T)
    changes = (np.diff(cells[order], axis=0) != 0.0).any(axis=1)
    return np.concatenate([[0], np.cumsum(changes)]), order


def _classes_of(cloud: PointCloud) -> NDArray[Any]:
    if cloud.table is None or _CLASSES not in (cloud.table.dtype.names or ()):
        raise InputError(cloud.source.file, f"its points have no {_CLASSES}", "give a LAS or LAZ file that has it")
    return np.asarray(cloud.table[_CLASSES])


def _whole_table(cloud: PointCloud) -> NDArray[np.void]:
    """Return the table; if a cloud has none, make one from its points."""
    if cloud.table is not None:
        return cloud.table
    table = np.empty(cloud.rows, np.dtype([(axis, "f8") for axis in "xyz"]))
    for place, axis in enumerate("xyz"):
        table[axis] = cloud.spread(cloud.points[:, place], np.nan)
    return table


def _corner(corner: FloatArray) -> str:
    return ",".join(f"{side:.10g}" for side in corner)
