"""The directions that planes have: of plates that are thick and thin, in noise, turned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.config import Config
from cylx.records import Explained
from cylx.scene import make_frame
from cylx.stages.plane_directions import MOST_DIRECTIONS, directions_of, directions_of_planes


def about(axis, count, spread_deg, rng):
    """Draw normals about an axis, either way."""
    normals = np.array(axis) + np.radians(spread_deg) * rng.standard_normal((count, 3))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True) * rng.choice([-1.0, 1.0], (count, 1))


def angle_deg(one, other):
    return np.degrees(np.arcsin(min(1.0, np.linalg.norm(np.cross(one, other)))))


def without_windows(points):
    """Return the directions in a cloud none of whose windows is flat."""
    frame, _ = make_frame(points, Config())
    none = Explained(np.zeros(len(points)), np.zeros(len(points), np.bool_))
    return directions_of_planes(frame, none, None)


def plate(rng, thickness, sigma, side=40.0):
    """Draw the two faces of a plate, a spacing apart."""
    points = np.column_stack([side * rng.random((3200, 2)), thickness * rng.integers(0, 2, 3200)])
    return points + sigma * rng.standard_normal(points.shape)


@pytest.mark.parametrize("seed", range(3))
def test_the_directions_are_those_of_many_normals_and_turn_with_them(seed):
    rng = np.random.default_rng(seed)
    axes = Rotation.random(random_state=seed).as_matrix()
    counts = (900, 500, 200)
    parts = [about(axis, count, 1.0, rng) for axis, count in zip(axes, counts, strict=True)]
    normals = rng.permutation(np.concatenate([*parts, about([0, 0, 0], 100, 60, rng)]))
    found = directions_of(normals)
    assert [angle_deg(one, axis) < 0.5 for one, axis in zip(found, axes, strict=False)] == [True] * 3
    assert all(np.isclose(np.linalg.norm(one), 1.0) for one in found)
    turned = directions_of(normals @ axes.T)
    near = [angle_deg(axes @ one, other) < 0.01 for one, other in zip(found, turned, strict=True)]
    assert near == [True] * len(found)


def test_normals_all_about_have_no_direction_and_a_few_normals_make_none():
    rng = np.random.default_rng(0)
    assert directions_of(about([0, 0, 0], 2000, 60, rng)) == []
    assert directions_of(about([0, 0, 1], 9, 0.1, rng)) == []
    assert directions_of(np.empty((0, 3))) == []


def test_there_are_no_more_directions_than_are_tried():
    rng = np.random.default_rng(1)
    axes = [(np.cos(turn), np.sin(turn), 0.0) for turn in np.linspace(0, np.pi, MOST_DIRECTIONS + 3, endpoint=False)]
    normals = np.concatenate([about(axis, 200, 0.3, rng) for axis in axes])
    assert len(directions_of(normals)) == MOST_DIRECTIONS


def test_a_few_normals_that_lean_are_of_edges_and_many_of_another_plane():
    rng = np.random.default_rng(2)
    leaning = [np.sin(np.radians(9.0)), 0.0, np.cos(np.radians(9.0))]
    main = about([0, 0, 1], 900, 0.5, rng)
    assert len(directions_of(np.concatenate([main, about(leaning, 150, 0.5, rng)]))) == 1
    assert len(directions_of(np.concatenate([main, about(leaning, 700, 0.5, rng)]))) == 2


@pytest.mark.parametrize("sigma", [0.02, 0.2])
@pytest.mark.parametrize("thickness", [2.5, 4.0, 12.0])
def test_a_plate_tells_its_direction_however_thin(thickness, sigma):
    turn = Rotation.random(random_state=1).as_matrix()
    found = without_windows(plate(np.random.default_rng(0), thickness, sigma) @ turn.T)
    assert angle_deg(found[0], turn[:, 2]) < 0.5


def test_two_thin_plates_tell_both_directions():
    rng = np.random.default_rng(0)
    points = np.concatenate([plate(rng, 3.5, 0.2), plate(rng, 3.5, 0.2)[:, [0, 2, 1]]])
    found = without_windows(points)
    assert max(abs(found[:, 2])) > np.cos(np.radians(0.5))
    assert max(abs(found[:, 1])) > np.cos(np.radians(0.5))


@pytest.mark.parametrize("radius", [6.0, 15.0])
def test_a_pipe_and_a_ball_have_no_planes(radius):
    rng = np.random.default_rng(0)
    turn = 2 * np.pi * rng.random(4000)
    height = 4000 / (2 * np.pi * radius)
    pipe = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height * rng.random(4000)])
    ball = rng.standard_normal((4000, 3))
    ball *= np.sqrt(4000 / (4 * np.pi)) / np.linalg.norm(ball, axis=1, keepdims=True)
    for points in (pipe, ball):
        assert len(without_windows(points + 0.1 * rng.standard_normal(points.shape))) == 0
