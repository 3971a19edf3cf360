"""The cylinder: a point on the axis, a direction, a radius, a height, and the distances to it."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import cross, fill_basis

POINT, DIRECTION, RADIUS = slice(0, 3), slice(3, 6), 6
"""Where a cylinder as a row of seven numbers has a point of its axis, the unit direction and the radius."""
UX, UY, UZ = 3, 4, 5
"""Where it has the components of the direction: kernels work with single numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Cylinder:
    """A finite right circular cylinder, without caps.

    Parameters
    ----------
    point : ndarray of shape (3,)
        Middle of the axis segment, scene units.
    direction : ndarray of shape (3,)
        Direction of the axis; normalised, with its largest component made positive.
    radius : float
        Scene units, > 0.
    height : float
        Length of the axis segment, scene units, >= 0.

    Examples
    --------
    >>> can = Cylinder((0, 0, 0.05), (0, 0, -2), radius=0.033, height=0.1)
    >>> can.direction
    array([0., 0., 1.])
    >>> can.start, can.end
    (array([0., 0., 0.]), array([0. , 0. , 0.1]))
    """

    point: FloatArray
    direction: FloatArray
    radius: float
    height: float = 0.0

    def __post_init__(self) -> None:
        point = np.array(self.point, dtype=np.float64)
        direction = canonical_direction(self.direction)
        if point.shape != (3,) or direction.shape != (3,):
            raise ValueError("point and direction must have three components")
        if not (np.isfinite(point).all() and self.radius > 0 and self.height >= 0 and np.isfinite(self.radius)):
            raise ValueError("a cylinder needs a finite point, a radius > 0 and a height >= 0")
        point.setflags(write=False)
        direction.setflags(write=False)
        object.__setattr__(self, "point", point)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "radius", float(self.radius))
        object.__setattr__(self, "height", float(self.height))

    @property
    def start(self) -> FloatArray:
        """Lower end of the axis segment, shape (3,)."""
        return self.point - 0.5 * self.height * self.direction

    @property
    def end(self) -> FloatArray:
        """Upper end of the axis segment, shape (3,)."""
        return self.point + 0.5 * self.height * self.direction

    def moved(self, origin: ArrayLike, scale: float = 1.0) -> Cylinder:
        """Return the cylinder transformed by x -> scale x + origin."""
        return Cylinder(
            scale * self.point + np.asarray(origin), self.direction, scale * self.radius, scale * self.height
        )


def cylinder_between(start: ArrayLike, end: ArrayLike, radius: float) -> Cylinder:
    """Return the cylinder with the given ends of its axis.

    Raises
    ------
    ValueError
        If the ends are one point, or the radius is not > 0.
    """
    first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    return Cylinder(0.5 * (first + last), last - first, radius, float(np.linalg.norm(last - first)))


def canonical_direction(direction: ArrayLike) -> FloatArray:
    """Return the unit vector along `direction` whose component of largest magnitude is positive.

    Parameters
    ----------
    direction : array_like of shape (..., 3)

    Raises
    ------
    ValueError
        If a direction has no finite, positive length.
    """
    vectors = np.array(direction, dtype=np.float64)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not (np.isfinite(length).all() and (length > 0).all()):
        raise ValueError("a direction needs a finite length > 0")
    vectors /= length
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=-1)[..., None], axis=-1)
    return np.asarray(np.where(largest < 0, -vectors, vectors) + 0.0, dtype=np.float64)


def cylinder_coordinates(
    points: FloatArray, point: ArrayLike, direction: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each point's height along the axis, distance from the axis and angle about it.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units.
    point, direction : array_like of shape (3,)
        The axis; the direction is of unit length.

    Returns
    -------
    heights : ndarray of shape (N,)
        Along `direction`, zero at `point`.
    distances : ndarray of shape (N,)
        From the axis, >= 0.
    angles : ndarray of shape (N,)
        About the axis, in (-pi, pi], from an arbitrary but fixed zero.
    """
    direction = np.asarray(direction, dtype=np.float64)
    across, along = axis_basis(direction)
    offsets = points - np.asarray(point)
    x, y = offsets @ across, offsets @ along
    return offsets @ direction, np.hypot(x, y), np.arctan2(y, x)


def axis_basis(direction: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that make a right-handed basis with a unit direction.

    Returns
    -------
    first, second : ndarray of shape (3,)
        first x second = direction.
    """
    direction = np.asarray(direction, dtype=np.float64)
    helper = np.zeros(3)
    helper[np.abs(direction).argmin()] = 1.0
    first = cross(direction, helper)
    first /= np.linalg.norm(first)
    return first, cross(direction, first)


def axis_frame(direction: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return what `axis_basis` does; the old name of it."""
    warnings.warn("axis_frame is axis_basis now; it goes with the next release", DeprecationWarning, stacklevel=2)
    return axis_basis(direction)


def surface_distances(points: FloatArray, cylinder: Cylinder) -> FloatArray:
    """Return the signed distance of each point to the infinite cylinder's surface, + is outside.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    cylinder : Cylinder

    Returns
    -------
    ndarray of shape (N,)
    """
    _, distances, _ = cylinder_coordinates(points, cylinder.point, cylinder.direction)
    return distances - cylinder.radius


def points_on(points: FloatArray, model: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return heights and angles of the points within `width` of a cylinder's surface.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    model : ndarray of shape (7,)
        A point of the axis, where heights are zero, its unit direction, the radius.
    width : float

    Returns
    -------
    heights, angles : ndarray of shape (n,)
    """
    heights, residuals, angles = np.empty(len(points)), np.empty(len(points)), np.empty(len(points))
    n = fill_coordinates(points, model, width, heights, residuals, angles)
    return heights[:n], angles[:n]


def distances_to(points: FloatArray, model: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return heights of points (n, 3) along a cylinder (7,), and their distances from its surface; shape (n,) each."""
    away = points - model[POINT]
    heights = away @ model[DIRECTION]
    distances = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - heights**2, 0.0))
    return heights, np.abs(distances - model[RADIUS])


def are_on(points: FloatArray, model: FloatArray, width: float) -> MaskArray:
    """Return which points (n, 3) lie within `width` of the surface of a cylinder (7,), however far along it."""
    return np.asarray(distances_to(points, model)[1] < width, dtype=np.bool_)


def coordinates_of(
    points: FloatArray, indices: IndexArray, model: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return heights, signed distances to a cylinder's surface, and angles of some of the points, shape (n,) each."""
    heights, residuals, angles = np.empty(len(indices)), np.empty(len(indices)), np.empty(len(indices))
    fill_coordinates(points[indices], model, math.inf, heights, residuals, angles)
    return heights, residuals, angles


@njit(cache=True, nogil=True)
def fill_coordinates(
    points: FloatArray, model: FloatArray, width: float, heights: FloatArray, residuals: FloatArray, angles: FloatArray
) -> int:
    """Fill in height, signed distance and angle of the points within `width` of the surface; return their number."""
    basis = np.empty((2, 3))
    fill_basis(model[UX : UZ + 1], basis)
    n = 0
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - model[0], points[i, 1] - model[1], points[i, 2] - model[2]
        x = dx * basis[0, 0] + dy * basis[0, 1] + dz * basis[0, 2]
        y = dx * basis[1, 0] + dy * basis[1, 1] + dz * basis[1, 2]
        residual = math.sqrt(x * x + y * y) - model[RADIUS]
        if abs(residual) < width:
            heights[n] = dx * model[UX] + dy * model[UY] + dz * model[UZ]
            residuals[n], angles[n] = residual, math.atan2(y, x)
            n += 1
    return n
