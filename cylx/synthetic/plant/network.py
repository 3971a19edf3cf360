"""What a plant is made of: straights, what sits on them, the fittings that join them, and the decks of cards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.synthetic.plant.sizes import PipeSize
from cylx.synthetic.plant.surfaces import PipingSurface


@dataclass(slots=True, eq=False)
class Span:
    """A part of a straight where something sits on it, hides it, or leaves it out.

    Parameters
    ----------
    kind : str
        `flange`, `inline`, `gap`, `insulation`, `tee`, `cross`.
    low, high : float
        From and to, along the straight, from its start; metres.
    size : PipeSize or None
        Of the branches of a tee or a cross.
    thickness : float
        Of the insulation, metres.
    """

    kind: str
    low: float
    high: float
    size: PipeSize | None = None
    thickness: float = 0.0


@dataclass(slots=True, eq=False)
class Straight:
    """A straight pipe of one size: one axis, whatever sits on it.

    Parameters
    ----------
    start, direction : ndarray of shape (3,)
        The axis begins here, metres; unit vector.
    length : float
        Metres.
    size : PipeSize
        Nominal size.
    run : int
        The run it belongs to.
    root : float
        Length at its start that is inside the pipe it branches off from, metres.
    spans : list of Span
        In order along the axis.
    """

    start: FloatArray
    direction: FloatArray
    length: float
    size: PipeSize
    run: int
    root: float = 0.0
    spans: list[Span] = field(default_factory=list)

    @property
    def end(self) -> FloatArray:
        """Where the axis ends, metres; shape (3,)."""
        return self.at(self.length)

    def at(self, along: float) -> FloatArray:
        """Return a point of the axis, shape (3,)."""
        return np.asarray(self.start + along * self.direction)

    def bare(self) -> list[tuple[float, float]]:
        """Return the parts of the axis about which the pipe is neither covered nor left out."""
        parts, low = [], self.root
        for span in sorted(self.spans, key=lambda one: one.low):
            if span.kind not in {"tee", "cross"}:
                parts.append((low, span.low))
                low = span.high
        return [part for part in [*parts, (low, self.length)] if part[1] > part[0] + 1e-9]


@dataclass(slots=True, eq=False)
class Joining:
    """A fitting as it was built.

    Parameters
    ----------
    kind : str
        As in `TrueFitting`.
    run : int
        The run it belongs to.
    joins : list of int
        Straights.
    geometry : dict
        As in `TrueFitting`.
    surfaces : list of PipingSurface
        Its own surfaces; a tee has none.
    length : float
        Of its centre line, metres, if the straights do not go through it.
    missing : bool
        Whether the cloud has none of it.
    part_of : int or None
        Another fitting that contains this one.
    """

    kind: str
    run: int
    joins: list[int]
    geometry: dict[str, Any]
    surfaces: list[PipingSurface] = field(default_factory=list)
    length: float = 0.0
    missing: bool = False
    part_of: int | None = None


@dataclass(slots=True, eq=False)
class OpenEnd:
    """Where a run ends without a cap: the straight, the point of its axis, and the reason."""

    run: int
    cylinder: int
    point: FloatArray
    reason: str


class Deck:
    """Cards drawn without putting back, shuffled again when all are drawn, so that each scene has its share of all.

    Parameters
    ----------
    rng : numpy.random.Generator
        Shuffles them.
    cards : mapping of str to int
        How often each is in the deck.
    """

    def __init__(self, rng: np.random.Generator, cards: Mapping[str, int]) -> None:
        self._rng = rng
        self._all = [name for name, count in cards.items() for _ in range(count)]
        self._left: list[str] = []

    def look(self, n: int = 1) -> list[str]:
        """Return the next n cards, which stay in the deck."""
        while len(self._left) < n:
            self._left += [self._all[i] for i in self._rng.permutation(len(self._all))]
        return self._left[:n]

    def take(self, n: int = 1) -> None:
        """Take the next n cards out."""
        del self._left[:n]

    def defer(self) -> None:
        """Put the next card behind the others."""
        self.look()
        self._left.append(self._left.pop(0))

    def give_back(self, cards: Sequence[str]) -> None:
        """Put cards in front."""
        self._left[:0] = cards
