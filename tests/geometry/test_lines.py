"""Pairs of lines: their feet, their angle, and the axis of the motion from one to the other; lines through points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.geometry.lines import LEAST_POINTS_OF_LINE, PARALLEL, common_perpendicular, fit_line, off_line

seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-7, np.log10(1.57)).map(
    lambda exponent: 10.0**exponent
)  # at right angles both ways round are as short
gaps = st.just(0.0) | st.floats(-6, 1).map(lambda exponent: 10.0**exponent)
laws = settings(max_examples=80, deadline=None)


def pair(seed, angle, gap):
    """Give two lines by a common perpendicular: points and directions, the true feet, and the axis of the motion."""
    rng = np.random.default_rng(seed)
    first, axis, _ = np.linalg.qr(rng.standard_normal((3, 3)))[0].T
    second = np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)
    foot = rng.standard_normal(3)
    feet = foot, foot + gap * axis
    points = feet[0] + 3 * rng.standard_normal() * first, feet[1] + 3 * rng.standard_normal() * second
    return points[0], first, points[1], second, *feet, axis


@laws
@given(seeds, angles, gaps)
def test_feet_angle_and_axis_are_the_true_ones(seed, angle, gap):
    *lines, foot, other, axis = pair(seed, angle, gap)
    found_foot, found_other, found_angle, found_axis = common_perpendicular(*lines)
    # the angle is good to rounding, the direction of the axis to rounding over the angle, and so the feet
    rounding = 1e-14 / angle
    reach = 10 + gap / angle
    assert np.isclose(found_angle, angle, rtol=1e-12, atol=1e-15)
    assert np.allclose(found_axis, axis, rtol=0, atol=rounding)
    assert np.allclose(found_foot, foot, rtol=0, atol=reach * rounding)
    assert np.allclose(found_other, other, rtol=0, atol=reach * rounding)


@laws
@given(seeds, angles, gaps)
def test_the_feet_are_on_their_lines_and_the_gap_is_square_to_both(seed, angle, gap):
    point, direction, other_point, other_direction, *_ = pair(seed, angle, gap)
    foot, other, _, axis = common_perpendicular(point, direction, other_point, other_direction)
    reach = 1.0 + np.abs(foot - point).max()
    assert np.allclose(np.cross(foot - point, direction), 0, atol=1e-14 * reach)
    assert np.allclose(np.cross(other - other_point, other_direction), 0, atol=1e-14 * reach)
    assert np.isclose(np.linalg.norm(axis), 1.0)
    assert abs(axis @ direction) < 1e-14
    assert abs(axis @ other_direction) < 1e-14
    if angle > 1e-3:
        assert np.allclose([(other - foot) @ direction, (other - foot) @ other_direction], 0, atol=1e-9)


@laws
@given(seeds, angles, gaps)
def test_directions_count_up_to_their_sign(seed, angle, gap):
    point, direction, other_point, other_direction, *_ = pair(seed, angle, gap)
    one = common_perpendicular(point, direction, other_point, other_direction)
    turned = common_perpendicular(point, direction, other_point, -other_direction)
    assert all(np.array_equal(a, b) for a, b in zip(one, turned, strict=True))


@laws
@given(seeds, angles, gaps)
def test_the_way_back_has_the_same_feet_and_the_opposite_axis(seed, angle, gap):
    point, direction, other_point, other_direction, *_ = pair(seed, angle, gap)
    foot, other, there, axis = common_perpendicular(point, direction, other_point, other_direction)
    other_, foot_, back, axis_ = common_perpendicular(other_point, other_direction, point, direction)
    rounding = 1e-14 / angle * (10 + gap / angle)
    assert np.isclose(there, back, rtol=1e-15)
    assert np.allclose(axis_, -axis, rtol=0, atol=1e-14 / angle)
    assert np.allclose(foot_, foot, rtol=0, atol=rounding)
    assert np.allclose(other_, other, rtol=0, atol=rounding)


@laws
@given(seeds, angles, gaps, st.floats(-3, 3).map(lambda exponent: 10.0**exponent))
def test_lines_are_moved_and_scaled_with_their_feet(seed, angle, gap, scale):
    point, direction, other_point, other_direction, *_ = pair(seed, angle, gap)
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.from_quat(rng.standard_normal(4)).as_matrix(), scale * rng.standard_normal(3)
    one = common_perpendicular(point, direction, other_point, other_direction)
    moved = common_perpendicular(
        scale * turn @ point + shift, turn @ direction, scale * turn @ other_point + shift, turn @ other_direction
    )
    tolerance = 1e-14 / angle * (10 + gap / angle)
    for foot, there in zip(one[:2], moved[:2], strict=True):
        assert np.allclose(there, scale * turn @ foot + shift, rtol=0, atol=scale * tolerance)
    assert np.isclose(moved[2], one[2], rtol=0, atol=1e-14)
    assert np.allclose(moved[3], turn @ one[3], rtol=0, atol=1e-13 / angle)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", [0.0, 0.5 * PARALLEL])
def test_parallel_lines_meet_beside_the_first_point(sign, angle):
    direction = np.array([0.0, 0.0, 1.0])
    tilted = np.array([np.sin(angle), 0.0, np.cos(angle)])
    foot, other, found, axis = common_perpendicular(
        np.array([1.0, 2, 3]), direction, np.array([4.0, 6, 9]), sign * tilted
    )
    assert foot.tolist() == [1, 2, 3]
    assert np.allclose(other, [4, 6, 3], atol=1e-6)
    assert found == 0.0
    assert abs(axis @ direction) < 1e-15
    assert np.isclose(np.linalg.norm(axis), 1.0)


def test_many_pairs_at_once_are_the_same_as_one_by_one():
    rows = [pair(seed, angle, 0.3) for seed, angle in enumerate([0.0, 1e-9, 1e-5, 0.3, 1.5])]
    stacked = [np.array([row[k] for row in rows]) for k in range(4)]
    together = common_perpendicular(*stacked)
    for i, row in enumerate(rows):
        alone = common_perpendicular(*row[:4])
        assert all(np.allclose(a[i], b, rtol=1e-15, atol=1e-15) for a, b in zip(together, alone, strict=True))


def rod(rng, n, length, sigma):
    """Give points that scatter about a piece of a line, and its direction."""
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    along = rng.uniform(-0.5, 0.5, n) * length
    return rng.standard_normal(3) + along[:, None] * direction + sigma * rng.standard_normal((n, 3)), direction, along


def fitted(points, reach=np.inf):
    """Fit a line; give the distances from it over those along it, and its direction."""
    place, direction = np.zeros(3), np.full(3, np.nan)
    across, along = fit_line(np.ascontiguousarray(points.T), len(points), reach, place, direction)
    return across / along, direction


@laws
@given(seeds, st.floats(-4, -1.5), st.integers(20, 400))
def test_a_line_is_fitted_as_well_as_its_noise_allows(seed, exponent, n):
    rng = np.random.default_rng(seed)
    sigma = 3 * 10.0**exponent
    points, true, along = rod(rng, n, 3.0, sigma)
    ratio, direction = fitted(points)
    # across the line each of two angles has the variance sigma^2 over the sum of squares along it
    bound = sigma * np.sqrt(2 / ((along - along.mean()) ** 2).sum())
    assert np.isclose(np.linalg.norm(direction), 1.0)
    assert np.linalg.norm(np.cross(direction, true)) < 5 * bound
    assert 0.3 < ratio / (np.sqrt(2) * sigma / along.std()) < 1.3


@laws
@given(seeds, st.integers(1, 20))
def test_a_few_points_beside_a_line_do_not_turn_it(seed, outliers):
    rng = np.random.default_rng(seed)
    points, true, along = rod(rng, 200, 10.0, 0.02)
    aside = np.cross(true, rng.standard_normal(3))
    aside *= rng.uniform(2.0, 4.0) / np.linalg.norm(aside)
    lump = points[rng.integers(200)] + aside + 0.3 * rng.standard_normal((outliers, 3))
    ratio, direction = fitted(rng.permutation(np.concatenate([points, lump])))
    # the first fit is turned by a lump at one end, and leaves out what is 2.5 deviations from it; the last one is not
    assert np.linalg.norm(np.cross(direction, true)) < 0.02
    assert ratio < 0.03
    bare, _ = fitted(points)
    assert np.isclose(bare, np.sqrt(2) * 0.02 / along.std(), rtol=0.3)


@laws
@given(seeds, st.floats(-3, 3))
def test_the_line_follows_motion_and_scale_and_does_not_know_the_order(seed, exponent):
    rng = np.random.default_rng(seed)
    points, _, _ = rod(rng, 100, 2.0, 0.05)
    turn, scale = Rotation.from_quat(rng.standard_normal(4)).as_matrix(), 10.0**exponent
    ratio, direction = fitted(points)
    moved_ratio, moved = fitted(rng.permutation(scale * points @ turn.T + scale * rng.standard_normal(3)))
    assert np.linalg.norm(np.cross(moved, turn @ direction)) < 1e-9
    assert np.isclose(moved_ratio, ratio, rtol=1e-9)


@laws
@given(seeds, st.sampled_from([2, 3]))
def test_a_disc_and_a_ball_are_no_lines(seed, dimensions):
    rng = np.random.default_rng(seed)
    points = np.zeros((500, 3))
    points[:, :dimensions] = rng.standard_normal((500, dimensions))
    points /= np.maximum(1.0, np.linalg.norm(points, axis=1, keepdims=True))
    ratio, _ = fitted(points @ Rotation.from_quat(rng.standard_normal(4)).as_matrix().T)
    assert ratio > 0.7


@laws
@given(seeds, st.floats(1.0, 4.0))
def test_points_out_of_reach_of_zero_do_not_count(seed, reach):
    rng = np.random.default_rng(seed)
    points, true, _ = rod(rng, 300, 10.0, 0.05)
    points -= points.mean(axis=0)
    near = points[np.linalg.norm(points, axis=1) < reach]
    beyond = rng.standard_normal((200, 3))
    beyond *= rng.uniform(1.0, 9.0, (200, 1)) * reach / np.linalg.norm(beyond, axis=1, keepdims=True)
    ratio, direction = fitted(near)
    mixed_ratio, mixed = fitted(rng.permutation(np.concatenate([points, beyond])), reach)
    assert np.linalg.norm(np.cross(mixed, direction)) < 1e-9
    assert np.isclose(mixed_ratio, ratio, rtol=1e-9)
    assert np.linalg.norm(np.cross(direction, true)) < 0.3 / reach


@laws
@given(seeds)
def test_the_place_is_on_the_line_and_the_distances_are_root_mean_squares(seed):
    rng = np.random.default_rng(seed)
    points, true, along = rod(rng, 400, 4.0, 0.02)
    place, direction = np.zeros(3), np.empty(3)
    across, length = fit_line(np.ascontiguousarray(points.T), 400, np.inf, place, direction)
    middle = points.mean(axis=0)
    assert np.linalg.norm(np.cross(place - middle, true)) < 0.01
    assert np.isclose(length, along.std(), rtol=0.1)
    assert np.isclose(across, np.sqrt(2) * 0.02, rtol=0.2)
    assert np.allclose(
        [off_line(np.ascontiguousarray(points.T), i, place, direction) for i in range(9)],
        np.linalg.norm(np.cross(points[:9] - place, direction), axis=1),
    )


def test_only_the_first_points_count_and_of_a_few_there_is_no_line():
    rng = np.random.default_rng(0)
    xyz = np.ascontiguousarray(rod(rng, 60, 2.0, 0.01)[0].T)
    for n in range(LEAST_POINTS_OF_LINE):
        assert fit_line(xyz, n, np.inf, np.zeros(3), np.empty(3)) == (np.inf, 1.0)
    one, other = (np.zeros(3), np.empty(3)), (np.zeros(3), np.empty(3))
    assert fit_line(xyz, 40, np.inf, *one) == fit_line(xyz[:, :40].copy(), 40, np.inf, *other)
    assert np.array_equal(one, other)
    assert fit_line(xyz, 40, np.inf, *one)[0] < 0.1
