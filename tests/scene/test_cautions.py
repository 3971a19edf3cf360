"""What will go wrong with a cloud is said before, and nothing is said of a cloud that is well."""

from pathlib import Path

import numpy as np
import pytest

from cylx.api import extract
from cylx.io import read_cloud
from cylx.records import PointCloud, Scene
from cylx.scene import measure_scene
from cylx.scene.cautions import cautions, damage, step_of
from cylx.synthetic import multi, single

SAMPLES = Path(__file__).resolve().parents[2] / "sample_data"
PIPES = read_cloud(SAMPLES / "pipes.ply").points
NOISE = 0.002
SAMPLED = 10_000
"""Points of a cloud that are looked at for steps and copies; fewer than otherwise, to be quick."""
MAP = np.array([5e5, 5e6, 100.0])


@pytest.fixture(autouse=True)
def _fewer_points_are_looked_at(monkeypatch):
    monkeypatch.setattr("cylx.scene.cautions.COORDINATES_SAMPLED", SAMPLED)


def said(points):
    """Give what is said of an array of points, by its kind."""
    cloud = PointCloud.from_array(points)
    return {caution.kind: caution for caution in cautions(cloud, cloud, measure_scene(cloud.points), 40)}


def random(*shape):
    return np.random.default_rng(0).standard_normal(shape)


def steps(points, step, axes=(0, 1, 2)):
    """Round some coordinates to multiples of a step."""
    rounded = points.copy()
    rounded[:, axes] = np.round(rounded[:, axes] / step) * step
    return rounded


def camera(disparities=8):
    """See a cylinder before a wall as a stereo camera does that tells parts of a pixel apart."""
    rng = np.random.default_rng(0)
    u, v = rng.integers(-320, 320, 40000), rng.integers(-240, 240, 40000)
    depth = np.where(abs(u) < 120, 2 - np.sqrt(np.maximum(0, 0.25 - (u / 262.5) ** 2)), 2.3)
    depth = 40 / (np.round(40 / (depth + 0.001 * rng.standard_normal(len(u))) * disparities) / disparities)
    return np.column_stack([u / 525 * depth, v / 525 * depth, depth])


WALL = np.column_stack([np.random.default_rng(1).random((5000, 2)) * 3, NOISE * random(5000)])


def bad_clouds(pipes):
    """Spoil a cloud in many ways; gives each with what is to be said of it."""
    return {
        "steps on all axes": (steps(pipes, 0.01), {"steps"}),
        "steps of z": (steps(pipes, 0.005, (2,)), {"steps"}),
        "steps that single precision has not": (steps(pipes, 0.01).astype(np.float32), {"steps"}),
        "steps of map coordinates": (steps(pipes + MAP, 0.01), {"steps"}),
        "levels of a camera": (camera(), {"steps"}),
        "single precision": ((pipes + 1e5).astype(np.float32), {"precision"}),
        "single precision that leaves nothing": ((pipes + 5e6).astype(np.float32), {"precision"}),
        "all points twice": (np.vstack([pipes, pipes]), {"copies"}),
        "a cloud too large to look at whole": (
            np.repeat(random(SAMPLED, 3), 3, axis=0),
            {"copies", "noise"},
        ),
        "noise above the spacing": (PIPES + 10 * NOISE * random(*PIPES.shape), {"noise"}),
        "half of the rows without a place": (np.vstack([pipes, np.full((len(pipes) + 1, 3), np.nan)]), {"missing"}),
        "few points": (single(points=39).points, {"few"}),
        "strays": (np.vstack([pipes, 100 * random(5, 3)]), {"strays"}),
        "one row of zeros among map coordinates": (np.vstack([pipes + MAP, np.zeros((1, 3))]), {"strays"}),
        "a tenth of zeros among map coordinates": (
            np.vstack([pipes + MAP, np.zeros((len(pipes) // 10, 3))]),
            {"strays", "zeros"},
        ),
        "zeros where nothing was measured": (np.vstack([pipes, np.zeros((10, 3))]), {"zeros"}),
        "a twentieth twice": (np.vstack([pipes, pipes[: len(pipes) // 20 + 1000]]), {"copies"}),
        "a wall": (WALL, {"flat"}),
        "degrees": (pipes / [111320, 80000, 1] + [11.5, 48.1, 500], {"degrees"}),
    }


THIN = PIPES[::5]
BAD = bad_clouds(THIN)


STRAYS = ("strays", "one row of zeros among map coordinates", "a tenth of zeros among map coordinates")
"""Clouds of which all but the first points are strays."""


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_said_and_nothing_else(name):
    points, kinds = BAD[name]
    found = said(points)
    assert set(found) == kinds
    if name in STRAYS:
        assert_box_has_all_others(points, found["strays"].remedy.rpartition(" ")[2])


def assert_box_has_all_others(points, box):
    """Check that a box leaves the strays out, and nothing else."""
    low, high = ([float(x) for x in corner.split(",")] for corner in box.split(":"))
    inside = ((points >= low) & (points <= high)).all(axis=1)
    assert inside[: len(THIN)].all()
    assert not inside[len(THIN) :].any()


@pytest.mark.parametrize("name", ["pipes.ply", "paper.xyz", "room.pcd", "site_mm.ply"])
def test_nothing_is_said_of_the_samples(name):
    cloud = read_cloud(SAMPLES / name)
    assert cautions(cloud, cloud, measure_scene(cloud.points), 40) == []


@pytest.mark.parametrize(
    "points",
    [
        single(seed=1, points=1000, p=0.3).points,
        single(seed=2, theta_deg=60).points,
        multi(seed=1, points=40000).points,
        multi(seed=2, points=40000, sigma=0.0, noise=0.0).points,
        multi(seed=2, points=40000, sigma=0.0, noise=0.0).points.astype(np.float32),
        steps(PIPES, 1e-3),
        (PIPES + 1e4).astype(np.float32),
        steps(PIPES, 1e-6) + MAP,
        np.vstack([PIPES, PIPES[:900]]),
        np.vstack([PIPES, 3 * random(50, 3)]),
        np.vstack([WALL, PIPES[:500]]),
        np.vstack([PIPES, np.full((40000, 3), np.nan)]),
        0.05 * single(points=40000, height=200.0).points,
    ],
    ids=[
        "few points, many outliers", "an arc", "a room", "exact", "exact, in single precision", "millimetres",
        "single precision, not so far", "map coordinates to a micrometre", "a few copies", "outliers about it",
        "a wall with something before it", "a picture with holes", "a mast",
    ],
)  # fmt: skip
def test_nothing_is_said_of_what_is_well(points):
    assert set(said(points)) == set()


@pytest.mark.parametrize("name", [name for name, (_, kinds) in BAD.items() if not kinds & {"precision", "degrees"}])
def test_the_unit_and_the_order_do_not_matter(name):
    points, kinds = BAD[name]
    assert set(said(1000 * points[::-1])) == kinds


@pytest.mark.parametrize("name", ["steps of z", "single precision", "all points twice"])
def test_the_remedy_helps(name):
    few = 2 if name == "single precision" else 3  # of fewer points some are seen in spite of it
    points, (kind,) = bad_clouds(PIPES[::few])[name]
    points = np.vstack([points] * (3 if kind == "copies" else 1))  # six times each
    before = extract(points)
    assert len(before.cylinders) == (6 if kind == "copies" else 0)  # copies are told before anything is measured
    (line,) = (line for line in before.warnings)
    fault, _, remedy = line.partition("; ")
    assert fault == said(points)[kind].fault
    if kind == "copies":
        after = extract(points, voxel=float(remedy.rpartition(" ")[2]))
    else:
        after = extract(points, overrides=[remedy.rpartition(" ")[2]])
    assert (len(after.cylinders), after.warnings) == (6, ())


@pytest.mark.parametrize("step", [1e-6, 0.001, 0.01, 0.025, 7.0])
@pytest.mark.parametrize("offset", [0.0, -300.0, 5e5])
def test_a_step_is_found(step, offset):
    values = np.round((offset + 40 * step * random(5000)) / step) * step
    assert step_of(values) == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("count", [0, 1, 2, 20, 500, 5000])
def test_where_there_is_no_step_none_is_found(count):
    assert step_of(random(count)) == 0.0
    assert step_of(1e6 + random(count)) == 0.0


def test_a_noise_that_was_given_needs_no_caution():
    cloud = PointCloud(steps(PIPES, 0.01))
    measured = measure_scene(cloud.points)
    assert [caution.kind for caution in damage(cloud, measured)] == ["steps"]
    assert damage(cloud, Scene(measured.spacing, 0.003, measured.extent)) == []
