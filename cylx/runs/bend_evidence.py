"""What points say of a bend: whether they show it, and how much of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.runs.bend import Bend
from cylx.runs.bend_fit import Solved
from cylx.runs.pipes import ON_SURFACE, End, Surroundings

WIDEST_BEND = 14.0
"""Bends of a greater radius, in radii of the pipe, are bent pipes rather than elbows."""
BINS = 8
"""Pieces of the arc, at most, that are asked for points."""
LEAST_INLIERS = 10
LEAST_LENGTHWISE, LEAST_GOOD = 0.5, 0.8
"""Share of the pieces of the arc that must hold more points on it than beside it: of all, of those with points."""
ROUGH = 1.45
"""Points that scatter so many times more than those of the pipes are of no bend."""
MOST_INSIDE = 0.5
"""Points inside the tube, or just beside its surface, for each point on it."""
FURTHEST_TURN = math.radians(100.0)
"""What turns by more may be two elbows in one plane, hardly apart: it is one if its surface is that of a torus."""
DOUBTED_TURN = math.radians(50.0)
"""Two elbows in one plane with a short pipe between turn by more: while others may be found, one is clearly a torus."""
MOST_DEVIATION, LEAST_IN_CELL, LEAST_CELLS = 0.015, 4, 8
"""By how many radii pieces of the surface of an elbow deviate at most, in the mean; points of a piece; pieces."""
BESIDE = 0.3
"""Points within so many radii of the surface are just beside it."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedBend:
    """A bend that was fitted to points.

    Parameters
    ----------
    pipes, ends
        As of the meeting.
    bend : Bend
    radius : float
        Of the tube.
    indices : ndarray of shape (n,)
        Points on the arc.
    rms : float
    lengthwise : float
        Share of the arc, in pieces, that has points.
    coverage : float
        Share of its surface that has points.
    inside : float
        Points inside the tube for each point on it.
    std : dict of str to float
    shifts : ndarray of shape (2, 4)
        By how much the axes of the pipes move: offsets and tilts.
    covariances : ndarray of shape (2, 4, 4)
        Of the two axes after the fit.
    """

    pipes: tuple[int, int]
    ends: tuple[End, End]
    bend: Bend
    radius: float
    indices: IndexArray
    rms: float
    lengthwise: float
    coverage: float
    inside: float
    std: dict[str, float]
    shifts: FloatArray
    covariances: FloatArray


def judged(
    pipes: tuple[int, int],
    ends: tuple[End, End],
    solved: Solved,
    indices: IndexArray,
    near: Surroundings,
    spread: float,
    least: float = 0.0,
    furthest: float = FURTHEST_TURN,
) -> FittedBend | None:
    """Return a fitted bend with its evidence; None if the points do not show it.

    If its arc is shorter than `least` radii, points of its pipes tell it as well, so far about its middle. If it turns
    by more than `furthest`, in radians, its surface is that of a torus.
    """
    bend, radius = solved.bend, solved.radius
    if bend.bend_radius > 1.1 * WIDEST_BEND * radius:
        return None
    along, distances = bend.coordinates(near.points[indices])
    errors = distances - radius
    width = ON_SURFACE * spread + 0.01 * radius
    # of a mitre and of a short arc, the points about the corner
    corner = max(0.0, 0.5 * radius * math.tan(0.5 * bend.angle) - 0.5 * bend.length)
    margin = max(corner, 0.5 * (least * radius - bend.length))
    on_arc = (along > -margin) & (along < bend.length + margin)
    inside = on_arc & (errors < -width - 0.1 * radius)
    own = on_arc & (np.abs(errors) < width)
    count = int(own.sum())
    beside = on_arc & (np.abs(errors) >= width) & (np.abs(errors) < max(BESIDE * radius, 2.0 * width))
    if count < LEAST_INLIERS or inside.sum() > MOST_INSIDE * count or beside.sum() > MOST_INSIDE * count:
        return None
    pieces = int(np.clip((bend.length + 2.0 * margin) / max(2.0 * near.spacing, 1e-12), 1, BINS))
    rows = np.clip(((along + margin) / (bend.length + 2.0 * margin) * pieces).astype(np.int64), 0, pieces - 1)
    on_it, off_it = (np.bincount(rows[which], minlength=pieces) for which in (own, inside | beside))
    # a bend that is two shows in pieces whose points are beside it
    good, filled = on_it > off_it, on_it + off_it > 0
    lengthwise = float(good.mean())
    one_bend = good.sum() >= LEAST_GOOD * filled.sum()
    rms = float(np.sqrt((errors[own] ** 2).mean()))
    if not one_bend or lengthwise < LEAST_LENGTHWISE or rms > ROUGH * math.hypot(spread, 0.005 * radius):
        return None
    about = own | beside
    if bend.angle > furthest and _deviates(bend, radius, near.points[indices[about]], rows[about], errors[about]):
        return None
    coverage = _covered(bend, near.points[indices[own]], rows[own]) / (12.0 * pieces)
    of_bend = own & (along > -corner) & (along < bend.length + corner)
    turn = solved.covariance[2:4, 2:4] + solved.covariance[6:8, 6:8]
    std = {
        "bend_radius": math.sqrt(max(solved.covariance[9, 9], 0.0)),
        "angle_deg": math.degrees(math.sqrt(max(0.5 * np.trace(turn), 0.0))),
        "radius": math.sqrt(max(solved.covariance[8, 8], 0.0)),
    }
    return FittedBend(
        pipes,
        ends,
        bend,
        radius,
        indices[of_bend],
        rms,
        lengthwise,
        coverage,
        float(inside.sum()) / count,
        std,
        solved.change.reshape(2, 4),
        np.stack([solved.covariance[:4, :4], solved.covariance[4:8, 4:8]]),
    )


def _deviates(bend: Bend, radius: float, points: FloatArray, rows: IndexArray, errors: FloatArray) -> bool:
    """Return whether the surface of a bend clearly deviates from its torus, beside what noise leaves of the means."""
    _, cells = np.unique(rows * 12 + _sectors(bend, points), return_inverse=True)
    counts = np.bincount(cells)
    means = np.bincount(cells, errors) / counts
    noise = (np.bincount(cells, errors**2) / counts - means**2) / np.maximum(counts - 1, 1)
    used = counts >= LEAST_IN_CELL
    if used.sum() < LEAST_CELLS:
        return False
    square = means[used] ** 2
    form, uncertain = float((square - noise[used]).mean()), math.sqrt(2.0 / used.sum()) * float(square.mean())
    return form - 2.0 * uncertain > (MOST_DEVIATION * radius) ** 2


def _covered(bend: Bend, points: FloatArray, rows: IndexArray) -> int:
    """Return how many cells of the surface of a bend hold points: each of its pieces has twelve about the tube."""
    return len(np.unique(rows * 12 + _sectors(bend, points)))


def _sectors(bend: Bend, points: FloatArray) -> IndexArray:
    """Return the sector about the tube of points on a bend."""
    radial = points - (bend.meeting if bend.bend_radius == 0 else bend.center)
    # angle about the tube: from the outside of the bend
    high = radial @ bend.normal
    out = np.hypot(radial @ bend.first, radial @ bend.inward) - bend.bend_radius
    return np.floor((np.arctan2(high, out) / (2 * math.pi) + 0.5) * 12).astype(np.int64) % 12
