"""Pipes as they are between their fittings: cut where their points leave them, and apart where they are two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.runs.changes import changed
from cylx.runs.facing import facing_ends
from cylx.runs.pipes import LEAST_SPREAD, End, Pipe, Surroundings, turned
from cylx.runs.refitting import LEAST_POINTS, differs, is_borne_out, refit
from cylx.runs.roughness import is_rough
from cylx.runs.stretches import SHELL, hole_in, stretch

CUT = 0.5
"""A pipe is fitted again if it lost so many radii of its length."""
LEAST_LENGTH = 1.5
"""Of a piece, in its radii."""
UNSURE = 0.01
"""A radius less certain than this, in itself, may be that of two pipes taken for one."""
ONE_RADIUS, MOST_PIECES = 0.15, 2
"""What is more pieces of about one radius winds: it is no pipe."""
PARTS = 4
DEPTH = 4
"""Times that the rest of a pipe is looked at for more pieces."""
LONGEST_HIDDEN = 20.0
"""Pieces of one pipe are joined across gaps up to so many radii."""
DEEP, FEW = 0.1, 0.005
"""Points so many radii inside a pipe, and clearly off its surface, are of something within; no more than this share of
those on it are of none."""
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
        pieces = [_seen_anew(piece, pipe, near) for piece in pieces]
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


def _seen_anew(piece: Pipe, pipe: Pipe, near: Surroundings) -> Pipe:
    """Return a piece of a pipe with the side from which it is seen.

    If two pipes were taken for one that is as wide as the wider of them, points of the other are inside it, as things
    are in a bore.
    """
    if not (pipe.is_other and is_unsure(pipe)) or pipe.length - piece.length < CUT * pipe.radius:
        return piece
    half, off = 0.5 * piece.length, max(4.5 * piece.spread, DEEP * piece.radius)
    within = near.about(piece.middle, piece.direction, -half, half, piece.radius - off)
    return replace(piece, is_other=len(within) > FEW * len(near.on(piece, (pipe.label,))))


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
    two = changed(best, own) if depth > 0 and is_unsure(pipe) else None
    if two is not None:
        new = [side for side in two if not any(is_twin(side, other) for other in others)]
        return [piece for side in new for piece in _pieces(side, near, others, depth - 1)]
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


def is_twin(pipe: Pipe, other: Pipe) -> bool:
    """Return whether most of a pipe is on another one of the same axis and radius."""
    if abs(float(pipe.direction @ other.direction)) < PARALLEL or differs(pipe, other):
        return False
    ends = sorted(float((place - other.middle) @ other.direction) for place in (pipe.start, pipe.end))
    within = min(ends[1], 0.5 * other.length) - max(ends[0], -0.5 * other.length)
    return within > 0.5 * pipe.length


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


def _parted(pipe: Pipe, points: FloatArray, own: FloatArray, foreign: MaskArray) -> tuple[Pipe, Pipe] | None:
    """Return the two pipes that a pipe is, if they are different on both sides of a hole in it; None if not."""
    hole = hole_in(pipe, points, foreign)
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
