"""Run after run through a room: straights, elbows and reducers one after the other, then branches and ends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cylx.errors import UsageError
from cylx.geometry.arrays import FloatArray
from cylx.synthetic.plant.fittings import (
    built_bend,
    built_cap,
    built_flange,
    built_reducer,
    furnish,
    reach_of,
    tee_geometry,
)
from cylx.synthetic.plant.network import Deck, Joining, OpenEnd, Span, Straight
from cylx.synthetic.plant.sizes import SHARES, SIZES, PipeSize
from cylx.synthetic.plant.space import CLEARANCE, Space
from cylx.synthetic.plant.surfaces import Revolved

_RUN_ATTEMPTS, _ATTEMPTS, _BRANCH_ATTEMPTS = 400, 24, 24
_FEWEST_STRAIGHTS, _MOST_STRAIGHTS = 3, 10  # of a run; one that has more gets no further branches
_ODD_ANGLES = (15.0, 22.5, 30.0, 60.0, 75.0)
_BENDS, _BEND_SHARES = (1.0, 1.5, 2.0, 3.0, 5.0), (0.15, 0.45, 0.1, 0.2, 0.1)
"""Bend radii in nominal diameters."""
_LONGEST = 2.5
"""Of a stretch without anything on it, metres."""


@dataclass(slots=True, eq=False)
class Cursor:
    """Where a line of pipes goes on: point, direction, size, its last straight and the parts it may touch."""

    point: FloatArray
    direction: FloatArray
    size: PipeSize
    straight: int
    parts: tuple[int, ...]


class Layout:
    """The plant as it grows.

    Parameters
    ----------
    rng : numpy.random.Generator
        All choices.
    space : Space
        The room.
    """

    def __init__(self, rng: np.random.Generator, space: Space) -> None:
        self.rng, self.space = rng, space
        self.straights: list[Straight] = []
        self.joinings: list[Joining] = []
        self.ends: list[OpenEnd] = []
        self.insulation: list[tuple[int, Revolved]] = []
        self._parts = 0
        self._connectors = Deck(rng, {"elbow 90": 9, "elbow 45": 4, "elbow odd": 2, "reducer": 4})
        plain = {"plain": 7, "flange": 4, "inline": 2, "gap": 2}
        self._features = Deck(rng, {**plain, "insulation": 2, "tee": 3, "cross": 1})
        self._line_ends = Deck(rng, {"cap": 3, "open": 3, "flange": 2})

    def build(self, runs: int) -> None:
        """Add runs.

        Raises
        ------
        UsageError
            If the room is too small for them.
        """
        for run in range(runs):
            if not any(self._run(run) for _ in range(_RUN_ATTEMPTS)):
                raise UsageError("runs", f"no space for all {runs} of them in the room", "ask for fewer")

    def _mark(self) -> tuple[int, ...]:
        return len(self.straights), len(self.joinings), len(self.ends), len(self.insulation), len(self.space)

    def _back(self, mark: tuple[int, ...]) -> bool:
        for built, count in zip((self.straights, self.joinings, self.ends, self.insulation), mark, strict=False):
            del built[count:]  # type: ignore[attr-defined]  # lists, of types that have no other in common
        self.space.cut(mark[4])
        return False

    def _part(self) -> int:
        self._parts += 1
        return self._parts

    def _run(self, run: int) -> bool:
        """Add a run; return whether there was space."""
        mark, first = self._mark(), len(self.straights)
        size = SIZES[self.rng.choice(len(SIZES), p=SHARES)]
        point = self.space.size * self.rng.random(3)
        direction = np.zeros(3)
        axis = int(self.rng.choice(3, p=(0.4, 0.4, 0.2)))
        direction[axis] = self.rng.choice([-1.0, 1.0])
        through_wall = axis < 2 and self.rng.random() < 0.3
        if through_wall:
            point[axis] = 0.0 if direction[axis] > 0 else self.space.size[axis]
        last = self._line(run, Cursor(point, direction, size, -1, ()), int(self.rng.integers(3, 7)), through_wall)
        if last is None or len(self.straights) - first < _FEWEST_STRAIGHTS:
            return self._back(mark)
        lines = [last]
        index = first
        while index < len(self.straights):  # those of branches, too
            lines += self._branches(run, index, full=len(self.straights) - first > _MOST_STRAIGHTS)
            index += 1
        for line in lines:
            self._end(run, line, backwards=False)
        head = self.straights[first]
        if through_wall:
            self.ends.append(OpenEnd(run, first, head.start, "leaves_cloud"))
        else:
            self._end(run, Cursor(head.start, -head.direction, head.size, first, (self._first_part,)), backwards=True)
        return True

    def _line(
        self, run: int, cursor: Cursor, sections: int, from_wall: bool = False, root: float = 0.0
    ) -> Cursor | None:
        """Add a line of straights with elbows and reducers between them, as far as there is space."""
        at = self._straight(run, cursor, from_wall, root)
        if at is None:
            return None
        for _ in range(sections - 1):
            for attempt in range(_ATTEMPTS):
                mark = self._mark()
                on = self._connect(run, at)
                after = on and self._straight(run, on)
                if after:
                    self._connectors.take()
                    at = after
                    break
                self._back(mark)
                if attempt % 8 == 7:
                    self._connectors.defer()
            else:
                break
        return at

    def _straight(self, run: int, cursor: Cursor, from_wall: bool = False, root: float = 0.0) -> Cursor | None:
        """Add a straight with what sits on it, if there is space."""
        length, spans, cards = self._plan(cursor.size, root)
        straight = Straight(cursor.point, cursor.direction, length, cursor.size, run, root, spans)
        radius, part = cursor.size.radius, self._part()
        inner = straight.at(radius + 1.01 * CLEARANCE) if from_wall else straight.at(root)
        if not self.space.inside(inner, straight.end, radius):
            return None
        pieces = [(straight.at(root), straight.end, radius)]
        pieces += [(straight.at(one.low), straight.at(one.high), reach_of(one, cursor.size)) for one in spans]
        for piece in pieces:
            inside = piece[2] == radius or self.space.inside(*piece)
            if not (inside and self.space.free(*piece, cursor.parts)):
                return None
        for piece in pieces:
            self.space.add(*piece, part)
        self._features.take(cards)
        index = len(self.straights)
        if not index or self.straights[-1].run != run:
            self._first_part = part
        self.straights.append(straight)
        joinings, covers = furnish(self.rng, index, straight, len(self.joinings))
        self.joinings += joinings
        self.insulation += [(index, cover) for cover in covers]
        return Cursor(straight.end, straight.direction, cursor.size, index, (*cursor.parts[-1:], part))

    def _plan(self, size: PipeSize, root: float) -> tuple[float, list[Span], int]:
        """Choose the length of a straight and what sits on it; also return how many cards that takes."""
        wide = 2 * size.radius
        if not root and self.rng.random() < 0.08:  # hardly more than the weld of two fittings
            return float(self.rng.uniform(0.6, 2.0)) * wide, [], 0
        cards = 1 + int(self.rng.random() < 0.3)
        spans, at = [], root + self._margin(wide)
        for card in self._features.look(cards):
            if card == "plain":
                at += min(self.rng.uniform(1.0, 12.0) * wide, _LONGEST)
                continue
            span = self._span(card, size, at)
            spans.append(span)
            at = span.high + self._margin(wide)
        return float(at + (0.0 if spans else self._margin(wide))), spans, cards

    def _margin(self, wide: float) -> float:
        return float(min(self.rng.uniform(3.0, 9.0) * wide, _LONGEST))

    def _span(self, card: str, size: PipeSize, at: float) -> Span:
        """Choose the measures of something on a straight."""
        wide = 2 * size.radius
        if card == "flange":
            return Span(card, at, at + 2 * size.flange_thickness + 0.003)
        if card == "inline":
            return Span(card, at, at + size.valve_length + 2 * (size.flange_thickness + 0.003))
        if card == "gap":
            return Span(card, at, at + max(self.rng.uniform(2.0, 5.0) * wide, 0.15))
        if card == "insulation":
            thickness = float(self.rng.choice([0.03, 0.04, 0.05, 0.06]))
            return Span(card, at, at + self.rng.uniform(4.0, 9.0) * wide, thickness=thickness)
        smaller = [one for one in SIZES if one.radius <= size.radius][-4:]
        branch = smaller[self.rng.integers(len(smaller))]
        return Span(card, at, at + 3.0 * branch.radius, size=branch)

    def _connect(self, run: int, cursor: Cursor) -> Cursor | None:
        """Add an elbow or a reducer, if there is space."""
        (card,) = self._connectors.look()
        following, part = len(self.straights), self._part()
        if card == "reducer":
            index = SIZES.index(cursor.size)
            others = [one for one in (index - 2, index - 1, index + 1) if 0 <= one < len(SIZES)]
            size = SIZES[others[self.rng.integers(len(others))]]
            aside = self._aside(cursor.direction, across=False) if self.rng.random() < 0.45 else None
            joining, nodes = built_reducer(
                run, cursor.straight, following, cursor.point, cursor.direction, cursor.size, size, aside
            )
            direction, radius = cursor.direction, max(size.radius, cursor.size.radius)
        else:
            angle_deg = {"elbow 90": 90.0, "elbow 45": 45.0}.get(card) or float(self.rng.choice(_ODD_ANGLES))
            bend_radius = float(self.rng.choice(_BENDS, p=_BEND_SHARES)) * cursor.size.nominal
            joining, nodes, direction = built_bend(
                run, cursor.straight, following, cursor.point, cursor.direction,
                self._aside(cursor.direction), cursor.size, bend_radius, math.radians(angle_deg),
            )  # fmt: skip
            joining.missing = bool(self.rng.random() < 0.04)
            size, radius = cursor.size, cursor.size.radius
        for a, b in pairwise(nodes):
            if not (self.space.inside(a, b, radius) and self.space.free(a, b, radius, (*cursor.parts, part))):
                return None
            self.space.add(a, b, radius, part)
        self.joinings.append(joining)
        return Cursor(nodes[-1], direction, size, cursor.straight, (*cursor.parts[-1:], part))

    def _aside(self, direction: FloatArray, across: bool = True) -> FloatArray:
        """Choose a unit vector across a direction: along an axis of the room as far as possible."""
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        leaning = axes - (axes @ direction)[:, None] * direction
        lengths = np.linalg.norm(leaning, axis=1)
        if not across and abs(direction[2]) < 0.7:  # flat on top or at the bottom
            chosen = int(self.rng.choice([2, 5]))
        else:
            chosen = int(self.rng.choice(np.flatnonzero(lengths > 0.3)))
        return np.asarray(leaning[chosen] / lengths[chosen])

    def _branches(self, run: int, index: int, *, full: bool) -> list[Cursor]:
        """Add the branches of a straight where there is space, unless the run is full; return where they end."""
        straight, found = self.straights[index], []
        for span in [one for one in straight.spans if one.kind in {"tee", "cross"}]:
            attempts = range(0 if full else _BRANCH_ATTEMPTS)
            lines = next(filter(None, (self._branch(run, index, span) for _ in attempts)), None)
            if lines is None:
                straight.spans.remove(span)
                self._features.give_back([] if full else [span.kind])
            found += lines or []
        return found

    def _branch(self, run: int, index: int, span: Span) -> list[Cursor] | None:
        """Add the branches of a tee or a cross, or nothing."""
        mark, straight, size = self._mark(), self.straights[index], span.size or SIZES[0]
        oblique = span.kind == "tee" and self.rng.random() < 0.25
        angle = math.radians(45.0 if oblique else 90.0)
        meeting, aside = straight.at(0.5 * (span.low + span.high)), self._aside(straight.direction)
        sign = float(self.rng.choice([-1.0, 1.0]))
        branches, lines = [], []
        root = straight.size.radius / math.sin(angle)
        own = self.space.parts_at(meeting)
        for side in (1.0, -1.0)[: 1 + (span.kind == "cross")]:
            direction = math.sin(angle) * side * aside + math.cos(angle) * sign * straight.direction
            branches.append(len(self.straights))
            cursor = Cursor(meeting, direction / np.linalg.norm(direction), size, index, tuple(own))
            line = self._line(run, cursor, int(self.rng.integers(1, 4)), root=root)
            if line is None:
                self._back(mark)
                return None
            lines.append(line)
            own += self.space.parts_at(meeting + 1.01 * root * cursor.direction)
        geometry = tee_geometry(meeting, index, branches, math.degrees(angle))
        self.joinings.append(Joining(span.kind, run, [index, *branches], geometry))
        return lines

    def _end(self, run: int, cursor: Cursor, *, backwards: bool) -> None:
        """Close the end of a line, or leave it open."""
        (card,) = self._line_ends.look()
        self._line_ends.take()
        straight, radius = self.straights[cursor.straight], cursor.size.radius
        if card == "cap" and self.space.free(
            cursor.point, cursor.point + 0.5 * radius * cursor.direction, radius, cursor.parts
        ):
            self.joinings.append(built_cap(run, cursor.straight, cursor.point, cursor.direction, radius))
            self.space.add(cursor.point, cursor.point + 0.5 * radius * cursor.direction, radius, cursor.parts[-1])
            return
        thick, disc = cursor.size.flange_thickness, cursor.size.flange_radius
        inner = cursor.point - thick * cursor.direction
        fits = straight.length - straight.root > 6 * radius and self.space.inside(inner, cursor.point, disc)
        if card == "flange" and fits and self.space.free(inner, cursor.point, disc, cursor.parts):
            ends = (0.0, thick) if backwards else (straight.length - thick, straight.length)
            straight.spans.append(Span("flange", *ends))
            self.joinings.append(built_flange(run, cursor.straight, inner, cursor.point, cursor.size))
            self.space.add(inner, cursor.point, disc, cursor.parts[-1])
        self.ends.append(OpenEnd(run, cursor.straight, cursor.point, "nothing_there"))
