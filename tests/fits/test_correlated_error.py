"""How uncertain a fit is whose errors neighbouring points share: against many fits of drawn errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.fits.correlated_error import shared_covariance, shared_variance

NOISE = 0.01


def rows_of(angles, heights):
    cosine, sine = np.cos(angles), np.sin(angles)
    return np.column_stack([cosine, sine, heights * cosine, heights * sine, np.ones(len(angles))])


def drawn(rng, arc, height, length, ratio, n=2000):
    """Return coordinates of points and errors, white ones and ones that neighbours share over a length."""
    angles, heights = rng.uniform(-arc / 2, arc / 2, n), rng.uniform(-height / 2, height / 2, n)
    knots = np.stack(np.meshgrid(np.linspace(-arc / 2, arc / 2, 20), np.linspace(-height / 2, height / 2, 12)))
    knots = knots.reshape(2, -1)
    apart = np.hypot(*(knots[:, :, None] - knots[:, None]))
    shared = np.linalg.cholesky(np.exp(-apart / length) + 1e-9 * np.eye(len(apart))) @ rng.standard_normal(len(apart))
    nearest = ((angles[:, None] - knots[0]) ** 2 + (heights[:, None] - knots[1]) ** 2).argmin(axis=1)
    return angles, heights, NOISE * (rng.standard_normal(n) + ratio * shared[nearest])


def fitted(angles, heights, errors):
    """Return errors of the parameters, residuals, and the covariance for independent errors."""
    rows = rows_of(angles, heights)
    found = np.linalg.lstsq(rows, errors, rcond=None)[0]
    residuals = errors - rows @ found
    return found, residuals, np.linalg.inv(rows.T @ rows) * residuals.var()


@pytest.mark.parametrize(
    ("arc", "height", "length", "ratio"), [(2.0, 1.0, 0.2, 1.0), (3.0, 2.0, 0.3, 2.0), (2.0, 1.0, 0.1, 0.5)]
)
def test_errors_are_as_large_as_stated_where_independent_ones_would_be_several_times_smaller(
    arc, height, length, ratio
):
    rng = np.random.default_rng(5)
    stated, independent = [], []
    for _ in range(25):
        angles, heights, errors = drawn(rng, arc, height, length, ratio)
        found, residuals, white = fitted(angles, heights, errors)
        covariance = white + shared_covariance(heights, residuals, angles, 1.0)
        stated.append(found @ np.linalg.solve(covariance, found) / 5)
        independent.append(found @ np.linalg.solve(white, found) / 5)
    assert 0.05 < np.mean(stated) < 2.0
    assert np.mean(independent) > 4.0 * np.mean(stated)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.0, 6.2), st.floats(0.3, 6.0))
def test_white_noise_is_hardly_shared(seed, arc, height):
    rng = np.random.default_rng(seed)
    angles, heights = rng.uniform(-arc / 2, arc / 2, 3000), rng.uniform(-height / 2, height / 2, 3000)
    _, residuals, white = fitted(angles, heights, NOISE * rng.standard_normal(3000))
    shared = shared_covariance(heights, residuals, angles, 1.0)
    assert (np.diag(shared) < 2.0 * np.diag(white)).all()


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-5, 5))
def test_unit_and_order_do_not_matter(seed, exponent):
    rng, scale = np.random.default_rng(seed), np.exp(exponent)
    angles, heights, errors = drawn(rng, 2.0, 1.0, 0.3, 1.0)
    _, residuals, _ = fitted(angles, heights, errors)
    shared, order = shared_covariance(heights, residuals, angles, 1.0), rng.permutation(len(angles))
    assert np.allclose(np.linalg.eigvalsh(shared), np.abs(np.linalg.eigvalsh(shared)), atol=1e-9 * np.trace(shared))
    shuffled = shared_covariance(heights[order], residuals[order], angles[order], 1.0)
    assert np.allclose(shuffled, shared, rtol=1e-6, atol=1e-9 * np.abs(shared).max())
    units = np.array([scale, scale, 1.0, 1.0, scale])
    larger = shared_covariance(scale * heights, scale * residuals, angles, scale)
    assert np.allclose(larger, shared * np.outer(units, units), rtol=1e-6)


def test_the_middle_of_a_cone_is_as_certain_as_a_cylinder():
    rng = np.random.default_rng(1)
    angles, heights = rng.uniform(-1.5, 1.5, 3000), rng.uniform(-2.0, 2.0, 3000)
    _, residuals, white = fitted(angles, heights, NOISE * rng.standard_normal(3000) + 0.02 * heights)
    shared = shared_covariance(heights, residuals, angles, 1.0)
    independent = white * NOISE**2 / residuals.var()
    assert (np.diag(shared) < 2.0 * np.diag(independent)).all()


def test_the_variance_of_an_estimate_that_weighs_all_alike_is_in_the_covariance():
    rng = np.random.default_rng(7)
    angles, heights, errors = drawn(rng, 2.0, 1.0, 0.3, 1.0)
    _, residuals, _ = fitted(angles, heights, errors)
    cosine, sine = np.cos(angles), np.sin(angles)
    rows = np.column_stack([cosine, sine, heights * cosine, heights * sine, np.ones(len(angles))])
    influence = np.linalg.solve(rows.T @ rows, rows.T)[4]
    covariance = shared_covariance(heights, residuals, angles, 1.0)
    variance = shared_variance(heights, residuals, angles, 1.0, influence)
    assert variance == pytest.approx(covariance[4, 4], rel=0.2)  # its rows are means over cells
    assert variance > 0
    assert shared_variance(heights, residuals, angles, 1.0, 2.0 * influence) == pytest.approx(4.0 * variance)


@pytest.mark.parametrize("n", [0, 1, 5, 20])
def test_few_points_tell_nothing(n):
    rng = np.random.default_rng(0)
    assert shared_covariance(rng.random(n), rng.random(n), rng.random(n), 1.0) is None


def test_points_exactly_on_the_surface_share_nothing():
    rng = np.random.default_rng(0)
    assert not shared_covariance(rng.random(2000), np.zeros(2000), 2 * rng.random(2000), 1.0).any()
