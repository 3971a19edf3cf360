"""A made plot of a forest: its points, their labels, and its true stems."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.synthetic.scene import demand


@dataclass(frozen=True, slots=True)
class TrueStem:
    """A stem of a made plot.

    Parameters
    ----------
    x, y, ground : float
        Its foot, and the height of the ground there, scene units.
    dbh : float
        Mean diameter across the axis at 1.3 m above the ground, metres.
    lean : float
        Angle of its axis at 1.3 m from the vertical, radians.
    height : float
        Up to which it has points, metres above the ground.
    arc : float
        Angle about the axis of which it has points between 1 and 1.6 m, radians.
    """

    x: float
    y: float
    ground: float
    dbh: float
    lean: float
    height: float
    arc: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """A made plot.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units.
    labels : ndarray of shape (N,)
        Index of the stem; -1 for branches, leaves and shrubs, -2 for ground.
    stems : tuple of TrueStem
    seed : int
        Random seed.
    params : mapping of str to number or str
        The other parameters, enough to make the plot again; `scale` and `offset` if it was moved.
    """

    points: FloatArray
    labels: IndexArray
    stems: tuple[TrueStem, ...]
    seed: int = 0
    params: Mapping[str, Any] = field(default_factory=dict)

    def truth(self) -> dict[str, object]:
        """Return the truth as a JSON object: places in scene units, other lengths in metres, angles in degrees."""
        return {
            "family": "forest",
            "seed": self.seed,
            "params": dict(self.params),
            "points": len(self.points),
            "stems": [
                {
                    "id": number,
                    "x": one.x,
                    "y": one.y,
                    "ground": one.ground,
                    "dbh": one.dbh,
                    "lean_deg": math.degrees(one.lean),
                    "height": one.height,
                    "arc_deg": math.degrees(one.arc),
                }
                for number, one in enumerate(self.stems, 1)
            ],
        }

    def moved(self, scale: float = 1.0, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> Plot:
        """Return the plot in another frame: x -> scale x + offset; diameters and heights of stems remain metres.

        Parameters
        ----------
        scale : float
            > 0; 1000 turns metres into millimetres.
        offset : sequence of three floats
            In the new unit.

        Raises
        ------
        UsageError
            If the scale is not positive or the offset not three finite numbers.
        """
        shift = np.array(offset, dtype=np.float64)
        demand(0 < scale < np.inf, "scale", f"must be > 0, not {scale}")
        demand(shift.shape == (3,) and bool(np.isfinite(shift).all()), "offset", "must be three finite numbers")
        x, y, z = map(float, shift)
        stems = tuple(
            replace(one, x=scale * one.x + x, y=scale * one.y + y, ground=scale * one.ground + z) for one in self.stems
        )
        params = {**self.params, "scale": float(scale), "offset": [x, y, z]}
        return replace(self, points=scale * self.points + shift, stems=stems, params=params)
