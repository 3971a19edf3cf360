"""Slices: planes drawn evenly through the cloud, and just the points close to them."""

import numpy as np
import pytest

from cylx.config import Config, SlicingConfig
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
    lifted = plane.lift(section.points) + plane.heights(expected)[:, None] * plane.normal
    assert np.allclose(lifted, expected, rtol=0, atol=1e-9)


def test_a_plane_beside_the_cloud_cuts_nothing(frame):
    beside = Plane(np.array([0.0, 0.0, 1e6]), np.array([0.0, 0.0, 1.0]))
    assert cut_slice(frame.points, beside, 1.0).points.shape == (0, 2)
