"""The paper's experiments: cells that can be run, trials that come out the same, tables, pictures, scenes of cans."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cylx
from cylx.config import load_config
from cylx.errors import UsageError
from cylx.experiments import (
    FIGURES,
    Key,
    ObjectScan,
    Outcome,
    draw,
    header_line,
    parse_trials,
    run_tasks,
    run_trial,
    scans,
    summarize,
    tasks_of,
    trial_lines,
    trials,
)
from cylx.experiments.figures import METHODS, UNSURE, Cell
from cylx.experiments.scans import cans_among_clutter, two_cans
from cylx.experiments.study import bound_of
from cylx.experiments.trials import config_of
from cylx.fits.cramer_rao import mean_errors_at_bound
from cylx.geometry.cylinder import Cylinder
from cylx.synthetic import single
from cylx.synthetic.surfaces import Mantle

NAN = float("nan")
UNIT = (("points", 1500), ("height", 4.0), ("sigma", 0.01), ("sigma_o", 0.04), ("p", 0.1))


def cut_down(number, *, cells=2, points=1500):
    """Give a figure with a few cells of few points."""
    figure = FIGURES[number]
    chosen = [cell._replace(scene=tuple({**dict(cell.scene), "points": points}.items())) for cell in figure.cells]
    return figure._replace(cells=tuple(chosen[:cells]))


def outcome(found=2, angle=0.5, offset=0.25, radius=1.5, seconds=2.0):
    return Outcome(found, angle, offset, radius, seconds)


# figures


def test_figures_5_to_12_are_there():
    assert list(FIGURES) == list(range(5, 13))
    assert [figure.number for figure in FIGURES.values()] == list(range(5, 13))
    assert [number for number, figure in FIGURES.items() if figure.needs_scan] == [11, 12]


@pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
def test_no_two_cells_are_at_one_place_and_a_file_can_tell_them_apart(figure):
    places = [(cell.panel, cell.curve, float(cell.x)) for cell in figure.cells]
    assert len(set(places)) == len(places) > 0
    keys = [Key.of(cell, 3) for cell in figure.cells]
    assert list(parse_trials(header_line() + trial_lines((key, outcome()) for key in keys))) == keys


@pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
def test_each_place_has_all_methods_that_can_be_there(figure):
    expected = {5: {"gt", "auto"}, 6: {"gt"}, 11: set(METHODS) - {"line-fit"}, 12: set(METHODS) - {"line-fit"}}
    assert {cell.method for cell in figure.cells} == expected.get(figure.number, set(METHODS))
    if figure.number > 6:
        for panel, x in {(cell.panel, cell.x) for cell in figure.cells}:
            here = [cell for cell in figure.cells if (cell.panel, cell.x) == (panel, x) and cell.curve != UNSURE]
            assert sorted(cell.method for cell in here) == sorted(expected.get(figure.number, METHODS))
            assert len({cell.scene for cell in here}) == 1
            assert all(cell.curve == cell.method for cell in here)


@pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
def test_the_configuration_of_every_cell_loads(figure):
    extent = 150.0 if figure.needs_scan else None
    for cell in figure.cells:
        config = config_of(cell, 7, most=2, extent=extent)
        assert config.seed == 7
        assert config.method == ("gt" if cell.method == "auto" else cell.method)
        if cell.method == "auto":
            assert config == load_config(overrides=cell.settings, options={"seed": 7})
            assert cell.curve == UNSURE or not cell.settings
            continue
        assert (config.preset, config.max_cylinders) == ("paper", 2)
        # 2 mm and 1.2 radii of the soup can, whose box is 66 x 66 x 101 mm; 0.03 and 1.2 of the unit cylinder
        near, ball = (2.16, 42.9) if figure.needs_scan else (0.03, 1.2)
        if cell.method in {"msac", "tran", "jin"}:
            assert getattr(config, cell.method).distance == pytest.approx(near)
            assert config.jin.neighbourhood == pytest.approx(ball)


@pytest.mark.parametrize("figure", [figure for figure in FIGURES.values() if not figure.needs_scan])
def test_the_scene_of_every_cell_can_be_made(figure):
    for cell in figure.cells:
        assert dict(cell.scene)["points"] == 10_000
        assert single(**{**dict(cell.scene), "points": 50}).points.shape == (50, 3)


def test_the_planes_are_the_papers():
    def planes_of(number):
        return {config_of(cell, 0, most=1).slicing.planes for cell in FIGURES[number].cells if cell.method != "auto"}

    assert planes_of(5) == {10, 20, 30, 40, 60, 90}
    assert planes_of(6) == planes_of(7) == planes_of(8) == {20}
    assert planes_of(9) == {40}
    for cell in FIGURES[6].cells:
        assert config_of(cell, 0, most=1).slicing.inclination_deg == [cell.x - 5, cell.x + 5]
    assert {config_of(cell, 0, most=1).tran.neighbours for cell in FIGURES[8].cells if cell.method == "tran"} == {100}


# trials


@pytest.mark.parametrize("method", METHODS)
def test_every_method_gives_finite_errors_and_the_same_twice(method):
    (cell,) = (cell for cell in FIGURES[9].cells if cell.method == method and cell.x == 360)
    cell = cell._replace(scene=tuple({**dict(cell.scene), "points": 1500}.items()))
    first, again, other = (run_trial(cell, trial, None) for trial in (3, 3, 4))
    assert first[:4] == again[:4] != other[:4]
    assert first.found == 1
    # the roughest of them, of ten times the noise and more
    assert 0 < first.angle_deg < 3
    assert 0 < first.offset < 0.1
    assert 0 < first.radius_percent < 10
    assert first.seconds > 0


@pytest.fixture
def answer(monkeypatch, make_extraction):
    """Make the pipeline find these cylinders: (shape, inliers) each."""

    def find(*fits):
        extraction = make_extraction(cylinders=len(fits))
        found = tuple(
            replace(fit, cylinder=shape, inliers=inliers)
            for fit, (shape, inliers) in zip(extraction.cylinders, fits, strict=True)
        )
        monkeypatch.setattr(trials, "extract_cylinders", lambda *_, **__: replace(extraction, cylinders=found))

    return find


CELL = Cell("", "gt", 1.0, "gt", UNIT)


def test_errors_are_measured_of_the_cylinder_with_most_points(answer):
    tilted = Cylinder((0.3, 0.4, 0), (0, math.sin(0.2), math.cos(0.2)), 1.1, 3.0)
    answer((Cylinder((9, 9, 9), (1, 0, 0), 5.0, 1.0), 99), (tilted, 100))
    found = run_trial(CELL, 0, None)
    assert found.found == 1
    assert found.angle_deg == pytest.approx(math.degrees(0.2))
    # from the origin to the axis: the part of (0.3, 0.4, 0) across it
    assert found.offset == pytest.approx(math.hypot(0.3, 0.4 * math.cos(0.2)))
    assert found.radius_percent == pytest.approx(10.0)


def test_what_finds_nothing_has_no_errors(answer):
    answer()
    found = run_trial(CELL, 0, None)
    assert found.found == 0
    assert np.isnan(found[1:4]).all()
    assert math.isfinite(found.seconds)


def test_the_direction_of_an_axis_has_no_sign(answer):
    answer((Cylinder((0, 0, 1), (0, 0, -1), 1.0, 4.0), 9))
    assert run_trial(CELL, 0, None)[:4] == (1, 0.0, 0.0, 0.0)


CAN_CELL = Cell("", "gt", 1.0, "gt", (("share", 1.0),))


def test_the_angle_of_two_cans_is_that_of_the_cylinders_through_their_middles(answer):
    rng = np.random.default_rng([0, 21])
    scan = can_scan(500)
    centers = two_cans(scan, scan.center, 1.0, rng)[1]
    upright, tilted = (0, 0, 1), (0, math.sin(0.1), math.cos(0.1))
    first, second = (Cylinder(center, upright, 0.033, 0.1) for center in centers)
    answer((first, 50), (second, 40))
    assert run_trial(CAN_CELL, 0, scan)[:2] == (2, 0.0)
    answer((replace(first, direction=np.array(tilted)), 50), (second, 40))
    assert run_trial(CAN_CELL, 0, scan).angle_deg == pytest.approx(math.degrees(0.1))
    # of two at one place that with more points counts; what goes past the middle, or ends before it, does not
    answer((replace(first, direction=np.array(tilted)), 50), (first, 60), (second, 40))
    assert run_trial(CAN_CELL, 0, scan).angle_deg == 0.0
    beside = replace(second, point=second.point + np.array([0.02, 0, 0]))
    above = replace(second, point=second.point + np.array([0, 0, 0.1]))
    for lost in (beside, above):
        answer((first, 50), (lost, 40))
        found = run_trial(CAN_CELL, 0, scan)
        assert found.found == 1
        assert np.isnan(found[1:4]).all()


# tables

numbers = st.floats(0, 1e6) | st.just(NAN)
keys = st.builds(
    Key,
    st.sampled_from(["", 'least angle of normal and (0, 1, 0), "°"', "p = 0.1\n"]),
    st.sampled_from(["gt", "gt 50°"]),
    st.sampled_from([0.001, 0.05, 10.0, 300.0, 1000.0]),
    st.integers(0, 99),
)
outcomes = st.builds(Outcome, st.integers(0, 5), numbers, numbers, numbers, numbers)


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(keys, outcomes, max_size=20))
def test_a_table_reads_back(done):
    text = header_line() + trial_lines(done.items())
    back = parse_trials(text)
    assert list(back) == list(done)
    for key, one in done.items():
        assert back[key].found == one.found
        assert np.allclose(back[key], one, rtol=1e-5, atol=0, equal_nan=True)  # six digits
    assert header_line() + trial_lines(back.items()) == text
    for cut in range(len(text) - 2, max(0, len(text) - 12), -1):  # within the last line
        kept = parse_trials(text[:cut])
        assert kept is not None or not done
        assert not done or list(kept) == list(done)[:-1]


DONE = {Key("", "gt", 0.01, 0): outcome(), Key("", "gt", 0.01, 1): outcome(angle=NAN)}


def test_lines_of_other_versions_and_damaged_ones_are_passed_over():
    text = header_line() + trial_lines(DONE.items())
    first, second = text.splitlines()[1:]
    for other in (
        first.replace(cylx.__version__, "0.0.1"),
        first.replace("0.01", "x"),
        first.replace("0.5", "?"),
        "a,b",
        "",
    ):
        assert list(parse_trials(f"{header_line()}{other}\n{second}\n")) == list(DONE)[1:]
    assert parse_trials(header_line()) == parse_trials("") == {}


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n1,2,3\n",
        "precious",
        header_line().upper(),
        "\n" + header_line(),
        "a" * 200_000,
        header_line() + "a" * 200_000,
    ],
    ids=["other columns", "words", "capitals", "empty line first", "long field", "long field below"],
)
def test_a_foreign_file_is_none(text):
    assert parse_trials(text) is None


# studies


def test_what_is_done_is_not_done_again():
    figure = cut_down(7, cells=3)
    a, b, c = figure.cells
    assert [(task.cell, task.trial) for task in tasks_of(figure, 2, {})] == [
        (a, 0),
        (b, 0),
        (c, 0),
        (a, 1),
        (b, 1),
        (c, 1),
    ]
    done = {Key.of(b, 0): outcome(), Key.of(a, 1): outcome(), Key.of(c, 5): outcome()}
    assert [(task.cell, task.trial) for task in tasks_of(figure, 2, done)] == [(a, 0), (c, 0), (b, 1), (c, 1)]
    assert tasks_of(figure, 0, done) == []
    assert list(run_tasks([], 1, None)) == []


def test_means_and_standard_errors_are_those_by_hand():
    figure = cut_down(7, cells=3)
    a, b, _ = figure.cells
    done = {
        Key.of(a, 0): outcome(1, 1.0, 2.0, NAN, 10.0),
        Key.of(a, 1): outcome(0, 2.0, NAN, NAN, 20.0),
        Key.of(a, 2): outcome(1, 6.0, 4.0, NAN, 60.0),
        Key.of(b, 0): outcome(1, 7.0, 8.0, 9.0, 1.0),
    }
    one, two, three = summarize(figure, done)
    assert (one.trials, one.found) == (3, pytest.approx(2 / 3))
    assert one.means == pytest.approx((3.0, 3.0, NAN, 30.0), nan_ok=True)
    # variances of (1, 2, 6), (2, 4) and (10, 20, 60): 7, 2 and 700
    assert one.errors == pytest.approx((math.sqrt(7 / 3), 1.0, NAN, math.sqrt(700 / 3)), nan_ok=True)
    assert (two.trials, two.found, two.means) == (1, 1.0, (7.0, 8.0, 9.0, 1.0))
    assert np.isnan(two.errors).all()
    assert three.trials == 0
    assert np.isnan([three.found, *three.means, *three.errors]).all()
    assert [summary.cell for summary in (one, two, three)] == list(figure.cells)


@pytest.mark.parametrize("number", FIGURES)
def test_the_bound_is_that_of_the_scene(number):
    figure = FIGURES[number]
    if figure.kind != "cylinder":
        assert all(bound_of(figure, cell) is None for cell in figure.cells)
        return
    for cell in figure.cells[::7]:
        scene = {"theta_deg": 360, **dict(cell.scene)}
        expected = mean_errors_at_bound(
            scene["points"],
            scene["height"],
            math.radians(scene["theta_deg"]),
            scene["sigma"],
            scene["sigma_o"],
            scene["p"],
        )
        assert bound_of(figure, cell) == expected


def done_of(figure, cells):
    rng = np.random.default_rng(0)
    return {Key.of(cell, trial): outcome(1, *rng.uniform(0.1, 1, 4)) for cell in cells for trial in range(2)}


@pytest.mark.parametrize("number", [5, 6, 7, 11, 12])
def test_every_kind_of_figure_is_drawn_however_much_of_it_is_there(number):
    figure = FIGURES[number]
    figure = figure._replace(cells=tuple(cell for cell in figure.cells if cell.panel == figure.panels[-1]))
    nothing_found = {Key.of(figure.cells[0], 0): outcome(0, NAN, NAN, NAN, 1.0)}
    states = [{}, nothing_found, done_of(figure, figure.cells[:-1])]
    pictures = [draw(figure, summarize(figure, done), done) for done in states]
    assert all(picture.startswith(b"\x89PNG\r\n") for picture in pictures)
    assert len(set(pictures)) == len(pictures)


def test_without_matplotlib_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(UsageError) as refused:
        draw(FIGURES[7], summarize(FIGURES[7], {}), {})
    assert str(refused.value) == "the picture: matplotlib is not installed; pip install 'cylx[plots]'"


# scenes of cans


def can_scan(points, seed=0):
    """Scan a can of 33 mm radius and 100 mm height, in metres, away from the origin."""
    rng = np.random.default_rng(seed)
    mantle = Mantle(Cylinder((0.2, -0.1, 0.05), (0, 0, 1), 0.033, 0.1), 0.0, 2 * np.pi).sample(rng, points)
    return ObjectScan.of(mantle, None)


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
    noise = scans.THICKNESS * extent
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
    assert np.array_equal(centers[0], middle)
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


def test_two_cans_are_found_in_a_trial():
    scan = can_scan(1500)
    cell = Cell("", "msac", 1.0, "msac", (("share", 0.9), ("view_deg", 60.0), ("side", -1.0)), ("msac.iterations=500",))
    first, again = (run_trial(cell, 0, scan) for _ in range(2))
    assert first.found == 2
    assert first.angle_deg < 3
    assert first[:2] == again[:2]
    assert np.isnan(first[2:4]).all()


def test_trials_made_with_another_scan_are_not_taken_for_those_of_this_one():
    text = header_line() + trial_lines(DONE.items(), "0.1.0 aaaaaaaa")
    assert list(parse_trials(text, "0.1.0 aaaaaaaa")) == list(parse_trials(text, None)) == list(DONE)
    assert parse_trials(text, "0.1.0 bbbbbbbb") == parse_trials(text) == {}


def test_where_there_are_two_cans_the_default_is_there_once_more_and_less_strict():
    unsure = [cell for figure in FIGURES.values() for cell in figure.cells if cell.curve == UNSURE]
    others = [cell for cell in FIGURES[11].cells if cell.curve == "auto"]
    assert [cell._replace(curve="auto", settings=()) for cell in unsure] == others
    for cell in unsure:
        config = config_of(cell, 3, most=2)
        assert (config.max_cylinders, config.seed) == (None, 3)
        assert config.verification.min_confidence < load_config().verification.min_confidence
