"""Pipes and fittings that meet: each cylinder from fitting to fitting, and what is joined with what at which place.

A cylinder is drawn along the line between the places where its fittings hold its two ends. What sits on it, such as the
main of a tee or a flange, is on this line. So the parts meet exactly, wherever the measured axes do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeGuard

import numpy as np

from cylx.export.claims import Claim, claims_of, on_side
from cylx.export.solids import unit
from cylx.geometry.arrays import FloatArray
from cylx.results import ResultCylinder
from cylx.results.fittings import AnyFitting, ResultFlange

Hold = Literal["start", "end", "low", "high"]
"""Where a fitting holds a cylinder: at an end of it, or on it, before and behind the fitting."""
Key = tuple[int, int, Hold]
"""Fitting, cylinder and hold: what a port of a fitting is known by."""
TINY = 1e-6
"""Parts shorter than so many radii are left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """An open face of a part.

    Parameters
    ----------
    place : ndarray of shape (3,)
        Its middle, scene units.
    outward : ndarray of shape (3,)
        Unit direction out of the part.
    radius : float
        Scene units.
    """

    place: FloatArray
    outward: FloatArray
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Straight:
    """A piece of a cylinder between its fittings.

    Parameters
    ----------
    cylinder : int
        Its id.
    start, end : ndarray of shape (3,)
        Scene units.
    holds : pair of tuple or None
        What holds its start and its end; None for an open end.
    """

    cylinder: int
    start: FloatArray
    end: FloatArray
    holds: tuple[Key | None, Key | None]


@dataclass(slots=True, eq=False)
class Layout:
    """Where everything is.

    Parameters
    ----------
    straights : list of Straight
    ports : dict of tuple to Port
        Of the fittings.
    links : list of pair of tuple
        Ports of fittings that are joined with no pipe between them.
    fittings : dict of int to fitting
        Those that have ports.
    directions : dict of int to ndarray
        Unit direction of the line of each cylinder.
    """

    straights: list[Straight] = field(default_factory=list)
    ports: dict[Key, Port] = field(default_factory=dict)
    links: list[tuple[Key, Key]] = field(default_factory=list)
    fittings: dict[int, AnyFitting] = field(default_factory=dict)
    directions: dict[int, FloatArray] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class _Line:
    """A cylinder with what holds its ends and what sits on it."""

    found: ResultCylinder
    ends: dict[str, Claim] = field(default_factory=dict)
    items: list[Claim] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class _Span:
    """What sits on a line: from where to where along it, and which fitting."""

    low: float
    middle: float
    high: float
    claim: Claim


def lay_out(cylinders: Sequence[ResultCylinder], fittings: Sequence[AnyFitting]) -> Layout:
    """Let cylinders and fittings meet.

    Parameters
    ----------
    cylinders : sequence of ResultCylinder
    fittings : sequence of fittings
        What joins a cylinder that is not among them is left out, and so is what claims an end that is taken already.
    """
    lines = {one.id: _Line(one) for one in cylinders}
    out = Layout()
    for fitting in sorted(fittings, key=_is_disc):
        members = set(fitting.joins)
        if not (members <= lines.keys() and len(members) == len(fitting.joins) == len(fitting.ends)):
            continue
        claims = claims_of(fitting, {number: lines[number].found for number in fitting.joins})
        if _is_disc(fitting) and claims[0].where in lines[claims[0].cylinder].ends:
            claims = [on_side(fitting)]
        if claims and all(one.where == "side" or one.where not in lines[one.cylinder].ends for one in claims):
            out.fittings[fitting.id] = fitting
            for one in claims:
                if one.where == "side":
                    lines[one.cylinder].items.append(one)
                else:
                    lines[one.cylinder].ends[one.where] = one
    for line in lines.values():
        _lay(line, out)
    return out


def _lay(line: _Line, out: Layout) -> None:
    """Add the straights of a cylinder, and the ports of the fittings that hold it."""
    found, radius = line.found, line.found.radius
    held = [line.ends.get(end) for end in ("start", "end")]
    first, last = (
        np.array(own) if one is None else one.anchor for one, own in zip(held, (found.start, found.end), strict=True)
    )
    u = unit(last - first, np.array(found.axis_direction))
    out.directions[found.id] = u
    length = float(np.linalg.norm(last - first))
    low, high = (0.0 if one is None else one.reach for one in held)
    share = min(1.0, length / (low + high)) if low + high > 0.0 else 1.0
    low, high = low * share, length - high * share
    spans = _spans(line, first, u, (low, held[0] is not None), (high, held[1] is not None))
    if spans:
        low, high = min(low, spans[0].low), max(high, spans[-1].high)
    cursor: Key | None = None
    if held[0] is not None:
        begin: Key = (held[0].fitting, found.id, "start")
        out.ports[begin] = Port(first + low * u, u, radius)
        cursor = begin
    at = low
    for span in spans:
        before: Key = (span.claim.fitting, found.id, "low")
        after: Key = (span.claim.fitting, found.id, "high")
        out.ports[before] = Port(first + span.low * u, -u, radius)
        out.ports[after] = Port(first + span.high * u, u, radius)
        _join(out, line, (first + at * u, first + span.low * u), (cursor, before), span.low - at)
        cursor, at = after, span.high
    final: Key | None = None
    if held[1] is not None:
        finish: Key = (held[1].fitting, found.id, "end")
        out.ports[finish] = Port(first + high * u, -u, radius)
        final = finish
    _join(out, line, (first + at * u, first + high * u), (cursor, final), high - at)


def _join(
    out: Layout, line: _Line, ends: tuple[FloatArray, FloatArray], holds: tuple[Key | None, Key | None], length: float
) -> None:
    """Add a straight; if it has no length, join what holds it."""
    if abs(length) > TINY * line.found.radius:
        out.straights.append(Straight(line.found.id, *ends, holds))
    elif holds[0] is not None and holds[1] is not None:
        out.links.append((holds[0], holds[1]))


def _spans(
    line: _Line, first: FloatArray, u: FloatArray, low: tuple[float, bool], high: tuple[float, bool]
) -> list[_Span]:
    """Return what sits on a line in its order, cut where it would overlap, and at ends that are held."""
    spans = []
    for one in line.items:
        middle = float((one.anchor - first) @ u)
        spans.append(_Span(middle - one.reach, middle, middle + one.reach, one))
    spans.sort(key=lambda span: (span.middle, span.claim.fitting))
    solid = [span for span in spans if not span.claim.gives_way]
    for span in spans:
        if span.claim.gives_way:  # something between two flanges is seen with them
            span.low = max([span.low, *(one.high for one in solid if span.low <= one.middle < span.middle)])
            span.high = min([span.high, *(one.low for one in solid if span.middle < one.middle <= span.high)])
    spans = [span for span in spans if span.low < span.high]
    bottom, top = low[0] if low[1] else -np.inf, high[0] if high[1] else np.inf
    for k, span in enumerate(spans):
        if k and spans[k - 1].high > span.low:
            where = 0.5 * (max(spans[k - 1].middle, span.low) + min(span.middle, spans[k - 1].high))
            spans[k - 1].high = span.low = min(max(where, spans[k - 1].middle), span.middle)
    for span in spans:
        span.low, span.high = (float(np.clip(at, bottom, max(bottom, top))) for at in (span.low, span.high))
    return [span for span in spans if span.low < span.high or not span.claim.may_vanish]


def _is_disc(fitting: AnyFitting) -> TypeGuard[ResultFlange]:
    """Return whether a fitting is a flange on one pipe: it leaves the end of that to what joins it with another."""
    return isinstance(fitting, ResultFlange) and len(fitting.joins) == 1
