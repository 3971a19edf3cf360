"""The circle with the most support: the true one among strays, within the radii that are asked for."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.circle import search_circle

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)
ANY = 0.0, np.inf


def ring(rng, n, center, radius, arc=2 * np.pi):
    angles = arc * rng.random(n)
    return center + radius * np.column_stack([np.cos(angles), np.sin(angles)])


def search(points, samples, tolerance, radii=ANY):
    shape = np.full(5, np.nan)
    return search_circle(points, samples, tolerance, *radii, shape), shape


def samples_of(rng, n, count=60):
    return rng.integers(0, n, (count, 5))


def by_hand(points, samples, tolerance, radii=ANY):
    """Give support and shape, sample by sample: the circumcentre as where two bisectors meet."""
    record, found = 0.0, None
    for i, j, k in samples[:, :3]:
        a, b, c = points[i], points[j], points[k]
        chords = np.array([b - a, c - a])
        if len({i, j, k}) < 3 or np.linalg.matrix_rank(chords) < 2:
            continue
        center = np.linalg.solve(chords, 0.5 * np.array([b @ b - a @ a, c @ c - a @ a]))
        radius = np.linalg.norm(center - a)
        if not radii[0] <= radius <= radii[1]:
            continue
        distances = np.abs(np.linalg.norm(points - center, axis=1) - radius)
        support = (1 - (distances[distances < tolerance] / tolerance) ** 2).sum()
        if support > record:
            record, found = support, np.array([*center, radius, radius, 0.0])
    return record, found


@laws
@given(seeds, st.floats(0.5, 2 * np.pi), st.floats(0, 0.5))
def test_an_exact_circle_is_found_among_strays(seed, arc, strays):
    rng = np.random.default_rng(seed)
    center, radius = 10 * rng.standard_normal(2), np.exp(rng.uniform(-3, 3))
    on = ring(rng, 60, center, radius, arc)
    off = center + radius * rng.uniform(-3, 3, (int(60 * strays), 2))
    points = rng.permutation(np.concatenate([on, off]))
    # at least eight of twenty-seven samples hold no stray
    support, shape = search(points, samples_of(rng, len(points)), 1e-7 * radius)
    assert support >= 0.99 * 60
    assert np.allclose(shape, [*center, radius, radius, 0], rtol=0, atol=1e-5 * radius)


@laws
@given(seeds, st.floats(0.01, 0.3))
def test_support_and_shape_are_those_of_the_best_sample(seed, tolerance):
    rng = np.random.default_rng(seed)
    points = ring(rng, 30, rng.standard_normal(2), 1.0) + 0.05 * rng.standard_normal((30, 2))
    samples = samples_of(rng, 30, 15)
    support, shape = search(points, samples, tolerance)
    expected, expected_shape = by_hand(points, samples, tolerance)
    assert np.isclose(support, expected, rtol=1e-6)
    assert np.allclose(shape, expected_shape, rtol=1e-6, atol=1e-6)


@laws
@given(seeds)
def test_the_better_supported_of_two_circles_wins_unless_its_radius_is_out_of_range(seed):
    rng = np.random.default_rng(seed)
    points = np.concatenate([ring(rng, 60, [0, 0], 1.0), ring(rng, 40, [5, 0], 2.0)])
    samples = samples_of(rng, 100, 200)
    for radii, expected in (
        (ANY, (0, 0, 1, 1, 0)),
        ((0.5, 1.5), (0, 0, 1, 1, 0)),
        ((1.5, 3.0), (5, 0, 2, 2, 0)),
        ((1.0 + 1e-6, 2.0 + 1e-6), (5, 0, 2, 2, 0)),
    ):
        support, shape = search(points, samples, 0.01, radii)
        assert np.allclose(shape, expected, rtol=0, atol=1e-2)
        assert support > 0.9 * (60 if expected[2] == 1 else 40)


@laws
@given(seeds, st.floats(-2, 2), st.floats(0.2, 2.0))
def test_no_radius_out_of_range_is_found(seed, exponent, ratio):
    rng = np.random.default_rng(seed)
    least = 10.0**exponent
    radii = least, least * ratio
    points = rng.standard_normal((40, 2))
    support, shape = search(points, samples_of(rng, 40), 0.1, radii)
    if support > 0:
        assert radii[0] <= shape[2] <= radii[1]
        assert shape[2] == shape[3]
    else:
        assert np.isnan(shape).all()  # left as it was
    assert ratio >= 1 or support == 0


@laws
@given(seeds, st.floats(-3, 3))
def test_the_circle_follows_motion_and_scale(seed, exponent):
    rng = np.random.default_rng(seed)
    points = ring(rng, 50, [0, 0], 1.0, 3.0) + 0.02 * rng.standard_normal((50, 2))
    samples, scale, angle = samples_of(rng, 50), 10.0**exponent, rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = scale * rng.standard_normal(2)
    support, shape = search(points, samples, 0.06)
    moved_support, moved = search(scale * points @ turn.T + shift, samples, 0.06 * scale)
    assert np.isclose(moved_support, support, rtol=1e-6)
    assert np.allclose(moved[:2], scale * turn @ shape[:2] + shift, rtol=0, atol=1e-6 * scale)
    assert np.isclose(moved[2], scale * shape[2], rtol=1e-6)


def test_points_on_a_line_and_single_points_have_no_circle():
    line = np.column_stack([np.arange(20.0), 3 * np.arange(20.0)])
    rng = np.random.default_rng(0)
    for points in (line, np.ones((20, 2))):
        support, shape = search(points, samples_of(rng, 20), 0.1)
        assert support == 0
        assert np.isnan(shape).all()
    assert search(line, np.full((5, 5), 3), 0.1)[0] == 0  # one point drawn again and again
    assert search(line, np.empty((0, 5), np.int64), 0.1)[0] == 0
