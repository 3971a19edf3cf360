"""Select the points that a report shows, and pack them into few bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.records import PointCloud

STEPS_ACROSS_BOX = 65535
"""Number of steps of a coordinate across the bounding box."""
LEAST_OF_EACH_CYLINDER = 200
"""Minimum number of points shown per cylinder, if it has that many."""
NO_RESIDUAL = -128


def choose_points(labels: NDArray[np.int32], most: int, rng: np.random.Generator) -> IndexArray:
    """Choose the points to show, from each cylinder and from the rest, evenly along the order of the cloud.

    Parameters
    ----------
    labels : ndarray of shape (N,)
        Cylinder of each point, -1 for none.
    most : int
        Maximum number of points chosen.
    rng : numpy.random.Generator
        Chooses one point in each stretch of the order, which avoids patterns of the scanner.

    Returns
    -------
    ndarray of shape (n,)
        Indices, shuffled: any first part of them is also an even choice.
    """
    if len(labels) <= most:
        return rng.permutation(len(labels))
    order = np.argsort(labels, kind="stable")
    counts = np.bincount(labels + 1)
    ends = np.cumsum(counts)
    quotas = _quotas(counts, most)
    parts = []
    for end, count, quota in zip(ends, counts, quotas, strict=True):
        borders = end - count + np.arange(quota + 1) * count // max(quota, 1)
        widths = np.diff(borders)
        parts.append(order[borders[:-1] + (rng.random(quota) * widths).astype(np.int64)])
    return rng.permutation(np.concatenate(parts))


def _quotas(counts: IndexArray, most: int) -> IndexArray:
    """Distribute the number of points: a minimum to every cylinder, the rest by size."""
    least = np.minimum(counts, min(LEAST_OF_EACH_CYLINDER, most // (2 * len(counts))))
    rest = counts - least
    return np.asarray(least + rest * (most - least.sum()) // rest.sum(), dtype=np.int64)


def quantise(points: FloatArray) -> tuple[NDArray[np.uint16], FloatArray, FloatArray]:
    """Convert coordinates to integers of 16 bits within their bounding box.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        At least one; scene units.

    Returns
    -------
    steps : ndarray of shape (n, 3), uint16
        A coordinate is low + steps / 65535 * size, off by at most half a step.
    low, size : ndarray of shape (3,)
        The box, scene units.
    """
    low = points.min(axis=0)
    size = points.max(axis=0) - low
    steps = np.rint((points - low) * (STEPS_ACROSS_BOX / np.where(size > 0, size, 1.0)))
    return steps.astype("<u2"), low, size


def pack_labels(labels: NDArray[np.int32], cylinders: int) -> NDArray[np.unsignedinteger[Any]]:
    """Pack labels into one byte each, or two if necessary; the largest number means none."""
    kind = np.dtype("u1" if cylinders <= 255 else "<u2")
    none = np.iinfo(kind).max
    return np.where((labels < 0) | (labels >= none), none, labels).astype(kind)


def pack_residuals(residuals: FloatArray, limit: float) -> NDArray[np.int8]:
    """Pack residuals as multiples of a 127th of `limit`, clipped to it; -128 means none."""
    scaled = np.rint(np.clip(np.nan_to_num(residuals) / limit, -1.0, 1.0) * 127)
    return np.where(np.isnan(residuals), NO_RESIDUAL, scaled).astype(np.int8)


def original_colors(cloud: PointCloud) -> NDArray[np.uint8] | None:
    """Return the colour of each finite point in its file, None if it had none.

    Parameters
    ----------
    cloud : PointCloud
        Its colours are `red`, `green` and `blue`, or packed in an `rgb` or `rgba` of four bytes.

    Returns
    -------
    ndarray of shape (N, 3), uint8, or None
    """
    table = cloud.table
    if table is None or table.dtype.names is None:
        return None
    rows = slice(None) if cloud.valid is None else cloud.valid
    if {"red", "green", "blue"} <= set(table.dtype.names):
        return np.column_stack([_byte(table[name][rows]) for name in ("red", "green", "blue")])
    for name in ("rgb", "rgba"):
        if name in table.dtype.names and table.dtype[name].shape == () and table.dtype[name].itemsize == 4:
            packed = np.ascontiguousarray(table[name][rows]).view(np.uint32)
            return np.column_stack([(packed >> shift).astype(np.uint8) for shift in (16, 8, 0)])
    return None


def _byte(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert a colour to 0 to 255: bytes as they are, 16 bits and fractions of one scaled."""
    if values.dtype == np.uint16:
        return (values >> 8).astype(np.uint8)
    values = np.nan_to_num(values.astype(np.float64))
    scale = 255.0 if len(values) and values.max() <= 1.0 else 1.0
    return np.clip(np.rint(values * scale), 0, 255).astype(np.uint8)
