"""A synthetic scene: its points, their labels, and the true cylinders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylx.errors import UsageError
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, cylinder_coordinates
from cylx.synthetic.runs import TrueFitting, TrueRun

OTHER_SURFACE = -1
NOISE = -2

_MIN_POINTS = 100  # a cylinder with fewer points, or less coverage, need not be found
_MIN_COVERAGE_DEG = 20.0
_COVERAGE_BINS = 72


@dataclass(frozen=True, slots=True, eq=False)
class TrueCylinder:
    """A cylinder of a synthetic scene, and its visible part.

    Parameters
    ----------
    cylinder : Cylinder
        The shape; its point is at mid-height.
    points : int
        Points that lie on it.
    coverage_deg : float
        Angle about the axis that these points cover, in steps of 5 degrees.
    ignore : bool
        Whether it need not be found: fewer than 100 points or less than 20 degrees are visible, or it is a part of a
        fitting.
    pieces : ndarray of shape (P, 2, 3), optional
        Starts and ends of the parts of its axis about which it is bare, scene units; only in scenes of piping.
    of : mapping of str to int
        What it belongs to: `run`, `insulates` (a cylinder) or `part_of` (a fitting); only in scenes of piping.
    """

    cylinder: Cylinder
    points: int
    coverage_deg: float
    ignore: bool
    pieces: FloatArray | None = None
    of: Mapping[str, int] = field(default_factory=dict)

    def moved(self, shift: FloatArray, scale: float) -> TrueCylinder:
        """Return it after x -> scale x + shift."""
        pieces = None if self.pieces is None else scale * self.pieces + shift
        return replace(self, cylinder=self.cylinder.moved(shift, scale), pieces=pieces)


@dataclass(frozen=True, slots=True, eq=False)
class SyntheticScene:
    """A cloud with labels and true cylinders.

    Parameters
    ----------
    points : ndarray of shape (N, 3), float64
        Scene units.
    labels : ndarray of shape (N,), int32
        Index of the cylinder a point lies on, -1 on another surface, -2 for noise and outliers.
    cylinders : tuple of TrueCylinder
        The true cylinders.
    sigma : float
        Standard deviation of the Gaussian noise of each coordinate, scene units.
    family : str
        `single`, `multi` or `piping`.
    seed : int
        Random seed.
    params : mapping of str to number
        The other parameters, enough to make the scene again; `scale` and `offset` if it was moved.
    fittings, runs : tuple of TrueFitting and of TrueRun, optional
        Only in scenes of piping.
    fitting_labels : ndarray of shape (N,), int32, optional
        Index of the fitting a point belongs to, -1 for none; only in scenes of piping. Points about the weld of a tee
        also have the label of the pipe they lie on.
    """

    points: FloatArray
    labels: NDArray[np.int32]
    cylinders: tuple[TrueCylinder, ...]
    sigma: float
    family: str
    seed: int
    params: Mapping[str, Any]
    fittings: tuple[TrueFitting, ...] | None = None
    runs: tuple[TrueRun, ...] | None = None
    fitting_labels: NDArray[np.int32] | None = None

    def truth(self) -> dict[str, object]:
        """Return the truth as a JSON object: lengths in scene units, angles in degrees."""
        piping: dict[str, object] = {}
        if self.fittings is not None and self.runs is not None:
            piping["fittings"] = [fitting.entry(i) for i, fitting in enumerate(self.fittings)]
            piping["runs"] = [run.entry(i) for i, run in enumerate(self.runs)]
        return {
            "family": self.family,
            "seed": self.seed,
            "sigma": self.sigma,
            "params": dict(self.params),
            "points": len(self.points),
            "cylinders": [_truth_entry(i, true) for i, true in enumerate(self.cylinders)],
            **piping,
        }

    def moved(self, scale: float = 1.0, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> SyntheticScene:
        """Return the scene in another frame: x -> scale x + offset.

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
        params = {
            **self.params,
            "scale": float(scale) * self.params.get("scale", 1.0),
            "offset": (scale * np.array(self.params.get("offset", np.zeros(3))) + shift).tolist(),
        }
        return replace(
            self,
            points=scale * self.points + shift,
            cylinders=tuple(true.moved(shift, scale) for true in self.cylinders),
            sigma=scale * self.sigma,
            params=params,
            fittings=None if self.fittings is None else tuple(one.moved(shift, scale) for one in self.fittings),
            runs=None if self.runs is None else tuple(run.moved(shift, scale) for run in self.runs),
        )


def true_cylinder(shape: Cylinder, clean: FloatArray) -> TrueCylinder:
    """Measure the visible part of a cylinder; `clean` are its points before the noise."""
    angles = cylinder_coordinates(clean, shape.point, shape.direction)[2]
    bins = np.floor((angles / (2 * np.pi) + 0.5) * _COVERAGE_BINS).astype(int) % _COVERAGE_BINS
    coverage_deg = 360.0 / _COVERAGE_BINS * len(np.unique(bins))
    ignore = len(clean) < _MIN_POINTS or coverage_deg < _MIN_COVERAGE_DEG
    return TrueCylinder(shape, len(clean), coverage_deg, ignore)


def _truth_entry(index: int, true: TrueCylinder) -> dict[str, object]:
    shape = true.cylinder
    pieces = {} if true.pieces is None else {"pieces": true.pieces.tolist()}
    return {
        "id": index,
        "axis_point": shape.point.tolist(),
        "axis_direction": shape.direction.tolist(),
        "radius": shape.radius,
        "height": shape.height,
        "start": shape.start.tolist(),
        "end": shape.end.tolist(),
        "points": true.points,
        "coverage_deg": true.coverage_deg,
        "ignore": true.ignore,
        **pieces,
        **true.of,
    }


def demand(holds: object, name: str, fault: str) -> None:
    """Raise a UsageError about the parameter `name` unless the condition holds."""
    if not holds:
        raise UsageError(name, fault, "choose another value")
