"""Noise that differs from place to place: found where it is large, and not where it is even."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.records import IndexedCloud, Noise
from cylx.records.frames import ENOUGH_PATCHES, MOST_NOISE, cell_keys
from cylx.scene import make_frame, noise_by_place
from cylx.scene.noise_variation import AGREED
from cylx.synthetic import single

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)
POINTS, LOUD = 12000, 0.4
SPACING = POINTS**-0.5


def floor(seed, sigma, times):
    """Give points of a unit square whose noise is `sigma` spacings, and so many times that for x beyond 0.6."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.random((POINTS, 2)), np.zeros(POINTS)])
    scale = SPACING * sigma * np.where(points[:, 0] > 1 - LOUD, times, 1.0)
    return points + scale[:, None] * rng.standard_normal((POINTS, 3))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("sigma", "times"), [(0.05, 3.0), (0.1, 3.0), (0.05, 5.0)])
def test_the_loud_part_of_a_floor_has_its_factor_and_the_quiet_part_has_one(seed, sigma, times):
    frame, scene = make_frame(floor(seed, sigma, times), Config())
    assert np.isclose(scene.noise, sigma * SPACING, rtol=0.1)
    x = (frame.points * frame.spacing + frame.origin)[:, 0]
    border = frame.noise.side * frame.spacing
    assert border < 0.2
    factors = frame.noise.factors_at(frame.points)
    loud = factors[x > 1 - LOUD + border]
    assert np.isclose(np.median(loud), times, rtol=0.1)
    # each cell is told by the mode of about fifty patches
    assert np.abs(loud / times - 1).max() < 0.35
    assert (np.abs(loud / times - 1) < 0.2).mean() > 0.85
    assert (factors[x < 1 - LOUD - border] == 1).all()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("sigma", [0.05, 0.2, 0.5])
def test_even_noise_is_the_same_everywhere(seed, sigma):
    can = single(points=8000, sigma=sigma * np.sqrt(8 * np.pi / 8000), seed=seed).points
    for points in (floor(seed, sigma, 1.0), can):
        noise = make_frame(points, Config())[0].noise
        assert len(noise.cells) == len(noise.factors) == 0
        assert (noise.factors_at(np.random.default_rng(0).uniform(-9, 99, (50, 3))) == 1).all()


def patches(rng, count, times, scatter=0.1):
    """Give places in the unit cube and ratios that are `times` one where x is above one half."""
    places = rng.random((count, 3))
    return places, np.where(places[:, 0] > 0.5, times, 1.0) * np.exp(scatter * rng.standard_normal(count))


@laws
@given(seeds, st.floats(1.6, 8), st.integers(600, 2000))
def test_cells_of_patches_that_agree_have_their_mode(seed, times, count):
    places, ratios = patches(np.random.default_rng(seed), count, times)
    side, cells, factors = noise_by_place(places, ratios, 1.0)
    assert 0 < len(cells) == len(factors)
    numbers = np.array([(np.floor(places / side) == cell).all(axis=1).sum() for cell in cells])
    assert (numbers >= AGREED).all()
    low, high = cells * side, (cells + 1) * side
    loud, quiet = low[:, 0] >= 0.5, high[:, 0] <= 0.5
    assert (np.abs(np.log(factors[loud] / times)) < 0.25).all()
    assert (factors[quiet] == 1).all()
    assert ((factors == 1) | (factors > 1.3)).all()


@laws
@given(seeds, st.floats(-3, 3))
def test_places_and_order_of_the_patches_are_all_that_counts(seed, exponent):
    rng = np.random.default_rng(seed)
    places, ratios = patches(rng, 800, 3.0)
    side, cells, factors = noise_by_place(places, ratios, 1.0)
    scale, order = 2.0 ** round(3 * exponent), rng.permutation(800)
    other_side, other_cells, other_factors = noise_by_place(scale * places[order], ratios[order], scale)
    assert np.isclose(other_side, scale * side)
    assert np.array_equal(other_cells, cells)
    assert np.allclose(other_factors, factors, rtol=1e-12)


@laws
@given(seeds, st.integers(0, 1500), st.floats(0, 0.1))
def test_even_ratios_make_no_cells(seed, count, scatter):
    places, ratios = patches(np.random.default_rng(seed), count, 1.0, scatter)
    _, cells, factors = noise_by_place(places, ratios, 1.0)
    assert cells.shape == (0, 3)
    assert factors.shape == (0,)


@laws
@given(seeds)
def test_less_than_usual_is_taken_for_usual(seed):
    places, ratios = patches(np.random.default_rng(seed), 800, 0.3)
    assert len(noise_by_place(places, ratios, 1.0)[1]) == 0


def test_patches_that_do_not_agree_say_nothing():
    rng = np.random.default_rng(7)
    places, ratios = patches(rng, 2000, 3.0)
    ratios[places[:, 0] > 0.5] = np.exp(rng.uniform(-1, 3, (places[:, 0] > 0.5).sum()))
    side, cells, factors = noise_by_place(places, ratios, 1.0)
    looked_at = len(np.unique(np.floor(places[places[:, 0] > 0.5] / side), axis=0))
    assert (factors != 1).sum() < 0.2 * looked_at
    assert (cells[factors != 1][:, 0] * side > 0.5 - side).all()


def by_hand(noise, place, unknown, known):
    cell = tuple(int(c) for c in np.floor(place / noise.side))
    return known.get(cell, unknown)


@laws
@given(seeds, st.floats(0.1, 10))
def test_factors_are_looked_up_by_cell(seed, side):
    rng = np.random.default_rng(seed)
    known = {tuple(int(c) for c in rng.integers(-3, 4, 3)): float(rng.uniform(1, 5)) for _ in range(60)}
    keys = cell_keys(np.array(list(known)))
    assert len(set(keys)) == len(known)
    order = np.argsort(keys)
    factors = np.array(list(known.values()))[order]
    noise = Noise(np.array([1.0, 4.0]), np.array([0.1, 0.4]), side, keys[order], factors)
    places = side * rng.uniform(-4, 5, (300, 3))
    for unknown in (1.0, 7.0):
        expected = [by_hand(noise, place, unknown, known) for place in places]
        assert noise.factors_at(places, unknown).tolist() == expected
    assert np.array_equal(np.isnan(noise.factors_at(places, np.nan)), noise.factors_at(places, -1.0) == -1)
    assert np.allclose(noise.about(places, 2.0), 0.2 * noise.factors_at(places))


def ground_of(patches, cells=None, factor=1.0):
    """Give a ground that knows nothing but its noise: 0.1 usually, and in one cell, of the side 10, so many times."""
    known = {} if cells is None else {"side": 10.0, "cells": cell_keys(cells), "factors": np.full(len(cells), factor)}
    noise = Noise(np.array([1.0]), np.array([0.1]), **known, patches=patches)
    return IndexedCloud(Cells(np.zeros((1, 3)), np.zeros(1, np.int64)), np.zeros(1), noise)


def patches_on(rng, model, half, count, times, size=0.2):
    """Give patches on the surface of a cylinder, of so many radii, and of about so many times the usual noise."""
    turn = np.linalg.qr(np.column_stack([model[3:6], rng.standard_normal((3, 2))]))[0]
    angles, heights = rng.uniform(0, 2 * np.pi, count), rng.uniform(-half, half, count)
    local = np.column_stack([heights, model[6] * np.cos(angles), model[6] * np.sin(angles)])
    places = local @ turn.T + model[:3]
    return np.column_stack([places, np.full(count, size * model[6]), times * np.exp(0.05 * rng.standard_normal(count))])


def drawn(seed):
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(3)
    model = np.array([*rng.uniform(2, 8, 3), *direction / np.linalg.norm(direction), rng.uniform(1, 3)])
    return rng, model, rng.uniform(1, 9)


@laws
@given(seeds, st.floats(1.5, 3.5))
def test_a_cylinder_has_the_noise_of_the_patches_on_its_surface(seed, times):
    rng, model, half = drawn(seed)
    own = patches_on(rng, model, half, 21, times)
    within = model.copy()
    within[6] *= 0.3
    others = [
        patches_on(rng, within, half, 50, 0.5 * times, 0.05),  # on a smaller one inside it
        patches_on(rng, model, half, 50, 9.0, 0.9),  # as large as itself: they show its curvature
    ]
    indexed = ground_of(rng.permutation(np.concatenate([own, *others])))
    assert np.isclose(indexed.noise_about(model, half), 0.1 * np.median(own[:, 4]))
    # beyond its ends there are none, and nobody knows better than what is usual
    model[:3] += (2.1 * half + 4 * model[6]) * model[3:6]
    assert indexed.noise_about(model, half) == pytest.approx(0.1)


@laws
@given(seeds)
def test_no_surface_is_less_noisy_than_usual_or_many_times_more(seed):
    rng, model, half = drawn(seed)
    for times, expected in ((0.4, 1.0), (1.05, 1.0), (30.0, MOST_NOISE)):
        indexed = ground_of(patches_on(rng, model, half, 40, times))
        assert np.isclose(indexed.noise_about(model, half), 0.1 * expected)


@pytest.mark.parametrize("count", [0, ENOUGH_PATCHES - 1])
def test_where_patches_are_few_the_place_says_what_the_noise_is(count):
    rng, model, half = drawn(1)
    few = patches_on(rng, model, half, count, 3.0)
    here, there = np.zeros((1, 3), np.int64), np.full((1, 3), 5)
    assert np.isclose(ground_of(few, here, 2.0).noise_about(model, half), 0.2)
    assert np.isclose(ground_of(few, there, 2.0).noise_about(model, half), 0.1)
    assert np.isclose(ground_of(few).noise_about(model, half), 0.1)
    enough = patches_on(rng, model, half, ENOUGH_PATCHES, 3.0)
    assert np.isclose(ground_of(enough, here, 2.0).noise_about(model, half), 0.3, rtol=0.1)


def test_the_frame_knows_its_patches():
    frame, scene = make_frame(floor(3, 0.1, 3.0), Config())
    patches = frame.noise.patches
    x = patches[:, 0] * frame.spacing + frame.origin[0]
    assert len(patches) > 1000
    assert (patches[:, 3] > 2).all()  # spacings
    assert (patches[:, 3] < 12).all()
    assert np.isclose(np.median(patches[x < 0.5, 4]), 1.0, rtol=0.1)
    assert np.isclose(np.median(patches[x > 0.7, 4]), 3.0, rtol=0.1)
    assert scene.noise > 0
