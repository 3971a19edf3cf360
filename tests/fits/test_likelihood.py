"""The maximum-likelihood fit: at the bound whatever share scatters widely, and as uncertain as it says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.fits.likelihood import Prior, fit_mixture
from cylx.fits.robust import TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder
from cylx.geometry.cylinder import axis_basis

UNIT = np.array([0.0, 0, 0, 0, 0, 1, 1])
CHI_5_95, CHI_2_95 = 11.07, 5.991
laws = settings(max_examples=20, deadline=None)


def sample(rng, n, *, theta_deg=360.0, sigma=0.01, share=0.0, broad=0.04):
    """Give points of the unit cylinder about the z axis, some of which scatter more, with angles and heights."""
    angles, heights = np.radians(theta_deg) * (rng.random(n) - 0.5), 3.0 * (rng.random(n) - 0.5)
    points = np.column_stack([np.cos(angles), np.sin(angles), heights])
    scatter = np.where(rng.random(n) < share, broad, sigma)
    return points + scatter[:, None] * rng.standard_normal((n, 3)), angles, heights


def fitted(points, start=UNIT, sigma=0.01, prior=None):
    return fit_mixture(points, start, low=-2.0, high=2.0, width=8.0 * sigma, deviation=sigma, prior=prior)


def errors(fit, truth=UNIT):
    """Give how far the true cylinder is off, in the frame of the fit: two offsets, two tilts, radius."""
    frame = np.array(axis_basis(fit.model[3:6]))
    direction = truth[3:6] * np.sign(truth[3:6] @ fit.model[3:6])
    direction = direction / (direction @ fit.model[3:6])
    away = truth[:3] - fit.model[:3]
    away = away - (away @ fit.model[3:6]) * direction
    return np.array([*(frame @ away), *(frame @ (direction - fit.model[3:6])), truth[6] - fit.model[6]])


def bound(angles, heights, sigma):
    cosine, sine = np.cos(angles), np.sin(angles)
    rows = np.column_stack([cosine, sine, heights * cosine, heights * sine, np.ones_like(angles)])
    return sigma**2 * np.linalg.inv(rows.T @ rows)


@pytest.mark.parametrize("theta_deg", [360.0, 135.0, 50.0])
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_errors_are_as_large_as_the_covariance_says(theta_deg, share):
    rng = np.random.default_rng(int(theta_deg) + int(10 * share))
    squares, radii = [], []
    for _ in range(150):
        fit = fitted(sample(rng, 1500, theta_deg=theta_deg, share=share)[0])
        error = errors(fit)
        squares.append(error @ np.linalg.solve(fit.covariance, error))
        radii.append(error[4] ** 2 / fit.covariance[4, 4])
    # 95 % of 150 are 142.5, with a standard deviation of 2.7
    assert 133 <= np.sum(np.array(squares) < CHI_5_95) <= 150
    assert 133 <= np.sum(np.array(radii) < 1.96**2) <= 150
    assert np.mean(squares) == pytest.approx(5.0, abs=1.3)


def test_the_bound_is_reached_where_a_third_scatters_widely():
    rng = np.random.default_rng(3)
    # what is known of the location of 0.7 N(0, 0.01) + 0.3 N(0, 0.04), against points that all scatter by 0.01
    information = 0.52
    found, least = [], []
    for _ in range(60):
        points, angles, heights = sample(rng, 2000, share=0.3)
        found.append(errors(fitted(points)) ** 2)
        least.append(np.diag(bound(angles, heights, 0.01)) / information)
    ratio = np.sqrt(np.mean(found, axis=0) / np.mean(least, axis=0))
    assert (ratio < 1.3).all()
    assert ratio.mean() == pytest.approx(1.0, abs=0.12)


@laws
@given(st.integers(0, 2**32 - 1), st.floats(60, 360))
def test_exact_points_give_the_exact_cylinder(seed, theta_deg):
    points, _, _ = sample(np.random.default_rng(seed), 200, theta_deg=theta_deg, sigma=0.0)
    fit = fit_mixture(points, UNIT, low=-2.0, high=2.0, width=1e-6, deviation=1e-9)
    assert np.abs(errors(fit)).max() < 1e-9


@laws
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_turned_moved_and_scaled_alike(seed, scale):
    rng = np.random.default_rng(seed)
    points, _, _ = sample(rng, 400, theta_deg=200.0, share=0.2)
    plain = fitted(points)
    turn, shift = Rotation.from_rotvec(rng.standard_normal(3)), rng.uniform(-5, 5, 3)
    start = np.concatenate([scale * (turn.apply(UNIT[:3]) + shift), turn.apply(UNIT[3:6]), [scale]])
    other = fit_mixture(
        scale * (turn.apply(points) + shift),
        start,
        low=-2 * scale,
        high=2 * scale,
        width=0.08 * scale,
        deviation=0.01 * scale,
    )
    expected = np.concatenate(
        [scale * (turn.apply(plain.model[:3]) + shift), turn.apply(plain.model[3:6]), [scale * plain.model[6]]]
    )
    assert np.abs(errors(other, expected)[[0, 1, 4]]).max() < 1e-6 * scale
    assert np.abs(errors(other, expected)[2:4]).max() < 1e-6
    units = np.array([scale, scale, 1, 1, scale])
    frame = turn.apply(np.array(axis_basis(plain.model[3:6])))
    mixing = np.array(axis_basis(other.model[3:6])) @ frame.T
    whole = np.zeros((5, 5))
    whole[:2, :2], whole[2:4, 2:4], whole[4, 4] = mixing, mixing, 1.0
    # small covariances of large variances are the rounding of these
    turned = whole @ plain.covariance @ whole.T * np.outer(units, units)
    deviations = np.sqrt(np.diag(turned))
    assert np.abs((other.covariance - turned) / np.outer(deviations, deviations)).max() < 1e-3


def test_a_neighbour_on_one_side_does_not_pull():
    shifts, pulled = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        points, _, _ = sample(rng, 3000, theta_deg=180.0)
        # a wall that begins just outside the surface, on one side
        wall = np.column_stack([np.full(600, 1.05), rng.uniform(-0.2, 0.2, 600), rng.uniform(-1.5, 1.5, 600)])
        both = np.concatenate([points, wall + 0.01 * rng.standard_normal(wall.shape)])
        schedule = WeightSchedule(0.08, 0.03, 1.0, TUKEY * TUKEY_SPREAD)
        robust, _ = fit_cylinder(both, UNIT, low=-2.0, high=2.0, schedule=schedule, steps=60)
        alone = fitted(points)
        deviations = np.sqrt(np.diag(alone.covariance))
        shifts.append(np.abs(errors(fitted(both, robust)) - errors(alone)) / deviations)
        pulled.append(np.abs(errors(alone._replace(model=robust)) - errors(alone)) / deviations)
    assert np.max(np.median(shifts, axis=0)) < 1.0
    assert np.max(np.median(pulled, axis=0)) > 10.0


def test_too_few_points_give_nothing():
    rng = np.random.default_rng(6)
    assert fitted(sample(rng, 8)[0]) is None
    assert fitted(np.empty((0, 3))) is None
    assert fitted(np.tile([1.0, 0.0, 0.0], (50, 1))) is None


def test_a_known_radius_wins_ten_times_at_a_right_angle():
    rng = np.random.default_rng(10)
    free, drawn, held = [], [], []
    for _ in range(40):
        points, _, _ = sample(rng, 1000, theta_deg=90.0)
        one, other = fitted(points), fitted(points, prior=Prior(radius=1.0, radius_deviation=1e-6))
        # towards the viewer, which is along x, whatever the frame
        free.append(errors(one)[:2] @ np.array(axis_basis(one.model[3:6]))[:, 0])
        drawn.append(errors(other)[:2] @ np.array(axis_basis(other.model[3:6]))[:, 0])
        error = errors(other)[:2]
        held.append(error @ np.linalg.solve(other.covariance[:2, :2], error) < CHI_2_95)
        assert other.model[6] == pytest.approx(1.0, abs=1e-5)
        assert other.covariance[4, 4] == pytest.approx(1e-12, rel=1e-3)
    # the bound says 10.3
    assert np.sqrt(np.mean(np.square(free)) / np.mean(np.square(drawn))) == pytest.approx(10.3, rel=0.4)
    assert np.mean(held) > 0.85


def test_a_known_direction_draws_the_tilts_alone():
    points, _, _ = sample(np.random.default_rng(11), 800, theta_deg=120.0)
    known = Prior(direction=np.array([0.0, 0.0, -1.0]), direction_deviation=1e-7)
    free, drawn = fitted(points), fitted(points, prior=known)
    assert np.linalg.norm(drawn.model[3:5]) < 1e-5 < np.linalg.norm(free.model[3:5])
    assert np.sqrt(np.diag(drawn.covariance)[2:4]) == pytest.approx([1e-7, 1e-7], rel=0.01)
    assert drawn.model[6] == pytest.approx(free.model[6], abs=np.sqrt(free.covariance[4, 4]))


@pytest.mark.parametrize("prior", [Prior(), Prior(1.01, 1e6), Prior(direction=UNIT[3:6], direction_deviation=1e3)])
def test_a_prior_that_knows_nothing_changes_nothing(prior):
    points, _, _ = sample(np.random.default_rng(12), 800, theta_deg=150.0)
    free, drawn = fitted(points), fitted(points, prior=prior)
    assert drawn.model == pytest.approx(free.model, abs=1e-9)
    assert drawn.covariance == pytest.approx(free.covariance, rel=1e-5, abs=1e-15)


def test_priors_of_the_right_width_are_as_certain_as_they_say():
    rng = np.random.default_rng(13)
    squares = []
    for _ in range(120):
        points, _, _ = sample(rng, 600, theta_deg=120.0)
        tilts = 0.001 * rng.standard_normal(2)
        known = Prior(1.0 + 0.001 * rng.standard_normal(), 0.001, np.array([*tilts, 1.0]), 0.001)
        fit = fitted(points, prior=known)
        error = errors(fit)
        squares.append(error @ np.linalg.solve(fit.covariance, error))
    assert 105 <= np.sum(np.array(squares) < CHI_5_95) <= 120
    assert np.mean(squares) == pytest.approx(5.0, abs=1.4)


def test_what_the_points_contradict_is_left_out():
    points, _, _ = sample(np.random.default_rng(14), 2000)
    free = fitted(points)
    wrong = Prior(1.2, 0.001, np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0), 0.001)
    assert wrong.as_far_as_borne_out(free) is None
    assert wrong._replace(radius=1.0).as_far_as_borne_out(free).direction is None
    right = Prior(1.0, 0.001, UNIT[3:6], 0.001)
    assert right.as_far_as_borne_out(free) is right
    assert wrong._replace(radius_deviation=0.1).as_far_as_borne_out(free).radius == 1.2
