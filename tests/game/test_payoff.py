"""The payoffs: the rules of eq. 2 and 5, and the local ones against an evaluation of all pairs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.game import local_payoff, screw_payoff
from cylx.game.payoff import CUT, REACH_IN_RADII
from cylx.geometry.dual_quaternions import pairwise_screw_distances

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)
X, Z = np.eye(3)[0], np.eye(3)[2]


def model(point=(0, 0, 0), direction=Z, radius=1.0):
    return np.concatenate([point, direction, [radius]])


def tilted(angle):
    return np.array([np.sin(angle), 0.0, np.cos(angle)])


def dense(payoff, count):
    return payoff.block(np.arange(count))


def candidates(seed, count=40):
    """Give models about a few cylinders and at random, their parents and extents."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 4, count)
    axes = rng.standard_normal((4, 3))
    directions = axes[truth] + 0.03 * rng.standard_normal((count, 3))
    directions *= rng.choice([-1, 1], (count, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
    radii = rng.uniform(0.5, 2, 4)[truth] * rng.uniform(0.9, 1.1, count)
    points = 6 * rng.random((4, 3))[truth] + rng.uniform(-4, 4, (count, 1)) * axes[truth]
    points += 0.05 * rng.standard_normal((count, 3))
    return np.column_stack([points, directions, radii]), rng.integers(0, 25, count), rng.uniform(0, 6, count), rng


@laws
@given(seeds)
def test_the_payoff_of_the_paper_is_its_formula(seed):
    models, parents, _, _ = candidates(seed, 15)
    unit, middle = np.median(models[:, 6]), np.median(models[:, :3], axis=0)
    distances, gaps = pairwise_screw_distances((models[:, :3] - middle) / unit, models[:, 3:6])
    payoff = screw_payoff(models, parents, 5.0, 0.8)
    assert np.array_equal(payoff, payoff.T)
    assert ((payoff >= 0) & (payoff <= 1)).all()
    for i in range(len(models)):
        for j in range(len(models)):
            r, s = models[i, 6] / unit, models[j, 6] / unit
            fits = parents[i] != parents[j] and gaps[i, j] < r + s and min(r, s) / max(r, s) > 0.8
            assert np.isclose(payoff[i, j], np.exp(-distances[i, j] / 5.0) if fits else 0.0, rtol=1e-13)


@pytest.mark.parametrize(
    ("other", "parents", "plays"),
    [
        (model(), (0, 1), True),
        (model(), (3, 3), False),
        (model((1.99, 0, 0)), (0, 1), True),
        (model((2.01, 0, 0)), (0, 1), False),
        (model(radius=0.81), (0, 1), True),
        (model(radius=0.79), (0, 1), False),
        (model(radius=1 / 0.81), (0, 1), True),
        (model(radius=1 / 0.79), (0, 1), False),
        (model(direction=X), (0, 1), True),
        (model((0, 0, 50)), (0, 1), True),
    ],
    ids=["same", "same slice", "touch", "apart", "ratio", "thinner", "wider", "too wide", "crossing", "further on"],
)
def test_who_plays_with_whom_in_the_paper(other, parents, plays):
    payoff = screw_payoff(np.array([model(), other]), np.array(parents), 5.0, 0.8)
    assert (payoff[0, 1] > 0) == plays
    assert np.diag(payoff).tolist() == [0, 0]


def test_equal_candidates_of_different_slices_have_payoff_one():
    models = np.array([model((1, 2, 3)), model((1, 2, 3), -Z)])
    assert screw_payoff(models, np.array([0, 1]), 5.0, 0.9)[0, 1] == pytest.approx(1.0, rel=1e-7)


def test_the_scale_of_the_payoff_is_lambda():
    models = np.array([model(), model((0.5, 0, 0))])
    # half a radius apart: the logarithm is half of that
    assert np.isclose(screw_payoff(models, np.arange(2), 0.25, 0.9)[0, 1], np.exp(-1.0))


@laws
@given(seeds, st.floats(-3, 3))
def test_the_payoff_of_the_paper_does_not_know_the_unit_or_where_the_scene_is(seed, exponent):
    models, parents, _, rng = candidates(seed, 15)
    scale = 10.0**exponent
    moved = models.copy()
    moved[:, :3] = scale * models[:, :3] + 100 * scale * rng.standard_normal(3)
    moved[:, 6] *= scale
    one, other = screw_payoff(models, parents, 5.0, 0.8), screw_payoff(moved, parents, 5.0, 0.8)
    assert np.allclose(other, one, rtol=0, atol=1e-9)


def brute_force(models, parents, extents, angle, offset, radius, min_ratio):
    """Give the local payoff, pair by pair, as its docstring has it."""
    count = len(models)
    out = np.zeros((count, count))
    for i in range(count):
        for j in range(count):
            p, q, r, s = models[i, :3], models[j, :3], models[i, 6], models[j, 6]
            u, v = models[i, 3:6], models[j, 3:6]
            ratio, mean = min(r, s) / max(r, s), 0.5 * (r + s)
            reach = max(REACH_IN_RADII * mean, extents[i], extents[j])
            if parents[i] == parents[j] or ratio < min_ratio or np.linalg.norm(q - p) > reach:
                continue
            turn = np.arctan2(np.linalg.norm(np.cross(u, v)), abs(u @ v))
            shift = 0.5 * (np.linalg.norm(np.cross(q - p, u)) + np.linalg.norm(np.cross(q - p, v))) / mean
            value = np.exp(-np.sqrt((turn / angle) ** 2 + (shift / offset) ** 2 + ((1 - ratio) / radius) ** 2))
            out[i, j] = value if value >= CUT else 0.0
    return out


@laws
@given(seeds, st.floats(0.02, 0.3), st.floats(0.05, 0.5), st.floats(0.03, 0.3), st.floats(0.3, 0.95))
def test_the_local_payoff_is_that_of_all_pairs(seed, angle, offset, radius, min_ratio):
    models, parents, extents, _ = candidates(seed, 20)
    settings_of_it = angle, offset, radius, min_ratio
    expected = brute_force(models, parents, extents, *settings_of_it)
    found = dense(local_payoff(models, parents, extents, *settings_of_it), len(models))
    # a pair at the very border may fall on either side of it
    assert ((np.abs(found - expected) < 1e-9) | (np.abs(np.maximum(found, expected) - CUT) < 1e-9)).all()
    assert np.array_equal(found, found.T)


@laws
@given(seeds)
def test_the_local_payoff_does_not_know_names(seed):
    models, parents, extents, rng = candidates(seed)
    order = rng.permutation(len(models))
    widths = 0.1, 0.2, 0.1, 0.7
    one = dense(local_payoff(models, parents, extents, *widths), 40)
    other = dense(local_payoff(models[order], parents[order], extents[order], *widths), 40)
    assert np.allclose(other, one[np.ix_(order, order)], rtol=1e-12, atol=0)


@laws
@given(seeds, st.floats(-3, 3))
def test_the_local_payoff_follows_motion_and_scale(seed, exponent):
    models, parents, extents, rng = candidates(seed, 20)
    turn, scale = Rotation.from_quat(rng.standard_normal(4)).as_matrix(), 10.0**exponent
    moved = np.column_stack(
        [scale * models[:, :3] @ turn.T + scale * rng.standard_normal(3), models[:, 3:6] @ turn.T, scale * models[:, 6]]
    )
    widths = 0.1, 0.2, 0.1, 0.7
    one = dense(local_payoff(models, parents, extents, *widths), 20)
    other = dense(local_payoff(moved, parents, scale * extents, *widths), 20)
    near_the_cut = np.abs(np.maximum(one, other) - CUT) < 1e-9
    assert (np.isclose(one, other, rtol=0, atol=1e-9) | near_the_cut).all()


@pytest.mark.parametrize(
    ("other", "value"),
    [
        (model(), 1.0),
        (model((0, 0, 2)), 1.0),
        (model((0.1, 0, 0)), np.exp(-1)),
        (model(direction=tilted(0.05)), np.exp(-1)),
        (model(radius=1 / 0.94), np.exp(-1)),
        (model((0.3, 0, 0)), 0.0),
        (model((0, 0, 4.1)), 0.0),
        (model(direction=X), 0.0),
    ],
    ids=["same", "further on", "offset", "angle", "radius", "too far aside", "out of reach", "crossing"],
)
def test_each_width_is_where_the_payoff_has_fallen_to_1_over_e(other, value):
    payoff = local_payoff(np.array([model(), other]), np.arange(2), np.zeros(2), 0.05, 0.1, 0.06, 0.5)
    assert np.isclose(dense(payoff, 2)[0, 1], value, rtol=1e-9)


def test_long_candidates_reach_further():
    models = np.array([model(), model((0, 0, 9))])
    for extents, value in (((0, 0), 0.0), ((8.9, 8.9), 0.0), ((9.1, 0), 1.0), ((0, 9.1), 1.0)):
        payoff = local_payoff(models, np.arange(2), np.array(extents, dtype=float), 0.05, 0.1, 0.06, 0.5)
        assert dense(payoff, 2)[0, 1] == pytest.approx(value, rel=1e-9, abs=0)


def test_nobody_plays_alone():
    nobody = np.empty((0, 7)), np.empty(0, np.int64)
    assert screw_payoff(*nobody, 5.0, 0.9).shape == (0, 0)
    assert len(local_payoff(*nobody, np.empty(0), 0.05, 0.1, 0.06, 0.5).degrees()) == 0
    alone = local_payoff(np.array([model()]), np.arange(1), np.zeros(1), 0.05, 0.1, 0.06, 0.5)
    assert alone.degrees().tolist() == [0.0]


def reaching(seed, count):
    """Give models about a few axes whose radii differ a thousandfold and whose extents differ more."""
    rng = np.random.default_rng(seed)
    axes = rng.standard_normal((5, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    truth = rng.integers(0, 5, count)
    radii = 10.0 ** rng.uniform(-1.5, 1.5, 5)[truth] * rng.uniform(0.9, 1.1, count)
    extents = radii * 10.0 ** rng.uniform(-2, 2, count) * (rng.random(count) < 0.8)
    points = rng.standard_normal((5, 3))[truth] + 10 * radii[:, None] * rng.uniform(-1, 1, (count, 1)) * axes[truth]
    points += 0.1 * radii[:, None] * rng.standard_normal((count, 3))
    directions = axes[truth] + 0.03 * rng.standard_normal((count, 3))
    directions *= rng.choice([-1, 1], (count, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
    return np.column_stack([points, directions, radii]), rng.integers(0, count, count), extents


@settings(max_examples=20, deadline=None)
@given(seeds, st.floats(0.05, 0.95))
def test_candidates_of_very_different_reaches_miss_nobody(seed, min_ratio):
    models, parents, extents = reaching(seed, 60)
    widths = 0.1, 0.3, 0.15, min_ratio
    expected = brute_force(models, parents, extents, *widths)
    found = dense(local_payoff(models, parents, extents, *widths), 60)
    assert ((np.abs(found - expected) < 1e-9) | (np.abs(np.maximum(found, expected) - CUT) < 1e-9)).all()
    assert np.array_equal(found, found.T)


def assert_same_rows(one, other, count):
    """Compare payoffs row by row, whatever the order in a row."""
    for i in range(count):
        columns, values = one.row(i)
        others, other_values = other.row(i)
        order, other_order = np.argsort(columns), np.argsort(others)
        assert np.array_equal(columns[order], others[other_order])
        assert np.array_equal(values[order], other_values[other_order])


@pytest.mark.parametrize("piece", [1, 7, 50])
@pytest.mark.parametrize("seed", range(2))
def test_threads_and_pieces_make_no_difference(monkeypatch, seed, piece):
    models, parents, extents = reaching(seed, 400)
    widths = 0.1, 0.3, 0.15, 0.7
    whole = local_payoff(models, parents, extents, *widths)
    assert len(whole.values) > 2000
    monkeypatch.setattr("cylx.game.payoff.PIECE", piece)
    one = local_payoff(models, parents, extents, *widths)
    assert_same_rows(one, whole, 400)
    for threads in (2, 5):
        other = local_payoff(models, parents, extents, *widths, threads=threads)
        for name in ("pointers", "indices", "values"):
            assert np.array_equal(getattr(other, name), getattr(one, name)), name


def test_a_row_holds_each_partner_once():
    models, parents, extents = reaching(3, 300)
    payoff = local_payoff(models, parents, extents, 0.1, 0.3, 0.15, 0.7)
    for i in range(300):
        columns, values = payoff.row(i)
        assert len(set(columns)) == len(columns)
        assert i not in columns
        assert (parents[columns] != parents[i]).all()
        assert ((values > 0) & (values <= 1)).all()
