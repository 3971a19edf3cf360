"""The robust fit of a cylinder: exact without noise, at the Cramer-Rao bound with it, and blind to its surroundings."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.fits.polish import SHARP, candidate_quality, move_to_foot, polish
from cylx.fits.robust import TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder, unbiased_radius

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=30, deadline=None)
UNIT = np.array([0.0, 0, 0, 0, 0, 1, 1])


def schedule(sigma):
    return WeightSchedule(max(10.0 * sigma, 0.05), 3.0 * sigma, 1.0, TUKEY * TUKEY_SPREAD)


def sample(rng, n, theta_deg=360.0, height=3.0, sigma=0.01):
    """Give points of the unit cylinder about the z axis, seen from x, and their true angles and heights."""
    angles = np.radians(theta_deg) * (rng.random(n) - 0.5)
    heights = height * (rng.random(n) - 0.5)
    points = np.column_stack([np.cos(angles), np.sin(angles), heights])
    return points + sigma * rng.standard_normal((n, 3)), angles, heights


def rough(rng, size=0.05):
    """Give a start near the unit cylinder."""
    model = UNIT + size * np.concatenate([rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 2), [0], rng.uniform(-1, 1, 1)])
    model[3:6] /= np.linalg.norm(model[3:6])
    return model


def fitted(points, start, sigma, low=-np.inf, high=np.inf, steps=60):
    found = fit_cylinder(points, start, low=low, high=high, schedule=schedule(sigma), steps=steps)
    assert found is not None
    return found


def deviations(model):
    """Give (a, b, alpha, beta, r) of a model against the unit cylinder: offsets at z = 0, tilts, radius."""
    direction = model[3:6] / model[5]
    at_zero = model[:2] - model[2] * direction[:2]
    return np.array([*at_zero, *direction[:2], model[6] - 1.0])


def bound(angles, heights, sigma):
    """Give the Cramer-Rao standard deviations of (a, b, alpha, beta, r) of the unit cylinder for these points.

    The tangential parts of the noise only tell where on the surface a point was; what is left is one row a point.
    """
    cosine, sine = np.cos(angles), np.sin(angles)
    rows = np.column_stack([cosine, sine, heights * cosine, heights * sine, np.ones_like(angles)])
    return sigma * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))


@laws
@given(seeds, st.floats(60, 360))
def test_exact_points_give_the_exact_cylinder(seed, theta_deg):
    rng = np.random.default_rng(seed)
    points, _, _ = sample(rng, 100, theta_deg, sigma=0.0)
    model, spread = fitted(points, rough(rng, 0.02), 1e-3)
    assert np.abs(deviations(model)).max() < 1e-8
    assert spread < 1e-8
    assert np.isclose(np.linalg.norm(model[3:6]), 1.0)


def trials(theta_deg, *, n=400, sigma=0.01, outliers=0.0, away=0.2, count=100):
    """Fit many noisy cylinders; give deviations over the bound of the good points, and the spreads over sigma."""
    rng = np.random.default_rng([int(theta_deg), int(100 * outliers)])
    found, spreads = [], []
    for _ in range(count):
        points, angles, heights = sample(rng, n, theta_deg, sigma=sigma)
        bad = rng.random(n) < outliers
        points[bad] += away * rng.standard_normal((bad.sum(), 3))
        model, spread = fitted(points, rough(rng), sigma)
        spread *= TUKEY_SPREAD
        model[6] = unbiased_radius(model[6], spread)
        found.append(deviations(model) / bound(angles[~bad], heights[~bad], sigma))
        spreads.append(spread / sigma)
    return np.array(found), np.array(spreads)


@pytest.mark.parametrize("theta_deg", [360, 270, 180, 120, 90, 60])
def test_it_reaches_the_cramer_rao_bound(theta_deg):
    found, spreads = trials(theta_deg)
    # the root mean square of 100 scatters by 7 %, Tukey's biweight costs 2.6 %
    assert (np.sqrt((found**2).mean(axis=0)) < 1.3).all()
    assert (np.sqrt((found**2).mean(axis=0)) > 0.75).all()
    assert np.abs(found.mean(axis=0)).max() < 0.4
    assert abs(spreads.mean() - 1) < 0.02


@pytest.mark.parametrize("outliers", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("theta_deg", [360, 120])
def test_outliers_cost_little_more_than_their_number(theta_deg, outliers):
    found, _ = trials(theta_deg, outliers=outliers)
    # an outlier that happens to lie near the surface says little, and says it loudly
    assert (np.sqrt((found**2).mean(axis=0)) < 1.6).all()


def test_the_radius_is_too_large_by_what_is_taken_off():
    rng = np.random.default_rng(5)
    sigma, n, raw, clean = 0.05, 2000, [], []
    for _ in range(100):
        points, _, _ = sample(rng, n, sigma=sigma)
        model, spread = fitted(points, rough(rng), sigma)
        raw.append(model[6] - 1)
        clean.append(unbiased_radius(model[6], TUKEY_SPREAD * spread) - 1)
    error = sigma / math.sqrt(n) / math.sqrt(100)  # of the mean of 100 fits; the bias is eleven times that
    assert abs(np.mean(raw) - sigma**2 / 2) < 4 * error
    assert abs(np.mean(clean)) < 4 * error


@laws
@given(seeds, st.floats(-3, 3))
def test_the_fit_follows_motion_and_scale(seed, exponent):
    rng = np.random.default_rng(seed)
    points, _, _ = sample(rng, 200, 150.0, sigma=0.02)
    start, scale = rough(rng), 10.0**exponent
    turn, shift = Rotation.from_quat(rng.standard_normal(4)).as_matrix(), scale * rng.standard_normal(3)
    one, spread = fitted(points, start, 0.02)
    moved = np.concatenate([scale * turn @ start[:3] + shift, turn @ start[3:6], [scale * start[6]]])
    widths = schedule(0.02)
    other, spread_ = fit_cylinder(
        rng.permutation(scale * points @ turn.T + shift),
        moved,
        low=-np.inf,
        high=np.inf,
        schedule=WeightSchedule(scale * widths.start, scale * widths.floor, widths.decay, widths.tuning),
        steps=60,
    )
    # the point may slide along the axis by as much as the steps of the two fits differ
    expected = scale * turn @ one[:3] + shift
    assert np.linalg.norm(np.cross(other[:3] - expected, other[3:6])) < 1e-7 * scale
    assert np.allclose(other[3:6], turn @ one[3:6], rtol=0, atol=1e-7)
    assert np.isclose(other[6], scale * one[6], rtol=1e-7)
    assert np.isclose(spread_, scale * spread, rtol=1e-6)


def test_far_away_is_as_good_as_here():
    rng = np.random.default_rng(6)
    points, _, _ = sample(rng, 300)
    start, shift = rough(rng), np.array([512345.678, 5412345.432, 123.4])
    moved = start.copy()
    moved[:3] += shift
    here, there = fitted(points, start, 0.01)[0], fitted(points + shift, moved, 0.01)[0]
    there[:3] -= shift
    assert np.allclose(deviations(there), deviations(here), rtol=0, atol=1e-8)


def test_the_start_is_left_as_it_was():
    rng = np.random.default_rng(7)
    start = rough(rng)
    before = start.copy()
    fitted(sample(rng, 100)[0], start, 0.01)
    assert np.array_equal(start, before)


@laws
@given(seeds)
def test_different_starts_end_in_the_same_place(seed):
    rng = np.random.default_rng(8)
    points, angles, heights = sample(rng, 400, 180.0)
    one, _ = fitted(points, UNIT, 0.01)
    other, _ = fitted(points, rough(np.random.default_rng(seed), 0.03), 0.01)
    assert (np.abs(deviations(other) - deviations(one)) < 1e-6 * bound(angles, heights, 0.01)).all()


def test_points_beyond_the_heights_do_not_take_part():
    rng = np.random.default_rng(9)
    points, _, _ = sample(rng, 400)
    cone = sample(rng, 400)[0] * [1.05, 1.05, 1] + [0, 0, 3.5]
    alone, _ = fitted(points, UNIT, 0.01, low=-1.7, high=1.7)
    among, _ = fitted(np.concatenate([cone, points]), UNIT, 0.01, low=-1.7, high=1.7)
    # the heights are measured along an axis that moves, but no point is near the ends
    assert np.allclose(among, alone, rtol=0, atol=1e-12)
    assert not np.allclose(fitted(np.concatenate([cone, points]), UNIT, 0.01)[0], alone, rtol=0, atol=1e-4)


@pytest.mark.parametrize("n", [0, 1, 7])
def test_a_few_points_are_not_fitted(n):
    points = sample(np.random.default_rng(0), n)[0]
    assert fit_cylinder(points, UNIT, low=-9, high=9, schedule=schedule(0.01), steps=20) is None


def test_points_all_far_from_the_start_are_not_fitted():
    points = 5.0 * sample(np.random.default_rng(0), 200)[0]
    assert fit_cylinder(points, UNIT, low=-99, high=99, schedule=schedule(0.01), steps=20) is None


def test_points_on_one_ring_are_fitted_across_it_or_not_at_all():
    # nothing is known of the tilt of a ring but its own plane
    ring = np.column_stack([np.cos(np.arange(60)), np.sin(np.arange(60)), np.zeros(60)])
    found = fit_cylinder(ring, UNIT, low=-9, high=9, schedule=schedule(0.01), steps=20)
    assert found is None or np.allclose(deviations(found[0]), 0, atol=1e-6)


def quality_of(points, model, width):
    quality = np.empty(2)
    candidate_quality(np.ascontiguousarray(points.T), len(points), model, width, np.empty((2, 3)), quality)
    return quality


@laws
@given(seeds)
def test_the_quality_counts_what_supports_a_cylinder(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    n_on, n_in, n_out = rng.integers(1, 60, 3)
    angles = rng.uniform(0, np.pi, n_on + n_in + n_out)
    distances = np.concatenate([np.full(n_on, 1.0), rng.uniform(0, 0.8, n_in), rng.uniform(1.2, 3, n_out)])
    heights = rng.uniform(-2, 2, len(angles))
    points = np.column_stack([distances * np.cos(angles), distances * np.sin(angles), heights]) @ turn.T + [5, 6, 7]
    model = np.concatenate([[5, 6, 7], turn[:, 2], [1.0]])
    count, extent = quality_of(rng.permutation(points), model, 0.1)
    assert count == n_on
    assert np.isclose(extent, np.ptp(heights[:n_on]))


def test_nothing_supports_a_cylinder_beside_the_points():
    assert tuple(quality_of(5.0 + np.zeros((9, 3)), UNIT, 0.1)) == (0, 0)


LIMITS = 0.1, 10.0, 15, 0.25, 0.5
"""Least and greatest radius; fewest points, least share of all, least length along the axis."""


def polished(points, start, noise, limits=LIMITS):
    """Polish a copy of a rough cylinder; give what it is said to be, the model and its quality."""
    model, quality = start.copy(), np.full(3, np.nan)
    return polish(np.ascontiguousarray(points.T), len(points), model, noise, *limits, quality), model, quality


@laws
@given(seeds, st.floats(90, 360), st.floats(0.003, 0.02))
def test_a_rough_cylinder_becomes_the_true_one(seed, theta_deg, sigma):
    rng = np.random.default_rng(seed)
    points, angles, heights = sample(rng, 300, theta_deg, sigma=sigma)
    fit, model, quality = polished(points, rough(rng, 0.1), sigma)
    assert fit == 2
    # a fixed width of three deviations takes off the outer tenth of the information
    assert (np.abs(deviations(model)) < 6 * bound(angles, heights, sigma) + 3 * sigma**2).all()
    assert quality[0] >= 0.97 * 300
    assert np.isclose(quality[1], np.ptp(points @ model[3:6]), atol=0.3)
    assert 0.6 * sigma < quality[2] < 1.1 * sigma


@laws
@given(seeds)
def test_others_beside_and_within_do_not_draw_it_away(seed):
    rng = np.random.default_rng(seed)
    points, _, _ = sample(rng, 300, 200.0, sigma=0.01)
    clutter = np.concatenate(
        [rng.uniform(-0.5, 0.5, (60, 3)), rng.uniform([1.5, -1.5, -1.5], [2.5, 1.5, 1.5], (60, 3))]
    )
    fit, model, quality = polished(rng.permutation(np.concatenate([points, clutter])), rough(rng, 0.05), 0.01)
    assert fit == 2
    assert np.abs(deviations(model)).max() < 0.02
    assert 290 <= quality[0] <= 310


@settings(max_examples=8, deadline=None)
@given(seeds)
def test_points_of_no_surface_are_no_cylinder(seed):
    rng = np.random.default_rng(seed)
    assert polished(rng.uniform(-2, 2, (800, 3)), UNIT, 0.01)[0] < 2  # by chance a few lie closer to a surface
    assert polished(rng.uniform(-2, 2, (30000, 3)), UNIT, 0.01)[0] == 0  # as even within the kernel as anywhere


def test_what_is_missing_is_told_from_what_does_not_fit():
    rng = np.random.default_rng(3)
    points, _, _ = sample(rng, 200, 180.0, height=2.0)
    crowd = np.concatenate([points, np.tile([[9.0, 9, 9]], (500, 1))])
    start = rough(rng, 0.02)
    for cloud, limits, expected in (
        (points, LIMITS, 2),
        (points, (1.1, 10.0, *LIMITS[2:]), 0),
        (points, (0.1, 0.9, *LIMITS[2:]), 0),
        (points, (0.1, 10.0, 201, 0.25, 0.5), 1),
        (crowd, LIMITS, 2),
        (crowd, (0.1, 10.0, 15, 0.4, 0.5), 1),
        (points, (0.1, 10.0, 15, 0.25, 2.5), 1),
        (points[:7], LIMITS, 0),
        (points[:0], LIMITS, 0),
        (points + 9.0, LIMITS, 0),
    ):
        assert polished(cloud, start, 0.01, limits)[0] == expected


@laws
@given(seeds, st.floats(-3, 3))
def test_the_polish_follows_motion_and_scale(seed, exponent):
    rng = np.random.default_rng(seed)
    points, _, _ = sample(rng, 150, 200.0, sigma=0.02)
    start, scale = rough(rng), 10.0**exponent
    turn, shift = Rotation.from_quat(rng.standard_normal(4)).as_matrix(), scale * rng.standard_normal(3)
    fit, one, quality = polished(points, start, 0.02)
    moved = np.concatenate([scale * turn @ start[:3] + shift, turn @ start[3:6], [scale * start[6]]])
    limits = scale * LIMITS[0], scale * LIMITS[1], *LIMITS[2:4], scale * LIMITS[4]
    other_fit, other, other_quality = polished(scale * points @ turn.T + shift, moved, scale * 0.02, limits)
    assert other_fit == fit
    # both end with a step below a hundredth of the spread, not always with the same one
    tolerance = 0.02 * quality[2]
    assert np.linalg.norm(np.cross(other[:3] - scale * turn @ one[:3] - shift, other[3:6])) < tolerance * scale
    assert np.allclose(other[3:6], turn @ one[3:6], rtol=0, atol=tolerance)
    assert np.isclose(other[6], scale * one[6], rtol=tolerance)
    assert np.isclose(other_quality[2], scale * quality[2], rtol=0.02)
    assert np.allclose(other_quality[0], quality[0], rtol=0, atol=2)


def test_the_limit_of_sharpness_lies_between_noise_and_an_even_background():
    # weighted by the biweight of half width 1
    x = np.linspace(-1, 1, 20001)
    weight = (1 - x * x) ** 2
    even = np.sqrt((weight * x * x).sum() / weight.sum())
    gauss = weight * np.exp(-0.5 * (3 * x) ** 2)
    noisy = np.sqrt((gauss * x * x).sum() / gauss.sum())
    assert noisy < 0.9 * SHARP < SHARP < 0.95 * even


@laws
@given(seeds)
def test_the_foot_is_the_point_of_the_axis_next_to_the_centre(seed):
    rng = np.random.default_rng(seed)
    direction, center = rng.standard_normal(3), 10 * rng.standard_normal(3)
    model = np.array([*rng.standard_normal(3), *direction / np.linalg.norm(direction), 2.0])
    moved = model.copy()
    move_to_foot(moved, center)
    assert abs((moved[:3] - center) @ model[3:6]) < 1e-12
    assert np.allclose(np.cross(moved[:3] - center - model[:3], model[3:6]), 0, atol=1e-12)
    assert np.array_equal(moved[3:], model[3:])
