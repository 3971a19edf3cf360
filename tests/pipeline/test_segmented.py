"""One cylinder fitted to its points: laws, and what is refused."""

import numpy as np
import pytest

import cylx
from cylx.errors import InputError
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.synthetic.surfaces import Mantle


def pipe(rng, *, points=500, radius=1.0, height=3.0, arc_deg=200.0, sigma=0.01):
    """Draw points of a cylinder that lies anyhow; give them and it."""
    shape = Cylinder(rng.uniform(-1, 1, 3), rng.standard_normal(3), radius, height)
    clean = Mantle(shape, rng.uniform(0, 6), np.radians(arc_deg)).sample(rng, points)
    return clean + sigma * rng.standard_normal(clean.shape), shape


def errors(fit, shape):
    """Give the five errors that the covariance is of."""
    found = fit.cylinder
    frame = np.array(axis_basis(found.direction))
    away = shape.point - found.point
    away = away - shape.direction * (away @ found.direction) / (shape.direction @ found.direction)
    return np.concatenate([frame @ away, frame @ shape.direction, [shape.radius - found.radius]])


@pytest.mark.parametrize(
    "kind",
    [
        {},
        {"arc_deg": 360.0, "height": 0.5},
        {"arc_deg": 60.0, "sigma": 0.003},
        {"radius": 0.05, "height": 20.0, "sigma": 0.001},
        {"points": 60},
        {"points": 20, "arc_deg": 360.0},
        {"points": 20000},
    ],
    ids=str,
)
def test_the_truth_is_within_the_covariance(kind):
    rng = np.random.default_rng(7)
    away = []
    for _ in range(6):
        points, shape = pipe(rng, **kind)
        fit = cylx.fit_cylinder(points)
        off = errors(fit, shape)
        away.append(off @ np.linalg.solve(fit.covariance, off))
    assert 0.5 < np.mean(away) < 15.0  # chi-square of five degrees of freedom; its mean over six is within these
    assert fit.inliers > 0.9 * len(points)
    assert fit.cylinder.height == pytest.approx(shape.height, rel=0.2)
    if len(points) >= 500:  # fewer leave sectors of ten degrees empty
        assert np.degrees(fit.coverage) == pytest.approx(kind.get("arc_deg", 200.0), rel=0.25)


def test_outliers_are_left_out():
    rng = np.random.default_rng(3)
    points, shape = pipe(rng)
    strays = rng.random(len(points)) < 0.2
    points[strays] += 0.5 * rng.standard_normal((strays.sum(), 3))
    fit = cylx.fit_cylinder(points)
    assert abs(fit.cylinder.radius - shape.radius) < 4 * fit.radius_sd < 0.02
    assert fit.inliers < 0.9 * len(points)


def test_unit_origin_and_order_of_the_points_do_not_matter():
    points, _ = pipe(np.random.default_rng(5))
    fit = cylx.fit_cylinder(points)
    far = cylx.fit_cylinder(1000.0 * points[::-1] + [5e5, 5e6, 100.0])
    assert far.cylinder.radius == pytest.approx(1000.0 * fit.cylinder.radius, rel=1e-5)
    assert far.radius_sd == pytest.approx(1000.0 * fit.radius_sd, rel=1e-3)
    assert far.angle_sd == pytest.approx(fit.angle_sd, rel=1e-3)
    assert np.allclose(far.cylinder.point, 1000.0 * fit.cylinder.point + [5e5, 5e6, 100.0], atol=0.1)


def test_a_start_leads_to_the_same_cylinder():
    points, shape = pipe(np.random.default_rng(9))
    tilted = Cylinder(shape.point + 0.1, shape.direction + 0.05, 1.1 * shape.radius)
    fits = [cylx.fit_cylinder(points, start=start) for start in (None, tilted)]
    assert fits[0].cylinder.radius == pytest.approx(fits[1].cylinder.radius, rel=1e-5)


def test_points_without_noise_lie_on_it():
    points, shape = pipe(np.random.default_rng(11), sigma=0.0)
    fit = cylx.fit_cylinder(points)
    assert fit.inliers == len(points)
    assert fit.cylinder.radius == pytest.approx(shape.radius, rel=1e-6)


def test_rows_that_are_not_finite_are_passed_over():
    points, _ = pipe(np.random.default_rng(13))
    fit = cylx.fit_cylinder(np.concatenate([points, np.full((3, 3), np.nan)]))
    assert fit.cylinder.radius == pytest.approx(cylx.fit_cylinder(points).cylinder.radius, rel=1e-9)


RNG = np.random.default_rng(0)
FLAT = RNG.random((500, 3)) * [1, 1, 0]
WIDENING = RNG.random((900, 2)) * [1, 2 * np.pi]
CONE = np.column_stack(
    [*((1 - 0.5 * WIDENING[:, 0]) * (np.cos(WIDENING[:, 1]), np.sin(WIDENING[:, 1]))), WIDENING[:, 0]]
)


@pytest.mark.parametrize(
    ("points", "fault"),
    [
        (np.empty((0, 3)), "only 0 usable points"),
        (RNG.random((19, 3)), "only 19 usable points"),
        (np.full((50, 3), np.inf), "only 0 usable points"),
        (np.ones((50, 3)), "all points are equal"),
        (np.outer(RNG.random(50), [1, 2, 3]), "all points lie on one line"),
        (FLAT, "all points lie on one plane"),
        (FLAT + 0.01 * RNG.standard_normal((500, 3)), "the points are as flat as their noise"),
        (RNG.standard_normal((500, 3)), "the points scatter as widely as a cylinder through them is thick"),
        (CONE, "of the points lie on one cylinder"),
    ],
)
def test_what_determines_no_cylinder_is_refused(points, fault):
    with pytest.raises(InputError) as refused:
        cylx.fit_cylinder(points)
    assert refused.value.place == "<array>"
    assert fault in refused.value.fault


def test_points_need_three_columns():
    with pytest.raises(ValueError, match=r"shape \(N, 3\)"):
        cylx.fit_cylinder(np.zeros((50, 2)))
