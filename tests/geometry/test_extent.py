"""How far a surface goes on: to its ends, whatever strays beyond them, either way round."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.geometry.cylinder import coordinates_of, points_on
from cylx.geometry.extent import LEAP, LEAST_POINTS_OF_EXTENT, visible_extent

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=50, deadline=None)


def surface(rng, n, arc, low, high):
    """Give heights and angles of points on a surface of radius 1, seen from anywhere."""
    angles = rng.uniform(-np.pi, np.pi) + arc * rng.random(n)
    return rng.uniform(low, high, n), (angles + np.pi) % (2 * np.pi) - np.pi


def drawn(seed):
    """Give a surface with its ends and its spacing, from sparse to dense, from a fifth of the arc to all of it."""
    rng = np.random.default_rng(seed)
    n, arc, length = (
        int(np.exp(rng.uniform(np.log(150), np.log(5000)))),
        rng.uniform(1.2, 2 * np.pi),
        rng.uniform(2, 12),
    )
    low = -rng.uniform(0.35, 0.65) * length
    return rng, *surface(rng, n, arc, low, low + length), low, low + length, np.sqrt(arc * length / n)


@laws
@given(seeds, st.floats(0, 0.3), st.integers(0, 4))
def test_the_ends_are_those_of_the_points_in_noise_and_among_strays(seed, noise, strays):
    rng, heights, angles, low, high, spacing = drawn(seed)
    heights = heights + noise * spacing * rng.standard_normal(len(heights))
    beyond = np.where(rng.random(strays) < 0.5, low - rng.uniform(0, 3, strays), high + rng.uniform(0, 3, strays))
    heights = np.concatenate([heights, beyond])
    angles = np.concatenate([angles, rng.uniform(-np.pi, np.pi, strays)])
    ends = visible_extent(heights, angles, 0.3 * (high - low), 1.0)
    assert np.allclose(ends, (low, high), rtol=0, atol=2.5 * spacing)


@laws
@given(seeds, st.integers(0, 4))
def test_the_ends_are_mirrored_with_the_heights_and_do_not_know_order_or_unit(seed, strays):
    rng, heights, angles, low, high, _ = drawn(seed)
    heights = np.concatenate([heights, high + rng.uniform(0, 3, strays)])
    angles = np.concatenate([angles, rng.uniform(-np.pi, np.pi, strays)])
    half, scale, order = 0.3 * (high - low), np.exp(rng.uniform(-5, 5)), rng.permutation(len(heights))
    ends = np.array(visible_extent(heights, angles, half, 1.0))
    assert np.allclose(visible_extent(-heights, angles, half, 1.0), -ends[::-1], rtol=0, atol=1e-12)
    assert np.allclose(visible_extent(heights[order], angles[order], half, 1.0), ends, rtol=0, atol=1e-12)
    assert np.allclose(visible_extent(scale * heights, angles, scale * half, scale), scale * ends, rtol=1e-9)


def test_what_was_found_before_is_not_cut_where_it_is_thinly_seen():
    rng = np.random.default_rng(0)
    heights = np.concatenate([rng.uniform(-12, -4, 240), np.linspace(-4, 5, 28), rng.uniform(5, 12, 210)])
    angles = rng.uniform(-1, 1, len(heights))
    low, high = visible_extent(heights, angles, 12.0, 1.0)
    assert low < -11.5
    assert high < -1.0
    assert np.allclose(visible_extent(heights, angles, 12.0, 1.0, doubt=0.4), (-12, 12), atol=0.3)


@laws
@given(seeds)
def test_the_ends_are_points(seed):
    _, heights, angles, low, high, _ = drawn(seed)
    ends = visible_extent(heights, angles, 0.2 * (high - low), 1.0)
    # up to rounding of their depths
    assert all(np.abs(heights - end).min() < 1e-12 * (high - low) for end in ends)


def three_parts(rng, gap, between=0):
    """Give a dense surface from -3 to 3, a gap, and a surface from there to 5 further on; some points in the gap."""
    parts = [surface(rng, 3000, 2 * np.pi, -3, 3), surface(rng, 2500, 2 * np.pi, 3 + gap, 8 + gap)]
    parts.append(surface(rng, between, 2 * np.pi, 3, 3 + gap))
    return (np.concatenate(columns) for columns in zip(*parts, strict=True))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("gap", "goes_on"), [(0.5, True), (2.0, True), (2.8, True), (4.0, False), (9.0, False)])
@pytest.mark.parametrize("between", [0, 3])
def test_gaps_of_three_radii_are_bridged_and_wider_ones_are_not(seed, gap, goes_on, between):
    rng = np.random.default_rng(seed)
    heights, angles = three_parts(rng, gap, between if not goes_on else 0)
    expected = -3.0, 8 + gap if goes_on else 3.0
    assert np.allclose(visible_extent(heights, angles, 1.5, 1.0), expected, rtol=0, atol=0.15)
    mirrored = -expected[1], 3.0
    assert np.allclose(visible_extent(-heights, angles, 1.5, 1.0), mirrored, rtol=0, atol=0.15)


@laws
@given(seeds, st.floats(0.05, 0.3), st.floats(-5, 5))
def test_a_disc_is_as_high_as_its_points(seed, height, power):
    rng, scale = np.random.default_rng(seed), np.exp(power)
    heights, angles = surface(rng, 1500, 2 * np.pi, -0.5 * height, 0.5 * height)
    ends = visible_extent(scale * heights, angles, 0.5 * scale * height, scale)
    assert np.allclose(ends, (-0.5 * scale * height, 0.5 * scale * height), rtol=0, atol=0.05 * scale * height)


@laws
@given(seeds, st.floats(0.05, 0.3), st.floats(LEAP * 1.5 * 0.3 + 0.05, 2.5))  # pieces are quarters of a disc's height
def test_two_discs_on_one_axis_are_not_bridged(seed, height, gap):
    rng = np.random.default_rng(seed)
    one = surface(rng, 1500, 2 * np.pi, -0.5 * height, 0.5 * height)
    other = surface(rng, 1500, 2 * np.pi, 0.5 * height + gap, 1.5 * height + gap)
    heights, angles = (np.concatenate(both) for both in zip(one, other, strict=True))
    for sign in (-1.0, 1.0):
        ends = visible_extent(sign * heights, angles, 0.5 * height, 1.0)
        assert np.allclose(ends, (-0.5 * height, 0.5 * height), rtol=0, atol=0.05 * height)


@pytest.mark.parametrize("seed", range(5))
def test_what_goes_on_at_one_side_of_the_arc_alone_is_something_else(seed):
    rng = np.random.default_rng(seed)
    heights, angles = surface(rng, 2000, 2 * np.pi, -2, 2)
    # the line where a can touches its table goes on, as dense as the can all around
    along = rng.uniform(-9, 9, 2500)
    beside = 0.05 * rng.standard_normal(2500)
    ends = visible_extent(np.concatenate([heights, along]), np.concatenate([angles, beside]), 1.0, 1.0)
    assert np.allclose(ends, (-2, 2), rtol=0, atol=0.35)


@pytest.mark.parametrize("n", [0, 1, LEAST_POINTS_OF_EXTENT - 1])
def test_a_handful_of_points_has_no_extent(n):
    heights, angles = surface(np.random.default_rng(0), n, 2 * np.pi, -1, 1)
    assert visible_extent(heights, angles, 1.0, 1.0) is None
    far = np.concatenate([heights, np.full(100, 7.0)])  # points out of the known height do not count
    assert visible_extent(far, np.concatenate([angles, np.zeros(100)]), 1.0, 1.0) is None


@laws
@given(seeds)
def test_points_on_a_surface_have_their_heights_and_angles(seed):
    rng = np.random.default_rng(seed)
    turn, middle, radius = (
        Rotation.from_quat(rng.standard_normal(4)).as_matrix(),
        rng.standard_normal(3),
        rng.uniform(1, 3),
    )
    off = rng.uniform(-0.5, 0.5, 80)
    angles, heights = rng.uniform(-np.pi, np.pi, 80), rng.uniform(-4, 4, 80)
    local = np.column_stack([(radius + off) * np.cos(angles), (radius + off) * np.sin(angles), heights])
    model = np.array([*middle, *turn[:, 2], radius])
    found_heights, found_angles = points_on(local @ turn.T + middle, model, 0.25)
    near = np.abs(off) < 0.25
    assert np.allclose(found_heights, heights[near], rtol=0, atol=1e-12)
    # angles are counted from a direction that depends on the axis alone, one way round or the other
    steps = np.exp(1j * (found_angles - found_angles[:1])), np.exp(1j * (angles[near] - angles[near][:1]))
    assert np.allclose(steps[0], steps[1], atol=1e-9) or np.allclose(steps[0], steps[1].conj(), atol=1e-9)


@laws
@given(seeds)
def test_coordinates_of_some_points_are_those_of_each(seed):
    rng = np.random.default_rng(seed)
    points, direction = rng.standard_normal((50, 3)), rng.standard_normal(3)
    model = np.array([*rng.standard_normal(3), *direction / np.linalg.norm(direction), 0.7])
    indices = rng.integers(0, 50, 20)
    heights, distances, angles = coordinates_of(points, indices, model)
    offsets = points[indices] - model[:3]
    assert np.allclose(heights, offsets @ model[3:6], atol=1e-12)
    off_axis = np.linalg.norm(offsets - heights[:, None] * model[3:6], axis=1)
    assert np.allclose(distances, off_axis - 0.7, atol=1e-12)
    assert (np.abs(angles) <= np.pi).all()
    all_heights, all_angles = points_on(points, model, np.inf)
    assert np.array_equal(all_heights[indices], heights)
    assert np.array_equal(all_angles[indices], angles)


def test_nothing_is_on_a_surface_far_away():
    heights, angles = points_on(np.ones((9, 3)), np.array([0, 0, 0, 0, 0, 1, 50.0]), 0.1)
    assert heights.shape == angles.shape == (0,)
