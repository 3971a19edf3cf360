"""Candidates of the nearest points: what is too short or too small for a window."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.pipeline.candidates import candidates_of_patches, windows_and_explained
from cylx.pipeline.stage_log import StageLog
from cylx.records import PointCloud, SilentObserver
from cylx.scene import prepare


def proposed(points):
    """Give the candidates in scene units, the normals and the report."""
    prepared = prepare(PointCloud(points), Config())
    log = StageLog(SilentObserver())
    _, explained = windows_and_explained(prepared, log)
    found, _, normals, _ = candidates_of_patches(prepared, explained, log)
    models = found.models.copy()
    models[:, 6] *= prepared.frame.spacing
    models[:, :3] = models[:, :3] * prepared.frame.spacing + prepared.frame.origin
    return models, normals, next(report for report in log.reports if report.name == "patches")


def wall(count, radius, height, seed=0):
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * rng.random(count)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height * rng.random(count)])


def face(count, side, height, radius, seed, inside=False):
    """Draw from a square with a round hole, or from what fills it."""
    points = np.column_stack([side * (np.random.default_rng(seed).random((count, 2)) - 0.5), np.full(count, height)])
    return points[(np.linalg.norm(points[:, :2], axis=1) < radius) == inside]


def right(models, radius, cosine=0.995, offset=0.1, tolerance=0.05):
    """Tell which candidates are the cylinder about the z axis."""
    away = np.linalg.norm(np.cross(models[:, :3], models[:, 3:6]), axis=1)
    return (np.abs(models[:, 5]) > cosine) & (away < offset * radius) & (np.abs(models[:, 6] / radius - 1) < tolerance)


@pytest.mark.parametrize("seed", range(3))
def test_a_bore_of_eighty_points_has_a_candidate_of_the_right_radius(seed):
    bore = [face(6000, 6.0, z, 0.22, seed + k) for k, z in enumerate((0.0, 0.4))]
    models, _, report = proposed(np.concatenate([*bore, wall(80, 0.22, 0.4, seed)]))
    assert report.kept == len(models)
    good = right(models, 0.22)
    assert good.sum() > 5
    assert np.median(models[good, 6]) == pytest.approx(0.22, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_the_rim_of_a_disc_has_candidates(seed):
    caps = [face(5000, 2.0, z, 1.0, seed + k, inside=True) for k, z in enumerate((0.0, 0.15))]
    models, _, _ = proposed(np.concatenate([*caps, wall(1200, 1.0, 0.15, seed)]))
    assert right(models, 1.0).sum() > 20


def test_planes_alone_have_no_candidates():
    models, _, _ = proposed(np.concatenate([face(8000, 6.0, z, 0.0, seed) for seed, z in enumerate((0.0, 2.0))]))
    assert len(models) == 0


def test_noise_that_hides_the_curvature_leaves_nothing_to_say():
    points = wall(6000, 1.0, 4.0)
    spacing = prepare(PointCloud(points), Config()).frame.spacing
    models, normals, _ = proposed(points + 0.5 * spacing * np.random.default_rng(1).standard_normal(points.shape))
    assert len(models) == 0
    assert normals is None
