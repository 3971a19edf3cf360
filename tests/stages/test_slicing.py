"""Slices: planes drawn evenly through the cloud, and just the points close to them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.config import Config, SlicingConfig
from cylx.geometry.cylinder import axis_basis
from cylx.geometry.plane import Plane
from cylx.scene import make_frame
from cylx.stages.slicing import cut_slice, draw_planes
from cylx.synthetic import single


@pytest.fixture(scope="module")
def frame():
    return make_frame(single(points=2000).points, Config())[0]


def test_there_are_as_many_planes_as_asked_for(frame):
    assert [len(draw_planes(frame, SlicingConfig(planes=n), 0)) for n in (0, 1, 7)] == [0, 1, 7]


def test_planes_go_through_points_of_the_cloud_in_all_directions(frame):
    planes = draw_planes(frame, SlicingConfig(planes=3000), 0)
    normals = np.array([plane.normal for plane in planes])
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.allclose(normals.T @ normals / 3000, np.eye(3) / 3, atol=5 / np.sqrt(3000))
    places = {tuple(point) for point in frame.points}
    assert all(tuple(plane.point) in places for plane in planes)
    assert len({tuple(plane.point) for plane in planes}) > 1000


def test_the_seed_decides_and_the_first_planes_of_two_seeds_differ(frame):
    one, again, other = (draw_planes(frame, SlicingConfig(planes=5), seed) for seed in (1, 1, 2))
    assert all(np.array_equal(a.normal, b.normal) for a, b in zip(one, again, strict=True))
    assert not any(np.allclose(a.normal, b.normal) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("thickness", [0.5, 2.0, 1e9])
def test_a_slice_holds_the_points_within_half_its_thickness(frame, thickness):
    plane = draw_planes(frame, SlicingConfig(planes=1), 3)[0]
    section = cut_slice(frame.points, plane, thickness)
    expected = frame.points[np.abs((frame.points - plane.point) @ plane.normal) < 0.5 * thickness]
    assert section.plane is plane
    assert 0 < len(section.points) == len(expected)
    # projected along the normal: lifted again, each is its point without its height
    lifted = plane.lift(section.points) + ((expected - plane.point) @ plane.normal)[:, None] * plane.normal
    assert np.allclose(lifted, expected, rtol=0, atol=1e-9)


def test_a_plane_beside_the_cloud_cuts_nothing(frame):
    beside = Plane(np.array([0.0, 0.0, 1e6]), np.array([0.0, 0.0, 1.0]))
    assert cut_slice(frame.points, beside, 1.0).points.shape == (0, 2)


directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: np.linalg.norm(axis) > 1e-3)


def angles_deg(planes, axis):
    normals = np.array([plane.normal for plane in planes])
    return np.degrees(np.arccos(np.minimum(np.abs(normals @ axis) / np.linalg.norm(axis), 1.0)))


@settings(max_examples=30, deadline=None)
@given(directions, st.floats(-6, 6), st.floats(0, 90), st.floats(0, 90), st.integers(0, 2**32 - 1))
def test_planes_keep_the_inclination_to_any_axis(frame, axis, exponent, one, other, seed):
    axis = list(10.0**exponent * np.array(axis))
    low, high = sorted((one, other))
    config = SlicingConfig(planes=50, inclination_deg=[low, high])
    planes = draw_planes(frame, config, seed, axis)
    found = angles_deg(planes, np.array(axis))
    # an arc cosine of a number within 1e-16 of 1 is as far off as its square root
    assert found.min() >= low - 1e-5
    assert found.max() <= high + 1e-5
    assert np.allclose([np.linalg.norm(plane.normal) for plane in planes], 1.0)
    opposite = draw_planes(frame, config, seed, [-x for x in axis])
    assert all(np.array_equal(a.normal, b.normal) for a, b in zip(planes, opposite, strict=True))


@pytest.mark.parametrize(("low", "high"), [(0, 90), (20, 70), (80, 90), (45, 45)])
def test_they_are_spread_evenly_over_that_part_of_the_sphere(frame, low, high):
    axis, n = np.array([1.0, -2.0, 0.5]), 4000
    axis /= np.linalg.norm(axis)
    planes = draw_planes(frame, SlicingConfig(planes=n, inclination_deg=[low, high]), 7, list(axis))
    normals = np.array([plane.normal for plane in planes])
    normals *= np.where(normals @ axis < 0, -1.0, 1.0)[:, None]
    # even over the area means even in the height, by Archimedes; and even about the axis
    top, bottom = np.cos(np.radians([low, high]))
    heights = normals @ axis
    assert heights.mean() == pytest.approx((top + bottom) / 2, abs=4 * (top - bottom) / np.sqrt(12 * n) + 1e-9)
    assert heights.std() == pytest.approx((top - bottom) / np.sqrt(12), abs=4 * (top - bottom) / np.sqrt(12 * n) + 1e-9)
    first, second = axis_basis(axis)
    turns = np.arctan2(normals @ second, normals @ first)
    for k in (1, 2, 3):
        assert abs(np.exp(1j * k * turns).mean()) < 4 / np.sqrt(n)


def test_without_an_axis_or_an_inclination_all_planes_are_as_ever(frame):
    anyhow = draw_planes(frame, SlicingConfig(planes=20), 1)
    without_axis = draw_planes(frame, SlicingConfig(planes=20, inclination_deg=[10, 20]), 1)
    with_axis_alone = draw_planes(frame, SlicingConfig(planes=20), 1, [0.0, 0.0, 1.0])
    for others in (without_axis, with_axis_alone):
        assert all(np.array_equal(a.normal, b.normal) for a, b in zip(anyhow, others, strict=True))
        assert all(np.array_equal(a.point, b.point) for a, b in zip(anyhow, others, strict=True))
