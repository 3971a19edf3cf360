"""MSAC: sample consensus over pairs of oriented points, one cylinder after the other.

After P. H. S. Torr and A. Zisserman, "MLESAC: a new robust estimator with application to estimating image geometry",
Computer Vision and Image Understanding 78 (2000), with the cylinder through two points and their normals. The paper's
description: at most 5000 iterations, a greatest distance of 3 % of the radius, normals by planes through the
neighbours, and all points within 5 % of the radius of a cylinder's surface are removed before the next search.

Our readings, where the paper says nothing: all iterations are run, rather than as many as a target probability needs;
inliers are decided by distance only, not by the angle of the normals; the best sample is the result, without a fit to
its inliers (`refine` adds one); and the search ends with a cylinder that too small a share of the points supports.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.baselines.limits import Limits
from cylx.baselines.normals import normals_for
from cylx.baselines.proposal import Proposal
from cylx.config import MsacConfig
from cylx.fits.robust import WeightSchedule, fit_cylinder
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, UX, UY, UZ, cylinder_coordinates
from cylx.geometry.kernels import njit
from cylx.records import Frame

LEAST_SINE = 1e-4
"""Normals that are more nearly parallel than this define no axis."""
CHUNK = 250
"""Hypotheses per task of a thread; does not depend on the number of threads."""
UNBOUNDED_WIDTH = 1e6
"""With a weight function this many times wider than the inliers' distance all points have the same weight."""


def find_by_consensus(
    frame: Frame,
    limits: Limits,
    config: MsacConfig,
    *,
    rng: np.random.Generator,
    threads: int,
) -> Iterator[Proposal]:
    """Find cylinders by MSAC, the best supported one first.

    Parameters
    ----------
    frame : Frame
    limits : Limits
    config : MsacConfig
        Resolved.
    rng : numpy.random.Generator
    threads : int
        Does not change the result.

    Yields
    ------
    Proposal

    Raises
    ------
    ConfigError
        If open3d cannot be imported.
    """
    # in random order, the loss of a bad hypothesis exceeds the best one's after a few points
    order = rng.permutation(len(frame.points))
    points = frame.points[order]
    normals = normals_for("msac", frame.points, config.neighbours)[order]
    distance = (config.distance or 0.0) / frame.spacing
    least = max(6, math.ceil(config.min_share * len(points)))
    while len(points) >= least:
        pairs = rng.integers(len(points), size=(config.iterations, 2))
        model = _best_of(points, normals, pairs, distance, limits.numbers, threads)
        if model is None:
            return
        _, distances, _ = cylinder_coordinates(points, model[POINT], model[DIRECTION])
        inliers = np.abs(distances - model[RADIUS]) < distance
        if int(inliers.sum()) < least:
            return
        if config.refine:
            model = _refined(points[inliers], model, distance)
            _, distances, _ = cylinder_coordinates(points, model[POINT], model[DIRECTION])
        yield Proposal.spanning(model[POINT], model[DIRECTION], float(model[RADIUS]), points[inliers], 1)
        left = np.abs(distances - model[RADIUS]) > config.removal * model[RADIUS]
        if left.all():  # the same one would be found again and again
            return
        points, normals = points[left], normals[left]


def _best_of(
    points: FloatArray, normals: FloatArray, pairs: IndexArray, distance: float, limits: FloatArray, threads: int
) -> FloatArray | None:
    """Return the cylinder of least loss among those of all pairs of points."""

    def work(start: int) -> tuple[float, int, FloatArray]:
        model = np.empty(7)
        loss = _search(points, normals, pairs[start : start + CHUNK], distance, limits, model)
        return loss, start, model

    with ThreadPoolExecutor(threads) as pool:
        best = min(pool.map(work, range(0, len(pairs), CHUNK)), key=lambda one: one[:2])
    return best[2] if math.isfinite(best[0]) else None


@njit(cache=True, nogil=True)
def _search(
    points: FloatArray, normals: FloatArray, pairs: IndexArray, distance: float, limits: FloatArray, best: FloatArray
) -> float:
    """Fill `best` (7,) with the cylinder of least loss; return the loss, infinite if no pair gives a cylinder."""
    record = math.inf
    model = np.empty(7)
    for k in range(len(pairs)):
        if not _cylinder_through(points, normals, pairs[k, 0], pairs[k, 1], limits, model):
            continue
        loss = _loss(points, model, distance, record)
        if loss < record:
            record = loss
            for d in range(len(best)):
                best[d] = model[d]
    return record


@njit(cache=True, nogil=True)
def _cylinder_through(
    points: FloatArray, normals: FloatArray, i: int, j: int, limits: FloatArray, model: FloatArray
) -> bool:
    """Fill `model` with the cylinder through two oriented points; return whether there is one within the limits.

    The axis is along the cross product of the normals, through the point where the lines of the normals cross in
    projection along it. The radius is the mean distance of the points from it.
    """
    a0, a1, a2 = normals[i, 0], normals[i, 1], normals[i, 2]
    b0, b1, b2 = normals[j, 0], normals[j, 1], normals[j, 2]
    v0, v1, v2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    sine = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    if sine < LEAST_SINE:
        return False
    v0, v1, v2 = v0 / sine, v1 / sine, v2 / sine
    if abs(v0 * limits[2] + v1 * limits[3] + v2 * limits[4]) < limits[5]:
        return False
    w0, w1, w2 = v1 * a2 - v2 * a1, v2 * a0 - v0 * a2, v0 * a1 - v1 * a0
    dx, dy, dz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    across = b0 * w0 + b1 * w1 + b2 * w2
    t = -(dx * w0 + dy * w1 + dz * w2) / across
    s = dx * a0 + dy * a1 + dz * a2 + t * (a0 * b0 + a1 * b1 + a2 * b2)
    radius = 0.5 * (abs(s) + abs(t))
    if not (limits[0] <= radius <= limits[1]):
        return False
    model[0], model[1], model[2] = points[i, 0] + s * a0, points[i, 1] + s * a1, points[i, 2] + s * a2
    model[UX], model[UY], model[UZ], model[RADIUS] = v0, v1, v2, radius
    return True


@njit(cache=True, nogil=True)
def _loss(points: FloatArray, model: FloatArray, distance: float, record: float) -> float:
    """Sum the squared distances to the surface, each limited to `distance`; stop when the sum exceeds the record."""
    loss, most = 0.0, distance * distance
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - model[0], points[i, 1] - model[1], points[i, 2] - model[2]
        height = dx * model[UX] + dy * model[UY] + dz * model[UZ]
        off = math.sqrt(max(0.0, dx * dx + dy * dy + dz * dz - height * height)) - model[RADIUS]
        loss += min(off * off, most)
        if loss >= record:
            return math.inf
    return loss


def _refined(inliers: FloatArray, model: FloatArray, distance: float) -> FloatArray:
    """Fit a cylinder to its inliers by least squares of the orthogonal distances."""
    wide = UNBOUNDED_WIDTH * distance
    fit = fit_cylinder(
        inliers, model, low=-math.inf, high=math.inf, schedule=WeightSchedule(wide, wide, 1.0, math.inf), steps=50
    )
    return model if fit is None else fit[0]
