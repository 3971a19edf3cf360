"""Dual quaternions: the laws of a group, screws from line to line (A.2), their distance (eq. 1), their mean."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.geometry.dual_quaternions import (
    blend,
    conjugate,
    exponential,
    line_screws,
    logarithm,
    move_points,
    multiply,
    normalised,
    pairwise_screw_distances,
    screw,
    turn_vectors,
)

seeds = st.integers(0, 2**32 - 1)
angles = st.just(0.0) | st.floats(-9, np.log10(3.1)).map(lambda exponent: 10.0**exponent)
lengths = st.just(0.0) | st.floats(-6, 2).map(lambda exponent: 10.0**exponent)
laws = settings(max_examples=80, deadline=None)
IDENTITY = np.array([1.0, 0, 0, 0, 0, 0, 0, 0])


def motion(seed, angle=1.0, shift=1.0):
    """Give a screw about an axis near the origin, and its parts."""
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    foot = rng.standard_normal(3)
    return screw(axis, foot, np.array(angle), np.array(shift)), axis, foot


def assert_unit(q):
    assert np.allclose(np.linalg.norm(q[..., :4], axis=-1), 1.0, rtol=1e-13)
    assert np.allclose((q[..., :4] * q[..., 4:]).sum(-1), 0.0, atol=1e-12 * (1 + np.abs(q).max()))


@laws
@given(seeds, angles, lengths)
def test_a_screw_turns_about_its_axis_and_moves_along_it(seed, angle, shift):
    q, axis, foot = motion(seed, angle, shift)
    points = np.random.default_rng(seed + 1).standard_normal((10, 3))
    turn = Rotation.from_rotvec(angle * axis)
    assert_unit(q)
    assert np.allclose(turn_vectors(q, points), turn.apply(points), rtol=0, atol=1e-14)
    expected = turn.apply(points - foot) + foot + shift * axis
    assert np.allclose(move_points(q, points), expected, rtol=0, atol=1e-14 * (1 + shift))


@laws
@given(seeds)
def test_motions_are_a_group(seed):
    p, q, r = (motion(seed + k, 2.0, 0.7)[0] for k in range(3))
    assert np.allclose(multiply(multiply(p, q), r), multiply(p, multiply(q, r)), rtol=0, atol=1e-14)
    assert np.allclose(multiply(p, IDENTITY), p, rtol=0, atol=0)
    assert np.allclose(multiply(IDENTITY, p), p, rtol=0, atol=0)
    assert np.allclose(multiply(p, conjugate(p)), IDENTITY, rtol=0, atol=1e-15 * 10)
    assert np.allclose(multiply(conjugate(p), p), IDENTITY, rtol=0, atol=1e-15 * 10)
    assert_unit(multiply(p, q))
    points = np.random.default_rng(seed).standard_normal((5, 3))
    assert np.allclose(move_points(multiply(p, q), points), move_points(p, move_points(q, points)), rtol=0, atol=1e-13)


@laws
@given(seeds, st.floats(0.1, 10))
def test_normalising_gives_a_motion_and_leaves_one_alone(seed, length):
    q, _, _ = motion(seed)
    assert np.allclose(normalised(length * q), q, rtol=0, atol=1e-14)
    noisy = q + 0.1 * np.random.default_rng(seed).standard_normal(8)
    assert_unit(normalised(noisy))


@laws
@given(seeds, angles, lengths)
def test_the_logarithm_is_half_the_screw(seed, angle, shift):
    q, axis, foot = motion(seed, angle, shift)
    expected = 0.5 * np.concatenate([angle * axis, shift * axis + angle * np.cross(foot, axis)])
    # close to no turn at all, what is known of the pitch is what the turn leaves of it
    assert np.allclose(logarithm(q), expected, rtol=0, atol=1e-13 * (1 + shift) + 3e-15 * shift / max(angle, 1e-3))


@laws
@given(seeds, angles, lengths)
def test_logarithm_and_exponential_undo_each_other(seed, angle, shift):
    q, *_ = motion(seed, angle, shift)
    assert np.allclose(exponential(logarithm(q)), q, rtol=0, atol=1e-13 * (1 + shift))
    assert np.allclose(exponential(logarithm(-q)), q, rtol=0, atol=1e-13 * (1 + shift))
    assert np.allclose(logarithm(exponential(logarithm(q))), logarithm(q), rtol=0, atol=1e-13 * (1 + shift))
    assert np.allclose(exponential(np.zeros(6)), IDENTITY, rtol=0, atol=0)


@laws
@given(seeds, angles, lengths)
def test_the_inverse_has_the_opposite_logarithm(seed, angle, shift):
    q, *_ = motion(seed, angle, shift)
    assert np.allclose(logarithm(conjugate(q)), -logarithm(q), rtol=0, atol=1e-13 * (1 + shift))


def lines(seed, angle, gap, sign=1.0):
    """Give two lines with this angle and distance: points, directions."""
    rng = np.random.default_rng(seed)
    first, axis, _ = np.linalg.qr(rng.standard_normal((3, 3)))[0].T
    second = np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)
    foot = rng.standard_normal(3)
    points = foot + 3 * rng.standard_normal() * first, foot + gap * axis + 3 * rng.standard_normal() * second
    return np.array(points), np.array([first, sign * second])


right_angles = st.just(0.0) | st.floats(-12, np.log10(np.pi / 2)).map(lambda exponent: 10.0**exponent)


@settings(max_examples=200, deadline=None)
@given(seeds, right_angles, lengths, st.sampled_from([1.0, -1.0]))
def test_the_screw_takes_one_line_to_the_other(seed, angle, gap, sign):
    points, directions = lines(seed, angle, gap, sign)
    q, found_angle, found_gap = line_screws(points[0], directions[0], points[1:], directions[1:])
    assert_unit(q)
    # nearly parallel lines are parallel within 1e-8; the points are some units apart
    tolerance = 3e-7 * (1 + gap)
    assert np.isclose(found_angle[0], angle, rtol=1e-9, atol=1e-8)
    if angle > 1e-8:
        assert np.isclose(found_gap[0], gap, rtol=1e-6, atol=tolerance)
    assert np.allclose(np.cross(turn_vectors(q[0], directions[0]), directions[1]), 0, atol=1.1e-8)
    offset = move_points(q[0], points[0]) - points[1]
    assert np.allclose(np.cross(offset, directions[1]), 0, atol=tolerance)
    assert abs(logarithm(q[0])[:3] @ directions[0]) < 1e-14  # the smallest screw does not turn about the line


@pytest.mark.parametrize("angle", [1e-7, 1e-5, 1e-3, 0.1, 1.5])
def test_lines_that_cross_turn_about_their_crossing(angle):
    for seed in range(20):
        points, directions = lines(seed, angle, 0.0)
        q, _, gap = line_screws(points[0], directions[0], points[1:], directions[1:])
        offset = move_points(q[0], points[0]) - points[1]
        assert np.linalg.norm(np.cross(offset, directions[1])) < 1e-6 * angle + 1e-13
        assert gap[0] < 1e-6 * angle + 1e-13
        assert np.isclose(2 * np.linalg.norm(logarithm(q[0])[:3]), angle, rtol=1e-7)


def some_lines(seed, count=8):
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[1] = directions[0]  # parallel, and the other way round
    directions[2] = -directions[0]
    return rng.standard_normal((count, 3)), directions, rng


@laws
@given(seeds)
def test_distances_are_symmetric_and_vanish_on_the_line_itself(seed):
    points, directions, rng = some_lines(seed)
    distances, gaps = pairwise_screw_distances(points, directions)
    assert np.array_equal(distances, distances.T)
    assert np.array_equal(gaps, gaps.T)
    assert (np.diag(distances) == 0).all()
    assert (distances[~np.eye(8, dtype=bool)] > 0).all()
    signs = rng.choice([-1.0, 1.0], (8, 1))
    # right angles are at the border between the two ways round
    assert np.allclose(pairwise_screw_distances(points, signs * directions)[0], distances, rtol=0, atol=1e-12)


@laws
@given(seeds)
def test_a_line_does_not_depend_on_the_point_that_names_it(seed):
    points, directions, rng = some_lines(seed)
    slid = points + rng.standard_normal((8, 1)) * directions
    distances, gaps = pairwise_screw_distances(points, directions)
    again, gaps_ = pairwise_screw_distances(slid, directions)
    # parallel lines are told by their translation, which has no part along them
    assert np.allclose(again, distances, rtol=0, atol=1e-11)
    assert np.allclose(gaps_, gaps, rtol=0, atol=1e-11)


@laws
@given(seeds)
def test_distances_do_not_change_when_the_scene_turns_about_the_origin(seed):
    points, directions, rng = some_lines(seed)
    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    assert np.allclose(
        pairwise_screw_distances(points @ turn.T, directions @ turn.T)[0],
        pairwise_screw_distances(points, directions)[0],
        rtol=0,
        atol=1e-12,
    )


@laws
@given(seeds, st.floats(0.01, 1.5), st.floats(0, 2))
def test_the_distance_is_that_of_its_formula_and_depends_on_the_origin(seed, angle, gap):
    points, directions = lines(seed, angle, gap)
    axis = np.cross(*directions) / np.sin(angle)
    offset = points[1] - points[0]
    along = np.cross(offset, directions[1]) @ axis / np.sin(angle)
    foot = points[0] + along * directions[0]
    for shift in (np.zeros(3), np.array([10.0, -5, 3])):
        distances, gaps = pairwise_screw_distances(points + shift, directions)
        moment = np.linalg.norm(np.cross(foot + shift, axis))
        # eq. 1: the dual vector is gap s + angle (m x s), whose two parts are square to each other
        expected = 0.5 * np.sqrt(angle**2 + gap**2 + (angle * moment) ** 2)
        assert np.isclose(distances[0, 1], expected, rtol=1e-9)
        assert np.isclose(gaps[0, 1], gap, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("gap", [0.0, 0.01, 1.0])
def test_the_distance_has_no_jump_where_lines_become_parallel(gap):
    for seed in range(10):
        limit = pairwise_screw_distances(*lines(seed, 0.0, gap))[0][0, 1]
        for angle in (1e-10, 0.99e-8, 1.01e-8, 1e-7, 1e-6, 1e-5):
            # turning by an angle moves what is within ten of the feet by ten times that
            found = pairwise_screw_distances(*lines(seed, angle, gap))[0][0, 1]
            assert abs(found - limit) < 10 * angle + 1e-7


@laws
@given(seeds)
def test_the_mean_of_equal_motions_is_that_motion(seed):
    q, *_ = motion(seed)
    weights = np.random.default_rng(seed).dirichlet(np.ones(5))
    signs = np.array([1.0, -1, 1, 1, -1])[:, None]
    mean = blend(signs * q, weights)
    assert np.allclose(mean * np.sign(mean @ q), q, rtol=0, atol=1e-14)


@laws
@given(seeds, st.floats(0.01, 3), st.floats(0, 5))
def test_the_mean_of_two_motions_is_halfway(seed, angle, shift):
    first, *_ = motion(seed, 0.8, 0.3)
    step, axis, foot = motion(seed + 1, angle, shift)
    second = multiply(first, step)
    half = multiply(first, screw(axis, foot, np.array(0.5 * angle), np.array(0.5 * shift)))
    mean = blend(np.array([first, second]), np.array([0.5, 0.5]))
    assert np.allclose(mean * np.sign(mean[:4] @ half[:4]), half, rtol=0, atol=1e-9)


def spread_motions(seed, size, count=6):
    """Give motions a share `size` of a unit motion away from one of them, and weights."""
    rng = np.random.default_rng(seed)
    center, *_ = motion(seed, 1.1, 0.4)
    twists = size * rng.standard_normal((count, 6))
    return center, twists, multiply(center, exponential(twists)), rng.dirichlet(np.ones(count)), rng


@laws
@given(seeds)
def test_the_mean_does_not_know_the_order_of_the_motions(seed):
    _, _, motions, weights, rng = spread_motions(seed, 0.3)
    order = rng.permutation(len(motions))
    one, other = blend(motions, weights), blend(motions[order], weights[order])
    assert np.allclose(other * np.sign(other @ one), one, rtol=0, atol=1e-10)


@laws
@given(seeds)
def test_the_mean_is_where_the_weighted_logarithms_vanish(seed):
    _, _, motions, weights, _ = spread_motions(seed, 0.3)
    mean = blend(motions, weights)
    assert_unit(mean)
    assert np.linalg.norm(weights @ logarithm(multiply(conjugate(mean), motions))) < 1e-9


@laws
@given(seeds)
def test_the_mean_moves_with_the_motions(seed):
    _, _, motions, weights, _ = spread_motions(seed, 0.3)
    before, after = motion(seed + 1)[0], motion(seed + 2)[0]
    moved = multiply(multiply(before, motions), after)
    expected = multiply(multiply(before, blend(motions, weights)), after)
    found = blend(moved, weights)
    assert np.allclose(found * np.sign(found @ expected), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("size", [1e-2, 1e-3, 1e-4])
def test_the_mean_of_small_motions_is_the_mean_of_their_twists(size):
    for seed in range(10):
        center, twists, motions, weights, _ = spread_motions(seed, size)
        apart = logarithm(multiply(conjugate(center), blend(motions, weights))) - weights @ twists
        # what is left is of second order
        assert np.linalg.norm(apart) < 20 * size**2


def test_the_mean_of_lines_about_a_line_is_that_line():
    direction = np.array([0.0, 0.0, 1.0])
    turns = 2 * np.pi * np.arange(6) / 6
    ring = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(6)])
    points, directions = 0.2 * ring, direction + 0.1 * np.roll(ring, 2, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    motions, _, _ = line_screws(np.zeros(3), direction, points, directions)
    mean = blend(motions, np.full(6, 1 / 6))
    assert np.allclose(turn_vectors(mean, direction), direction, atol=1e-12)
    assert np.allclose(move_points(mean, np.zeros(3))[:2], 0, atol=1e-12)
