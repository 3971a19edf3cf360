"""Planes and osculating cylinders of small windows: exact in the limit, blind to how they are turned."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.geometry.quadric import fit_plane, osculating_cylinder

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)
TINY = 1e-9  # a noise for clouds that have none


def plane_of(points, noise=TINY):
    """Give share, centre and normal."""
    center, normal = np.full(3, np.nan), np.full(3, np.nan)
    share = fit_plane(
        np.ascontiguousarray(points.T), len(points), noise, center, normal, np.empty((3, 3)), np.empty((3, 3))
    )
    return share, center, normal


def cylinder_of(points, center, normal, noise=TINY):
    """Give the osculating cylinder (7,), or None where there is no curvature."""
    model = np.full(7, np.nan)
    scratch = np.empty((6, 6)), np.empty(6), np.empty((2, 3)), np.empty((4, len(points)))
    xyz = np.ascontiguousarray(points.T)
    return model if osculating_cylinder(xyz, len(points), noise, center, normal, model, *scratch) else None


def window(rng, size, n=300, radius=1.0):
    """Give points of the cylinder about the z axis within `size` of (radius, 0, 0), evenly spread."""
    angles = rng.uniform(-size, size, 4 * n) / radius
    heights = rng.uniform(-size, size, 4 * n)
    points = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), heights])
    return points[np.linalg.norm(points - [radius, 0, 0], axis=1) < size][:n]


def tilt(model, direction=(0, 0, 1)):
    return np.linalg.norm(np.cross(model[3:6], direction))


def off_axis(model):
    """Distance of the model's axis from the z axis where they are compared, at z = 0."""
    return np.hypot(*(model[:2] - model[2] / model[5] * model[3:5]))


@laws
@given(seeds)
def test_a_plane_is_found_wherever_it_is(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    flat = np.column_stack([rng.uniform(-1, 1, (60, 2)), np.zeros(60)])
    shift = rng.standard_normal(3)  # the points of a window lie about zero
    share, center, normal = plane_of(flat @ turn.T + shift)
    assert share == 1.0
    assert np.allclose(np.cross(normal, turn[:, 2]), 0, atol=1e-12)
    assert np.isclose(np.linalg.norm(normal), 1.0)
    assert np.allclose(center, flat.mean(axis=0) @ turn.T + shift, atol=1e-12)


@pytest.mark.parametrize("outliers", [0.0, 0.05, 0.1])
def test_a_noisy_plane_is_found_beside_what_is_not_on_it(outliers):
    rng = np.random.default_rng(2)
    n, sigma = 400, 0.01
    for _ in range(20):
        points = np.column_stack([rng.uniform(-1, 1, (n, 2)), sigma * rng.standard_normal(n)])
        away = rng.random(n) < outliers
        points[away, 2] = rng.uniform(0.1, 0.5, away.sum())
        share, center, normal = plane_of(points, sigma)
        # two slopes, each known to sigma over the root of the squared distances
        assert tilt(np.concatenate([center, normal, [1]])) < 5 * sigma / np.sqrt(n * (1 - outliers) / 3)
        assert abs(share - 0.997 * (1 - away.mean())) < 0.02


def test_a_curved_surface_is_not_flat():
    assert plane_of(window(np.random.default_rng(3), 0.5), 0.01)[0] < 0.9


@pytest.mark.parametrize(("step", "share"), [(0.5, 1.0), (1.0, 1.0), (2.0, 0.0), (2.9, 0.0)])
def test_what_lies_within_three_noises_must_scatter_like_noise(step, share):
    rng = np.random.default_rng(3)
    ridge = np.column_stack([rng.uniform(-1, 1, (200, 2)), step * 0.01 * rng.choice([-1, 1], 200)])
    assert plane_of(ridge, 0.01)[0] == share


@pytest.mark.parametrize("n", [0, 1, 9])
def test_a_few_points_are_no_plane(n):
    assert plane_of(np.random.default_rng(0).random((n, 3)), 1.0)[0] == 0.0


@pytest.mark.parametrize("radius", [0.2, 1.0, 5.0])
def test_small_windows_on_a_cylinder_show_the_cylinder(radius):
    rng = np.random.default_rng(4)
    points = window(rng, 0.05 * radius, radius=radius)
    _, center, normal = plane_of(points)
    model = cylinder_of(points, center, normal)
    assert np.isclose(np.linalg.norm(model[3:6]), 1.0)
    assert np.isclose(model[6], radius, rtol=1e-3)
    assert tilt(model) < 1e-4
    assert off_axis(model) < 1e-3 * radius
    # the point is the one of the axis nearest the window
    assert abs((model[:3] - points.mean(axis=0)) @ model[3:6]) < 0.02 * radius


def test_the_error_falls_with_the_square_of_the_window():
    errors = []
    for size in (0.4, 0.2, 0.1):
        found = []
        for seed in range(30):
            points = window(np.random.default_rng(seed), size)
            _, center, normal = plane_of(points)
            model = cylinder_of(points, center, normal)
            found.append([abs(model[6] - 1), tilt(model), off_axis(model)])
        errors.append(np.sqrt((np.array(found) ** 2).mean(axis=0)))
    ratios = np.array([errors[0] / errors[1], errors[1] / errors[2]])
    assert ((ratios > 3.5) & (ratios < 4.5)).all()
    assert errors[2].max() < 0.002


@laws
@given(seeds, st.floats(-2, 2))
def test_the_cylinder_follows_motion_and_scale(seed, exponent):
    rng = np.random.default_rng(seed)
    points = window(rng, 0.4)
    turn, scale = Rotation.from_quat(rng.standard_normal(4)).as_matrix(), 10.0**exponent
    shift = scale * rng.standard_normal(3)
    _, center, normal = plane_of(points)
    one = cylinder_of(points, center, normal)
    moved = rng.permutation(scale * points @ turn.T + shift)
    other = cylinder_of(moved, scale * turn @ center + shift, turn @ normal, scale * TINY)
    assert np.isclose(other[6], scale * one[6], rtol=1e-8)
    assert np.allclose(other[:3], scale * turn @ one[:3] + shift, rtol=0, atol=1e-8 * scale)
    assert np.allclose(np.cross(other[3:6], turn @ one[3:6]), 0, atol=1e-8)


@laws
@given(seeds)
def test_it_does_not_matter_which_side_of_the_plane_is_up(seed):
    points = window(np.random.default_rng(seed), 0.4)
    _, center, normal = plane_of(points)
    one, other = cylinder_of(points, center, normal), cylinder_of(points, center, -normal)
    assert np.allclose(other[[0, 1, 2, 6]], one[[0, 1, 2, 6]], rtol=0, atol=1e-9)
    assert np.allclose(np.cross(other[3:6], one[3:6]), 0, atol=1e-9)


@pytest.mark.parametrize("lean_deg", [5, 15, 30])
def test_a_plane_that_leans_does_not_change_the_curvature(lean_deg):
    lean = np.radians(lean_deg)
    points = window(np.random.default_rng(6), 0.06, n=600)
    normal = np.array([np.cos(lean), 0.6 * np.sin(lean), 0.8 * np.sin(lean)])
    model = cylinder_of(points, points.mean(axis=0), normal)
    assert np.isclose(model[6], 1.0, rtol=0.02)
    assert tilt(model) < 0.02
    assert off_axis(model) < 0.02


def test_of_two_curvatures_the_stronger_one_counts():
    rng = np.random.default_rng(7)
    x, y = rng.uniform(-0.05, 0.05, (2, 400))
    up = np.array([0.0, 0, 1])
    for strong, weak in ((1.0, 0.5), (-1.0, 0.5), (1.0, -0.5), (-1.0, -0.5)):
        model = cylinder_of(np.column_stack([x, y, 0.5 * (strong * x * x + weak * y * y)]), np.zeros(3), up)
        assert np.isclose(model[6], 1.0, rtol=1e-6)
        assert tilt(model, (0, 1, 0)) < 1e-6
        assert np.allclose(model[:3], [0, 0, strong], atol=1e-6)


def test_a_sphere_is_a_cylinder_of_its_own_radius():
    rng = np.random.default_rng(8)
    points = rng.standard_normal((40000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points = points[points[:, 2] > np.cos(0.08)]
    assert len(points) > 30
    model = cylinder_of(points, np.array([0.0, 0, 1]), np.array([0.0, 0, 1]))
    assert np.isclose(model[6], 1.0, rtol=0.01)
    assert np.linalg.norm(model[:3]) < 0.02


def test_a_plane_is_not_curved():
    rng = np.random.default_rng(9)
    points = np.column_stack([rng.integers(-8, 9, (100, 2)) / 8.0, np.zeros(100)])
    assert cylinder_of(points, np.zeros(3), np.array([0.0, 0, 1])) is None


@pytest.mark.parametrize("n", [0, 5, 9])
def test_a_few_points_are_no_surface(n):
    points = window(np.random.default_rng(0), 0.4)[:n]
    assert cylinder_of(points, np.array([1.0, 0, 0]), np.array([1.0, 0, 0])) is None


def test_points_on_a_line_are_no_surface():
    line = np.outer(np.linspace(-1, 1, 30), [0, 1.0, 0])
    assert cylinder_of(line, np.zeros(3), np.array([0.0, 0, 1])) is None


@pytest.mark.parametrize("outliers", [0.0, 0.1, 0.2])
def test_a_noisy_window_among_outliers_shows_the_cylinder_roughly(outliers):
    rng = np.random.default_rng(10)
    sigma, errors = 0.01, []
    for _ in range(30):
        points = window(rng, 0.5, n=300)
        points += sigma * rng.standard_normal(points.shape)
        away = rng.random(len(points)) < outliers
        points[away] += 0.2 * rng.standard_normal((away.sum(), 3))
        _, center, normal = plane_of(points, sigma)
        model = cylinder_of(points, center, normal, sigma)
        errors.append([abs(model[6] - 1), tilt(model)])
    # a start for the fit of a cylinder, which needs the radius to a fifth or so
    assert (np.median(errors, axis=0) < [0.1, 0.03]).all()
