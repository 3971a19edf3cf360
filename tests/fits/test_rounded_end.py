"""Two rounded edges with something flat between them are told from one half round."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.fits.rounded_end import fit_rounded_end

SIGMA = 0.03
laws = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)
turns = st.floats(-np.pi, np.pi)


def end_of_bar(rng, half_flat, turn, count=1500, sigma=SIGMA, back=1.5):
    """Draw points of a bar's end, its edges of radius one, between parallel sides; evenly along the profile."""
    lengths = np.array([back, 0.5 * np.pi, 2.0 * half_flat, 0.5 * np.pi, back])
    s = rng.uniform(0.0, lengths.sum(), count)
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    which = np.clip(np.searchsorted(starts, s, "right") - 1, 0, 4)
    s = s - starts[which]
    ahead, along = np.empty(count), np.empty(count)
    for k, side in ((0, -1.0), (4, 1.0)):
        own = which == k
        ahead[own] = -s[own]
        along[own] = side * (half_flat + 1.0)
    for k, side in ((1, -1.0), (3, 1.0)):
        own = which == k
        ahead[own], along[own] = np.sin(s[own]), side * (half_flat + np.cos(s[own]))
    own = which == 2
    ahead[own], along[own] = 1.0, s[own] - half_flat
    points = np.column_stack([ahead, along]) + sigma * rng.standard_normal((count, 2))
    return points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])


@laws
@given(seeds, turns, st.floats(0.15, 0.6))
def test_two_edges_are_found_where_one_circle_was_seen(seed, turn, half_flat):
    rng = np.random.default_rng(seed)
    points = end_of_bar(rng, half_flat, turn)
    end = fit_rounded_end(points, 1.0 + half_flat, turn + 0.1 * rng.standard_normal(), SIGMA)
    assert end is not None
    assert end.radius == pytest.approx(1.0, abs=0.05)
    assert end.flat == pytest.approx(half_flat, abs=max(0.03, 5 * end.flat_error))
    assert end.gain > 40
    assert end.share > 0.5
    across = half_flat * np.array([-np.sin(turn), np.cos(turn)])
    np.testing.assert_allclose(end.centers, [-across, across], atol=0.08)
    np.testing.assert_allclose(np.cos(end.middles - turn), np.cos(0.25 * np.pi), atol=0.05)


@laws
@given(seeds, turns)
def test_a_half_round_is_not_explained_better_by_two_edges(seed, turn):
    rng = np.random.default_rng(seed)
    end = fit_rounded_end(end_of_bar(rng, 0.0, turn), 1.0, turn, SIGMA)
    assert end is None or end.gain < 20 or end.flat < 0.04


@laws
@given(seeds, turns, st.floats(0.1, 1000.0))
def test_neither_the_unit_nor_the_order_counts(seed, turn, unit):
    points = end_of_bar(np.random.default_rng(seed), 0.4, turn)
    one = fit_rounded_end(points, 1.4, turn, SIGMA)
    other = fit_rounded_end(unit * points[::-1], unit * 1.4, turn, unit * SIGMA)
    assert other.radius == pytest.approx(unit * one.radius, rel=1e-4)
    assert other.gain == pytest.approx(one.gain, rel=1e-3)


@laws
@given(seeds)
def test_what_has_no_sides_is_no_end_of_a_bar(seed):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi, np.pi, 1500)
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) + SIGMA * rng.standard_normal((1500, 2))
    end = fit_rounded_end(circle, 1.0, 0.0, SIGMA)
    assert end is None or end.gain < 20 or end.share < 0.5


def test_too_few_points_are_no_end_of_a_bar():
    assert fit_rounded_end(np.zeros((0, 2)), 1.0, 0.0, SIGMA) is None
    assert fit_rounded_end(end_of_bar(np.random.default_rng(0), 0.4, 0.0, 20), 1.4, 0.0, SIGMA) is None
