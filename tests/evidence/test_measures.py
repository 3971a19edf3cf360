"""Measures of a surface: the scatter of its points, and what its form deviates by."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.evidence.measures import (
    Shell,
    deviations_of_form,
    edge_gain,
    look_at,
    own_scatter,
    scatter_of,
)
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import coordinates_of
from cylx.records import IndexedCloud, Noise, Segment
from cylx.scene import make_frame

RADIUS, HALF, SIGMA = 1.0, 2.0, 0.01
SHAPES = {
    "cone": lambda z, turn: 0.03 * z,
    "barrel": lambda z, turn: 0.04 * (1 / 3 - z**2),
    "bent": lambda z, turn: 0.05 * (z**2 - 1 / 3) * np.cos(turn - 1.0),
    "oval": lambda z, turn: 0.03 * np.cos(2 * (turn - 0.4)),
}


def shell(form=lambda z, turn: 0.0 * z, sigma=SIGMA, count=6000, seed=0, arc=2 * np.pi):
    """Draw a surface that deviates from a cylinder by a form and by noise."""
    rng = np.random.default_rng(seed)
    z, turn = rng.uniform(-1, 1, count), rng.uniform(-arc / 2, arc / 2, count)
    residuals = form(z, turn) + sigma * rng.standard_normal(count)
    on = np.ones(count, bool)
    return Shell(np.arange(count), z, residuals, turn, on, ~on, float(residuals.std()))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_another_shape_explains_its_own_deviation(name, seed):
    seen = shell(SHAPES[name], seed=seed)
    measured = deviations_of_form(seen, SIGMA)
    assert measured["explained"] > 0.8
    assert measured["structure"] == pytest.approx(SHAPES[name](seen.heights, seen.angles).std(), rel=0.15)
    assert measured["lack_of_fit"] > 3
    assert (measured["ovality"] > 0.5 * measured["structure"]) == (name == "oval")


def test_noise_is_explained_by_no_shape():
    measured = [deviations_of_form(shell(seed=seed), SIGMA) for seed in range(20)]
    assert np.mean([each["explained"] for each in measured]) < 0.05
    assert max(each["explained"] for each in measured) < 0.3
    assert np.mean([each["lack_of_fit"] for each in measured]) == pytest.approx(1.0, abs=0.1)
    assert max(each["structure"] for each in measured) < 0.3 * SIGMA


def test_roughness_of_no_shape_is_structure_that_is_not_explained():
    rng = np.random.default_rng(3)
    waves, phases = rng.integers(4, 9, 40), 2 * np.pi * rng.random(40)
    lengths = rng.uniform(3, 9, 40)

    def bark(z, turn):
        waved = np.cos(np.outer(turn, waves) + np.outer(z, lengths) + phases)
        return 0.04 * np.sqrt(2 / 40) * waved.sum(axis=1)

    measured = deviations_of_form(shell(bark), SIGMA)
    assert measured["structure"] > 2 * SIGMA
    assert measured["explained"] < 0.3


@pytest.mark.parametrize("arc", [np.pi / 2, np.pi, 2 * np.pi])
@pytest.mark.parametrize("count", [300, 3000, 30000])
def test_the_scatter_of_a_surface_is_its_noise(arc, count):
    measured = [own_scatter(shell(count=count, arc=arc, seed=s), RADIUS, HALF, arc) for s in range(5)]
    assert np.mean(measured) == pytest.approx(SIGMA, rel=0.05)


@pytest.mark.parametrize("name", SHAPES)
def test_its_form_does_not_enter_the_scatter(name):
    seen = shell(SHAPES[name], count=20000)
    assert seen.deviation > 1.4 * SIGMA
    assert own_scatter(seen, RADIUS, HALF, 2 * np.pi) == pytest.approx(SIGMA, rel=0.05)


def test_the_scatter_scales_with_the_unit():
    one, other = (own_scatter(shell(sigma=k * SIGMA), k * RADIUS, k * HALF, 2 * np.pi) for k in (1.0, 1e3))
    assert other == pytest.approx(1e3 * one)


def test_a_surface_may_be_rougher_than_the_noise_about_it_within_bounds():
    model = np.array([0.0, 0, 0, 0, 0, 1, RADIUS])
    spreads = np.geomspace(1e-5, 1.0, 50)
    for noise in (1e-4, 1e-2, 1e-1):
        taken = np.array([scatter_of(Segment(model, HALF, spread), noise) for spread in spreads])
        assert (np.diff(taken) >= 0).all()
        assert taken.min() < noise < 2 * noise <= taken.max()
        assert taken.max() < max(2.1 * noise, 0.1 * RADIUS)
        between = (spreads > noise) & (spreads < 2 * noise)
        assert taken[between] == pytest.approx(spreads[between])


def wedge(turn_deg, way_deg=0.0):
    """Give an arc about the z axis, of which so much is its own, and its middle that way."""
    way, half = np.radians(way_deg), 0.5 * np.radians(turn_deg)
    model = np.array([0.0, 0, 0, 0, 0, 1, RADIUS])
    return Segment(model, HALF, SIGMA, wedge=np.array([np.cos(way), np.sin(way), 0.0, np.cos(half)]))


def surface(turn, seed=0):
    rng = np.random.default_rng(seed)
    own = RADIUS + SIGMA * rng.standard_normal(len(turn))
    return np.column_stack([own * np.cos(turn), own * np.sin(turn), rng.uniform(-HALF, HALF, len(turn))])


@pytest.mark.parametrize(("turn_deg", "way_deg"), [(60, 0), (90, 130), (180, -90), (270, 10)])
def test_what_lies_beyond_the_ends_of_an_arc_is_not_of_it(turn_deg, way_deg):
    turn = np.random.default_rng(1).uniform(-np.pi, np.pi, 4000)
    segment = wedge(turn_deg, way_deg)
    shell = look_at(segment, world(surface(turn)))
    away = np.abs((shell.angles - angle_of(segment) + np.pi) % (2 * np.pi) - np.pi)
    inside = away < np.radians(turn_deg / 2)
    assert (shell.flat == ~inside).all()
    assert shell.on[inside].mean() > 0.99
    assert not shell.on[~inside].any()
    assert len(shell.on) == 4000


def test_a_segment_that_is_no_arc_has_no_edge_to_gain_on():
    turn = np.random.default_rng(1).uniform(-np.pi, np.pi, 2000)
    plain = Segment(np.array([0.0, 0, 0, 0, 0, 1, RADIUS]), HALF, SIGMA)
    assert edge_gain(look_at(plain, world(surface(turn))), plain, SIGMA) == 0.0


@pytest.mark.parametrize("turn_deg", [60, 90, 150])
def test_an_arc_gains_on_its_edge_and_an_edge_on_its_arc(turn_deg):
    segment, half = wedge(turn_deg), 0.5 * np.radians(turn_deg)
    turn = np.random.default_rng(2).uniform(-half, half, 1500)
    points = surface(turn)
    shell = look_at(segment, world(points))
    gain = edge_gain(shell, segment, SIGMA)
    assert gain > 1500
    assert edge_gain(shell, segment, 100 * SIGMA) < gain  # what scatters more tells less
    sharp = points.copy()
    sharp[:, :2] *= (1.0 / np.cos(half - np.abs(turn)))[:, None]
    assert edge_gain(look_at(segment, world(sharp)), segment, SIGMA) < 0


def angle_of(segment):
    """Give the angle of the middle of an arc, as the coordinates of its cylinder have it."""
    _, _, angles = coordinates_of(segment.wedge[None, :3], np.array([0]), segment.model)
    return float(angles[0])


def world(points):
    """Put points into cells as they are."""
    frame, _ = make_frame(points, Config())
    # the unit of the frame is undone: what is looked at has the lengths of the scene
    return IndexedCloud(
        Cells(frame.points * frame.spacing + frame.origin, frame.codes),
        np.zeros(len(points)),
        Noise(np.ones(1), np.array([SIGMA])),
    )
