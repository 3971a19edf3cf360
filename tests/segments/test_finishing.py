"""A catalogue from end to end: what is snapped, what is left as it is, and what it does to axis and covariance."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from cylx.api import extract
from cylx.config import Config
from cylx.fits.nominal_radius import Catalogue
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import axis_basis
from cylx.records import IndexedCloud, Noise, Segment
from cylx.results import Result, result_schema
from cylx.scene import make_frame
from cylx.segments.finishing import finish, inflation
from cylx.synthetic import single

LISTED = [{"name": "DN40", "radius": 0.8}, {"name": "DN50", "radius": 1.0, "tolerance": 1e-3}, {"radius": 1.25}]


@pytest.fixture(scope="module")
def arc():
    return single(points=2000, sigma=0.01, theta_deg=90, seed=3)


@pytest.fixture(scope="module")
def free(arc):
    return extract(arc.points)


@pytest.fixture(scope="module")
def snapped(arc):
    return extract(arc.points, catalogue=LISTED)


def only(extraction):
    (cylinder,) = Result.of(extraction).to_object()["cylinders"]
    return cylinder


def without_match(cylinder):
    return {key: value for key, value in cylinder.items() if key != "catalogue"}


def test_a_radius_that_is_listed_is_snapped(free, snapped):
    before, after = only(free), only(snapped)
    assert "catalogue" not in before
    assert list(after)[-1] == "catalogue"
    match = after["catalogue"]
    keys = ["decision", "name", "nominal_radius", "likelihood_ratio", "free_radius", "free_radius_sd"]
    assert list(match) == keys
    assert (match["decision"], match["name"], match["nominal_radius"]) == ("snapped", "DN50", 1.0)
    assert match["likelihood_ratio"] > 20
    assert (match["free_radius"], match["free_radius_sd"]) == pytest.approx(
        (before["radius"], before["uncertainty"]["radius"]), rel=1e-9
    )
    assert abs(after["radius"] - 1) < abs(before["radius"] - 1)
    assert after["uncertainty"]["radius"] < 1e-3
    assert snapped.warnings == ()


def test_the_resolved_configuration_has_the_entries(snapped):
    config = json.loads(Result.of(snapped).to_json())["config"]["scene"]["catalogue"]
    assert config == [
        {"name": "DN40", "radius": 0.8, "tolerance": 0.0016},
        {"name": "DN50", "radius": 1.0, "tolerance": 0.001},
        {"name": None, "radius": 1.25, "tolerance": 0.0025},
    ]


def test_the_result_is_by_the_schema(snapped):
    content = json.loads(Result.of(snapped).to_json())
    jsonschema.validate(content, result_schema())
    assert Result.parse(content, "r.json").to_object() == content


@pytest.mark.parametrize(
    ("radii", "tolerance", "decision"),
    [
        ([0.999, 1.001], 5e-4, "ambiguous"),  # closer than the arc can tell
        ([0.95, 1.05], 2e-3, "none"),
        ([0.1, 10.0], 2e-3, "none"),
    ],
)
def test_what_the_points_do_not_bear_out_is_left_as_it_is(arc, free, radii, tolerance, decision):
    found = extract(arc.points, catalogue=[{"radius": radius, "tolerance": tolerance} for radius in radii])
    after = only(found)
    assert after["catalogue"]["decision"] == decision
    assert "name" not in after["catalogue"]
    assert without_match(after) == only(free)
    (warning,) = found.warnings
    assert warning.startswith("no radius was snapped to the catalogue")


def test_the_same_in_millimetres_is_the_same(arc, snapped):
    listed = [{key: 1000 * value if key != "name" else value for key, value in each.items()} for each in LISTED]
    metres, millimetres = only(snapped), only(extract(1000 * np.array(arc.points), catalogue=listed))
    for key in ("decision", "name"):
        assert millimetres["catalogue"][key] == metres["catalogue"][key]
    assert millimetres["catalogue"]["likelihood_ratio"] == pytest.approx(
        metres["catalogue"]["likelihood_ratio"], rel=1e-4
    )
    assert millimetres["radius"] == pytest.approx(1000 * metres["radius"], rel=1e-7)
    units = np.array([1000, 1000, 1, 1, 1000])
    covariances = [np.array(each["uncertainty"]["covariance"]) for each in (metres, millimetres)]
    assert covariances[1] == pytest.approx(covariances[0] * np.outer(units, units), rel=1e-4)


def test_the_threads_do_not_matter(arc, snapped):
    assert Result.of(extract(arc.points, catalogue=LISTED, threads=3)).to_json() == Result.of(snapped).to_json()


def test_the_result_finds_the_same_again(arc, snapped):
    again = json.loads(Result.of(extract(arc.points, config=snapped.config)).to_json())
    assert again["scene"].pop("given") == ["spacing", "noise"]  # what was measured then is given now
    assert again == json.loads(Result.of(snapped).to_json())


def test_it_goes_with_a_known_direction(arc):
    found = only(extract(arc.points, catalogue=LISTED, axis="z", axis_sd_deg=0.001))
    assert found["catalogue"]["decision"] == "snapped"
    assert found["uncertainty"]["axis_angle_deg"] == pytest.approx(0.001 * np.sqrt(2), rel=0.05)


def test_an_oval_is_moved_by_what_its_covariance_says():
    points = np.array(single(points=4000, sigma=0.003, seed=5).points)
    points[:, :2] *= [1.004, 0.996]
    before, after = (only(extract(points, catalogue=[{"radius": r, "tolerance": 5e-4}])) for r in (3.0, 1.001))
    assert before["evidence"]["lack_of_fit"] > 1.4
    assert after["catalogue"]["decision"] == "snapped"
    assert after["catalogue"]["free_radius_sd"] == pytest.approx(before["uncertainty"]["radius"], rel=1e-9)
    variance = before["uncertainty"]["radius"] ** 2
    gain = variance / (variance + 5e-4**2)
    assert after["radius"] - before["radius"] == pytest.approx(gain * (1.001 - before["radius"]), rel=1e-6)
    assert after["uncertainty"]["radius"] ** 2 == pytest.approx((1 - gain) * variance, rel=1e-6)


def test_what_has_no_covariance_has_no_match(arc):
    found = extract(arc.points, overrides=["averaging.refine=false"], max_cylinders=1, catalogue=LISTED)
    assert not {"catalogue", "uncertainty"} & set(only(found))
    assert found.warnings[-1].startswith("no radius was snapped to the catalogue")


# the last fit, many times


def ground_of(points, noise):
    frame, _ = make_frame(points, Config())
    known = Noise(np.ones(1), np.array([noise / frame.spacing]))
    return IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(frame.points)), known), frame


def last_fit(indexed, frame, catalogue=None, inflated=1.0):
    """Finish an upright cylinder about the origin; give choice, model and covariance in scene units."""
    model = np.concatenate([-frame.origin, [0, 0, frame.spacing], [1.0]]) / frame.spacing
    if catalogue is not None:
        catalogue = Catalogue(*(tuple(x / frame.spacing for x in part) for part in catalogue))
    fit = finish(Segment(model, 2.0 / frame.spacing, 0.0), indexed, None, catalogue, inflated=inflated)
    units = np.array([frame.spacing, frame.spacing, 1.0, 1.0, frame.spacing])
    point, radius = fit.model[:3] * frame.spacing + frame.origin, fit.model[6] * frame.spacing
    covariance = fit.covariance * np.outer(units, units)
    return fit.choice, np.array([*point, *fit.model[3:6], radius]), covariance


def error_of(model, radius):
    """Give the error against an upright cylinder about the origin, as the covariance has it."""
    frame, direction = np.array(axis_basis(model[3:6])), model[3:6]
    along = np.array([0, 0, 1.0]) / direction[2]
    away = -model[:3] + (model[:3] @ direction) * along
    return np.array([*(frame @ away), *(frame @ (along - direction)), radius - model[6]])


def test_of_an_arc_the_axis_is_several_times_more_certain_and_rightly_so():
    rng = np.random.default_rng(0)
    before, after, squares, tolerance = [], [], [], 2e-4
    for seed in range(25):
        radius = 1.0 + tolerance * rng.standard_normal()
        points = radius * np.array(single(points=1500, sigma=0.01, theta_deg=90, seed=seed).points)
        indexed = ground_of(points, 0.01)
        _, free, covariance = last_fit(*indexed)
        choice, drawn, smaller = last_fit(*indexed, ((0.9, 1.0), (tolerance, tolerance)))
        assert choice.entry == 1
        if choice.decision != "snapped":
            assert np.array_equal(drawn, free)
            continue
        assert np.trace(covariance[:2, :2]) > 4**2 * np.trace(smaller[:2, :2])
        errors = error_of(free, radius), error_of(drawn, radius)
        before.append(errors[0][:2] @ errors[0][:2])
        after.append(errors[1][:2] @ errors[1][:2])
        squares.append(errors[1] @ np.linalg.solve(smaller, errors[1]))
    assert len(after) >= 22  # of an arc so noisy some are left in doubt
    assert np.sqrt(np.mean(before) / np.mean(after)) > 4
    # chi-square of five degrees of freedom: with 25 seeds the mean has a standard error of 0.6
    assert np.mean(squares) == pytest.approx(5, abs=2)


def test_what_is_no_perfect_cylinder_keeps_its_robust_fit():
    points = np.array(single(points=3000, sigma=0.002, seed=5).points)
    points[:, :2] *= [1.01, 0.99]  # an oval
    indexed, lack, tolerance = ground_of(points, 0.002), 20.0, 5e-4
    _, free, before = last_fit(*indexed, inflated=lack)
    nominal = free[6] + 2 * tolerance
    choice, drawn, after = last_fit(*indexed, ((nominal, 1.2), (tolerance, tolerance)), inflated=lack)
    assert choice.decision == "snapped"
    assert free[6] < drawn[6] < nominal
    # the robust fit is moved by just what its covariance says
    gain = before[4, 4] / (before[4, 4] + tolerance**2)
    assert drawn[6] - free[6] == pytest.approx(gain * 2 * tolerance, rel=1e-6)
    assert np.sqrt(after[4, 4]) == pytest.approx(np.sqrt((1 - gain) * before[4, 4]), rel=1e-6)
    assert np.sqrt(after[4, 4]) < tolerance


def test_a_lack_of_fit_inflates_from_where_it_is_none_by_chance():
    assert [inflation({"lack_of_fit": lack}) for lack in (0.5, 1.0, 1.4, 1.41, 30.0)] == [1, 1, 1, 1.41, 30]
    assert inflation({}) == 1


def test_the_structure_of_an_object_makes_its_radius_less_certain():
    points = np.array(single(points=2000, sigma=0.01, theta_deg=90, seed=2).points)
    angles = np.arctan2(points[:, 1], points[:, 0])
    points[:, :2] *= 1.0 + 0.02 * (np.sin(10.0 * angles) * np.cos(4.0 * points[:, 2]))[:, None]
    indexed = ground_of(points, 0.01)
    sure, unsure = (last_fit(*indexed, ((1.0,), (1e-3,)), inflated=inflated)[0] for inflated in (1.0, 9.0))
    assert unsure.deviation > 2.0 * sure.deviation


def test_where_too_little_is_seen_to_tell_the_covariance_is_multiplied():
    indexed = ground_of(np.array(single(points=30, sigma=0.01, theta_deg=60, seed=2).points), 0.01)
    one, nine = (last_fit(*indexed, inflated=inflated)[2] for inflated in (1.0, 9.0))
    assert np.allclose(nine, 9.0 * one, rtol=1e-9)


# the command line


@pytest.fixture
def scan(arc, tmp_path):
    path = tmp_path / "arc.xyz"
    np.savetxt(path, arc.points)
    return path


def test_the_command_reads_a_catalogue_and_shows_the_names(run_cylx, scan, tmp_path):
    listed = tmp_path / "pipes.csv"
    listed.write_text("# outer diameters\nname;diameter;tolerance\nDN40;1.6;\nDN50;2;0.002\n")
    done = run_cylx("extract", scan, "--catalogue", listed, "-o", tmp_path / "r.json", "--no-annotate")
    assert done.exit_code == 0, done.stderr
    head, _, row = done.stderr.splitlines()[-3:]
    assert head.split()[-1] == "nominal"
    assert row.split()[-1] == "DN50"
    match = json.loads((tmp_path / "r.json").read_bytes())["cylinders"][0]["catalogue"]
    assert (match["decision"], match["name"], match["nominal_radius"]) == ("snapped", "DN50", 1.0)
    listed.write_text("radius\n0.999\n1.001\n")
    done = run_cylx("extract", scan, "--catalogue", listed, "-o", "-")
    assert done.stderr.splitlines()[-1].split()[-1].endswith("?")
    assert "warning: no radius was snapped to the catalogue" in done.stderr
    listed.write_text("radius\n3\n")
    assert run_cylx("extract", scan, "--catalogue", listed, "-o", "-").stderr.splitlines()[-1].split()[-1] == "-"
    assert "nominal" not in run_cylx("extract", scan, "-o", "-").stderr


def test_the_command_refuses_a_bad_catalogue_before_it_reads_the_scan(run_cylx, tmp_path):
    failed = run_cylx("extract", tmp_path / "gone.ply", "--catalogue", tmp_path / "gone.csv")
    assert (failed.exit_code, failed.stdout) == (2, "")
    assert failed.stderr.startswith(f"cylx: {tmp_path / 'gone.csv'}: no such file; ")
    assert len(failed.stderr.splitlines()) == 1
    (tmp_path / "pipes.csv").write_text("radius\n0\n")
    failed = run_cylx("config", "show", "--catalogue", tmp_path / "pipes.csv")
    assert (failed.exit_code, failed.stderr) == (
        2,
        f"cylx: {tmp_path / 'pipes.csv'}:2: the radius '0' is out of range; it must be > 0 and finite\n",
    )
    (tmp_path / "pipes.csv").write_text("radius\n1\n")
    both = ["--catalogue", tmp_path / "pipes.csv", "--known-radius", "1"]
    failed = run_cylx("extract", tmp_path / "gone.ply", *both)
    assert (failed.exit_code, failed.stderr) == (
        2,
        "cylx: scene.catalogue: contradicts scene.known_radius; leave one of them out\n",
    )


# what stands on a plane


def pin(lean_deg, height, seed, sigma=0.03):
    """Draw a pin of radius 1 that leans in the plane of x and z."""
    rng = np.random.default_rng(seed)
    count = round(60 * height)
    turn = 2 * np.pi * rng.random(count)
    points = np.column_stack([np.cos(turn), np.sin(turn), height * (rng.random(count) - 0.5)])
    cosine, sine = np.cos(np.radians(lean_deg)), np.sin(np.radians(lean_deg))
    return points @ np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]).T + sigma * rng.standard_normal(
        points.shape
    )


def lean_found(points, height, start_deg, planes):
    """Finish a cylinder that leans so much; give the angle of its axis to z."""
    indexed, frame = ground_of(points, 0.03)
    indexed = replace(indexed, planes=np.array(planes, dtype=np.float64).reshape(-1, 3))
    direction = [np.sin(np.radians(start_deg)), 0.0, np.cos(np.radians(start_deg))]
    model = np.concatenate([-frame.origin / frame.spacing, direction, [1.0 / frame.spacing]])
    fit = finish(Segment(model, 0.5 * height / frame.spacing, 0.03 / frame.spacing), indexed)
    return np.degrees(np.arccos(min(1.0, abs(fit.direction[2]))))


UPRIGHT = [[0.0, 0.0, -1.0]]


@pytest.mark.parametrize("seed", range(3))
def test_a_short_pin_on_a_plane_stands_upright(seed):
    points = pin(0.0, 0.5, seed)
    free, upright = (lean_found(points, 0.5, 2.0, planes) for planes in ([], UPRIGHT))
    assert upright < 0.3
    assert upright < free


def test_a_pin_that_leans_stays_so():
    points = pin(9.0, 0.8, 0)
    assert lean_found(points, 0.8, 9.0, UPRIGHT) == pytest.approx(9.0, abs=1.5)


def test_a_long_pipe_and_a_plane_far_off_its_axis_are_left_alone():
    points = pin(1.0, 4.0, 0)
    assert lean_found(points, 4.0, 1.0, UPRIGHT) == pytest.approx(lean_found(points, 4.0, 1.0, []), abs=1e-9)
    points = pin(0.0, 0.5, 0)
    assert lean_found(points, 0.5, 0.0, [[1.0, 0, 0]]) == pytest.approx(lean_found(points, 0.5, 0.0, []), abs=1e-9)
