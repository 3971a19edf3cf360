"""The level of the ground above its lowest points: with noise, herbs and slopes, and where there is none."""

import numpy as np
import pytest

from cylx.records.stems import Ground
from cylx.stems.ground import find_ground
from cylx.stems.level import levels_over

SIDE = 12.0


def floor(rng, noise, *, density=150, herbs=0.0, slope=0.0):
    xy = rng.uniform(0.0, SIDE, (int(density * SIDE * SIDE), 2))
    up = np.where(rng.random(len(xy)) < herbs, rng.exponential(0.08, len(xy)), 0.0)
    points = np.column_stack([xy, slope * xy[:, 0] + up])
    return points + rng.normal(0.0, noise, points.shape)


@pytest.mark.parametrize("slope", [0.0, 0.5])
@pytest.mark.parametrize("density", [80, 1000])
@pytest.mark.parametrize("noise", [0.003, 0.015, 0.03])
def test_the_ground_is_where_its_points_are(noise, density, slope):
    """The lowest points are two to three deviations lower."""
    rng = np.random.default_rng(3)
    points = floor(rng, noise, density=density, slope=slope)
    ground = find_ground(points, None, "lowest")
    places = rng.uniform(1.0, SIDE - 1.0, (500, 2))
    error = ground.at(places) - slope * places[:, 0]
    wide = np.hypot(noise, slope * noise)
    assert abs(error.mean()) < 0.002 + 0.1 * wide
    assert error.std() < 0.003 + 0.2 * wide


def test_herbs_lift_it_by_a_part_of_its_noise_only():
    rng = np.random.default_rng(4)
    points = floor(rng, 0.025, herbs=0.3)
    ground = find_ground(points, None, "lowest")
    error = ground.at(rng.uniform(1.0, SIDE - 1.0, (500, 2))).mean()
    assert 0.0 < error < 0.5 * 0.025
    assert points[:, 2].mean() > 1.5 * error


def test_known_ground_is_at_the_middle_of_its_points_too():
    rng = np.random.default_rng(5)
    points = floor(rng, 0.02)
    shrubs = rng.uniform(0.0, SIDE, (5000, 3)) * [1.0, 1.0, 0.05]
    classes = np.repeat([2, 5], [len(points), len(shrubs)])
    ground = find_ground(np.concatenate([points, shrubs]), classes, "classes")
    assert abs(ground.at(rng.uniform(1.0, SIDE - 1.0, (500, 2))).mean()) < 0.004


def test_where_points_are_as_dense_all_the_way_up_there_is_no_level():
    """A stem alone: its lowest points are the best that is known."""
    rng = np.random.default_rng(6)
    angle = rng.uniform(0.0, 2.0 * np.pi, 40000)
    stem = np.column_stack([2.0 + 0.2 * np.cos(angle), 2.0 + 0.2 * np.sin(angle), rng.uniform(0.0, 4.0, 40000)])
    ground = Ground(np.zeros(2), 0.5, np.zeros((8, 8)), "lowest")
    assert (np.abs(levels_over(stem, ground)) < 0.01).all()


def test_without_points_there_is_no_level():
    ground = Ground(np.zeros(2), 0.5, np.zeros((5, 7)), "lowest")
    assert (levels_over(np.empty((0, 3)), ground) == np.zeros((5, 7))).all()


def test_a_part_of_a_plot_has_the_level_of_the_whole():
    rng = np.random.default_rng(7)
    points = floor(rng, 0.025, herbs=0.3, slope=0.3)
    part = points[points[:, 0] < 8.0]
    places = rng.uniform(1.0, 5.0, (200, 2))
    whole, alone = (find_ground(one, None, "lowest").at(places) for one in (points, part))
    assert np.abs(whole - alone).max() < 0.002
