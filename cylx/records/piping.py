"""Records of the runs that fittings make of cylinders."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cylx.records.fittings import End, Fitting

Openness = Literal["nothing_there", "leaves_cloud", "hidden"]
"""Why a run goes on at an end of a cylinder no further, as far as can be told."""


@dataclass(frozen=True, slots=True)
class OpenEnd:
    """An end of a run.

    Parameters
    ----------
    cylinder : int
        Id of the cylinder.
    end : {'start', 'end'}
        Which end of it.
    reason : {'nothing_there', 'leaves_cloud', 'hidden'}
        Why nothing joins it: it was seen to end, it reaches the border of the cloud, or there are no points about it.
    """

    cylinder: int
    end: End
    reason: Openness


@dataclass(frozen=True, slots=True)
class PipeSize:
    """The cylinders of a run that have one size, taken together.

    Parameters
    ----------
    radius : float
        Their common radius, scene units.
    std : float
        Its standard deviation, scene units.
    length : float
        Length along the centre line, with the elbows, scene units.
    cylinders : tuple of int
        Their ids.
    nominal : str or None
        The entry of the catalogue that all of them together support; None if none, or without a catalogue.
    """

    radius: float
    std: float
    length: float
    cylinders: tuple[int, ...]
    nominal: str | None = None


@dataclass(frozen=True, slots=True)
class PipeRun:
    """Cylinders that are joined with each other, in their order.

    Parameters
    ----------
    cylinders : tuple of int
        Ids, in order from one end; where it branches, the branch comes after all that lies ahead.
    fittings : tuple of int
        Indices in the list of fittings, in order.
    length : float
        Length along the centre line, scene units.
    slope : float or None
        Rise along z over horizontal distance of its level cylinders, in its direction; None if none is level.
    sizes : tuple of PipeSize
        By length, descending.
    open_ends : tuple of OpenEnd
    loops : int
        Number of ways round; 0 for a tree.
    """

    cylinders: tuple[int, ...]
    fittings: tuple[int, ...]
    length: float
    slope: float | None
    sizes: tuple[PipeSize, ...]
    open_ends: tuple[OpenEnd, ...]
    loops: int = 0


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What came of a constraint on a run that was fitted as it was built.

    Parameters
    ----------
    fitting : int or None
        The fitting that asks for it; None for the radius of a size.
    what : str
        `meeting` (the axes meet), `angle_deg` (their angle is round), `line` (they are one line, or parallel) or
        `radius` (that of all cylinders of the size).
    cylinders : tuple of int
        Ids of the cylinders it is about.
    measured, target : float
        Value before, and with the constraint: scene units, degrees for `angle_deg`; of `line` also radians.
    std : float
        Standard deviation of the measured value.
    applied : bool
        Whether it holds now; otherwise it was refused, as the measured value contradicts it.
    """

    fitting: int | None
    what: str
    cylinders: tuple[int, ...]
    measured: float
    target: float
    std: float
    applied: bool


@dataclass(frozen=True, slots=True, eq=False)
class Piping:
    """The fittings and the runs of a cloud.

    Parameters
    ----------
    fittings : tuple of Fitting
        The index is the `id`.
    runs : tuple of PipeRun
        By length, descending; the index is the `id`. A cylinder that nothing joins is a run of its own.
    labels : ndarray of shape (N,), int32
        Fitting of each point of the cloud, -1 for none; empty if there was no cloud.
    adjustments : tuple of Adjustment or None
        What moved so that the runs are as they were built, and what was refused; None if that was not asked for.
    """

    fittings: tuple[Fitting, ...]
    runs: tuple[PipeRun, ...]
    labels: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    adjustments: tuple[Adjustment, ...] | None = None

    def run_ids(self, cylinders: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the run of each point.

        Parameters
        ----------
        cylinders : ndarray of shape (N,), int32
            Cylinder of each point, -1 for none.

        Returns
        -------
        ndarray of shape (N,), int32
            -1 for points of no cylinder and no fitting.
        """
        most = max((cylinder for run in self.runs for cylinder in run.cylinders), default=-1)
        of_cylinder, of_fitting = np.full(most + 2, -1, np.int32), np.full(len(self.fittings) + 1, -1, np.int32)
        for number, run in enumerate(self.runs):
            of_cylinder[list(run.cylinders)] = number
            of_fitting[list(run.fittings)] = number
        out = of_cylinder[cylinders]
        if len(self.labels):
            out = np.where(self.labels >= 0, of_fitting[self.labels], out)
        return np.asarray(out, dtype=np.int32)
