"""Where a fitting holds its cylinders: the place to which an end of each goes, or what part of it the fitting takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, cos, degrees, radians, sin, tan
from typing import Literal

import numpy as np

from cylx.export.solids import Bend, unit
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import canonical_direction
from cylx.geometry.lines import common_perpendicular
from cylx.geometry.numerics import cross
from cylx.results import ResultCylinder
from cylx.results.fittings import (
    AnyFitting,
    ResultCap,
    ResultCross,
    ResultElbow,
    ResultFlange,
    ResultInline,
    ResultJoint,
    ResultReducer,
    ResultTee,
)

STEEPEST = radians(150.0)
"""Bends by more than this have no corner that is of use."""
FLATTEST = radians(10.0)
"""Branches at less than this angle are drawn as at this one."""
STRAIGHT = radians(3.0)
"""A gap between axes at a smaller angle is bridged straight."""
FLAT = 0.1
"""Thickness of a cap that does not bulge, in its radius."""

BEYOND = 0.5
"""A junction goes so far beyond the line where its surfaces meet, in the radius of its branch: a scan does not show how
far it goes, and solids that only just touch are hard to join."""


@dataclass(frozen=True, slots=True, eq=False)
class Claim:
    """Where a fitting holds a cylinder.

    Parameters
    ----------
    fitting, cylinder : int
        Ids.
    where : {'start', 'end', 'side'}
    anchor : ndarray of shape (3,)
        The place the line of the cylinder goes to; for `side`, the middle of what sits on it; scene units.
    reach : float
        How far before it the pipe ends, scene units.
    gives_way : bool
        Whether others on the cylinder cut it off.
    may_vanish : bool
        Whether it is left out if others leave no room for it.
    """

    fitting: int
    cylinder: int
    where: Literal["start", "end", "side"]
    anchor: FloatArray
    reach: float
    gives_way: bool = False
    may_vanish: bool = True


def claims_of(fitting: AnyFitting, cylinders: Mapping[int, ResultCylinder]) -> list[Claim]:
    """Return how a fitting holds each of its cylinders; nothing if it cannot be drawn."""
    if isinstance(fitting, ResultTee | ResultCross):
        return _junction(fitting, cylinders)
    if isinstance(fitting, ResultFlange):
        return _flange(fitting, cylinders)
    if isinstance(fitting, ResultCap):
        return _cap(fitting, cylinders)
    if isinstance(fitting, ResultInline) and len(fitting.joins) == 1:
        start, end = np.array(fitting.start), np.array(fitting.end)
        reach = 0.5 * float(np.linalg.norm(end - start))
        return [Claim(fitting.id, fitting.joins[0], "side", 0.5 * (start + end), reach, gives_way=True)]
    if len(fitting.joins) != 2 or "side" in fitting.ends:
        return []
    bent = elbow_of(fitting, cylinders)
    if bent is not None:
        places, reach = _elbow(bent)
    else:
        places, reach = (np.array(fitting.start), np.array(fitting.end)), 0.0
        if isinstance(fitting, ResultJoint | ResultInline) and _overlap(fitting, places, cylinders):
            places = (0.5 * (places[0] + places[1]),) * 2
    return [
        Claim(fitting.id, number, end, place, reach)
        for number, end, place in zip(fitting.joins, fitting.ends, places, strict=True)
    ]


def elbow_of(fitting: AnyFitting, cylinders: Mapping[int, ResultCylinder]) -> ResultElbow | None:
    """Return a fitting as the elbow it is drawn as: an elbow, or a gap around a corner; None for anything else.

    The arc over a gap touches both axes. It begins at the end that is nearer to where these meet, and the other
    cylinder is drawn up to it.

    Parameters
    ----------
    fitting : fitting
    cylinders : mapping of int to ResultCylinder
        Those that it joins.
    """
    if isinstance(fitting, ResultElbow):
        return fitting
    if not isinstance(fitting, ResultJoint) or len(fitting.joins) != 2 or "side" in fitting.ends:
        return None
    one, two = (cylinders[number] for number in fitting.joins)
    first, second = _outward(one, fitting.ends[0]), -_outward(two, fitting.ends[1])
    across = cross(first, second)
    turn = atan2(float(np.linalg.norm(across)), float(first @ second))
    if not STRAIGHT < turn < STEEPEST:
        return None
    start, end = np.array(fitting.start), np.array(fitting.end)
    feet = common_perpendicular(start, first, end, second)[:2]
    ahead = min(float((feet[0] - start) @ first), float((end - feet[1]) @ second))
    radius = 0.5 * (one.radius + two.radius)
    if ahead < -radius:  # they passed each other
        return None
    corner, tangent = 0.5 * (feet[0] + feet[1]), max(ahead, 0.0)
    bend_radius, normal = tangent / tan(0.5 * turn), unit(across, np.zeros(3))
    begin = corner - tangent * first
    return ResultElbow(
        **fitting.model_dump(exclude={"kind", "start", "end", "length", "assumed"}),
        kind="elbow",
        center=(begin + bend_radius * cross(normal, first)).tolist(),
        normal=normal.tolist(),
        bend_radius=bend_radius,
        angle_deg=degrees(turn),
        radius=radius,
        start=begin.tolist(),
        end=(corner + tangent * second).tolist(),
    )


def bend_of(elbow: ResultElbow) -> Bend | None:
    """Return the torus of an elbow; None if it has none, as a mitre, or would go through its own middle."""
    if elbow.bend_radius <= elbow.radius * (1.0 + 1e-9):
        return None
    center = np.array(elbow.center)
    away = np.array(elbow.start) - center
    normal = unit(elbow.normal, np.array([0.0, 0.0, 1.0]))
    away = unit(away - (away @ normal) * normal, cross(normal, _other(normal)))
    return Bend(center, normal, center + elbow.bend_radius * away, radians(elbow.angle_deg), elbow.radius)


def _elbow(elbow: ResultElbow) -> tuple[tuple[FloatArray, FloatArray], float]:
    """Return where the pipes of an elbow go, and how far before they end."""
    bend = bend_of(elbow)
    if bend is not None:
        return (bend.start, bend.at(bend.angle)), 0.0
    turn = min(radians(elbow.angle_deg), STEEPEST)
    start, end = np.array(elbow.start), np.array(elbow.end)
    corner = np.array(elbow.center)
    if elbow.bend_radius > 0.0:
        out = unit(0.5 * (start + end) - corner, np.zeros(3))
        corner = corner + elbow.bend_radius / cos(0.5 * turn) * out
    return (corner, corner), elbow.radius * tan(0.5 * turn)


def _overlap(
    fitting: ResultJoint | ResultInline | ResultReducer,
    places: tuple[FloatArray, FloatArray],
    cylinders: Mapping[int, ResultCylinder],
) -> bool:
    """Return whether the first cylinder ends beyond where the second one begins."""
    found = cylinders[fitting.joins[0]]
    out = np.array(found.end) - found.start if fitting.ends[0] == "end" else np.array(found.start) - found.end
    return float((places[1] - places[0]) @ out) <= 0.0


def _junction(fitting: ResultTee | ResultCross, cylinders: Mapping[int, ResultCylinder]) -> list[Claim]:
    """Return a junction that reaches a little beyond the line where the surfaces of main and branch meet."""
    center, mains = np.array(fitting.center), set(fitting.main)
    if not set(fitting.branches) | mains <= set(fitting.joins) or not mains or not fitting.branches:
        return []
    turn = max(radians(fitting.angle_deg), FLATTEST)
    main = max(cylinders[number].radius for number in mains)
    branch = max(cylinders[number].radius for number in fitting.branches)
    along_main = (branch + main * cos(turn)) / sin(turn) + BEYOND * branch
    along_branch = (main + branch * cos(turn)) / sin(turn) + BEYOND * branch
    return [
        Claim(fitting.id, number, end, center, along_main if number in mains else along_branch, may_vanish=False)
        for number, end in zip(fitting.joins, fitting.ends, strict=True)
    ]


def on_side(flange: ResultFlange) -> Claim:
    """Return a flange as something on its pipe."""
    return Claim(flange.id, flange.joins[0], "side", np.array(flange.center), 0.5 * flange.thickness)


def _flange(flange: ResultFlange, cylinders: Mapping[int, ResultCylinder]) -> list[Claim]:
    """Return a flange on a pipe, at its end, or between two."""
    center, half = np.array(flange.center), 0.5 * flange.thickness
    if len(flange.joins) == 1 and flange.ends[0] != "side":
        (number,), (end,) = flange.joins, flange.ends
        outward = _outward(cylinders[number], end)
        return [Claim(flange.id, number, end, center + half * outward, flange.thickness)]
    return [Claim(flange.id, number, end, center, half) for number, end in zip(flange.joins, flange.ends, strict=True)]


def _cap(cap: ResultCap, cylinders: Mapping[int, ResultCylinder]) -> list[Claim]:
    """Return a cap: from where its pipe was seen to end."""
    (number, end) = cap.joins[0], cap.ends[0]
    if len(cap.joins) != 1 or end == "side":
        return []
    found, center = cylinders[number], np.array(cap.center)
    seen = np.array(found.end if end == "end" else found.start)
    bulge = float((center - seen) @ _outward(found, end))
    return [Claim(cap.id, number, end, center, max(bulge, FLAT * cap.radius))]


def _outward(found: ResultCylinder, end: str) -> FloatArray:
    """Return the unit direction out of an end of a cylinder."""
    away = np.array(found.end) - found.start
    out = unit(away, canonical_direction(found.axis_direction))
    return out if end == "end" else -out


def _other(direction: FloatArray) -> FloatArray:
    """Return a unit vector that is not along a direction."""
    out = np.zeros(3)
    out[np.abs(direction).argmin()] = 1.0
    return out
