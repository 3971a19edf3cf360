"""Circles about the directions of planes: what is too short for any window, exact or in noise."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.config import Config
from cylx.pipeline.candidates import candidates_of_patches, windows_and_explained
from cylx.pipeline.stage_log import StageLog
from cylx.records import PointCloud, SilentObserver
from cylx.scene import prepare
from cylx.stages.plane_directions import MOST_DIRECTIONS, directions_of

STEP = 0.025
"""Spacing; the radius of the disc is 1."""
HEIGHT = 0.1


def about(axis, count, spread_deg, rng):
    """Draw normals about an axis, either way."""
    normals = np.array(axis) + np.radians(spread_deg) * rng.standard_normal((count, 3))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True) * rng.choice([-1.0, 1.0], (count, 1))


def angle_deg(one, other):
    return np.degrees(np.arcsin(min(1.0, np.linalg.norm(np.cross(one, other)))))


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
    assert [angle_deg(axes @ one, other) < 0.01 for one, other in zip(found, turned, strict=True)] == [True] * len(
        found
    )


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


def disc_on_a_plate(noise, seed):
    """Draw a disc that stands on a plate 2.8 radii wide; noise in spacings."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * rng.random(round(2 * np.pi * HEIGHT / STEP**2))
    wall = np.column_stack([np.cos(turn), np.sin(turn), HEIGHT * rng.random(len(turn))])
    count = round(2.8**2 / STEP**2)
    face = np.column_stack([rng.uniform(-1.4, 1.4, (count, 2)), np.zeros(count)])
    face[np.linalg.norm(face[:, :2], axis=1) < 1, 2] = HEIGHT
    points = np.concatenate([wall, face])
    return points + noise * STEP * rng.standard_normal(points.shape)


@pytest.mark.parametrize(("noise", "within"), [(0.0, 1e-3), (0.2, 0.02)])
def test_the_rim_of_a_disc_on_a_plate_has_candidates_in_any_attitude(noise, within):
    turn, shift = Rotation.random(random_state=7).as_matrix(), np.array([3.0, -2.0, 5.0])
    models = rims_of(disc_on_a_plate(noise, 0) @ turn.T + shift)
    away = np.linalg.norm(np.cross(models[:, :3] - shift, turn[:, 2]), axis=1)
    upright = np.abs(models[:, 3:6] @ turn[:, 2]) > np.cos(np.radians(2))
    right = upright & (away < 0.05) & (np.abs(models[:, 6] - 1) < 0.05)
    assert right.sum() > 20
    assert np.median(models[right, 6]) == pytest.approx(1.0, abs=within)


def rims_of(points):
    """Give the candidates of circles, scene units."""
    prepared = prepare(PointCloud(points), Config())
    log = StageLog(SilentObserver())
    _, explained = windows_and_explained(prepared, log)
    _, rims, _, _ = candidates_of_patches(prepared, explained, log)
    assert log.reports[-1].name == "rims"
    assert log.reports[-1].kept == len(rims)
    models = rims.models.copy()
    models[:, 6] *= prepared.frame.spacing
    models[:, :3] = models[:, :3] * prepared.frame.spacing + prepared.frame.origin
    return models
