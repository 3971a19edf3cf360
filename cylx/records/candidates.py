"""Records before the fit: slices, ellipses, candidates, and clusters of candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS
from cylx.geometry.ellipse import Ellipse
from cylx.geometry.plane import Plane


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """The points close to a plane, in the coordinates of the plane.

    Parameters
    ----------
    plane : Plane
    points : ndarray of shape (n, 2)
    """

    plane: Plane
    points: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class EllipseFit:
    """An ellipse found in a slice.

    Parameters
    ----------
    ellipse : Ellipse
        In the coordinates of the plane.
    plane : Plane
        The plane it lies in.
    inliers : int
        Points that support it.
    """

    ellipse: Ellipse
    plane: Plane
    inliers: int


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Cylinder candidates, a structure of arrays over M candidates, in the frame of the cloud.

    Parameters
    ----------
    models : ndarray of shape (M, 7)
        Point of the axis, unit direction, radius. The point is the location of the candidate: the ellipse's centre, or
        the axis point nearest to its window.
    parents : ndarray of shape (M,)
        Slice or window it comes from; candidates of one parent exclude each other (eq. 5).
    extents : ndarray of shape (M,)
        Length of the axis that its own points cover; 0 if unknown.
    inliers : ndarray of shape (M,)
        Points that support it.
    windows : ndarray of shape (M,)
        Radius of the window it was found in.
    places : ndarray of shape (M, 3)
        Point of the surface about which its window was laid; NaN where there is none.
    """

    models: FloatArray
    parents: IndexArray
    extents: FloatArray
    inliers: IndexArray
    windows: FloatArray
    places: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    def __post_init__(self) -> None:
        if len(self.places) != len(self.models):
            object.__setattr__(self, "places", np.full((len(self.models), 3), np.nan))

    def __len__(self) -> int:
        return len(self.models)

    @property
    def points(self) -> FloatArray:
        """Points of the axes, shape (M, 3)."""
        return self.models[:, POINT]

    @property
    def directions(self) -> FloatArray:
        """Unit directions, shape (M, 3)."""
        return self.models[:, DIRECTION]

    @property
    def radii(self) -> FloatArray:
        """Radii, shape (M,)."""
        return self.models[:, RADIUS]

    def take(self, which: IndexArray | MaskArray) -> Candidates:
        """Return the candidates at these indices, or under this mask."""
        return Candidates(
            self.models[which],
            self.parents[which],
            self.extents[which],
            self.inliers[which],
            self.windows[which],
            self.places[which],
        )

    @classmethod
    def of_windows(cls, rows: FloatArray, radius: float | FloatArray, places: FloatArray) -> Candidates:
        """Make candidates of windows, each its own parent: rows (M, 9) of model, inliers, extent."""
        inliers, radii = rows[:, 7].astype(np.int64), np.full(len(rows), radius, np.float64)
        return cls(rows[:, :7].copy(), np.arange(len(rows)), rows[:, 8].copy(), inliers, radii, places)

    @classmethod
    def joined(cls, parts: Sequence[Candidates]) -> Candidates:
        """Concatenate several sets; parents are renumbered so that they stay distinct."""
        if not parts:
            return cls(np.empty((0, 7)), np.empty(0, np.int64), np.empty(0), np.empty(0, np.int64), np.empty(0))
        shifts = np.cumsum([0] + [int(part.parents.max(initial=-1)) + 1 for part in parts])
        return cls(
            np.concatenate([part.models for part in parts]),
            np.concatenate([part.parents + shift for part, shift in zip(parts, shifts, strict=False)]),
            np.concatenate([part.extents for part in parts]),
            np.concatenate([part.inliers for part in parts]),
            np.concatenate([part.windows for part in parts]),
            np.concatenate([part.places for part in parts]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Cluster:
    """Candidates that agree, with their shares of the final population.

    Parameters
    ----------
    members : ndarray of shape (m,)
        Indices of candidates.
    weights : ndarray of shape (m,)
        Their shares, of sum 1.
    payoff : float
        Mean payoff of the population, in [0, 1].
    """

    members: IndexArray
    weights: FloatArray
    payoff: float
