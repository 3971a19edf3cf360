"""The payoff of pairs of cylinders: how well two hypotheses play together (section 3.1, eq. 1, 2, 5 and 6)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cylx.game import SparsePayoff
from cylx.geometry.dual_quaternions import pairwise_screw_distances

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

CUT = 0.1
"""Local payoffs below this are zero."""
REACH = 4.0
"""Candidates play against those within this many radii, or their own extent if that is more."""


def screw_payoff(models: FloatArray, parents: IndexArray, scale: float, min_ratio: float) -> FloatArray:
    """Give the paper's payoff (eq. 2, 5 and 6) of all pairs, shape (M, M), with a zero diagonal.

    Lengths are measured in the median radius of the candidates and from the middle of their points: eq. 1 mixes radians
    with lengths and depends on the origin, and so the paper's own experiments, a cylinder of radius 1 at the origin,
    are met exactly.

    Parameters
    ----------
    models : ndarray of shape (M, 7)
        Points of the axes, unit directions, radii.
    parents : ndarray of shape (M,)
        Candidates of one parent are incompatible (eq. 5).
    scale : float
        Lambda of eq. 2.
    min_ratio : float
        p of eq. 2.
    """
    if len(models) == 0:
        return np.zeros((0, 0))
    unit = float(np.median(models[:, 6]))
    middle = np.median(models[:, :3], axis=0)
    radii = models[:, 6] / unit
    distance, gap = pairwise_screw_distances((models[:, :3] - middle) / unit, models[:, 3:6])
    ratio = np.minimum.outer(radii, radii) / np.maximum.outer(radii, radii)
    compatible = (gap < np.add.outer(radii, radii)) & (ratio > min_ratio) & (parents[:, None] != parents[None, :])
    return np.where(compatible, np.exp(-distance / scale), 0.0)  # eq. 2 and 5


def local_payoff(
    models: FloatArray,
    parents: IndexArray,
    extents: FloatArray,
    angle: float,
    offset: float,
    radius: float,
    min_ratio: float,
) -> SparsePayoff:
    """Give the payoffs of all pairs within reach: angle, offset at the candidates in radii, ratio of radii.

    Parameters
    ----------
    models : ndarray of shape (M, 7)
        The places the candidates speak for, unit directions, radii.
    parents : ndarray of shape (M,)
        Candidates of one parent are incompatible.
    extents : ndarray of shape (M,)
        A candidate reaches as far as its extent, at least four radii.
    angle, offset, radius : float
        Where the payoff has fallen to 1/e: radians, radii, relative difference.
    min_ratio : float
        Candidates whose radii differ more are incompatible.

    Returns
    -------
    SparsePayoff
        exp(-sqrt((angle / a)^2 + (offset / o)^2 + ((1 - ratio) / p)^2)) where it exceeds 0.1, else nothing.
    """
    order = np.argsort(models[:, 6], kind="stable")
    models = np.ascontiguousarray(models[order])
    parents, extents = parents[order], extents[order]
    least_ratio = max(min_ratio, 1.0 + math.log(CUT) * radius)
    widths = angle, offset, radius
    counts = np.zeros(len(models) + 1, np.int64)
    nothing = np.empty(0, np.int64), np.empty(0)
    _pairs(models, parents, extents, least_ratio, *widths, counts[1:], np.empty(0, np.int64), *nothing, False)
    pointers = np.cumsum(counts)
    columns, values = np.empty(pointers[-1], np.int64), np.empty(pointers[-1])
    _pairs(models, parents, extents, least_ratio, *widths, counts[1:], pointers[:-1].copy(), columns, values, True)
    # back from the order of radii to the order of the candidates
    rows = order[np.repeat(np.arange(len(models)), counts[1:])]
    columns = order[columns]
    sort = np.lexsort((columns, rows))
    starts = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=len(models))))).astype(np.int64)
    return SparsePayoff(starts, columns[sort], values[sort])


@njit(cache=True, nogil=True)
def _pairs(
    models: FloatArray,
    parents: IndexArray,
    extents: FloatArray,
    least_ratio: float,
    angle: float,
    offset: float,
    radius: float,
    counts: IndexArray,
    ends: IndexArray,
    columns: IndexArray,
    values: FloatArray,
    fill: bool,
) -> None:
    """Count the pairs of each row, or fill them in at `ends`; the models come by ascending radius."""
    bound = -math.log(CUT)
    sine = math.sin(min(1.5, bound * angle))
    for i in range(len(models)):
        for j in range(i + 1, len(models)):
            ratio = models[i, 6] / models[j, 6]
            if ratio < least_ratio:
                break
            mean = 0.5 * (models[i, 6] + models[j, 6])
            reach = max(REACH * mean, max(extents[i], extents[j]))
            dx, dy, dz = models[j, 0] - models[i, 0], models[j, 1] - models[i, 1], models[j, 2] - models[i, 2]
            square = dx * dx + dy * dy + dz * dz
            if square > reach * reach or parents[i] == parents[j]:
                continue
            cx = models[i, 4] * models[j, 5] - models[i, 5] * models[j, 4]
            cy = models[i, 5] * models[j, 3] - models[i, 3] * models[j, 5]
            cz = models[i, 3] * models[j, 4] - models[i, 4] * models[j, 3]
            turn = math.sqrt(cx * cx + cy * cy + cz * cz)
            if turn > sine:
                continue
            a = dx * models[i, 3] + dy * models[i, 4] + dz * models[i, 5]
            b = dx * models[j, 3] + dy * models[j, 4] + dz * models[j, 5]
            shift = 0.5 * (math.sqrt(max(0.0, square - a * a)) + math.sqrt(max(0.0, square - b * b))) / mean
            strangeness = (math.asin(min(1.0, turn)) / angle) ** 2 + (shift / offset) ** 2
            strangeness += ((1.0 - ratio) / radius) ** 2
            if strangeness > bound * bound:
                continue
            if fill:
                value = math.exp(-math.sqrt(strangeness))
                columns[ends[i]], values[ends[i]] = j, value
                columns[ends[j]], values[ends[j]] = i, value
                ends[i] += 1
                ends[j] += 1
            else:
                counts[i] += 1
                counts[j] += 1
