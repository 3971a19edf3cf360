"""The true fittings and runs of a scene of piping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray

_PLACES = frozenset({"center", "start", "end"})
_LENGTHS = frozenset({"bend_radius", "radius", "start_radius", "end_radius", "offset", "thickness", "length"})


@dataclass(frozen=True, slots=True, eq=False)
class TrueFitting:
    """A fitting of a synthetic scene.

    Parameters
    ----------
    kind : str
        `elbow`, `tee`, `cross`, `reducer`, `flange`, `inline`, `cap` or `joint`.
    joins : tuple of int
        Indices of the cylinders it joins, or sits on.
    run : int
        Index of its run.
    geometry : mapping of str to anything
        What the kind has, by the names of the truth file; lengths in scene units, angles in degrees.
    points : int
        Points that lie on it, or, of a tee, about its weld.
    seen : float
        Share of its surface that a scanner sees, in [0, 1].
    ignore : bool
        Whether it need not be found.
    part_of : int or None
        Index of another fitting that contains it.
    """

    kind: str
    joins: tuple[int, ...]
    run: int
    geometry: Mapping[str, Any]
    points: int
    seen: float
    ignore: bool
    part_of: int | None = None

    def moved(self, shift: FloatArray, scale: float) -> TrueFitting:
        """Return it after x -> scale x + shift."""
        geometry = dict(self.geometry)
        for name, value in self.geometry.items():
            if name in _PLACES:
                geometry[name] = scale * value + shift
            elif name in _LENGTHS:
                geometry[name] = scale * value
        return replace(self, geometry=geometry)

    def entry(self, index: int) -> dict[str, object]:
        """Return it as a JSON object."""
        geometry = {
            name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in self.geometry.items()
        }
        return {
            "id": index,
            "kind": self.kind,
            "joins": list(self.joins),
            "run": self.run,
            **geometry,
            "points": self.points,
            "seen": self.seen,
            "ignore": self.ignore,
            **({} if self.part_of is None else {"part_of": self.part_of}),
        }


@dataclass(frozen=True, slots=True, eq=False)
class TrueRun:
    """Straights and fittings that are connected.

    Parameters
    ----------
    cylinders : tuple of int
        Indices of its straights: the main line from one end to the other, then the branches.
    fittings : tuple of int
        Indices of its fittings.
    length : float
        Along the centre line, branches included from the axis they start at; scene units.
    open_ends : tuple of (int, ndarray of shape (3,), str)
        Straight, place and reason: `nothing_there` or `leaves_cloud`.
    """

    cylinders: tuple[int, ...]
    fittings: tuple[int, ...]
    length: float
    open_ends: tuple[tuple[int, FloatArray, str], ...]

    def moved(self, shift: FloatArray, scale: float) -> TrueRun:
        """Return it after x -> scale x + shift."""
        ends = tuple((cylinder, scale * place + shift, reason) for cylinder, place, reason in self.open_ends)
        return replace(self, length=scale * self.length, open_ends=ends)

    def entry(self, index: int) -> dict[str, object]:
        """Return it as a JSON object."""
        ends = [
            {"cylinder": cylinder, "point": place.tolist(), "reason": reason}
            for cylinder, place, reason in self.open_ends
        ]
        return {
            "id": index,
            "cylinders": list(self.cylinders),
            "fittings": list(self.fittings),
            "length": self.length,
            "open_ends": ends,
        }
