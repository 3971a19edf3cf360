"""Pins and bores are told apart by where their scanner stood, unless that is no scanner."""

import numpy as np
import pytest

import cylx
from cylx.io import read_cloud
from tests.io.test_ptx import scan

AT = np.array([4.0, 1.0, 1.5])


def half(inside, center, rng, points=3000):
    """Return the half of an upright cylinder that is seen from `AT`: the near one, or from within the far one."""
    towards = np.arctan2(AT[1] - center[1], AT[0] - center[0]) + (np.pi if inside else 0.0)
    angle, height = towards + rng.uniform(-1.2, 1.2, points), rng.uniform(0, 2, points)
    away = 0.3 + rng.normal(0, 0.001, points)
    return np.column_stack([away * np.cos(angle), away * np.sin(angle), height]) + np.array([*center, 0.0])


@pytest.fixture
def put(tmp_path):
    def write(points, at, shape=None):
        rows = [(*row, 0.5) for row in np.round(points - at, 5).tolist()]
        path = tmp_path / "scan.ptx"
        path.write_text(scan(rows, at=np.asarray(at, dtype=float), shape=shape))
        return path

    return write


def test_a_pin_is_seen_from_outside_and_a_bore_from_within(put):
    rng = np.random.default_rng(1)
    points = np.vstack([half(False, (0, 0), rng), half(True, (0, 3), rng)])
    found = cylx.extract(put(points, AT))
    sides = {round(fit.cylinder.point[1]): fit.side for fit in found.cylinders}
    assert sides == {0: "convex", 3: "concave"}
    # without a scanner nothing tells
    assert {fit.side for fit in cylx.extract(points).cylinders} == {"unknown"}


def test_a_place_that_is_no_scanner_is_not_believed(put):
    """Pipes that were seen from all sides, joined, with the zero of a map as their pose."""
    rng = np.random.default_rng(2)
    angle, height = rng.uniform(-np.pi, np.pi, 4000), rng.uniform(0, 2, 4000)
    points = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), height]) + rng.normal(0, 0.001, (4000, 3))
    assert {fit.side for fit in cylx.extract(put(points, AT)).cylinders} == {"unknown"}


def test_one_column_without_a_pose_has_no_scanner(put):
    points = half(False, (0, 0), np.random.default_rng(3)) - AT
    assert read_cloud(put(points, np.zeros(3))).source.stations == (None,)
    assert read_cloud(put(points, np.zeros(3), shape=(2, 1500))).source.stations == ((0.0, 0.0, 0.0),)
    assert read_cloud(put(points, AT)).source.stations == (tuple(AT),)


def test_the_poses_of_e57_are_the_places_of_its_scanners(tmp_path):
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "a.e57"
    rng = np.random.default_rng(4)
    with pye57.E57(str(path), mode="w") as file:
        for at in (AT, np.zeros(3), -AT):
            own = half(False, (0, 0), rng) - AT
            file.write_scan_raw(
                {f"cartesian{axis}": own[:, k] for k, axis in enumerate("XYZ")},
                translation=at, rotation=np.array([1.0, 0, 0, 0]),
            )  # fmt: skip
    cloud = read_cloud(path)
    assert cloud.source.stations == (tuple(AT), None, tuple(-AT))
    (fit,) = cylx.extract(path, scan=0).cylinders
    assert fit.side == "convex"
