"""The ellipse: direct least-squares fit, robust fit, and distances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import solve_in_place


@dataclass(frozen=True, slots=True)
class Degenerate:
    """The reason why points admit no solution; a return value, as it occurs thousands of times per run."""

    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Ellipse:
    """An ellipse in the plane.

    Parameters
    ----------
    center : ndarray of shape (2,)
    semi_major, semi_minor : float
        semi_major >= semi_minor > 0.
    angle : float
        Direction of the major axis, in [0, pi).
    """

    center: FloatArray
    semi_major: float
    semi_minor: float
    angle: float

    def __post_init__(self) -> None:
        if not (self.semi_major >= self.semi_minor > 0 and math.isfinite(self.semi_major)):
            raise ValueError("an ellipse needs finite semi_major >= semi_minor > 0")
        object.__setattr__(self, "center", np.array(self.center, dtype=np.float64))
        # a tiny negative angle modulo pi rounds to pi itself
        angle = self.angle % math.pi
        object.__setattr__(self, "angle", 0.0 if angle >= math.pi else angle)

    @property
    def major_axis(self) -> FloatArray:
        """Unit vector along the major axis, shape (2,)."""
        return np.array([math.cos(self.angle), math.sin(self.angle)])

    def conic(self) -> FloatArray:
        """Return (a, b, c, d, e, f) of a x^2 + b x y + c y^2 + d x + e y + f = 0, negative inside, with a + c = 1."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        u, v = self.semi_major**-2, self.semi_minor**-2
        a, b = u * cosine**2 + v * sine**2, 2.0 * cosine * sine * (u - v)
        c = u * sine**2 + v * cosine**2
        x, y = self.center
        d, e = -2.0 * a * x - b * y, -2.0 * c * y - b * x
        return np.array([a, b, c, d, e, a * x * x + b * x * y + c * y * y - 1.0]) / (a + c)


def fit_ellipse(points: FloatArray) -> Ellipse | Degenerate:
    """Fit an ellipse to points by direct least squares.

    Minimises the algebraic distance under 4 a c - b^2 = 1, in the numerically stable form, after centring and scaling.
    Points on a hyperbola also give an ellipse, far away from them.

    Parameters
    ----------
    points : ndarray of shape (n, 2)

    Returns
    -------
    Ellipse or Degenerate

    References
    ----------
    A. Fitzgibbon, M. Pilu, R. Fisher, PAMI 21 (1999), reference [44] of the paper; R. Halir, J. Flusser, WSCG (1998).
    """
    if len(points) < 5:
        return Degenerate("fewer than five points")
    middle = points.mean(axis=0)
    offsets = points - middle
    scale = float(np.sqrt((offsets**2).sum(axis=1).mean()))
    if not (np.ptp(points, axis=0).any() and scale > 0):  # the mean of equal points has rounding errors
        return Degenerate("all points are equal")
    x, y = (offsets / scale).T
    quadratic = np.column_stack([x * x, x * y, y * y])
    linear = np.column_stack([x, y, np.ones_like(x)])
    s1, s2, s3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    if np.linalg.cond(s3) > 1e12:
        return Degenerate("points on a line")
    reduction = -np.linalg.solve(s3, s2.T)
    system = s1 + s2 @ reduction
    # the inverse of the constraint matrix [[0, 0, 2], [0, -1, 0], [2, 0, 0]] applied to the rows
    system = np.array([0.5 * system[2], -system[1], 0.5 * system[0]])
    values, vectors = np.linalg.eig(system)
    vectors = np.real(vectors)
    constraint = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    allowed = (constraint > 0) & (np.abs(np.imag(values)) <= 1e-9 * (1.0 + np.abs(values)))
    if not allowed.any():
        return Degenerate("no ellipse fits")
    which = int(np.flatnonzero(allowed)[np.argmin(np.abs(np.real(values[allowed])))])
    shape = _from_conic(np.concatenate([vectors[:, which], reduction @ vectors[:, which]]))
    if shape is None:
        return Degenerate("no ellipse fits")
    center, major, minor, angle = shape
    return Ellipse(middle + scale * center, scale * major, scale * minor, angle)


def _from_conic(conic: FloatArray) -> tuple[FloatArray, float, float, float] | None:
    """Return centre, semi-axes and angle of a conic; None if it is not a real ellipse."""
    shape = np.empty(5)
    if not conic_shape(np.asarray(conic, dtype=np.float64), shape):
        return None
    return shape[:2].copy(), float(shape[2]), float(shape[3]), float(shape[4])


@njit(cache=True, nogil=True)
def conic_shape(conic: FloatArray, shape: FloatArray) -> bool:
    """Fill `shape` (5,) with centre, semi-major, semi-minor and angle of a conic (6,); False if it is no ellipse."""
    a, b, c, d, e, f = conic[0], conic[1], conic[2], conic[3], conic[4], conic[5]
    det = 4.0 * a * c - b * b
    if det <= 0.0:
        return False
    x, y = (b * e - 2.0 * c * d) / det, (b * d - 2.0 * a * e) / det
    level = f + 0.5 * (d * x + e * y)
    root = math.sqrt((a - c) ** 2 + b * b)
    flat, steep = 0.5 * (a + c - root), 0.5 * (a + c + root)
    if a + c < 0.0:
        flat, steep = steep, flat
    if flat == 0.0 or steep == 0.0 or -level / flat <= 0.0 or -level / steep <= 0.0:
        return False
    major, minor = math.sqrt(-level / flat), math.sqrt(-level / steep)
    shape[0], shape[1], shape[2], shape[3] = x, y, max(major, minor), min(major, minor)
    shape[4] = 0.5 * math.atan2(b, a - c) + (0.5 * math.pi if a + c > 0.0 else 0.0)
    return True


def ellipse_distances(ellipse: Ellipse, points: FloatArray) -> FloatArray:
    """Return signed first-order (Sampson) distances of points to an ellipse, + is outside.

    Parameters
    ----------
    ellipse : Ellipse
    points : ndarray of shape (n, 2)

    Returns
    -------
    ndarray of shape (n,)
    """
    a, b, c, d, e, f = ellipse.conic()
    x, y = points[:, 0], points[:, 1]
    value = a * x * x + b * x * y + c * y * y + d * x + e * y + f
    slope = np.hypot(2.0 * a * x + b * y + d, b * x + 2.0 * c * y + e)
    return np.asarray(value / np.maximum(slope, 1e-300))


def search_ellipse(
    points: FloatArray,
    samples: IndexArray,
    tolerance: float,
    semi_minor: tuple[float, float],
    max_aspect: float,
    refits: int = 3,
) -> tuple[Ellipse, MaskArray] | Degenerate:
    """Find the ellipse that most points support: RANSAC over samples of five, then direct fits to the support.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
    samples : ndarray of shape (k, 5)
        Indices of points; samples with repeated points are skipped.
    tolerance : float
        Distance within which a point supports an ellipse.
    semi_minor : tuple of float
        Least and greatest semi-minor axis.
    max_aspect : float
        Greatest semi_major / semi_minor.
    refits : int
        Maximum number of direct fits to the support.

    Returns
    -------
    ellipse : Ellipse
    inliers : ndarray of shape (n,), bool

    or Degenerate if no sample gave an ellipse within the limits.
    """
    middle = points.mean(axis=0)
    offsets = np.ascontiguousarray(points - middle)
    best = np.empty(6)
    xy = np.ascontiguousarray(offsets.T)
    score = search_conic(xy, len(offsets), samples, tolerance, semi_minor[0], semi_minor[1], max_aspect, best)
    if score <= 0.0:
        return Degenerate("no ellipse within the limits")
    shape = _from_conic(best)
    if shape is None:
        return Degenerate("no ellipse within the limits")
    ellipse = Ellipse(*shape)
    inliers = np.abs(ellipse_distances(ellipse, offsets)) < tolerance
    for _ in range(refits):
        refined = fit_ellipse(offsets[inliers])
        if isinstance(refined, Degenerate):
            break
        again = np.abs(ellipse_distances(refined, offsets)) < tolerance
        within = semi_minor[0] <= refined.semi_minor <= semi_minor[1]
        if not within or refined.semi_major > max_aspect * refined.semi_minor or again.sum() < 0.9 * inliers.sum():
            break
        ellipse, inliers = refined, again
    return Ellipse(ellipse.center + middle, ellipse.semi_major, ellipse.semi_minor, ellipse.angle), inliers


@njit(cache=True, nogil=True)
def search_conic(
    xy: FloatArray,
    n: int,
    samples: IndexArray,
    tolerance: float,
    least: float,
    greatest: float,
    max_aspect: float,
    best: FloatArray,
) -> float:
    """Fill `best` (6,) with the conic through five of xy[:, :n] that has the most support; return that support."""
    matrix, right = np.empty((5, 5)), np.empty(5)
    record = 0.0
    for k in range(len(samples)):
        for i in range(5):
            x, y = xy[0, samples[k, i]], xy[1, samples[k, i]]
            matrix[i, 0], matrix[i, 1], matrix[i, 2], matrix[i, 3], matrix[i, 4] = x * x, x * y, y * y, x, y
            right[i] = -1.0
        if not solve_in_place(matrix, right):
            continue
        a, b, c, d, e = right[0], right[1], right[2], right[3], right[4]
        det = 4.0 * a * c - b * b
        if det <= 0.0:
            continue
        x, y = (b * e - 2.0 * c * d) / det, (b * d - 2.0 * a * e) / det
        level = 1.0 + 0.5 * (d * x + e * y)
        root = math.sqrt((a - c) ** 2 + b * b)
        one, two = 0.5 * (a + c - root), 0.5 * (a + c + root)
        if one == 0.0 or two == 0.0 or -level / one <= 0.0 or -level / two <= 0.0:
            continue
        major, minor = math.sqrt(-level / one), math.sqrt(-level / two)
        if minor > major:
            major, minor = minor, major
        if minor < least or minor > greatest or major > max_aspect * minor:
            continue
        score = _support(xy, n, right, tolerance)
        if score > record:
            record = score
            best[0], best[1], best[2], best[3], best[4], best[5] = a, b, c, d, e, 1.0
    return record


@njit(cache=True, nogil=True)
def _support(xy: FloatArray, n: int, conic: FloatArray, tolerance: float) -> float:
    """Return the sum of one minus the squared distance from a conic over the squared tolerance, to first order."""
    a, b, c, d, e = conic[0], conic[1], conic[2], conic[3], conic[4]
    score = 0.0
    for i in range(n):
        x, y = xy[0, i], xy[1, i]
        value = a * x * x + b * x * y + c * y * y + d * x + e * y + 1.0
        gx, gy = 2.0 * a * x + b * y + d, b * x + 2.0 * c * y + e
        rest = 1.0 - value * value / ((gx * gx + gy * gy + 1e-300) * tolerance * tolerance)
        score += rest if rest > 0.0 else 0.0
    return score
