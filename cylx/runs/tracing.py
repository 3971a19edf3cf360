"""The pipes and fittings that were found so far: each end of a pipe has one fitting at most."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from cylx.geometry.arrays import IndexArray
from cylx.records import Fitting
from cylx.runs.pipes import ENDS, End, Pipe, Surroundings
from cylx.runs.wider import wider_ones

BY_AXES = 0.5
"""Confidence of a fitting that nothing but the axes tells."""


@dataclass(slots=True)
class Trace:
    """The pipes and fittings found so far.

    Parameters
    ----------
    pipes : list of Pipe
    near : Surroundings
    fittings : list of Fitting
        Their `joins` are indices of pipes.
    points : list of ndarray
        Indices of the points of each fitting.
    taken : dict of (int, {'start', 'end'}) to int
        Fitting at each end that has one.
    followed : set of (int, {'start', 'end'})
        Ends that were followed onward.
    starts : list of Pipe
        The pipes before any fitting was found.
    others : frozenset of int
        Cylinders that are no pipes: bores, and what is too rough.
    aside : set of int
        These, and the rims and covers of pipes.
    """

    pipes: list[Pipe]
    near: Surroundings
    fittings: list[Fitting] = field(default_factory=list)
    points: list[IndexArray] = field(default_factory=list)
    taken: dict[tuple[int, End], int] = field(default_factory=dict)
    followed: set[tuple[int, End]] = field(default_factory=set)
    starts: list[Pipe] = field(init=False)

    others: frozenset[int] = frozenset()
    aside: set[int] = field(init=False)

    def __post_init__(self) -> None:
        self.starts, self.aside = list(self.pipes), wider_ones(self.pipes) | self.others

    @property
    def closed(self) -> set[tuple[int, End]]:
        """Ends that have a fitting already, and those of cylinders that are no pipes."""
        return set(self.taken) | {(k, end) for k in self.aside for end in ENDS}

    def add(self, fitting: Fitting, points: IndexArray) -> None:
        """Add a fitting; the ends it joins are taken."""
        for pipe, end in zip(fitting.joins, fitting.ends, strict=True):
            if end != "side":
                self.taken[pipe, end] = len(self.fittings)
        self.fittings.append(fitting)
        self.points.append(points)
        self.near.label(points)

    def is_free(self, keys: Iterable[tuple[int, End]]) -> bool:
        """Return whether ends have no fitting yet."""
        return not any(key in self.taken for key in keys)


def trust(inliers: int, lengthwise: float, wrong: float = 0.0) -> float:
    """Return the confidence of a fitting: by its points, the share of its length they cover, and points against it."""
    return float(np.clip((1.0 - np.exp(-inliers / 10.0)) * (0.4 + 0.6 * lengthwise) * (1.0 - 0.5 * wrong), 0.0, 0.99))
