"""Short cylinders fitted with the axis held to the normal of a plane."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.records import IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.stages.upright import upright_of

UP = np.array([0.0, 0.0, 1.0])
seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=10, deadline=None)


def disc(seed, rows, radius=8.0, sigma=0.2, turn_deg=360.0):
    """Draw a disc on a plate, its top and the plate about it; lengths in spacings."""
    rng = np.random.default_rng(seed)
    count = round(np.radians(turn_deg) * radius * rows)
    turn = np.radians(turn_deg) * rng.random(count)
    wall = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rows * (rng.random(count) - 0.5)])
    parts = [wall]
    for inner, outer, height in ((0.0, radius, 0.5 * rows), (radius, 2.0 * radius, -0.5 * rows)):
        count = round(np.pi * (outer**2 - inner**2))
        turn, away = 2 * np.pi * rng.random(count), np.sqrt(rng.uniform(inner**2, outer**2, count))
        parts.append(np.column_stack([away * np.cos(turn), away * np.sin(turn), np.full(count, height)]))
    points = np.concatenate(parts)
    return points + sigma * rng.standard_normal(points.shape)


def held(points, rows, start, planes=(UP,), sigma=0.2, half=None):
    """Hold a segment upright that starts with a tilt (degrees) and a radius; in units of the points."""
    frame, _ = make_frame(points, Config())
    unit = frame.spacing
    noise = Noise(np.ones(1), np.array([sigma / unit]))
    found = np.array(planes, dtype=np.float64).reshape(-1, 3)
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(points)), noise, None, found)
    tilt_deg, radius = start
    direction = [np.sin(np.radians(tilt_deg)), 0.0, np.cos(np.radians(tilt_deg))]
    model = np.concatenate([-frame.origin / unit, direction, [radius / unit]])
    segment = upright_of(Segment(model, 0.5 * (half or rows) / unit, sigma / unit), indexed)
    if segment is None:
        return None
    return segment.direction, segment.radius * unit, 2.0 * segment.half * unit, segment


@laws
@given(seeds, st.floats(2.5, 6.0), st.floats(-8.0, 8.0), st.floats(0.96, 1.05))
def test_a_disc_of_a_few_rows_has_its_radius_and_height(seed, rows, tilt_deg, grown):
    direction, radius, height, _ = held(disc(seed, rows), rows, (tilt_deg, 8.0 * grown))
    assert abs(direction @ UP) == pytest.approx(1.0)
    assert radius == pytest.approx(8.0, rel=0.02)
    assert height == pytest.approx(rows, abs=1.6)


def test_it_is_held_to_the_plane_that_it_fits_best():
    askew = [np.sin(np.radians(6.0)), 0.0, np.cos(np.radians(6.0))]
    direction, *_ = held(disc(0, 5.0), 5.0, (5.0, 8.0), planes=(askew, UP))
    assert abs(direction @ UP) == pytest.approx(1.0)


@pytest.mark.parametrize("planes", [(), ([1.0, 0.0, 0.0],)])
def test_without_a_plane_that_it_stands_on_it_is_not_held(planes):
    assert held(disc(0, 5.0), 5.0, (2.0, 8.0), planes=planes) is None


def test_what_is_long_or_an_arc_is_not_held():
    assert held(disc(0, 20.0), 20.0, (1.0, 8.0), half=20.0) is None
    assert held(disc(0, 6.0, turn_deg=120), 6.0, (1.0, 8.0)) is None


def test_where_nothing_lies_there_is_none():
    assert held(disc(0, 5.0) + np.array([100.0, 0.0, 0.0]), 5.0, (0.0, 8.0)) is None


@laws
@given(seeds, st.floats(-6, 6))
def test_the_unit_does_not_matter(seed, power):
    scale, points = np.exp(power), disc(seed, 4.0)
    one = held(points, 4.0, (3.0, 8.2))
    other = held(scale * points, scale * 4.0, (3.0, scale * 8.2), sigma=scale * 0.2)
    assert other[1] == pytest.approx(scale * one[1], rel=1e-6)
    assert other[2] == pytest.approx(scale * one[2], rel=1e-6)
