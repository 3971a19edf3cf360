"""Circles about the directions of planes: what is too short for any window, exact or in noise."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.config import Config
from cylx.pipeline.candidates import candidates_of_patches, windows_and_explained
from cylx.pipeline.stage_log import StageLog
from cylx.records import PointCloud, SilentObserver
from cylx.scene import prepare

STEP = 0.025
"""Spacing; the radius of the disc is 1."""
HEIGHT = 0.1


def angle_deg(one, other):
    return np.degrees(np.arcsin(min(1.0, np.linalg.norm(np.cross(one, other)))))


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
