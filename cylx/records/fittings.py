"""Records of the fittings between cylinders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from cylx.geometry.arrays import FloatArray

End = Literal["start", "end", "side"]
"""Where a fitting meets a cylinder: at one of its ends, or on its surface between them."""


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
        How well its points tell it, or the axes where it has no points, in [0, 1]: a score, not a probability that was
        fitted to truths.
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
    """A gap that is bridged: nothing is seen of what is between two cylinders of one line, or of one bend.

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
