"""The circle through a point among others: found from its arc, whatever lies beside it, or refused."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cylx.geometry.circles import LEAST_ON, fill_circle

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)


def arc(rng, n, radius, turn_deg, noise):
    """Draw an arc through zero, with heights from 1 to 2; its centre lies up."""
    at = np.radians(turn_deg) * (rng.random(n) - 0.5) - np.pi / 2
    own = radius + noise * rng.standard_normal(n)
    return np.column_stack([own * np.cos(at), radius + own * np.sin(at), 1 + rng.random(n)])


def circle_of(points, noise=0.0, limits=(0.3, 10.0)):
    """Give centre, radius, middle and half of the heights, and points; None without a circle."""
    reach = float(np.linalg.norm(points[:, :2], axis=1).max())
    row = np.zeros(6)
    columns = (np.ascontiguousarray(column) for column in points.T)
    return row if fill_circle(*columns, len(points), reach, noise, *limits, row) else None


@laws
@given(seeds, st.floats(150, 360), st.floats(0.0, 0.01))
def test_the_circle_of_an_arc_is_found_whatever_its_attitude(seed, turn_deg, noise):
    rng = np.random.default_rng(seed)
    way = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(way), -np.sin(way)], [np.sin(way), np.cos(way)]])
    points = arc(rng, 300, 1.0, turn_deg, noise)
    points[:, :2] = points[:, :2] @ turn.T
    found = circle_of(points, noise)
    assume(found is not None)  # the closest points may show no tangent
    assert np.allclose(found[:2], turn @ [0, 1], rtol=0, atol=0.01 + 2 * noise)
    assert abs(found[2] - 1) < 0.01 + 2 * noise
    assert 1.3 < found[3] < 1.7
    assert 0.4 < found[4] < 0.51
    assert found[5] > 250


@laws
@given(seeds)
def test_exact_points_give_the_exact_circle(seed):
    rng = np.random.default_rng(seed)
    found = circle_of(arc(rng, 200, 1.0, rng.uniform(120, 360), 0.0))
    assert np.allclose(found[:3], [0, 1, 1], rtol=0, atol=1e-6)
    assert found[5] == 200


@laws
@given(seeds, st.floats(-6, 6))
def test_the_circle_does_not_know_the_unit(seed, power):
    rng = np.random.default_rng(seed)
    points, scale = arc(rng, 200, 1.0, 200, 0.01), np.exp(power)
    one, other = circle_of(points, 0.01), circle_of(scale * points, scale * 0.01, (0.3 * scale, 10 * scale))
    assume(one is not None)  # the closest points may show no tangent
    assert np.allclose(other[:5], scale * one[:5], rtol=1e-6)
    assert other[5] == one[5]


@laws
@given(seeds)
def test_what_is_scattered_about_does_not_draw_the_circle(seed):
    rng = np.random.default_rng(seed)
    strays = np.column_stack([rng.uniform(-1.5, 1.5, 60), rng.uniform(-0.5, 2.5, 60), 1 + rng.random(60)])
    strays = strays[np.linalg.norm(strays[:, :2], axis=1) > 0.3]  # the tangent is seen
    found = circle_of(np.concatenate([arc(rng, 300, 1.0, 360, 0.0), strays]))
    assume(found is not None)  # the closest points may show no tangent
    assert np.allclose(found[:3], [0, 1, 1], rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    "points",
    [
        np.random.default_rng(0).uniform(-1, 1, (300, 3)),
        np.column_stack([np.linspace(-1, 1, 300), np.zeros(300), np.linspace(0, 1, 300)]),
        arc(np.random.default_rng(1), 300, 1.0, 60, 0.0),
        arc(np.random.default_rng(2), LEAST_ON - 1, 1.0, 360, 0.0),
    ],
    ids=["a disc full of points", "a line", "a sixth of a turn", "too few points"],
)
def test_what_is_no_circle_has_none(points):
    assert circle_of(points) is None


def test_a_circle_is_found_from_nearly_every_point():
    found = [circle_of(arc(np.random.default_rng(seed), 300, 1.0, 200, 0.005), 0.005) for seed in range(100)]
    assert sum(one is not None for one in found) > 90


@pytest.mark.parametrize("limits", [(0.1, 0.9), (1.1, 5.0)])
def test_a_circle_beyond_the_limits_is_none(limits):
    assert circle_of(arc(np.random.default_rng(3), 300, 1.0, 360, 0.0), limits=limits) is None
