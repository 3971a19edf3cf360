"""Trials of many bends and reducers on the points ahead of an end: kernels that score all of them."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arc import arc_place
from cylx.geometry.arrays import FloatArray
from cylx.geometry.kernels import njit


@njit(cache=True, nogil=True)
def gain_of(error: float, spread: float, ratio: float) -> float:
    """Return how much a point speaks for a surface: its log-likelihood ratio, no less than against it at most."""
    return max(ratio - 0.5 * (error / spread) ** 2, -ratio)


@njit(cache=True, nogil=True)
def fill_radius_costs(
    points: FloatArray,
    corner: FloatArray,
    angle: float,
    radii: FloatArray,
    tube: float,
    width: float,
    costs: FloatArray,
) -> None:
    """Fill in how badly bends of several radii between two axes explain the points that some of them explain.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    corner : ndarray of shape (5, 3)
        Where the axes meet, the directions into the bend and out of it, its normal, and inward at its beginning.
    angle : float
        Radians.
    radii : ndarray of shape (M,)
        Bend radii, >= 0.
    tube, width : float
        Radius of the tube, and the error from which a point is not explained.
    costs : ndarray of shape (M,)
        To be filled with sums of squared errors over the width, no more than 1 each.
    """
    count = len(radii)
    frames, squares = np.empty((count, 6, 3)), np.empty(count)
    for k in range(count):
        costs[k] = 0.0
        tangent = radii[k] * math.tan(0.5 * angle)
        for d in range(3):
            frames[k, 0, d] = corner[0, d] - tangent * corner[1, d] + radii[k] * corner[4, d]
            frames[k, 1, d], frames[k, 2, d], frames[k, 3, d] = corner[1, d], -corner[4, d], corner[3, d]
            frames[k, 4, d], frames[k, 5, d] = corner[0, d] + tangent * corner[2, d], corner[2, d]
    for i in range(len(points)):
        explained = False
        for k in range(count):
            distance = arc_place(points[i, 0], points[i, 1], points[i, 2], frames[k], radii[k], angle)[1]
            squares[k] = min(((distance - tube) / width) ** 2, 1.0)
            explained = explained or squares[k] < 1.0
        if explained:
            for k in range(count):
                costs[k] += squares[k]


@njit(cache=True, nogil=True)
def fill_bend_scores(
    local: FloatArray,
    turns: FloatArray,
    radii: FloatArray,
    befores: FloatArray,
    surface: FloatArray,
    pieces: int,
    step: float,
    scores: FloatArray,
) -> None:
    """Fill in the score of the best bend from an end for each direction and bend radius, its beginning and its angle.

    Parameters
    ----------
    local : ndarray of shape (N, 3)
        Points: along the axis from the end, and across it in its basis.
    turns, radii, befores : ndarray of shape (T,), (R,), (B,)
        Directions to which a bend goes, radians; bend radii; where it may begin.
    surface : ndarray of shape (4,)
        Radius of the tube, spread of its points, width of the shell, log-likelihood ratio on the surface.
    pieces, step
        Number and length of the pieces of the centre line.
    scores : ndarray of shape (T, R, 3)
        To be filled.
    """
    tube, spread, shell, ratio = surface
    totals = np.empty(pieces)
    for t in range(len(turns)):
        cosine, sine = math.cos(turns[t]), math.sin(turns[t])
        for r in range(len(radii)):
            size = radii[r]
            scores[t, r, 0], scores[t, r, 1], scores[t, r, 2] = -math.inf, 0.0, 0.0
            for b in range(len(befores)):
                for k in range(pieces):
                    totals[k] = 0.0
                for i in range(len(local)):
                    ahead = local[i, 0] - befores[b]
                    y = size - cosine * local[i, 1] - sine * local[i, 2]
                    across = cosine * local[i, 2] - sine * local[i, 1]
                    out = math.sqrt(ahead * ahead + y * y) - size
                    error = abs(math.sqrt(out * out + across * across) - tube)
                    if error < shell:
                        along = size * math.atan2(ahead, y)
                        if 0.0 < along < 2.2 * size:
                            totals[min(int(along / step), pieces - 1)] += gain_of(error, spread, ratio)
                total, best, place = 0.0, -math.inf, 0
                for k in range(pieces):
                    total += totals[k]
                    if total > best:
                        best, place = total, k
                if best > scores[t, r, 0]:
                    scores[t, r, 0], scores[t, r, 1], scores[t, r, 2] = best, befores[b], (place + 1) * step / size


@njit(cache=True, nogil=True)
def fill_reducer_scores(
    local: FloatArray, tried: FloatArray, surface: FloatArray, back: float, step: float, scores: FloatArray
) -> None:
    """Fill in the score of each reducer with a pipe behind it, and where that pipe ends.

    Parameters
    ----------
    local : ndarray of shape (N, 3)
        Points: along the axis, and across it.
    tried : ndarray of shape (M, 5)
        Where the reducer begins, its length, the radius behind it, and by how much it shifts across the axis.
    surface : ndarray of shape (4,)
        As `fill_bend_scores` takes it.
    back, step : float
        Where the pieces begin, and their length.
    scores : ndarray of shape (M, 2)
        To be filled.
    """
    tube, spread, shell, ratio = surface
    count = 1
    for i in range(len(local)):
        count = max(count, int((local[i, 0] - back) / step) + 1)
    totals = np.empty(count)
    for m in range(len(tried)):
        begin, length, radius, first, second = tried[m]
        for k in range(count):
            totals[k] = 0.0
        for i in range(len(local)):
            share = min(max((local[i, 0] - begin) / length, 0.0), 1.0)
            a, b = local[i, 1] - share * first, local[i, 2] - share * second
            error = abs(math.sqrt(a * a + b * b) - tube - share * (radius - tube))
            if error < shell:
                totals[max(int((local[i, 0] - back) / step), 0)] += gain_of(error, spread, ratio)
        total, best, place = 0.0, -math.inf, 0
        for k in range(count):
            total += totals[k]
            if total > best:
                best, place = total, k
        scores[m, 0], scores[m, 1] = best, back + (place + 1) * step


@njit(cache=True, nogil=True)
def fill_cone_costs(
    local: FloatArray, tried: FloatArray, radii: FloatArray, second: FloatArray, width: float, costs: FloatArray
) -> None:
    """Fill in how badly cones between two pipes explain points: squared errors over the width, no more than 1 each.

    Parameters
    ----------
    local : ndarray of shape (N, 3)
        Points: along the first axis, and across it.
    tried : ndarray of shape (M, 2)
        Where each cone begins and ends along the first axis.
    radii : ndarray of shape (2,)
        Of the pipes.
    second : ndarray of shape (6,)
        The second axis: its middle across the first; how far that is along it from the origin, and by how much its
        foot moves along it for each length along the first axis; its direction across the first.
    width : float
    costs : ndarray of shape (M,)
        To be filled.
    """
    for m in range(len(tried)):
        low, high = tried[m]
        along = second[2] + high * second[3]
        x_end, y_end = second[0] + along * second[4], second[1] + along * second[5]
        slope = (radii[1] - radii[0]) / (high - low)
        slant, cost = 1.0 / math.sqrt(1.0 + slope * slope), 0.0
        for i in range(len(local)):
            height = local[i, 0]
            share, beyond = min(max((height - low) / (high - low), 0.0), 1.0), max(height - high, 0.0)
            x = local[i, 1] - share * x_end - beyond * second[4]
            y = local[i, 2] - share * y_end - beyond * second[5]
            error = math.sqrt(x * x + y * y) - radii[0] - share * (radii[1] - radii[0])
            if low < height < high:
                error *= slant
            cost += min((error / width) ** 2, 1.0)
        costs[m] = cost
