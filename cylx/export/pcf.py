"""PCF: the piping component file, a text of components with their ends, as programs for isometrics read it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import degrees
from typing import NamedTuple

import numpy as np

from cylx.export.drawing import Drawing, Exported
from cylx.export.layout import Port
from cylx.export.parts import Part, Piping
from cylx.export.solids import Bend
from cylx.geometry.arrays import FloatArray
from cylx.harmless import visible
from cylx.results.fittings import ResultElbow, ResultFlange, ResultJoint, ResultReducer, ResultTee
from cylx.units import METRES

MILLIMETRES = 1000.0
SHARPEST = np.radians(150.0)
"""Bends by more than this are written as two: the axes of their ends meet far away, or not at all."""
_UNITS = ("BORE", "CO-ORDS", "BOLT-LENGTH", "BOLT-DIA")
_COMPASS = (("EAST", "WEST"), ("NORTH", "SOUTH"), ("UP", "DOWN"))


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write a piping component file, in millimetres: one pipeline for each run, and a component for each part.

    The bore is the outer diameter, one for all pipes of a size in a run: what a scan shows. Consecutive components of a
    run have an end in common; where a run branches, the branch comes after all that lies ahead.

    Parameters
    ----------
    drawing : Drawing
        With a unit.
    suffix : str
        `.pcf`.
    """
    piping = drawing.piping or drawing.joined()
    writer = _Writer(piping, MILLIMETRES * METRES[drawing.unit or "m"])
    lines = ["ISOGEN-FILES ISOGEN.FLS", *(f"UNITS-{what} MM" for what in _UNITS), "UNITS-WEIGHT KGS"]
    for name, members in zip(piping.names, piping.systems, strict=True):
        lines += [f"PIPELINE-REFERENCE {name.replace(' ', '-')}", *writer.components(members)]
    return Exported(("\r\n".join(lines) + "\r\n").encode("ascii", "backslashreplace"))


class _Ends(NamedTuple):
    """The two ends of a component: places, scene units, and diameters."""

    places: list[FloatArray]
    sizes: list[float]


class _Writer:
    """The components of piping as lines of text.

    Parameters
    ----------
    piping : Piping
    scale : float
        Millimetres of a scene unit.
    """

    def __init__(self, piping: Piping, scale: float) -> None:
        self.parts, self.scale = piping.parts, scale
        self.bores: dict[tuple[int, int], float] = {}
        for number, part in enumerate(piping.parts):
            if part.cylinder is not None:
                self.bores |= {(number, 0): piping.bores[part.cylinder.id], (number, 1): piping.bores[part.cylinder.id]}
        for one, other in piping.links:  # that of the pipe holds on both sides of a joint
            for first, second in ((one, other), (other, one)):
                if self.parts[first[0]].cylinder is not None:
                    self.bores[second] = self.bores[first]
        self.beside: dict[tuple[int, int], int] = {}
        for one, other in piping.links:
            self.beside |= {one: other[0], other: one[0]}
        self.seen: set[int] = set()

    def components(self, members: Sequence[int]) -> list[str]:
        """Return the lines of the parts of a run."""
        out: list[str] = []
        for number in members:
            out += self.component(number, self.parts[number])
            self.seen.add(number)
        return out

    def is_turned(self, number: int) -> bool:
        """Return whether the walk goes through a part from its second end to its first."""
        part = self.parts[number]
        entries = [k for k in range(len(part.ports)) if self.beside.get((number, k), number) in self.seen]
        if entries:
            return entries[0] == 1
        return (number, 0) in self.beside and (number, 1) not in self.beside  # what is first begins at its open end

    def component(self, number: int, part: Part) -> list[str]:
        """Return the lines of a part."""
        bores = [self.bores.get((number, k), 2.0 * port.radius) for k, port in enumerate(part.ports)]
        ends = self.along(number, part, bores)
        if part.cylinder is not None:
            match = part.cylinder.catalogue
            named = [] if match is None or match.decision != "snapped" or not match.name else [match.name]
            return self.block("PIPE", part, ends, said=[part.name, *named])
        fitting = part.fitting
        if isinstance(fitting, ResultElbow) or (isinstance(fitting, ResultJoint) and len(part.lines[0]) > len(ends)):
            return self.elbow(part, ends)
        if len(part.ports) > 2:
            kind, key = ("TEE", "TEBW") if isinstance(fitting, ResultTee) else ("CROSS", "CRBW")
            return self.junction(kind, key, part, ends, bores)
        if isinstance(fitting, ResultFlange):
            return self.flange(fitting, part, ends)
        if isinstance(fitting, ResultReducer):
            return self.reducer(fitting, part, ends)
        if len(part.ports) == 1:
            return self.block("CAP", part, ends, "SKEY KABW")
        if isinstance(fitting, ResultJoint):
            return self.block("PIPE", part, ends)
        return self.block("VALVE", part, ends, "SKEY VVBW")

    def along(self, number: int, part: Part, bores: Sequence[float]) -> _Ends:
        """Return the two ends of the main line of a part with their bores, that of the part before first."""
        junction = len(part.ports) > 2
        places = [part.lines[0][0], part.lines[0][-1]]
        sizes = [bores[0], bores[1 if junction else -1]]
        if self.is_turned(number):
            places.reverse()
            sizes.reverse()
        return _Ends(places, sizes)

    def block(
        self,
        kind: str,
        part: Part,
        ends: _Ends,
        *others: str,
        said: Sequence[str] | None = None,
    ) -> list[str]:
        """Return a component with its end points; nothing if it has no length."""
        if np.linalg.norm(ends.places[1] - ends.places[0]) * self.scale < 1e-3:
            return []
        points = [self.place("END-POINT", place, size) for place, size in zip(*ends, strict=True)]
        notes = [f"COMPONENT-ATTRIBUTE{k} {visible(text)}" for k, text in enumerate(said or _said(part), start=1)]
        return [kind, *(f"    {line}" for line in (*points, *others, *notes))]

    def place(self, keyword: str, place: FloatArray, size: float | None = None) -> str:
        """Return a line with coordinates, and the bore if it has one."""
        numbers = [*(self.scale * place).tolist(), *([] if size is None else [self.scale * size])]
        return " ".join([keyword, *(f"{number + 0.0:.4f}" for number in numbers)])

    def elbow(self, part: Part, ends: _Ends) -> list[str]:
        """Return an elbow, or the two halves of a bend by nearly half a turn."""
        (solid,) = part.solids or (None,)
        if not isinstance(solid, Bend):
            if len(part.lines[0]) < len(("start", "corner", "end")):
                return self.block("PIPE", part, ends)
            before, corner, after = part.lines[0]
            turn = _angle(corner - before, after - corner)
            return self.block("ELBOW", part, ends, "SKEY MIBW", *self.corner(corner, turn))
        count = 2 if solid.angle > SHARPEST else 1
        steps = [float(step) for step in np.linspace(0.0, solid.angle, count + 1)]
        turn = solid.angle / count
        places, sizes = ends
        if np.linalg.norm(places[0] - solid.start) > np.linalg.norm(places[1] - solid.start):
            steps.reverse()
        out = []
        for first, second in pairwise(steps):
            reach = solid.bend_radius / np.cos(0.5 * turn)
            corner = solid.center + reach * solid.radial_at(0.5 * (first + second))
            half = _Ends([solid.at(first), solid.at(second)], [sizes[0] if first == steps[0] else sizes[1]] * 2)
            more = (*self.corner(corner, turn), f"BEND-RADIUS {self.scale * solid.bend_radius:.4f}")
            out += self.block("ELBOW", part, ends if count == 1 else half, "SKEY ELBW", *more)
        return out

    def corner(self, corner: FloatArray, turn: float) -> tuple[str, str]:
        """Return the lines of the corner of an elbow."""
        return self.place("CENTRE-POINT", corner), f"ANGLE {round(100.0 * degrees(turn))}"

    def junction(self, kind: str, key: str, part: Part, ends: _Ends, bores: Sequence[float]) -> list[str]:
        """Return a tee or a cross."""
        (_, center, _), *branches = part.lines
        points = [
            self.place(f"BRANCH{k}-POINT", port.place, size)
            for k, (port, size) in enumerate(zip(part.ports[2:], bores[2:], strict=True), start=1)
        ]
        turn = _angle(ends.places[1] - ends.places[0], branches[0][-1] - center)
        angle = () if abs(turn - np.pi / 2) < np.radians(0.005) else (f"ANGLE {round(100.0 * degrees(turn))}",)
        middle = self.place("CENTRE-POINT", center)
        return self.block(kind, part, ends, middle, *points, f"SKEY {key}", *angle)

    def flange(self, flange: ResultFlange, part: Part, ends: _Ends) -> list[str]:
        """Return a flange, or a pair as two."""
        if not flange.pair:
            return self.block("FLANGE", part, ends, "SKEY FLWN")
        (start, end), sizes = ends
        middle = 0.5 * (start + end)
        out = self.block("FLANGE", part, _Ends([start, middle], [sizes[0]] * 2), "SKEY FLWN")
        return out + self.block("FLANGE", part, _Ends([middle, end], [sizes[1]] * 2), "SKEY FLWN")

    def reducer(self, reducer: ResultReducer, part: Part, ends: _Ends) -> list[str]:
        """Return a reducer; of an eccentric one, also the side on which it is flat."""
        if reducer.concentric:
            return self.block("REDUCER-CONCENTRIC", part, ends, "SKEY RCBW")
        return self.block("REDUCER-ECCENTRIC", part, ends, "SKEY REBW", f"FLAT-DIRECTION {_flat(part.ports)}")


def _said(part: Part) -> list[str]:
    """Return what is noted of a part: its name, and whether nothing is seen of it."""
    return [part.name, *(["assumed"] if isinstance(part.fitting, ResultJoint) else [])]


def _angle(first: FloatArray, second: FloatArray) -> float:
    """Return the angle between two vectors, radians; a right angle if one has no length."""
    lengths = float(np.linalg.norm(first) * np.linalg.norm(second))
    if lengths == 0.0:
        return 0.5 * np.pi
    cosine = float(first @ second) / lengths
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _flat(ports: Sequence[Port]) -> str:
    """Return the direction in which the axis of the thinner end is aside."""
    wide, thin = sorted(ports, key=lambda port: -port.radius)
    along = wide.outward
    aside = thin.place - wide.place
    aside = aside - (aside @ along) * along
    axis = int(np.abs(aside).argmax())
    return _COMPASS[axis][0 if aside[axis] > 0.0 else 1]
