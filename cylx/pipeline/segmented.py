"""One cylinder fitted to points that are known to be of one: no normals, no start, and an answer with its covariance.

Directions from all over the sphere are tried: seen along its axis a cylinder is a circle. The best of them start robust
fits in space, and the best of these the fit that ends an extraction, too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cylx.errors import InputError
from cylx.fits.likelihood import fit_mixture
from cylx.fits.robust import FIT_BEYOND_ENDS, TUKEY, TUKEY_SPREAD, WeightSchedule, unbiased_radius
from cylx.fits.robust import fit_cylinder as fit_robustly
from cylx.geometry.arrays import FloatArray
from cylx.geometry.coverage import covered_angle
from cylx.geometry.cylinder import (
    DIRECTION,
    POINT,
    RADIUS,
    Cylinder,
    axis_basis,
    canonical_direction,
    cylinder_coordinates,
)
from cylx.records import CylinderFit, PointCloud
from cylx.scene import check_usable

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


DIRECTIONS_TRIED = 500
"""Directions tried at first, over the half sphere: six degrees apart."""
CONES_ABOUT_BEST = (0.1, 0.03, 0.01)
"""Then others about the best: within so many radians."""
FINALISTS = 6
ENOUGH_TO_COMPARE_DIRECTIONS = 250
"""Points that suffice to compare directions."""
LEAST_POINTS_TO_FIT = 20
LEAST_POINTS_FOR_OUTLIERS = 150
"""Fewer points than this do not tell how their outliers scatter."""
CURVED_IN_DEVIATIONS = 3.0
"""A radius of fewer standard deviations cannot be told from that of a plane."""
LOOSEST_DIRECTION = math.radians(15.0)
"""A direction less certain than this is none."""
LEAST_SHARE_ON_CYLINDER = 0.5
"""Of the points of one cylinder, more than this share lies on it."""
_REMEDY = "take the points of one cylinder, more of them or from further about it"


def fit_cylinder(points: ArrayLike | PointCloud, *, start: Cylinder | None = None) -> CylinderFit:
    """Fit one cylinder to points that are known to lie on one, but for some outliers.

    To find the cylinders of a scan there is `extract`. Nothing is verified here: that the points are those of a
    cylinder is taken for granted as far as they do not contradict it.

    Parameters
    ----------
    points : array_like of shape (N, 3) or PointCloud
        At least 20 finite points, any unit. Rows that are not finite are passed over.
    start : Cylinder, optional
        About where it is; its height does not matter. By default it is searched for.

    Returns
    -------
    CylinderFit
        With its covariance, scene units and radians, which takes the errors of the points for independent. The extent
        is that of the points on the surface, `rmse` is theirs. `support` is 0, and there are no `payoff`,
        `confidence` and `evidence`.

    Raises
    ------
    InputError
        If there are too few points, they lie on a plane, or they do not determine a cylinder.
    ValueError
        If the shape is not (N, 3).

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> scene = cylx.synthetic.multi(points=3000, cylinders=1, seed=3)
    >>> fit = cylx.fit_cylinder(scene.points[scene.labels == 0])
    >>> abs(fit.cylinder.radius - scene.cylinders[0].cylinder.radius) < 4 * fit.radius_sd
    True
    """
    cloud = points if isinstance(points, PointCloud) else PointCloud.from_array(points)
    place = cloud.source.file
    if len(cloud.points) < LEAST_POINTS_TO_FIT:
        raise InputError(place, f"only {len(cloud.points)} usable points", f"take at least {LEAST_POINTS_TO_FIT}")
    check_usable(cloud.points, place)
    # scaled to about unity about its middle, so that neither unit nor origin matters
    origin = cloud.points.mean(axis=0)
    scale = float(np.sqrt(((cloud.points - origin) ** 2).sum(axis=1).mean()))
    inside = (cloud.points - origin) / scale
    starts = _starts(inside) if start is None else [_as_model(start.moved(-origin).moved(np.zeros(3), 1.0 / scale))]
    robust = _best_fit(inside, starts)
    fit = None if robust is None else _likeliest(inside, *robust)
    if fit is None:
        raise InputError(place, "no cylinder fits the points", _REMEDY)
    _check_determined(fit, place)
    return _outcome(cloud.points, fit, origin, scale, place)


def _as_model(cylinder: Cylinder) -> FloatArray:
    """Return point, direction and radius as one array (7,)."""
    return np.concatenate([cylinder.point, cylinder.direction, [cylinder.radius]])


def _starts(points: FloatArray) -> list[FloatArray]:
    """Return rough cylinders (7,), the best first: the circles that the points are nearest to, seen along an axis."""
    sample = points
    if len(points) > ENOUGH_TO_COMPARE_DIRECTIONS:
        sample = points[np.random.default_rng(0).choice(len(points), ENOUGH_TO_COMPARE_DIRECTIONS, replace=False)]
    principal = np.linalg.svd(sample - sample.mean(axis=0), full_matrices=False)[2]
    directions = np.concatenate([principal, _sphere(DIRECTIONS_TRIED)])
    models, scores = _circles(sample, directions)
    for cone in CONES_ABOUT_BEST:
        best = models[np.argsort(scores)[:FINALISTS]]
        more, found = _circles(sample, np.concatenate([_about(model[DIRECTION], cone) for model in best]))
        models, scores = np.concatenate([models, more]), np.concatenate([scores, found])
    return list(models[np.argsort(scores)[:FINALISTS]])


def _sphere(count: int) -> FloatArray:
    """Return unit vectors (count, 3), evenly over the half sphere, on a spiral."""
    heights = (np.arange(count) + 0.5) / count
    turns = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    wide = np.sqrt(1.0 - heights**2)
    return np.column_stack([wide * np.cos(turns), wide * np.sin(turns), heights])


def _about(direction: FloatArray, cone: float) -> FloatArray:
    """Return unit vectors (24, 3) about one, within an angle."""
    first, second = axis_basis(direction)
    turns = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    tilts = cone * np.concatenate([[0.5 * np.cos(turns), 0.5 * np.sin(turns)], [np.cos(turns), np.sin(turns)]], axis=1)
    around = direction + np.outer(tilts[0], first) + np.outer(tilts[1], second)
    return np.asarray(around / np.linalg.norm(around, axis=1, keepdims=True))


def _circles(points: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit a circle to the points seen along each direction; give the cylinders (D, 7) and the median distances (D,).

    An algebraic fit comes first, then steps of an orthogonal one, in which points far off weigh less.
    """
    frames = np.array([axis_basis(direction) for direction in directions])
    x, y = np.einsum("dka,na->kdn", frames, points)
    rows = np.stack([2.0 * x, 2.0 * y, np.ones_like(x)], axis=2)
    shapes = _solve(rows, x**2 + y**2, np.ones_like(x))
    shapes[:, 2] = np.sqrt(np.maximum(shapes[:, 2] + shapes[:, 0] ** 2 + shapes[:, 1] ** 2, 1e-12))
    for _ in range(6):
        dx, dy = x - shapes[:, 0, None], y - shapes[:, 1, None]
        distances = np.hypot(dx, dy) + 1e-300
        residuals = distances - shapes[:, 2, None]
        deviations = 1.4826 * np.median(np.abs(residuals), axis=1)[:, None] + 1e-12
        weights = 1.0 / (1.0 + (residuals / (2.0 * deviations)) ** 2) ** 2
        steps = _solve(np.stack([dx / distances, dy / distances, np.ones_like(x)], axis=2), residuals, weights)
        most = 0.5 * np.abs(shapes[:, 2])
        sizes = np.abs(steps).max(axis=1) + 1e-300
        shapes += steps * np.minimum(1.0, most / sizes)[:, None]
    distances = np.hypot(x - shapes[:, 0, None], y - shapes[:, 1, None])
    scores = np.median(np.abs(distances - shapes[:, 2, None]), axis=1)
    places = np.einsum("dk,dka->da", shapes[:, :2], frames)
    good = np.isfinite(shapes).all(axis=1) & (shapes[:, 2] > 0.0)
    return np.column_stack([places, directions, shapes[:, 2]])[good], scores[good]


def _solve(rows: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    """Solve weighted least squares of three unknowns, many times: (D, n, 3), (D, n), (D, n) -> (D, 3)."""
    weighted = rows * weights[:, :, None]
    normal = np.einsum("dni,dnj->dij", weighted, rows)
    normal += 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.asarray(np.linalg.solve(normal, np.einsum("dni,dn->di", weighted, values)[:, :, None])[:, :, 0])


def _best_fit(points: FloatArray, starts: list[FloatArray]) -> tuple[FloatArray, float] | None:
    """Fit robustly from each start; give the cylinder that the points are nearest to, and the deviation about it."""
    best: tuple[FloatArray, float] | None = None
    least = math.inf
    for start in starts:
        away = np.median(np.abs(cylinder_coordinates(points, start[POINT], start[DIRECTION])[1] - start[RADIUS]))
        width = max(8.0 * float(away), 1e-9)
        floor = width if len(points) < LEAST_POINTS_FOR_OUTLIERS else 1e-9
        schedule = WeightSchedule(width, floor, 1.0, TUKEY * TUKEY_SPREAD, 1e-6)
        fit = fit_robustly(points, start, low=-math.inf, high=math.inf, schedule=schedule, steps=100)
        if fit is None:
            continue
        model, spread = fit
        score = float(
            np.median(np.abs(cylinder_coordinates(points, model[POINT], model[DIRECTION])[1] - model[RADIUS]))
        )
        if score < least:
            best, least = (model, max(spread * TUKEY_SPREAD, 1e-9 * model[RADIUS])), score
    return best


class _Fit(NamedTuple):
    """A cylinder (7,), half its height, its covariance (5, 5), and the deviation of the points about it."""

    model: FloatArray
    half: float
    covariance: FloatArray
    deviation: float


def _likeliest(points: FloatArray, model: FloatArray, deviation: float) -> _Fit | None:
    """Fit by maximum likelihood between the ends of the points on the surface, if they are enough for it."""
    if len(points) < LEAST_POINTS_FOR_OUTLIERS:
        steady = _fit_steadily(points, model)
        if steady is None:
            return None
        model, deviation = steady
    model = model.copy()
    model[DIRECTION] = canonical_direction(model[DIRECTION])  # which the covariance goes by
    heights, distances, angles = cylinder_coordinates(points, model[POINT], model[DIRECTION])
    on = np.abs(distances - model[RADIUS]) < 3.0 * deviation
    if on.sum() < LEAST_POINTS_TO_FIT:
        return None
    low, high = float(heights[on].min()), float(heights[on].max())
    half, middle = 0.5 * (high - low), 0.5 * (low + high)
    model[POINT] += middle * model[DIRECTION]
    model[RADIUS] = unbiased_radius(model[RADIUS], min(deviation, 0.5 * model[RADIUS]))
    if len(points) >= LEAST_POINTS_FOR_OUTLIERS:
        end, width = FIT_BEYOND_ENDS * half, 8.0 * deviation
        found = fit_mixture(points, model, low=-end, high=end, width=width, deviation=deviation)
        if found is not None:
            return _Fit(found.model, half, found.covariance, max(found.law.deviation, 1e-9 * float(model[RADIUS])))
    cosines, sines, ones = np.cos(angles[on]), np.sin(angles[on]), np.ones(int(on.sum()))
    rows = np.column_stack([cosines, sines, (heights[on] - middle) * cosines, (heights[on] - middle) * sines, ones])
    try:
        inverse = np.linalg.inv(rows.T @ rows)
    except np.linalg.LinAlgError:
        return None
    deviation *= math.sqrt(len(rows) / (len(rows) - 5.0))  # five parameters were fitted
    return _Fit(model, half, deviation**2 * inverse, deviation)


def _fit_steadily(points: FloatArray, model: FloatArray) -> tuple[FloatArray, float] | None:
    """Fit with a width that stays as it is: of few points one that adapts would pick those that agree by chance."""
    away = np.median(np.abs(cylinder_coordinates(points, model[POINT], model[DIRECTION])[1] - model[RADIUS]))
    width = max(2.0 * TUKEY * 1.4826 * float(away) * math.sqrt(len(points) / (len(points) - 5.0)), 1e-9)
    schedule = WeightSchedule(width, width, 1.0, math.inf, 1e-6)
    fit = fit_robustly(points, model, low=-math.inf, high=math.inf, schedule=schedule, steps=100)
    return None if fit is None else (fit[0], max(fit[1] * TUKEY_SPREAD, 1e-9 * float(fit[0][6])))


def _check_determined(fit: _Fit, place: str) -> None:
    """Refuse a cylinder that the points do not tell from a plane, or whose direction they do not tell."""
    model, covariance = fit.model, fit.covariance
    if not model[RADIUS] > CURVED_IN_DEVIATIONS * fit.deviation:
        raise InputError(place, "the points scatter as widely as a cylinder through them is thick", _REMEDY)
    if not model[RADIUS] > CURVED_IN_DEVIATIONS * math.sqrt(covariance[4, 4]):
        raise InputError(place, "the points are as flat as their noise", _REMEDY)
    if not math.sqrt(covariance[2, 2] + covariance[3, 3]) < LOOSEST_DIRECTION:
        raise InputError(place, "the points do not determine the direction of the axis", _REMEDY)


def _outcome(points: FloatArray, fit: _Fit, origin: FloatArray, scale: float, place: str) -> CylinderFit:
    """Put a fit into scene units, and measure the points on it."""
    model = fit.model
    shape = Cylinder(model[POINT], model[DIRECTION], float(model[RADIUS]), 2.0 * fit.half).moved(origin, scale)
    heights, distances, angles = cylinder_coordinates(points, shape.point, shape.direction)
    residuals = distances - shape.radius
    # of numbers far from zero the last digits are missing
    deviation = scale * fit.deviation + 4.0 * float(np.spacing(np.abs(points).max()))
    on = (np.abs(residuals) < 3.0 * deviation) & (np.abs(heights) <= 0.5 * FIT_BEYOND_ENDS * shape.height)
    if on.mean() < LEAST_SHARE_ON_CYLINDER:
        raise InputError(place, f"only {100 * on.mean():.0f} % of the points lie on one cylinder", _REMEDY)
    units = np.array([scale, scale, 1.0, 1.0, scale])
    covariance = fit.covariance * np.outer(units, units)
    rmse = float(np.sqrt(np.mean(residuals[on] ** 2)))
    return CylinderFit(shape, int(on.sum()), rmse, covered_angle(angles[on]), 0, None, covariance=covariance)
