"""Elbows with short pipes between them, fitted together: each point says once what it knows of all their axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.runs.bend import LEAST_TURN, Bend
from cylx.runs.bend_fit import SKEWED, axes_of, bend_of, signs_of
from cylx.runs.bend_normal import fill_bend_normal
from cylx.runs.chain_parts import Chain, bend_between, chains_of, ends_of, gathered
from cylx.runs.pipes import ON_SURFACE, Pipe, Surroundings, tilted
from cylx.runs.tracing import Trace

WIDE, STEPS = 1.8, 10
"""Points up to so many times their usual width have a say in the first steps of the fit; steps in all."""
LOOSE_OFFSET, LOOSE_TILT = 1.0, 0.5
"""What is known of a short pipe without its points: standard deviations, in radii and radians."""
LEAST_KEPT = 0.9
"""A fit of all that leaves an elbow a smaller share of its points is none."""
SHARES = (1.0, 0.99, 0.97, 0.94, 0.9)
"""Shares of what a fit of all changes that are tried: the first that leaves something between the elbows."""
MOST_MOVED, MOST_TURNED = 3.0, math.radians(15.0)
"""Nor is one that moves the ends of an elbow by so many radii, or turns it by so much."""


def settle_chains(trace: Trace, near: Surroundings) -> None:
    """Fit elbows that short pipes join together with these, and move all of them there.

    Parameters
    ----------
    trace : Trace
        Its elbows, and the pipes that they join, change.
    near : Surroundings
    """
    if near.cells is None:
        return
    for pipes, elbows in chains_of(trace):
        chain = gathered(trace, near, pipes, elbows)
        solved = _solved(chain)
        if solved is None:
            continue
        before, (state, covariance) = _before(chain), solved
        # a fit that lets elbows overlap that meet at a weld goes a little too far
        for share in SHARES:
            if _settle(trace, near, chain, before + share * (state - before), covariance):
                break


def _before(chain: Chain) -> FloatArray:
    """Return the unknowns of a chain before its fit: of each pipe no change, the radius, the bend radii."""
    base = np.zeros(4 * len(chain.pipes) + 1 + len(chain.bends))
    base[4 * len(chain.pipes)] = chain.radius
    for k, place in chain.bends.items():
        base[place] = chain.elbows[k].bend_radius
    return base


def _bends(chain: Chain, pipes: Mapping[int, Pipe], state: FloatArray) -> dict[int, Bend]:
    """Return the bends of a chain between pipes that moved."""
    return {
        k: bend_between(replace(one, bend_radius=float(state[chain.bends[k]])), pipes)
        for k, one in chain.elbows.items()
    }


def _solved(chain: Chain) -> tuple[FloatArray, FloatArray] | None:
    """Return the unknowns of a chain after its fit, and their covariance; None if that fails."""
    count = 4 * len(chain.pipes) + 1 + len(chain.bends)
    tube, radius, spread = 4 * len(chain.pipes), chain.radius, chain.spread
    information, base = np.zeros((count, count)), _before(chain)
    certain = 0.0
    for index, first in chain.place.items():
        pipe = chain.pipes[index]
        known = pipe.covariance[:4, :4] + np.diag([*[(0.002 * radius) ** 2] * 2, *[1e-6] * 2])
        if index in chain.short:
            known = np.diag([*[(LOOSE_OFFSET * radius) ** 2] * 2, *[LOOSE_TILT**2] * 2])
        else:
            certain += 1.0 / max(float(pipe.covariance[4, 4]), 1e-300)
        information[first : first + 4, first : first + 4] = np.linalg.inv(known)
    information[tube, tube] = 1.0 / (1.0 / max(certain, 1e-3 / radius**2) + (0.01 * radius) ** 2)
    for place in chain.bends.values():
        information[place, place] = 1e-9 / radius**2
    small = np.full(count, 1e-4 * radius)
    for first in chain.place.values():
        small[first + 2 : first + 4] = 1e-5
    state, covariance = base.copy(), np.zeros((count, count))
    for step in range(STEPS):
        width = ON_SURFACE * 1.5 * spread * (WIDE if step < STEPS // 3 else 1.0)
        normal, gradient = information.copy(), information @ (state - base)
        for place in chain.bends.values():
            gradient[place] -= information[place, place] * (state - base)[place]
        _add_arcs(chain, state, small, width, normal, gradient)
        _add_straights(chain, state, width, normal, gradient)
        try:
            covariance = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            return None
        change = covariance @ gradient
        state = state - change
        if not np.isfinite(state).all():
            return None
        for place in chain.bends.values():
            state[place] = max(state[place], 0.0)
        if step > STEPS // 3 and float(np.abs(change / small).max()) < 10.0:
            break
    return (state, covariance) if np.isfinite(state).all() and np.isfinite(covariance).all() else None


def _add_arcs(
    chain: Chain, state: FloatArray, small: FloatArray, width: float, normal: FloatArray, gradient: FloatArray
) -> None:
    """Add what the points on the arcs say."""
    part, line = np.empty((10, 10)), np.empty(10)
    tube = 4 * len(chain.pipes)
    reach = np.array([chain.spread, width, 0.0, 0.0, 0.0, 0.0, SKEWED * chain.radius])
    for k, one in chain.elbows.items():
        first, second = (chain.place[index] for index in one.joins)
        which = np.array([*range(first, first + 4), *range(second, second + 4), tube, chain.bends[k]])
        signs = signs_of(ends_of(one))
        axes = axes_of(chain.pipes[one.joins[0]], chain.pipes[one.joins[1]])
        weight = chain.weights["arc", k]
        reach[6] = SKEWED * chain.radius * math.sqrt(weight)
        fill_bend_normal(chain.arcs[k], axes, signs, state[which], small[which], reach, part, line)
        normal[np.ix_(which, which)] += weight * part
        gradient[which] += weight * line


def _add_straights(chain: Chain, state: FloatArray, width: float, normal: FloatArray, gradient: FloatArray) -> None:
    """Add what the points on the short pipes say: those between the arcs at both ends."""
    tube = 4 * len(chain.pipes)
    moved = {index: _moved(chain, index, state) for index in chain.pipes}
    bends = _bends(chain, moved, state)
    for index, points in chain.straights.items():
        pipe = _ended(chain, index, moved[index], {k: bends[k] for k in bends if index in chain.elbows[k].joins})
        if float(pipe.direction @ moved[index].direction) < 0.0:
            continue
        away = points - pipe.middle
        heights = away @ pipe.direction
        radial = away - heights[:, None] * pipe.direction
        distances = np.sqrt(np.einsum("ij,ij->i", radial, radial))
        errors = distances - state[tube]
        used = (np.abs(heights) < 0.5 * pipe.length) & (np.abs(errors) < width) & (distances > 0)
        if not used.any():
            continue
        outward, e = radial[used] / distances[used][:, None], errors[used]
        weights = (1.0 - (e / width) ** 2) ** 2 * chain.weights["pipe", index] / chain.spread**2
        first, second = chain.pipes[index].basis
        # heights from where the offsets are told
        lever = (points[used] - chain.pipes[index].middle) @ pipe.direction
        across = np.column_stack([outward @ first, outward @ second])
        rows = np.column_stack([-across, -lever[:, None] * across, -np.ones(len(e))])
        which = np.array([*range(chain.place[index], chain.place[index] + 4), tube])
        normal[np.ix_(which, which)] += (rows * weights[:, None]).T @ rows
        gradient[which] += rows.T @ (weights * e)


def _moved(chain: Chain, index: int, state: FloatArray) -> Pipe:
    first = chain.place[index]
    pipe = chain.pipes[index]
    return _at(pipe, state[first : first + 4])


def _at(pipe: Pipe, change: FloatArray) -> Pipe:
    """Return a pipe of the same length on its axis after a change."""
    middle, direction = tilted(pipe, change)
    half = 0.5 * pipe.length * direction
    return replace(pipe, start=middle - half, end=middle + half)


def _ended(chain: Chain, index: int, pipe: Pipe, bends: Mapping[int, Bend]) -> Pipe:
    """Return a pipe with its ends where the arcs of a chain begin."""
    for k, bend in bends.items():
        joins = chain.elbows[k].joins
        if index in joins:
            which = joins.index(index)
            pipe = pipe.with_end(ends_of(chain.elbows[k])[which], (bend.start, bend.end)[which])
    return pipe


def _is_near(chain: Chain, k: int, bend: Bend) -> bool:
    """Return whether a bend is about where it was before."""
    one, most = chain.elbows[k], MOST_MOVED * chain.radius
    turn = abs(bend.angle - one.angle)
    moves = [float(np.linalg.norm(new - old)) for new, old in ((bend.start, one.start), (bend.end, one.end))]
    return max(moves) < most and turn < MOST_TURNED and bend.angle > LEAST_TURN


def _settle(trace: Trace, near: Surroundings, chain: Chain, state: FloatArray, covariance: FloatArray) -> bool:
    """Move the pipes and elbows of a chain to where its fit has them, unless elbows lose their points or overlap."""
    radius = float(state[4 * len(chain.pipes)])
    width = ON_SURFACE * chain.spread + 0.01 * radius
    moved: dict[int, Pipe] = {}
    for index, first in chain.place.items():
        part = slice(first, first + 4)
        pipe = _at(chain.pipes[index], state[part])
        if index in chain.short:
            known = pipe.covariance.copy()
            known[:4, :4], known[:4, 4], known[4, :4] = covariance[part, part], 0.0, 0.0
            pipe = replace(pipe, covariance=known)
        moved[index] = pipe
    bends = _bends(chain, moved, state)
    for k, bend in bends.items():
        along, distances = bend.coordinates(chain.arcs[k])
        before, around = bend_between(chain.elbows[k], chain.pipes).coordinates(chain.arcs[k])
        now = (along > 0) & (along < bend.length) & (np.abs(distances - radius) < width)
        then = (before > 0) & (before < chain.elbows[k].bend_radius * chain.elbows[k].angle)
        then &= np.abs(around - chain.elbows[k].radius) < width
        if now.sum() < LEAST_KEPT * then.sum() or not _is_near(chain, k, bend):
            return False
    ends = {index: _ended(chain, index, pipe, bends) for index, pipe in moved.items()}
    if any(float(pipe.direction @ chain.pipes[index].direction) < 0.0 for index, pipe in ends.items()):
        return False
    for index, pipe in ends.items():
        trace.pipes[index] = pipe
    for k, bend in bends.items():
        one = chain.elbows[k]
        trace.fittings[k] = replace(
            one,
            center=bend.center,
            normal=bend.normal,
            bend_radius=bend.bend_radius,
            angle=bend.angle,
            radius=radius,
            start=bend.start,
            end=bend.end,
            std=_deviations(chain, k, state, covariance),
        )
    return True


def _deviations(chain: Chain, k: int, state: FloatArray, covariance: FloatArray) -> dict[str, float]:
    """Return the standard deviations of an elbow of a chain."""
    one, place = chain.elbows[k], chain.bends[k]
    first, second = (chain.pipes[index] for index in one.joins)
    which = [slot for index in one.joins for slot in range(chain.place[index], chain.place[index] + 4)]
    angle = bend_of(first, second, ends_of(one), state[which], one.bend_radius)[0].angle
    row = np.zeros(8)
    for d in (2, 3, 6, 7):
        shifted = state[which].copy()
        shifted[d] += 1e-6
        row[d] = (bend_of(first, second, ends_of(one), shifted, one.bend_radius)[0].angle - angle) / 1e-6
    tube = 4 * len(chain.pipes)
    return {
        "bend_radius": math.sqrt(max(float(covariance[place, place]), 0.0)),
        "angle_deg": math.degrees(math.sqrt(max(float(row @ covariance[np.ix_(which, which)] @ row), 0.0))),
        "radius": math.sqrt(max(float(covariance[tube, tube]), 0.0)),
    }
