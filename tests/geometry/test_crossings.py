"""What lids, rims and tables take off the ends of a surface, and what is left as it is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.crossings import CROWDED, MOST_CUT, SLICES, between_crossings, evened

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=50, deadline=None)
NEAR, SHELL = 3.0, 8.0  # deviations


def wall(rng, n, half, noise):
    return rng.uniform(-half, half, n), noise * rng.standard_normal(n)


def crossing(rng, n, height, noise):
    """Return points of a plane across the axis, on both sides of the surface."""
    return height + noise * rng.standard_normal(n), rng.uniform(-SHELL * noise, SHELL * noise, n)


def ends_of(heights, residuals, half, noise):
    return between_crossings(heights, residuals, half, NEAR * noise, SHELL * noise)


@laws
@given(seeds, st.integers(0, 4000))
def test_a_wall_alone_keeps_its_ends(seed, n):
    heights, residuals = wall(np.random.default_rng(seed), n, 1.0, 0.02)
    assert ends_of(heights, residuals, 1.0, 0.02) == (-1.0, 1.0)


@laws
@given(seeds, st.sampled_from([-1.0, 1.0]), st.floats(0.02, 0.1))
def test_what_crosses_an_end_is_taken_off_and_the_other_end_stays(seed, side, noise):
    rng = np.random.default_rng(seed)
    parts = wall(rng, 2000, 1.0, noise), crossing(rng, 1500, side * (1.0 - noise), noise)
    heights, residuals = (np.concatenate(both) for both in zip(*parts, strict=True))
    low, high = side * np.array(ends_of(heights, residuals, 1.0, noise))[:: int(side)]
    assert low == -1.0
    assert 1.0 - 2.0 * MOST_CUT <= high <= 1.0 - noise


@laws
@given(seeds, st.floats(-5, 5))
def test_the_cut_does_not_know_order_unit_or_which_end_is_up(seed, exponent):
    rng, scale = np.random.default_rng(seed), np.exp(exponent)
    parts = wall(rng, 2000, 1.0, 0.05), crossing(rng, 1000, rng.uniform(0.9, 1.0), 0.05)
    heights, residuals = (np.concatenate(both) for both in zip(*parts, strict=True))
    ends, order = np.array(ends_of(heights, residuals, 1.0, 0.05)), rng.permutation(len(heights))
    assert np.allclose(ends_of(heights[order], residuals[order], 1.0, 0.05), ends, rtol=0, atol=1e-12)
    assert np.allclose(ends_of(-heights, residuals, 1.0, 0.05), -ends[::-1], atol=1e-12)
    assert np.allclose(ends_of(scale * heights, scale * residuals, scale, scale * 0.05), scale * ends)


def test_what_crosses_the_middle_takes_nothing_off():
    rng = np.random.default_rng(2)
    parts = wall(rng, 2000, 1.0, 0.05), crossing(rng, 1000, 0.0, 0.05)
    heights, residuals = (np.concatenate(both) for both in zip(*parts, strict=True))
    assert ends_of(heights, residuals, 1.0, 0.05) == (-1.0, 1.0)


@pytest.mark.parametrize("times", [2.0, 8.0])
def test_an_end_that_is_only_denser_is_no_crossing(times):
    rng = np.random.default_rng(3)
    heights, residuals = wall(rng, 2000, 1.0, 0.05)
    more, own = rng.uniform(0.85, 1.0, int(150 * times)), 0.05 * rng.standard_normal(int(150 * times))
    both = np.concatenate([heights, more]), np.concatenate([residuals, own])
    assert ends_of(*both, 1.0, 0.05) == (-1.0, 1.0)


@laws
@given(seeds, st.integers(0, 3000), st.floats(0.1, 1.0))
def test_no_slice_is_crowded_once_it_is_evened(seed, crowd, share):
    rng = np.random.default_rng(seed)
    heights = np.concatenate([rng.uniform(-1.5, 1.5, 3000), rng.uniform(1.0 - share / SLICES, 1.0, crowd)])
    chosen = evened(heights, 1.0)
    assert chosen[np.abs(heights) >= 1.0].all()
    counts = np.histogram(heights[chosen], SLICES, (-1.0, 1.0))[0]
    assert counts.max() <= CROWDED * np.median(np.histogram(heights, SLICES, (-1.0, 1.0))[0])
    assert counts.min() > 0


@laws
@given(seeds, st.integers(0, 100))
def test_few_points_or_even_ones_are_all_chosen(seed, n):
    rng = np.random.default_rng(seed)
    assert evened(rng.uniform(-1, 1, min(n, 60)), 1.0).all()
    assert evened(np.linspace(-0.999, 0.999, 100 * n), 1.0).all()
