"""Pipes as they are between their fittings: cut where their points leave them, and apart where they are two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cylx.fits.likelihood import Prior, fit_mixture
from cylx.fits.robust import TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder
from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, canonical_direction
from cylx.runs.facing import facing_ends
from cylx.runs.pipes import LEAST_SPREAD, ON_SURFACE, End, Pipe, Surroundings, turned
from cylx.runs.roughness import is_rough

SHELL = 0.3
"""Points within so many radii of the surface, but not on it, say that the pipe is not there."""
CUT = 0.5
"""A pipe is fitted again if it lost so many radii of its length."""
LEAST_POINTS, LEAST_LENGTH = 30, 1.5
"""Of a piece: points, and length in its radii."""
OWN_SHARE = 0.6
"""Share of the points about a piece that must be on it."""
SHORT, KNOWN_TILT = 5.0, 0.02
"""The axis of a piece shorter than so many radii is known from before, with this deviation in radians."""
UNSURE = 0.01
"""A radius less certain than this, in itself, may be that of two pipes taken for one."""
HOLE = 12.0
"""Log-likelihood ratio against a pipe, within it, from which it may be two pipes."""
ONE_RADIUS, MOST_PIECES = 0.15, 2
"""What is more pieces of about one radius winds: it is no pipe."""
PARTS = 4
DEPTH = 4
"""Times that the rest of a pipe is looked at for more pieces."""
OTHER_RADIUS, OTHER_AXIS = 0.03, 0.06
"""Pieces that differ by less, in radii, beside their uncertainty, are one pipe."""
LONGEST_HIDDEN = 20.0
"""Pieces of one pipe are joined across gaps up to so many radii."""
PARALLEL = math.cos(math.radians(5.0))


def settled(pipes: Sequence[Pipe], near: Surroundings) -> list[Pipe]:
    """Return the pipes with the ends that their points bear out, and apart those that are several.

    Parameters
    ----------
    pipes : sequence of Pipe
    near : Surroundings
        Points that a pipe no longer has become free.
    """
    if near.cells is None:
        return list(pipes)
    out, more = [], []
    for one in pipes:
        pipe = one
        rough = not is_unsure(pipe) and is_rough(pipe, near)
        pieces = [] if rough else _pieces(pipe, near, [other for other in pipes if other is not pipe], DEPTH)
        if any(is_rough(piece, near) for piece in pieces):
            pieces = []
        if sum(abs(piece.radius - pipe.radius) < ONE_RADIUS * pipe.radius for piece in pieces) > MOST_PIECES:
            pieces, pipe = [], replace(pipe, is_other=True)
        first = max(pieces, key=lambda one: one.length) if pieces else pipe
        for piece in pieces:
            if piece is first:
                out.append(replace(piece, label=pipe.label, source=pipe.source))
            else:
                more.append(replace(piece, label=near.new_label(), source=None))
        if not pieces:
            out.append(pipe)
    for pipe in out:
        near.release(pipe)
    for pipe in more:
        near.label(near.on(pipe), pipe.label)
    return _rejoined(out + more, near) if more else out


def _rejoined(pipes: list[Pipe], near: Surroundings) -> list[Pipe]:
    """Return the pipes with new pieces joined to those that they continue, which are hidden in between."""
    out = list(pipes)
    changed = True
    while changed:
        changed = False
        for facing in facing_ends(out, set()):
            first, second = (out[k] for k in facing.pipes)
            if not facing.same_size or (first.source is not None and second.source is not None):
                continue
            if differs(first, second) or facing.gap > LONGEST_HIDDEN * first.radius:
                continue
            kept, lost = (first, second) if first.source is not None else (second, first)
            far = max((lost.start, lost.end), key=lambda place: float(np.linalg.norm(place - kept.middle)))
            end: End = "end" if float((far - kept.middle) @ kept.direction) > 0 else "start"
            longer = kept.with_end(end, far)
            near.label(near.on(lost, (lost.label,)), kept.label)
            out[out.index(kept)] = refit(longer, near.points[near.on(longer)]) or longer
            out.remove(lost)
            changed = True
            break
    return out


def _pieces(pipe: Pipe, near: Surroundings, others: Sequence[Pipe], depth: int) -> list[Pipe]:
    """Return the piece of a pipe that its points bear out, and the pieces that what is left of it is."""
    half = 0.5 * pipe.length
    indices = near.about(pipe.middle, pipe.direction, -half, half, (1.0 + 2.0 * SHELL) * pipe.radius)
    apart = pipe.middle - np.array([one.middle for one in others]).reshape(-1, 3)
    turns = np.abs(np.array([one.direction for one in others]).reshape(-1, 3) @ pipe.direction)
    square = np.einsum("ij,ij->i", apart, apart) - (apart @ pipe.direction) ** 2
    parallel = np.flatnonzero((turns > PARALLEL) & (square < pipe.radius**2))
    beside = [others[k].label for k in parallel.tolist()]
    of_others = np.isin(near.labels[indices], beside)
    used = near.free(indices, (pipe.label,)) | of_others
    indices, foreign = indices[used], of_others[used]
    points, own = near.points[indices], near.points[indices[~foreign]]
    best = _sure(pipe, points, own, foreign, near.noise)
    for _ in range(3):
        low, high, _ = stretch(best, points, foreign)
        if high - low < LEAST_LENGTH * pipe.radius:
            return []
        lost = best.length - (high - low)
        cut = best.with_ends(best.middle + low * best.direction, best.middle + high * best.direction)
        if lost < CUT * cut.radius:
            best = cut
            break
        best = refit(cut, own) or cut
    parted = _parted(best, points, own, foreign) if depth > 0 else None
    if parted is not None:
        first, second = parted
        sides = [piece for side in (first, second) for piece in _pieces(side, near, others, depth - 1)]
        between = _other(pipe.with_ends(first.end, second.start), near)
        return sides if between is None else [*sides, *_pieces(between, near, others, depth - 1)]
    return [best, *_rest(pipe, best, near, others, depth)]


def is_unsure(pipe: Pipe) -> bool:
    """Return whether the radius of a pipe is so uncertain that it may be several pipes taken for one."""
    return math.sqrt(max(float(pipe.covariance[4, 4]), 0.0)) >= UNSURE * pipe.radius


def _sure(pipe: Pipe, points: FloatArray, own: FloatArray, foreign: MaskArray, noise: float) -> Pipe:
    """Return a pipe as that of its parts that is borne out best, if it may be several pipes taken for one."""
    if not is_unsure(pipe):
        return pipe
    spread = max(LEAST_SPREAD * pipe.radius, min(noise, pipe.spread))
    best, most = pipe, -math.inf
    step = pipe.length / PARTS
    for k in range(PARTS):
        start = pipe.start + k * step * pipe.direction
        part = replace(pipe.with_ends(start, start + step * pipe.direction), spread=spread)
        fitted = refit(part, own, 0.3 * pipe.radius)
        if fitted is None:
            continue
        whole = replace(fitted.with_ends(pipe.start, pipe.end), spread=spread)
        gain = stretch(whole, points, foreign)[2]
        if gain > most:
            best, most = whole, gain
    return best


def gains(pipe: Pipe, points: FloatArray, foreign: MaskArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Return heights of points from the middle of a pipe, and the log-likelihood ratio of each for it.

    That is of a point on the surface against one anywhere in the shell about it; 0 for points further away.
    """
    away = points - pipe.middle
    heights = away @ pipe.direction
    square = np.einsum("ij,ij->i", away, away) - heights**2
    errors = np.abs(np.sqrt(np.maximum(square, 0.0)) - pipe.radius)
    shell = max(SHELL * pipe.radius, 2.0 * ON_SURFACE * pipe.spread)
    ratio = math.log(2.0 * shell / (math.sqrt(2.0 * math.pi) * pipe.spread))
    scores = np.where(errors < shell, np.maximum(ratio - 0.5 * (errors / pipe.spread) ** 2, -ratio), 0.0)
    if foreign is not None:
        scores[foreign] = np.minimum(scores[foreign], 0.0)
    return heights, scores


def _hole(pipe: Pipe, points: FloatArray, foreign: MaskArray) -> tuple[float, float] | None:
    """Return between which heights the points speak most against a pipe, if they do so clearly; None if not."""
    heights, scores = gains(pipe, points, foreign)
    order = np.argsort(heights, kind="stable")
    heights, total = heights[order], np.concatenate([[0.0], np.cumsum(scores[order])])
    highest = np.maximum.accumulate(total)
    last = int(np.argmin(total - highest))
    first = int(np.argmax(total[: last + 1]))
    if last <= first or total[last] - total[first] > -HOLE:
        return None
    return float(heights[first]), float(heights[last - 1])


def _parted(pipe: Pipe, points: FloatArray, own: FloatArray, foreign: MaskArray) -> tuple[Pipe, Pipe] | None:
    """Return the two pipes that a pipe is, if they are different on both sides of a hole in it; None if not."""
    hole = _hole(pipe, points, foreign)
    if hole is None:
        return None
    low, high = (pipe.middle + height * pipe.direction for height in hole)
    sides = []
    for start, end in ((pipe.start, low), (high, pipe.end)):
        if float((end - start) @ pipe.direction) < 2.0 * LEAST_LENGTH * pipe.radius:
            return None
        fitted = refit(pipe.with_ends(start, end), own)
        if fitted is None:
            return None
        sides.append(fitted)
    return (sides[0], sides[1]) if differs(sides[0], sides[1]) else None


def stretch(pipe: Pipe, points: FloatArray, foreign: MaskArray | None = None) -> tuple[float, float, float]:
    """Return between which heights from its middle a pipe is borne out by the points about it, and by how much.

    Points on its surface speak for it, those near it against it; the stretch has the largest sum.

    Parameters
    ----------
    pipe : Pipe
    points : ndarray of shape (N, 3)
    foreign : ndarray of shape (N,), bool, optional
        Points of other pipes: they speak against it, but where they are on its surface as well.
    """
    half = 0.5 * pipe.length
    heights, scores = gains(pipe, points, foreign)
    inside = np.abs(heights) <= half
    counted = np.flatnonzero(inside & (scores != 0.0))
    if not len(counted):
        return 0.0, 0.0, 0.0
    order = counted[np.argsort(heights[counted], kind="stable")]
    total = np.concatenate([[0.0], np.cumsum(scores[order])])
    lowest = np.minimum.accumulate(total)
    last = int(np.argmax(total - lowest))
    first = int(np.argmin(total[: last + 1]))
    if last <= first:
        return 0.0, 0.0, 0.0
    low, high = float(heights[order[first]]), float(heights[order[last - 1]])
    # ends that lose nothing stay where they were
    slack = 0.3 * pipe.radius
    gain = float(total[last] - total[first])
    return (-half if low + half < slack else low), (half if half - high < slack else high), gain


def refit(pipe: Pipe, points: FloatArray, width: float | None = None) -> Pipe | None:
    """Fit a pipe to the points between its ends; None if that fails.

    Parameters
    ----------
    pipe : Pipe
    points : ndarray of shape (N, 3)
    width : float, optional
        How near to its surface points have a say at first.
    """
    half = 0.5 * pipe.length
    width = width or max(4.0 * pipe.spread, 0.03 * pipe.radius)
    floor = ON_SURFACE * pipe.spread
    schedule = WeightSchedule(width, min(floor, width), 1.0, TUKEY * TUKEY_SPREAD, 1e-6)
    fit = fit_cylinder(np.ascontiguousarray(points), pipe.model(), low=-half, high=half, schedule=schedule, steps=30)
    if fit is None:
        return None
    model = fit[0]
    deviation = max(fit[1] * TUKEY_SPREAD, 1e-9 * float(model[RADIUS]))
    model[DIRECTION] = canonical_direction(model[DIRECTION])
    prior = None
    if pipe.length < SHORT * pipe.radius:  # points at the ends that are of something else would turn its axis
        model[DIRECTION] = pipe.direction
        prior = Prior(direction=pipe.direction, direction_deviation=KNOWN_TILT)
    likely = fit_mixture(points, model, low=-half, high=half, width=8.0 * deviation, deviation=deviation, prior=prior)
    if likely is None:
        return None
    model = likely.model
    middle, direction, radius = model[POINT], model[DIRECTION], float(model[RADIUS])
    spread = max(deviation, LEAST_SPREAD * radius)
    covariance = np.asarray(likely.covariance, dtype=np.float64)
    if not (np.isfinite(covariance).all() and np.isfinite(model).all() and radius > 0):
        return None
    found = replace(
        pipe,
        start=middle - half * direction,
        end=middle + half * direction,
        radius=radius,
        spread=min(spread, 2.0 * pipe.spread),
        covariance=covariance,
    )
    return found.with_ends(*turned(pipe.start, pipe.end))


def _rest(pipe: Pipe, best: Pipe, near: Surroundings, others: Sequence[Pipe], depth: int) -> list[Pipe]:
    """Return the pieces of another pipe, of about the same axis, in what is left of a pipe at both ends."""
    out: list[Pipe] = []
    if depth == 0:
        return out
    for start, end in ((pipe.start, best.start), (best.end, pipe.end)):
        if float((end - start) @ pipe.direction) < 2.0 * LEAST_LENGTH * pipe.radius:
            continue
        piece = _other(pipe.with_ends(*turned(start, end)), near)
        if piece is not None and differs(piece, best):
            out += _pieces(piece, near, others, depth - 1)
    return out


def _other(rest: Pipe, near: Surroundings) -> Pipe | None:
    """Fit a pipe of another radius to the points about a part of an axis; None if there is none."""
    half = 0.5 * rest.length
    indices = near.about(rest.middle, rest.direction, -half, half, 1.7 * rest.radius)
    indices = indices[near.free(indices, (rest.label,))]
    if len(indices) < LEAST_POINTS:
        return None
    away = near.points[indices] - rest.middle
    away -= (away @ rest.direction)[:, None] * rest.direction
    first = replace(rest, radius=float(np.median(np.linalg.norm(away, axis=1))))
    found = refit(first, near.points[indices], 0.35 * first.radius)
    if found is None or abs(float(found.direction @ rest.direction)) < PARALLEL:
        return None
    return found if is_borne_out(found, near.points[indices]) else None


def is_borne_out(pipe: Pipe, points: FloatArray, least: int = LEAST_POINTS) -> bool:
    """Return whether most of the points about a pipe are on it."""
    away = points - pipe.middle
    heights = away @ pipe.direction
    errors = np.abs(np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - heights**2, 0.0)) - pipe.radius)
    about = (np.abs(heights) <= 0.5 * pipe.length) & (errors < SHELL * pipe.radius)
    own = about & (errors < ON_SURFACE * pipe.spread)
    return bool(own.sum() >= max(least, OWN_SHARE * about.sum()))


def differs(one: Pipe, two: Pipe) -> bool:
    """Return whether two pieces of about one axis are different pipes."""
    sd = math.sqrt(max(float(one.covariance[4, 4] + two.covariance[4, 4]), 0.0))
    radius = min(one.radius, two.radius)
    if abs(one.radius - two.radius) > OTHER_RADIUS * radius + ON_SURFACE * sd:
        return True
    place = 0.5 * (one.middle + two.middle)
    feet = [pipe.middle + float((place - pipe.middle) @ pipe.direction) * pipe.direction for pipe in (one, two)]
    uncertain = ON_SURFACE * math.hypot(one.axis_deviation(place), two.axis_deviation(place))
    return float(np.linalg.norm(feet[0] - feet[1])) > OTHER_AXIS * radius + uncertain
