"""Pipes that leave their line and come back to it: two pipes were taken for one across the hole between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cylx.runs.bending import NEARBY, fit_meeting, gap_before
from cylx.runs.meetings import meetings
from cylx.runs.onward import SLIGHT, onward_bend
from cylx.runs.pipes import ENDS, End, Pipe, Surroundings

LEAST_HOLE, LEAST_SIDE = 3.0, 1.5
"""In a hole of so many radii a pipe may have left its line; it is as long as the second on either side of it."""


def split_jogs(pipes: list[Pipe], near: Surroundings) -> list[Pipe]:
    """Return the pipes with those cut in two that bend off at a hole in them.

    Parameters
    ----------
    pipes : list of Pipe
    near : Surroundings
        Points of what is cut off get its label.

    Returns
    -------
    list of Pipe
        What was cut off comes last.
    """
    out = list(pipes)
    if near.cells is None:
        return out
    k = 0
    while k < len(out):
        sides = None if out[k].is_other else _sides_of_hole(out[k], near)
        off = sides is not None and (
            _bends_off(sides[0], "end", out, k, near) or _bends_off(sides[1], "start", out, k, near)
        )
        if sides is not None and off:
            other = replace(sides[1], label=near.new_label(), source=None)
            out[k] = sides[0]
            near.label(near.on(other, (sides[0].label,)), other.label)
            out.append(other)
        k += 1
    return out


def _sides_of_hole(pipe: Pipe, near: Surroundings) -> tuple[Pipe, Pipe] | None:
    """Return the pieces of a pipe before and after the longest stretch of it without points; None without one."""
    heights = np.sort((near.points[near.on(pipe)] - pipe.middle) @ pipe.direction)
    if len(heights) < 2:
        return None
    gaps = np.diff(heights)
    place = int(gaps.argmax())
    low, high = float(heights[place]), float(heights[place + 1])
    half, least = 0.5 * pipe.length, LEAST_SIDE * pipe.radius
    if high - low < LEAST_HOLE * pipe.radius or min(low + half, half - high) < least:
        return None
    before, after = (pipe.middle + (height * pipe.direction) for height in (low, high))
    return pipe.with_ends(pipe.start, before), pipe.with_ends(after, pipe.end)


def _bends_off(side: Pipe, end: End, pipes: list[Pipe], index: int, near: Surroundings) -> bool:
    """Return whether points show a bend at an end of a piece: into a pipe that is known, or into one that is not."""
    those = [*pipes[:index], side, *pipes[index + 1 :]]
    taken: set[tuple[int, End]] = {(index, other) for other in ENDS if other != end}
    for meeting in meetings(those, taken, frozenset({index})):
        fitted = fit_meeting(meeting, [those[i] for i in meeting.pipes], near)
        if fitted is not None and gap_before(fitted, those) < NEARBY * side.radius:
            return True
    found = onward_bend(side, index, end, len(pipes), near)
    return found is not None and found[1].bend.angle > SLIGHT
