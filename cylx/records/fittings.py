"""Records of piping: the fittings between cylinders, and the runs that they make of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray

End = Literal["start", "end", "side"]
"""Where a fitting meets a cylinder: at one of its ends, or on its surface between them."""
Openness = Literal["nothing_there", "leaves_cloud", "hidden"]
"""Why a run goes on at an end of a cylinder no further, as far as can be told."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fitting:
    """What joins cylinders, or ends one, with the evidence for it.

    Parameters
    ----------
    joins : tuple of int
        Ids of the cylinders it joins.
    ends : tuple of {'start', 'end', 'side'}
        Where it meets each of them.
    confidence : float
        Probability that it is such a fitting, in [0, 1].
    inliers : int
        Points on its surface.
    rms : float
        Root mean square of their distances from it, scene units; 0 without inliers.
    coverage : float
        Share of its surface that they cover, in [0, 1].
    std : mapping of str to float
        Standard deviations of its values, by their names in the result: scene units, and degrees for `angle_deg`.
    """

    kind: ClassVar[str]
    joins: tuple[int, ...]
    ends: tuple[End, ...]
    confidence: float
    inliers: int = 0
    rms: float = 0.0
    coverage: float = 0.0
    std: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Elbow(Fitting):
    """A bend: a part of a torus that touches both cylinders, or a mitre if its bend radius is 0.

    Parameters
    ----------
    center : ndarray of shape (3,)
        Middle of the circle that the centre line follows; for a mitre, where the axes meet; scene units.
    normal : ndarray of shape (3,)
        Unit normal of its plane: the centre line turns about it, by the right-hand rule, from `start` to `end`.
    bend_radius : float
        Radius of that circle, scene units, >= 0.
    angle : float
        Change of direction, radians, in (0, pi].
    radius : float
        Radius of the tube, scene units, > 0.
    start, end : ndarray of shape (3,)
        First and last point of the centre line, scene units: at the first and at the second cylinder of `joins`.
    """

    kind: ClassVar[str] = "elbow"
    center: FloatArray
    normal: FloatArray
    bend_radius: float
    angle: float
    radius: float
    start: FloatArray
    end: FloatArray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Junction(Fitting):
    """A tee or a cross: one or two branches that end on the surface of a main.

    Parameters
    ----------
    center : ndarray of shape (3,)
        Where the axes meet, on the axis of the main; scene units.
    main : tuple of int
        Ids of the cylinders of the main: one that goes through, or one on either side.
    branches : tuple of int
        Ids of one branch (a tee) or of two that face each other (a cross).
    angle : float
        Angle between the axes of the main and of the first branch, radians, in (0, pi / 2].
    """

    kind: ClassVar[str] = "tee"
    center: FloatArray
    main: tuple[int, ...]
    branches: tuple[int, ...]
    angle: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cross(Junction):
    """A junction with two branches that face each other; see `Junction`."""

    kind: ClassVar[str] = "cross"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reducer(Fitting):
    """A piece between cylinders of different radius with parallel axes.

    Parameters
    ----------
    start, end : ndarray of shape (3,)
        Ends of its centre line, on the axes of the first and of the second cylinder of `joins`; scene units.
    start_radius, end_radius : float
        Radii there, scene units, > 0.
    offset : float
        Distance of the two axes, scene units, >= 0.
    concentric : bool
        Whether the axes are one line; otherwise the piece is eccentric.
    """

    kind: ClassVar[str] = "reducer"
    start: FloatArray
    end: FloatArray
    start_radius: float
    end_radius: float
    offset: float
    concentric: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Flange(Fitting):
    """A disc about the axis, or a pair of discs face to face.

    Parameters
    ----------
    center : ndarray of shape (3,)
        Middle of the disc, or of both, on the axis; scene units.
    axis : ndarray of shape (3,)
        Unit direction of the axis.
    radius : float
        Radius of the rim, scene units, > 0.
    thickness : float
        Length along the axis, of both discs for a pair; scene units, > 0.
    pair : bool
        Whether pipes go on at both sides.
    """

    kind: ClassVar[str] = "flange"
    center: FloatArray
    axis: FloatArray
    radius: float
    thickness: float
    pair: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Inline(Fitting):
    """Something of unknown kind between two coaxial cylinders, such as a valve.

    Parameters
    ----------
    start, end : ndarray of shape (3,)
        Its ends on the axis, scene units.
    """

    kind: ClassVar[str] = "inline"
    start: FloatArray
    end: FloatArray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cap(Fitting):
    """The closed end of a cylinder.

    Parameters
    ----------
    center : ndarray of shape (3,)
        On the axis, at the outermost points of the cap, scene units.
    axis : ndarray of shape (3,)
        Unit direction of the axis, out of the cylinder.
    radius : float
        Radius of the cylinder, scene units, > 0.
    """

    kind: ClassVar[str] = "cap"
    center: FloatArray
    axis: FloatArray
    radius: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Joint(Fitting):
    """A gap that is bridged: both cylinders point at each other, and nothing is seen of what is between them.

    Parameters
    ----------
    start, end : ndarray of shape (3,)
        The ends of the cylinders, scene units.
    length : float
        Length of the gap along the assumed centre line, scene units, >= 0.
    assumed : bool
        Whether nothing but the axes speaks for it.
    """

    kind: ClassVar[str] = "joint"
    start: FloatArray
    end: FloatArray
    length: float
    assumed: bool = True


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
