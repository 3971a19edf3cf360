"""A cylinder given its radius: what Gaussians say, and what a fit that knows it says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.fits.conditioning import given_radius
from cylx.fits.likelihood import Prior, fit_mixture
from cylx.geometry.cylinder import axis_basis
from cylx.synthetic import single


def some(seed):
    """Give a model in any attitude and a covariance in which everything hangs together."""
    rng = np.random.default_rng(seed)
    half = 1e-2 * rng.standard_normal((5, 7))
    direction = Rotation.from_quat(rng.standard_normal(4)).apply([0, 0, 1.0])
    return np.array([*rng.standard_normal(3), *direction, 1.0]), half @ half.T


@given(st.integers(0, 2**32 - 1), st.floats(-0.01, 0.01), st.floats(1e-5, 0.1))
def test_it_is_the_product_of_two_gaussians(seed, away, deviation):
    model, covariance = some(seed)
    before = model.copy()
    moved, left = given_radius(model, covariance, 1.0 + away, deviation)
    radius = np.array([0, 0, 0, 0, 1.0])
    precision = np.linalg.inv(covariance) + np.outer(radius, radius) / deviation**2
    assert left == pytest.approx(np.linalg.inv(precision), rel=1e-6, abs=1e-12)
    step = np.linalg.solve(precision, radius * away / deviation**2)
    frame = np.array(axis_basis(model[3:6]))
    assert frame @ (moved[:3] - model[:3]) == pytest.approx(step[:2], abs=1e-9)
    assert frame @ (moved[3:6] / (moved[3:6] @ model[3:6]) - model[3:6]) == pytest.approx(step[2:4], abs=1e-9)
    assert moved[6] - model[6] == pytest.approx(step[4], abs=1e-12)
    assert np.linalg.norm(moved[3:6]) == pytest.approx(1.0)
    assert np.array_equal(model, before)


@given(st.integers(0, 2**32 - 1))
def test_what_says_nothing_changes_nothing(seed):
    model, covariance = some(seed)
    moved, left = given_radius(model, covariance, 7.0, 1e9)
    assert moved == pytest.approx(model, abs=1e-12)
    assert left == pytest.approx(covariance, rel=1e-9)


def test_a_fit_that_knows_the_radius_comes_to_the_same():
    points = np.array(single(points=1500, sigma=0.01, theta_deg=90, seed=4).points)
    start = np.array([0.0, 0, 0, 0, 0, 1, 1])
    limits = {"low": -3.0, "high": 3.0, "width": 0.08, "deviation": 0.01}
    free = fit_mixture(points, start, **limits)
    drawn = fit_mixture(points, start, **limits, prior=Prior(radius=1.0, radius_deviation=5e-4))
    moved, left = given_radius(free.model, free.covariance, 1.0, 5e-4)
    away = np.linalg.norm(moved[:2] - drawn.model[:2]), np.linalg.norm(free.model[:2] - drawn.model[:2])
    assert away[0] < 0.1 * away[1]
    assert moved[6] == pytest.approx(drawn.model[6], abs=5e-5)
    assert np.sqrt(np.diag(left)) == pytest.approx(np.sqrt(np.diag(drawn.covariance)), rel=0.05)
