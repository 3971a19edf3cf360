"""Scenes of cans: points of a mesh, two cans, cans among clutter."""

import math

import numpy as np
import pytest

from cylx.experiments import (
    ObjectScan,
    scans,
)
from cylx.experiments.scans import cans_among_clutter, two_cans
from tests.support.experiments import can_scan

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)

CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def test_points_of_a_mesh_are_even_over_its_faces_within_the_noise(monkeypatch):
    monkeypatch.setattr(scans, "SCANNED", 20_000)
    scan = ObjectScan.of(CUBE, CUBE_FACES)
    sides = np.array([1.0, 2.0, 3.0])
    extent = math.sqrt(14)
    assert scan.extent == pytest.approx(extent)
    assert scan.points.shape == (20_000, 3)
    away = np.abs(np.stack([scan.points, scan.points - sides]))  # distance from each of the six faces
    nearest = away.transpose(1, 0, 2).reshape(-1, 6)
    noise = scans.NOISE_OF_SCAN * extent
    assert nearest.min(axis=1).max() < 5.5 * noise
    # off the edges only one coordinate has a part in the distance: that is Gaussian, and folded
    inside = np.sort(nearest, axis=1)[:, 1] > 6 * noise
    assert nearest[inside].min(axis=1).mean() == pytest.approx(noise * math.sqrt(2 / math.pi), rel=0.03)
    areas = np.array([6, 3, 2, 6, 3, 2]) / 22
    shares = np.bincount(nearest.argmin(axis=1), minlength=6) / 20_000
    assert np.allclose(shares, areas, rtol=0, atol=5 * math.sqrt(0.25 / 20_000))
    # and even within a face, though it is two triangles
    bottom = scan.points[nearest.argmin(axis=1) == 2][:, :2]
    assert np.allclose(bottom.mean(axis=0), [0.5, 1.0], rtol=0, atol=5 * np.array([1, 2]) / math.sqrt(12 * len(bottom)))
    assert np.allclose(np.corrcoef(bottom.T)[0, 1], 0, rtol=0, atol=5 / math.sqrt(len(bottom)))
    assert np.array_equal(ObjectScan.of(CUBE, CUBE_FACES).points, scan.points)


@pytest.mark.parametrize("faces", [None, np.array([[0, 0, 0], [1, 2, 1]])], ids=["none", "without area"])
def test_points_without_faces_stay_as_they_are(faces):
    scan = ObjectScan.of(CUBE, faces)
    assert scan.points is CUBE
    assert (scan.extent, scan.center.tolist()) == (math.sqrt(14), [0.5, 1.0, 1.5])


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("view", [30, 60, 90, 120])
def test_seen_is_what_faces_away_from_the_view(view, side):
    scan = can_scan(3000)
    seen = scan.seen_from(view, side, neighbours=20)
    assert seen.extent == scan.extent
    radial = (seen.points - [0.2, -0.1, 0.05])[:, 1] / 0.033
    # normals of 20 neighbours of 3000 exact points on 63 patches' worth of surface: good to some degrees
    assert (side * radial).max() < math.cos(math.radians(view - 8))
    share = len(seen.points) / 3000  # the angle of the normals that remain, of a whole turn
    assert share == pytest.approx((180 - view) / 180, abs=4 * math.sqrt(0.25 / 3000) + 0.02)


def test_without_a_view_all_is_seen():
    scan = can_scan(100)
    assert scan.seen_from(0.0) is scan


def test_two_cans_are_one_scan_twice():
    scan = can_scan(800)
    middle = np.array([0.2, -0.1, 0.05])
    points, centers = two_cans(scan, middle, 1.0, np.random.default_rng(1))
    step = centers[1] - centers[0]
    assert np.allclose(centers[0], middle, rtol=0, atol=1e-15)
    assert np.linalg.norm(step) == pytest.approx(1.5 * scan.extent)
    assert np.allclose(points, np.concatenate([scan.points, scan.points + step]), rtol=0, atol=1e-12)
    again = two_cans(scan, middle, 1.0, np.random.default_rng(1))
    assert np.array_equal(again[0], points)
    assert not np.allclose(two_cans(scan, middle, 1.0, np.random.default_rng(2))[1][1], centers[1])
    half = two_cans(scan, middle, 0.5, np.random.default_rng(1))[0]
    assert len(half) == pytest.approx(800, abs=5 * math.sqrt(1600 / 4))
    assert {tuple(point) for point in half} < {tuple(point) for point in points}


@pytest.mark.parametrize(("cans", "points"), [(5, 4000), (1, 4000), (9, 40_000)])
def test_cans_stand_among_clutter(cans, points):
    scan = can_scan(2000)
    cloud, centers = cans_among_clutter(scan, cans, points, np.random.default_rng(0))
    assert cloud.shape == (points, 3)
    assert centers.shape == (cans, 3)
    grid = centers / (1.3 * scan.extent)
    assert np.allclose(grid, np.round(grid))
    assert len({tuple(place) for place in np.round(grid)}) == cans
    # of 9 things and the floor a can has 2000 points and another one 1000
    total = 2000 * cans + 1000 * (9 - cans) + 1000
    for center in centers:
        away = cloud - center
        # the middle of the box of 2000 random points is a little off that of the can
        on = (np.abs(np.hypot(away[:, 0], away[:, 1]) - 0.033) < 1e-3) & (np.abs(away[:, 2]) <= 0.051)
        expected = points * 2000 / total
        assert on.sum() == pytest.approx(expected, abs=5 * math.sqrt(expected))
    again = cans_among_clutter(scan, cans, points, np.random.default_rng(0))
    assert np.array_equal(again[0], cloud)
    assert np.array_equal(again[1], centers)
