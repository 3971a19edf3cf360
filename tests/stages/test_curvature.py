"""Curved windows: most say what the cylinder is, flat ones are told, and the threads make no difference."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cylx.config import CandidatesConfig, Config
from cylx.records import Candidates
from cylx.scene import make_frame
from cylx.stages.curvature import find_curved_windows
from cylx.synthetic import multi, single

ALL_RADII = (0.0, np.inf)


@cache
def frame_of(make, **params):
    """Give the frame of a synthetic scene; measuring it takes longer than looking through its windows."""
    return make_frame(make(**params).points, Config())[0]


def look(frame, radii=ALL_RADII, threads=1, **changes):
    found, explained, report = find_curved_windows(frame, radii, CandidatesConfig(**changes), threads)
    return found, explained.flatness, report


def good(found, frame):
    """Tell which candidates are the unit cylinder about the z axis of the scene."""
    off_axis = np.hypot(*(found.points * frame.spacing + frame.origin)[:, :2].T)
    return (
        (off_axis < 0.15)
        & (np.abs(found.radii * frame.spacing - 1) < 0.1)
        & (np.abs(found.directions[:, 2]) > np.cos(np.radians(6)))
    )


@pytest.mark.parametrize("theta_deg", [360, 90, 45])
def test_most_windows_on_a_cylinder_say_so(theta_deg):
    frame = frame_of(single, points=3000, sigma=0.01, p=0.1, sigma_o=0.2, theta_deg=theta_deg)
    found, _, _ = look(frame)
    assert len(found) > 50
    # small windows see little of a large radius
    large = found.windows * frame.spacing > 0.3
    assert large.sum() > 15
    assert good(found, frame)[large].mean() > 0.8


def test_candidates_speak_for_a_place_beside_their_window():
    frame = frame_of(single, points=2500)
    found, _, _ = look(frame)
    nearest = np.abs(cKDTree(frame.points).query(found.points)[0] / found.radii - 1)
    assert np.median(nearest) < 0.05
    assert (found.extents >= 0.8 * found.windows).all()
    assert (found.inliers >= 15).all()
    assert np.allclose(np.linalg.norm(found.directions, axis=1), 1.0)


def test_every_window_is_counted_once():
    frame = frame_of(multi, points=5000, cylinders=3, seed=2)
    found, _, report = look(frame)
    assert report.considered == report.kept + sum(report.rejected.values())
    assert report.kept == len(found)
    assert "flat" in report.rejected
    assert set(np.unique(found.windows)) <= set(frame.window_radii(1.6))
    assert len(np.unique(found.parents)) == len(found)  # every window is a parent of its own


def test_points_of_a_plane_are_flat_and_propose_nothing():
    points = np.random.default_rng(0).uniform(0, 1, (3000, 3)) * [1, 1, 0] + [0, 0, 5]
    points[:, 2] += 0.002 * np.random.default_rng(1).standard_normal(3000)
    found, flatness, _ = look(make_frame(points, Config())[0])
    assert len(found) == 0
    assert (flatness > 0).mean() > 0.98


def test_flatness_is_the_size_of_the_window():
    frame = frame_of(single, points=6000, sigma=0.001)
    _, flatness, _ = look(frame)
    # two radii of the larger windows show the curve; a sag of x^2 / 2 is flat within three noises up to x = 0.08
    assert flatness.max() * frame.spacing < 0.5
    assert set(np.unique(flatness)) <= {0.0, *(2 * radius for radius in frame.window_radii(1.6))}


def test_radii_out_of_range_are_not_proposed():
    found, _, _ = look(frame_of(single, points=2500))
    least, greatest = np.quantile(found.radii, [0.2, 0.8])
    within, _, _ = look(frame_of(single, points=2500), (least, greatest))
    assert 0 < len(within) < len(found)
    assert ((within.radii >= least) & (within.radii <= greatest)).all()


def test_threads_make_no_difference():
    results = [look(frame_of(multi, points=5000, cylinders=3, seed=2), threads=threads) for threads in (1, 2, 5)]
    for found, flatness, report in results[1:]:
        assert np.array_equal(found.models, results[0][0].models)
        assert np.array_equal(found.parents, results[0][0].parents)
        assert np.array_equal(flatness, results[0][1])
        assert report == results[0][2]


@pytest.mark.parametrize("octave", [1.3, 1.6, 3.0])
def test_windows_grow_by_octaves_to_an_eighth_of_the_cloud(octave):
    frame = frame_of(single, points=2500)
    radii = frame.window_radii(octave)
    assert radii[0] == frame.window
    assert np.allclose(np.divide(radii[1:], radii[:-1]), octave)
    extent = np.linalg.norm(np.ptp(frame.points, axis=0))
    assert extent / 8 <= radii[-1] <= octave * extent / 8 * 1.001


def test_sets_of_candidates_stay_apart_when_they_are_joined():
    found, _, _ = look(frame_of(single, points=2500))
    twice = Candidates.joined([found, Candidates.joined([]), found])
    assert len(twice) == 2 * len(found)
    assert len(np.unique(twice.parents)) == 2 * len(found)
    assert np.array_equal(twice.take(np.arange(len(found))).models, found.models)
