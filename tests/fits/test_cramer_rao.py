"""The Cramér-Rao bound: its closed forms, its laws of scale, and a fit that scatters as it says."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from cylx.fits.cramer_rao import covariance_bound, mean_errors_at_bound, mean_length, outlier_information
from cylx.geometry.cylinder import axis_basis
from cylx.synthetic import single

laws = settings(max_examples=40, deadline=None)
counts = st.integers(10, 10**6)
heights = st.floats(0.1, 50)
sigmas = st.floats(1e-4, 0.5)
arcs = st.floats(math.radians(20), 2 * math.pi)
TURN = 2 * math.pi


@laws
@given(counts, heights, sigmas)
def test_a_full_turn_has_the_closed_form(points, height, sigma):
    k = sigma**2 / points
    expected = np.diag([2 * k, 2 * k, 24 * k / height**2, 24 * k / height**2, k])
    found = covariance_bound(points, height, TURN, sigma)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-9 * min(k, k / height**2))


@laws
@given(counts, heights, arcs, sigmas)
def test_an_arc_has_the_closed_form(points, height, theta, sigma):
    k = sigma**2 / points
    c1, c2 = math.sin(theta / 2) / (theta / 2), (1 + math.sin(theta) / theta) / 2
    s2, d = 1 - c2, c2 - c1**2
    found = covariance_bound(points, height, theta, sigma)
    expected = [k / d, k / s2, 12 * k / (height**2 * c2), 12 * k / (height**2 * s2), k * c2 / d]
    assert np.allclose(np.diag(found), expected, rtol=1e-6)
    assert np.isclose(found[0, 4], -k * c1 / d, rtol=1e-6, atol=1e-12 * k)
    assert np.allclose(found, found.T, rtol=1e-6)
    others = [found[i, j] for i in range(5) for j in range(i) if (i, j) != (4, 0)]
    assert np.allclose(others, 0, atol=1e-9 * found.max())


@laws
@given(arcs, heights)
def test_it_is_the_inverse_of_what_single_points_tell(theta, height):
    """Sum what each point of an even grid tells, which the formula has as integrals."""
    m, n = 400, 60
    phi = theta * ((np.arange(m) + 0.5) / m - 0.5)
    z = height * ((np.arange(n) + 0.5) / n - 0.5)
    phi, z = (each.ravel() for each in np.meshgrid(phi, z))
    rows = np.column_stack([np.cos(phi), np.sin(phi), z * np.cos(phi), z * np.sin(phi), np.ones(len(phi))])
    scale = np.diag([1, 1, height, height, 1])
    expected = scale @ np.linalg.inv(rows.T @ rows / 0.1**2) @ scale
    found = scale @ covariance_bound(m * n, height, theta, 0.1) @ scale
    # a sum of n cells differs from the integral of z^2 by 1 / n^2; an angular one by 1 / (24 m^2) of what is left of it
    assert np.allclose(np.diag(found), np.diag(expected), rtol=2e-3)


@laws
@given(counts, heights, arcs, sigmas, st.floats(0.1, 1.5), st.floats(0.1, 10))
def test_points_noise_and_information_scale_it(points, height, theta, sigma, information, factor):
    one = covariance_bound(points, height, theta, sigma)
    assert np.allclose(covariance_bound(4 * points, height, theta, sigma), one / 4, rtol=1e-9)
    assert np.allclose(covariance_bound(points, height, theta, factor * sigma), factor**2 * one, rtol=1e-9)
    assert np.allclose(covariance_bound(points, height, theta, sigma, information), one / information, rtol=1e-9)
    taller = covariance_bound(points, factor * height, theta, sigma)
    assert np.allclose(taller[2:4, 2:4], one[2:4, 2:4] / factor**2, rtol=1e-6, atol=1e-9 * one[2, 2] / factor**2)
    assert np.allclose(taller[4, 4], one[4, 4], rtol=1e-6)


@laws
@given(counts, heights, sigmas)
def test_more_of_the_turn_tells_more(points, height, sigma):
    spreads = [
        np.diag(covariance_bound(points, height, math.radians(deg), sigma))[[0, 4]] for deg in (30, 60, 90, 180, 270)
    ]
    assert (np.diff(spreads, axis=0) < 0).all()


@pytest.mark.parametrize("theta", [0.3, 0.6])
def test_a_short_arc_has_the_known_powers(theta):
    a, b, alpha, beta, r = np.sqrt(np.diag(covariance_bound(10_000, 3.0, theta, 0.02)))
    unit = 0.02 / 100  # sigma / sqrt(N)
    # the next term of each is of the order of theta^2 / 10
    near = {"rel": 0.1 * theta**2 + 0.005}
    assert a == pytest.approx(26.8 * unit / theta**2, **near)
    assert r == pytest.approx(26.8 * unit / theta**2, **near)
    assert b == pytest.approx(3.46 * unit / theta, **near)
    assert alpha == pytest.approx(3.46 * unit / 3.0, **near)
    assert beta == pytest.approx(12 * unit / (3.0 * theta), **near)


# noise with outliers


@given(sigmas, sigmas)
def test_without_outliers_noise_tells_all(sigma, sigma_o):
    assert outlier_information(sigma, sigma_o, 0.0) == 1.0
    assert outlier_information(sigma, sigma, 0.3) == 1.0


@laws
@given(sigmas, st.floats(1.01, 200))
def test_all_outliers_are_gaussian_noise_again(sigma, ratio):
    assert outlier_information(sigma, ratio * sigma, 1.0) == pytest.approx(ratio**-2, rel=1e-6)


@laws
@given(sigmas, st.floats(1.05, 200), st.floats(0.01, 0.99))
def test_it_lies_between_its_limits(sigma, ratio, p):
    """Between that of a Gaussian of the same variance, and that of knowing which points are outliers."""
    found = outlier_information(sigma, ratio * sigma, p)
    least = 1 / (1 - p + p * ratio**2)
    most = 1 - p + p / ratio**2
    assert least * (1 - 1e-6) <= found <= most * (1 + 1e-6)
    assert outlier_information(7 * sigma, 7 * ratio * sigma, p) == pytest.approx(found, rel=1e-6)


@pytest.mark.parametrize(
    ("sigma", "sigma_o", "p", "expected"),
    [
        (0.001, 0.1, 0.4, 0.565),
        (0.01, 0.04, 0.3, 0.520),
        (0.005, 0.01, 0.1, 0.836),
        (0.05, 0.1, 0.4, 0.534),
        (0.001, 0.04, 0.3, 0.642),
        (0.03, 0.04, 0.3, 0.817),
        (0.05, 0.04, 0.3, 1.123),  # the outliers are the better points
        (0.001, 0.1, 0.1, 0.886),
        (0.001, 0.1, 0.5, 0.461),
        (0.001, 0.05, 0.4, 0.542),
        (0.001, 0.2, 0.4, 0.579),
        (0.1, 0.05, 0.1, 1.094),
    ],
)
def test_it_is_what_another_program_found(sigma, sigma_o, p, expected):
    assert outlier_information(sigma, sigma_o, p) == pytest.approx(expected, abs=6e-4)


# mean errors


@laws
@given(st.floats(1e-6, 1e3))
def test_the_mean_length_of_a_round_cloud_is_that_of_rayleigh(variance):
    assert mean_length(variance * np.eye(2)) == pytest.approx(math.sqrt(math.pi / 2 * variance), rel=1e-9)


@laws
@given(st.floats(1e-3, 1e3), st.floats(0, TURN))
def test_the_mean_length_of_a_flat_cloud_is_the_mean_deviation_and_turning_it_changes_nothing(variance, angle):
    assert mean_length(np.diag([variance, 0.0])) == pytest.approx(math.sqrt(2 / math.pi * variance), rel=1e-6)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    cloud = np.diag([variance, 0.3])
    assert mean_length(turn @ cloud @ turn.T) == pytest.approx(mean_length(cloud), rel=1e-6)


def test_the_mean_length_is_what_samples_have():
    cloud = np.array([[4.0, 1.5], [1.5, 1.0]])
    lengths = np.linalg.norm(np.random.default_rng(0).multivariate_normal([0, 0], cloud, 200_000), axis=1)
    error = lengths.std() / math.sqrt(len(lengths))
    assert abs(mean_length(cloud) - lengths.mean()) < 5 * error


@laws
@given(counts, heights, sigmas)
def test_mean_errors_of_a_full_turn_are_the_known_ones(points, height, sigma):
    angle, offset, percent = mean_errors_at_bound(points, height, TURN, sigma, 0.04, 0.0)
    unit = sigma / math.sqrt(points)
    assert angle == pytest.approx(math.degrees(math.sqrt(12 * math.pi) * unit / height), rel=1e-6)  # 6.14
    assert offset == pytest.approx(math.sqrt(math.pi) * unit, rel=1e-6)  # 1.77
    assert percent == pytest.approx(100 * math.sqrt(2 / math.pi) * unit, rel=1e-6)  # 0.80


@pytest.mark.parametrize(
    ("theta_deg", "height", "sigma", "sigma_o", "p", "points", "angle_deg"),
    [
        (360, 3, 0.01, 0.01, 0.0, 2000, 0.0262),
        (90, 3, 0.01, 0.01, 0.0, 2000, 0.0330),
        (45, 3, 0.002, 0.002, 0.0, 2000, 0.0112),
        (360, 3, 0.001, 0.1, 0.4, 2000, 0.0035),
        (180, 3, 0.005, 0.01, 0.1, 2000, 0.0143),
        (50, 2, 0.005, 0.01, 0.1, 10_000, 0.01883),
        (270, 2, 0.005, 0.01, 0.1, 10_000, 0.00982),
    ],
)
def test_mean_angles_are_what_another_program_found(theta_deg, height, sigma, sigma_o, p, points, angle_deg):
    found = mean_errors_at_bound(points, height, math.radians(theta_deg), sigma, sigma_o, p)[0]
    assert found == pytest.approx(angle_deg, rel=0.015)  # of two digits


@pytest.mark.parametrize("theta_deg", [360, 120])
def test_least_squares_scatter_as_the_bound_says(theta_deg):
    points, height, sigma, trials = 500, 4.0, 0.01, 60
    theta = math.radians(theta_deg)
    first, second = axis_basis(np.array([0.0, 0.0, 1.0]))  # the arc of the scene begins at the first one
    view = math.cos(theta / 2) * first + math.sin(theta / 2) * second
    across = math.cos(theta / 2) * second - math.sin(theta / 2) * first

    def residuals(p, x, y, z):
        a, b, alpha, beta, r = p
        direction = np.array([alpha, beta, 1.0]) / math.sqrt(1 + alpha**2 + beta**2)
        away = np.column_stack([x - a, y - b, z])
        return np.linalg.norm(np.cross(away, direction), axis=1) - r

    fits = []
    for seed in range(trials):
        cloud = single(points=points, height=height, sigma=sigma, theta_deg=theta_deg, seed=seed).points
        fits.append(least_squares(residuals, [0, 0, 0, 0, 1], args=(cloud @ view, cloud @ across, cloud[:, 2])).x)
    bound = covariance_bound(points, height, theta, sigma)
    errors = np.array(fits) - [0, 0, 0, 0, 1]
    # each sum of squares over its variance is chi-squared with `trials` degrees of freedom: 4 sigma of it, both ways
    ratios = (errors**2).mean(axis=0) / np.diag(bound)
    assert np.allclose(ratios, 1.0, rtol=0, atol=4 * math.sqrt(2 / trials))
    angle, offset, percent = mean_errors_at_bound(points, height, theta, sigma, sigma, 0.0)
    tilts = np.degrees(np.linalg.norm(errors[:, 2:4], axis=1))
    lengths = np.linalg.norm(errors[:, :2], axis=1)
    for values, expected in ((tilts, angle), (lengths, offset), (100 * np.abs(errors[:, 4]), percent)):
        assert abs(values.mean() - expected) < 4 * values.std() / math.sqrt(trials)
