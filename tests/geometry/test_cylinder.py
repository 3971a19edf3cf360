"""The cylinder: one answer however the scene is turned, moved, scaled or far away."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.geometry.cylinder import (
    Cylinder,
    axis_basis,
    canonical_direction,
    cylinder_coordinates,
    surface_distances,
)
from cylx.geometry.plane import random_directions

seeds = st.integers(0, 2**32 - 1)
scales = st.floats(-4, 4).map(lambda exponent: 10.0**exponent)
vectors = st.tuples(*[st.floats(-1e3, 1e3)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)
laws = settings(max_examples=50, deadline=None)


def draw(seed, n=40):
    """Give a rotation, a cylinder of a radius about 1, and points about it."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    shape = Cylinder(rng.standard_normal(3), rng.standard_normal(3), rng.uniform(0.3, 2), rng.uniform(0, 5))
    return turn, shape, shape.point + 3.0 * rng.standard_normal((n, 3)), rng


@laws
@given(vectors, scales)
def test_a_direction_is_one_whatever_its_length_and_sign(vector, scale):
    direction = canonical_direction(vector)
    assert np.isclose(np.linalg.norm(direction), 1.0, rtol=1e-15)
    assert direction[np.abs(direction).argmax()] > 0
    assert np.allclose(np.cross(direction, vector), 0, atol=1e-12 * np.linalg.norm(vector))
    assert np.allclose(canonical_direction(-scale * np.array(vector)), direction, rtol=0, atol=1e-15)


def test_many_directions_at_once_are_the_same_as_one_by_one():
    rows = np.array([[0.0, 0, -3], [1, 2, -2], [-1, 0, 1], [-5, 4, 3]])
    one_by_one = [canonical_direction(row) for row in rows]
    assert np.allclose(canonical_direction(rows), one_by_one, rtol=0, atol=1e-15)
    assert canonical_direction(rows).tolist()[0] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("bad", [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 1)])
def test_no_direction_without_a_length(bad):
    with pytest.raises(ValueError, match="finite length > 0"):
        canonical_direction(bad)


@pytest.mark.parametrize(
    ("point", "direction", "radius", "height"),
    [
        ((0, 0, np.nan), (0, 0, 1), 1, 1),
        ((0, 0, 0), (0, 0, 1), 0, 1),
        ((0, 0, 0), (0, 0, 1), -1, 1),
        ((0, 0, 0), (0, 0, 1), np.inf, 1),
        ((0, 0, 0), (0, 0, 1), np.nan, 1),
        ((0, 0, 0), (0, 0, 1), 1, -1),
        ((0, 0, 0), (0, 0, 0), 1, 1),
        ((0, 0), (0, 0, 1), 1, 1),
        ((0, 0, 0), (0, 1), 1, 1),
    ],
)
def test_what_is_no_cylinder_is_refused(point, direction, radius, height):
    with pytest.raises(ValueError):  # noqa: PT011 (three messages, one kind)
        Cylinder(point, direction, radius, height)


def test_a_cylinder_keeps_its_own_copy():
    point = np.zeros(3)
    shape = Cylinder(point, (0, 0, 1), 1.0, 2.0)
    point[0] = 5.0
    assert shape.point[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        shape.point[0] = 1.0


@laws
@given(seeds)
def test_a_frame_is_right_handed_and_unit(seed):
    direction = random_directions(1, np.random.default_rng(seed))[0]
    frame = np.stack([*axis_basis(direction), direction])
    assert np.allclose(frame @ frame.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(frame) > 0


def test_outside_is_positive_and_heights_and_angles_turn_to_the_right():
    shape = Cylinder((1, 2, 3), (0, 0, 1), radius=2.0, height=9.0)
    points = np.array([[4.0, 2, 0], [1, 2.5, 3], [1, 0, 8]])
    assert surface_distances(points, shape).tolist() == [1.0, -1.5, 0.0]
    heights, distances, angles = cylinder_coordinates(points, shape.point, shape.direction)
    assert heights.tolist() == [-3.0, 0.0, 5.0]
    assert distances.tolist() == [3.0, 0.5, 2.0]
    # from x to y is a quarter turn about z, from y to -y a half
    assert np.allclose(np.exp(1j * np.diff(angles)), [1j, -1])


@laws
@given(seeds)
def test_coordinates_build_the_points_again(seed):
    _, shape, points, _ = draw(seed)
    heights, distances, angles = cylinder_coordinates(points, shape.point, shape.direction)
    first, second = axis_basis(shape.direction)
    again = (
        shape.point
        + heights[:, None] * shape.direction
        + (distances * np.cos(angles))[:, None] * first
        + (distances * np.sin(angles))[:, None] * second
    )
    assert np.allclose(again, points, rtol=0, atol=1e-13)
    assert (distances >= 0).all()


@laws
@given(seeds, scales)
def test_distances_follow_motion_and_scale(seed, scale):
    turn, shape, points, rng = draw(seed)
    shift = scale * rng.standard_normal(3)
    other = Cylinder(
        scale * (turn @ shape.point) + shift, turn @ shape.direction, scale * shape.radius, scale * shape.height
    )
    moved = scale * points @ turn.T + shift
    expected = scale * surface_distances(points, shape)
    assert np.allclose(surface_distances(moved, other), expected, rtol=0, atol=1e-12 * scale)
    sign = np.sign(turn @ shape.direction @ other.direction)
    heights, distances, angles = cylinder_coordinates(points, shape.point, shape.direction)
    heights_, distances_, angles_ = cylinder_coordinates(moved, other.point, sign * other.direction)
    assert np.allclose(heights_, scale * heights, rtol=0, atol=1e-12 * scale)
    assert np.allclose(distances_, scale * distances, rtol=0, atol=1e-12 * scale)
    # angles have an arbitrary zero, so they all change by the same turn
    turned = np.exp(1j * (angles_ - angles))
    assert np.allclose(turned, turned[0], rtol=0, atol=1e-9)


@laws
@given(seeds, scales)
def test_a_cylinder_moves_with_its_scene(seed, scale):
    _, shape, points, rng = draw(seed)
    shift = 10 * scale * rng.standard_normal(3)
    moved = shape.moved(shift, scale)
    expected = scale * surface_distances(points, shape)
    assert np.allclose(surface_distances(scale * points + shift, moved), expected, rtol=0, atol=1e-13 * scale)
    for end in ("start", "end"):
        assert np.allclose(getattr(moved, end), scale * getattr(shape, end) + shift, rtol=1e-13)
    assert np.isclose(np.linalg.norm(moved.end - moved.start), scale * shape.height, rtol=1e-11)


@laws
@given(seeds)
def test_far_away_is_as_good_as_here(seed):
    _, shape, points, _ = draw(seed)
    shift = np.array([512345.678, 5412345.432, 123.4])
    far = surface_distances(points + shift, shape.moved(shift))
    # a coordinate of 5e6 has steps of 1e-9
    assert np.allclose(far, surface_distances(points, shape), rtol=0, atol=4e-9)
