"""Quadrics over the nearest points: what they say of planes, of cylinders, and of both where they meet."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.geometry.morton import cell_starts
from cylx.geometry.patches import SIZE, TERMS, choose_patches, fit_patches
from cylx.geometry.planar import find_planar
from cylx.scene import make_frame

REACH = 2.6, 12.0


def in_cells(points):
    """Give the points of a frame, in cells."""
    frame, _ = make_frame(points, Config())
    level = max(0, round(np.log2(REACH[0] / frame.unit)))
    return frame, (*cell_starts(frame.codes, level), frame.unit * 2.0**level)


def patches_of(points):
    """Fit a patch to each point of a frame; give the frame, the patches, the points' own, and the normals."""
    frame, cells = in_cells(points)
    which = np.arange(len(frame.points))
    patches, members = np.empty((len(which), TERMS)), np.empty((len(which), SIZE), np.int64)
    fit_patches(frame.points, *cells, which, *REACH, patches, members)
    owners, normals = np.empty(len(which), np.int64), np.empty((len(which), 3))
    choose_patches(frame.points, which, which, patches, members, owners, normals)
    return frame, patches, owners, normals


def planar_of(points, noise=0.0):
    """Tell which points of a frame lie on planes, and give their normals."""
    frame, cells = in_cells(points)
    normals, planar = np.zeros((len(frame.points), 3), np.float32), np.zeros(len(frame.points), bool)
    find_planar(frame.points, *cells, np.arange(len(frame.points)), *REACH, noise, normals, planar)
    return frame, normals, planar


def wall(count=4000, radius=1.0, height=3.0, seed=0):
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * rng.random(count)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height * rng.random(count)])


def floor(count=8000, side=6.0, hole=1.0, seed=1):
    """Draw from a square with a hole."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([side * (rng.random((count, 2)) - 0.5), np.zeros(count)])
    return points[np.linalg.norm(points[:, :2], axis=1) > hole]


def test_the_normals_of_a_cylinder_are_radial():
    frame, patches, owners, normals = patches_of(wall())
    places = frame.points * frame.spacing + frame.origin
    radial = places[:, :2] / np.linalg.norm(places[:, :2], axis=1, keepdims=True)
    cosines = np.abs((normals[:, :2] * radial).sum(axis=1))
    assert (owners >= 0).mean() > 0.99
    assert np.median(cosines) > 0.9999
    assert np.quantile(cosines, 0.01) > 0.99
    assert np.median(patches[owners[owners >= 0], 13]) < 0.01  # spacings: nothing but what a quadric leaves open


def test_the_normals_of_a_cylinder_stay_radial_beside_a_plane():
    """Of the patches that hold a point, the one that does not cross the edge is its own."""
    frame, _, owners, normals = patches_of(np.concatenate([wall(), floor()]))
    places = frame.points * frame.spacing + frame.origin
    on = (places[:, 2] > 1e-6) & (places[:, 2] < 0.15) & (owners >= 0)
    radial = places[on, :2] / np.linalg.norm(places[on, :2], axis=1, keepdims=True)
    cosines = np.abs((normals[on, :2] * radial).sum(axis=1))
    assert on.sum() > 100
    assert np.median(cosines) > 0.99
    assert (cosines > 0.9).mean() > 0.8


def test_points_of_planes_are_told_from_those_of_a_cylinder():
    frame, normals, planar = planar_of(np.concatenate([wall(), floor()]))
    places = frame.points * frame.spacing + frame.origin
    on_floor = places[:, 2] < 1e-9
    assert planar[on_floor].mean() > 0.97
    assert planar[~on_floor].mean() < 0.25
    told = planar & on_floor & np.any(normals != 0, axis=1)
    assert told.sum() > 0.8 * on_floor.sum()
    assert np.abs(normals[told, 2]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_noise_that_is_known_does_not_hide_a_plane(noise):
    frame, _ = make_frame(floor(), Config())
    rng = np.random.default_rng(2)
    rough = floor() + noise * frame.spacing * rng.standard_normal((len(floor()), 3))
    _, _, planar = planar_of(rough, noise)
    assert planar.mean() > 0.95


def test_the_attitude_does_not_matter():
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    points = np.concatenate([wall(), floor()])
    here, there = (planar_of(each)[2].mean() for each in (points, points @ turn.T))
    assert there == pytest.approx(here, abs=0.01)
