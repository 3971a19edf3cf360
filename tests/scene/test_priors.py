"""What is known beforehand: a direction, radii, an angle seen. It is kept by all that is found, and costs nothing."""

import json
from pathlib import Path

import numpy as np
import pytest

from cylx.api import extract
from cylx.config import Config, load_config
from cylx.evaluation import Tolerances, compare
from cylx.geometry.lines import are_along
from cylx.pipeline import extract_cylinders, judging
from cylx.records import PointCloud, Segment
from cylx.results import Result
from cylx.synthetic import multi, single

SAMPLE_DATA = Path(__file__).resolve().parents[2] / "sample_data"
MAP = np.array([512345.678, 5412345.432, 123.4])
SMALL = {"points": 6000, "planes": 1, "boxes": 1, "spheres": 1, "cones": 1}
SAMPLES = {
    "pipes.ply": lambda: SAMPLE_DATA / "pipes.ply",
    "a room": lambda: multi(**SMALL, cylinders=3, seed=2).points,
    "another in millimetres on a map": lambda: 1000.0 * (multi(**SMALL, cylinders=4, seed=3).points + MAP),
}


@pytest.fixture(scope="module", params=SAMPLES)
def name(request):
    return request.param


@pytest.fixture(scope="module")
def sample(name):
    return SAMPLES[name]()


@pytest.fixture(scope="module")
def found(sample, extract_file):
    return extract_file(sample) if isinstance(sample, Path) else extract(sample)


@pytest.fixture(scope="module")
def can():
    return single(points=3000, sigma=0.01, theta_deg=120, seed=1)


def angles_to(axis, extraction):
    """Give the angle of each cylinder to an axis, degrees."""
    directions = np.array([fit.cylinder.direction for fit in extraction.cylinders]).reshape(-1, 3)
    return np.degrees(np.arccos(np.minimum(np.abs(directions @ axis) / np.linalg.norm(axis), 1.0)))


def assert_only_these(extraction, expected, wanted):
    """Check that just the wanted ones of the expected cylinders were found, within the errors of the fits."""
    one, other = (Result.of(each).to_object() for each in (expected, extraction))
    one["cylinders"] = [each for each, is_wanted in zip(one["cylinders"], wanted, strict=True) if is_wanted]
    assert compare(one, other, tolerances=Tolerances(angle_deg=0.3)).differences == ()


def test_a_direction_is_kept_by_all_and_costs_none(name, sample, found):
    tolerance = 3.0 if name == "a room" else None
    axis = -2.5 * found.cylinders[0].cylinder.direction
    other = extract(sample, axis=axis, axis_tolerance_deg=tolerance)
    within = tolerance or 10.0
    assert angles_to(axis, other).max() <= within
    assert_only_these(other, found, angles_to(axis, found) <= within)
    (report,) = (stage for stage in other.stages if stage.name == "priors")
    assert report.rejected == {"axis out of range": report.considered - report.kept}
    assert (other.config.scene.axis, other.config.scene.axis_tolerance_deg) == (list(axis), within)


def test_a_radius_is_kept_by_all_and_costs_none(sample, found):
    radii = np.sort([fit.cylinder.radius for fit in found.cylinders])
    least, greatest = 0.99 * radii[1], 1.01 * radii[-1]
    other = extract(sample, radius=(least, greatest))
    assert all(least <= fit.cylinder.radius <= greatest for fit in other.cylinders)
    assert_only_these(other, found, [least <= fit.cylinder.radius <= greatest for fit in found.cylinders])


def test_an_angle_seen_is_kept_by_all_and_costs_none(sample, found):
    seen = np.sort([fit.coverage for fit in found.cylinders])
    least = float(np.degrees(seen[:2].mean()))
    other = extract(sample, min_coverage_deg=least)
    assert all(fit.coverage >= np.radians(least) for fit in other.cylinders)
    assert_only_these(other, found, [fit.coverage >= np.radians(least) for fit in found.cylinders])
    assert "coverage" in {rejection.reason for rejection in other.rejected}


def test_a_direction_that_nothing_has_gives_nothing(can):
    assert extract(can.points, axis="z").cylinders != ()
    assert extract(can.points, axis="x").cylinders == ()


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({}, 1),
        ({"axis": (0, 0, 1)}, 1),
        ({"axis": (1, 0, 0)}, 0),
        ({"min_coverage_deg": 180}, 1),
        ({"min_coverage_deg": 330}, 0),
        ({"radius": (0.5, 1.5)}, 1),
        ({"radius": (2, 3)}, 0),
    ],
)
def test_all_hold_where_nothing_is_verified_too(options, count):
    scene = single(points=3000, sigma=0.01, theta_deg=270, seed=1)
    assert len(extract(scene.points, preset="paper", max_cylinders=1, **options).cylinders) == count


@pytest.mark.parametrize(
    ("moved", "reason"),
    [
        (lambda model: np.array([*model[:3], 0.0, np.sin(0.2), np.cos(0.2), model[6]]), "axis out of range"),
        (lambda model: np.array([*model[:6], 1.5 * model[6]]), "radius out of range"),
    ],
)
def test_what_leaves_the_range_in_the_last_fit_is_dropped(monkeypatch, can, moved, reason):
    scene = Config().scene.model_copy(update={"axis": [0, 0, -1], "axis_tolerance_deg": 5.0, "radius_max": 1.2})
    config = Config(scene=scene)
    before = extract_cylinders(PointCloud(can.points), config)
    assert len(before.cylinders) == 1
    monkeypatch.setattr(judging, "finish", lambda s, *_, **__: Segment(moved(s.model), s.half, s.spread))
    after = extract_cylinders(PointCloud(can.points), config)
    assert after.cylinders == ()
    assert {stage.name: stage for stage in after.stages}["merging"].rejected == {reason: 1}
    assert reason in {rejection.reason for rejection in after.rejected}


@pytest.mark.parametrize("tolerance", [1e-6, 0.01, 1.0, np.pi / 2])
@pytest.mark.parametrize("length", [-1.0, 1e-300, 1e300])
def test_the_angle_is_to_a_line_of_any_length(tolerance, length):
    rng = np.random.default_rng(0)
    axis, across, _ = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    inside, outside = (np.cos(a) * axis + np.sin(a) * across for a in (0.999 * tolerance, 1.001 * tolerance))
    directions = np.array([inside, -inside, outside, -outside])
    admits = [True, True] + [tolerance == np.pi / 2] * 2
    assert are_along(directions, length * axis, tolerance).tolist() == admits


def test_no_angle_is_above_a_right_one():
    assert are_along(np.eye(3), (0, 0, 1), np.pi / 2).all()


def found_by(extraction):
    """Give a result without what was given of the scene, measured or not."""
    result = json.loads(Result.of(extraction).to_json())
    result["scene"].pop("given", None)
    return result


def test_the_direction_is_in_the_configuration_that_finds_the_same_again(can):
    one = extract(can.points, axis=np.array([0, 0, 2], np.int32), axis_tolerance_deg=5)
    again = load_config(start=one.config)
    assert again.scene.axis == [0, 0, 2]
    assert found_by(extract(can.points, config=again)) == found_by(one)


def test_a_known_radius_makes_the_axis_more_certain():
    arc = single(points=2000, sigma=0.01, theta_deg=90, seed=3)
    free, drawn = extract(arc.points), extract(arc.points, known_radius=(1.0, 1e-4))
    (one,), (other,) = Result.of(free).cylinders, Result.of(drawn).cylinders
    assert other.uncertainty.radius == pytest.approx(1e-4, rel=0.05)
    assert one.uncertainty.axis_offset > 4 * other.uncertainty.axis_offset
    true = arc.cylinders[0].cylinder
    away = np.linalg.norm(np.cross(np.array(other.axis_point) - true.point, true.direction))
    assert away < 3 * other.uncertainty.axis_offset


def test_a_known_radius_follows_the_unit():
    arc = single(points=2000, sigma=0.01, theta_deg=90, seed=4)
    metres = extract(arc.points, known_radius=(1.0, 1e-3)).cylinders[0]
    millimetres = extract(1000 * arc.points, known_radius=(1000.0, 1.0)).cylinders[0]
    assert millimetres.cylinder.radius == pytest.approx(1000 * metres.cylinder.radius, rel=1e-7)
    units = np.array([1000, 1000, 1, 1, 1000])
    assert millimetres.covariance == pytest.approx(metres.covariance * np.outer(units, units), rel=1e-4)


def test_only_what_has_the_known_radius_is_drawn_to_it(extract_file):
    pipes = SAMPLE_DATA / "pipes.ply"
    free, drawn = extract_file(pipes), extract(pipes, known_radius=(0.151, 2e-5))
    radii = [np.array([fit.cylinder.radius for fit in found.cylinders]) for found in (free, drawn)]
    near = np.abs(radii[0] - 0.151) < 1e-4
    assert near.sum() == 1
    assert radii[1][~near] == pytest.approx(radii[0][~near], rel=1e-9)
    assert abs(radii[1][near][0] - 0.151) < abs(radii[0][near][0] - 0.151)


def test_a_known_direction_makes_the_tilt_more_certain(can):
    free, drawn = extract(can.points), extract(can.points, axis="z", axis_sd_deg=0.001)
    assert angles_to(np.array([0, 0, 1.0]), drawn).max() < 0.005
    (one,), (other,) = Result.of(free).cylinders, Result.of(drawn).cylinders
    assert other.uncertainty.axis_angle_deg == pytest.approx(0.001 * np.sqrt(2), rel=0.05)
    assert one.uncertainty.axis_angle_deg > 5 * other.uncertainty.axis_angle_deg


def test_a_known_radius_that_nothing_has_is_told_of(can):
    (warning,) = extract(can.points, known_radius=(2.0, None)).warnings
    assert warning.startswith("no cylinder has the known radius of 2; the nearest has 1.0")
    assert extract(can.points, known_radius=(1.0, None)).warnings == ()
