"""The circle with the most support among strays, within the radii asked for; and the circle of least squares."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.circle import fit_circle, search_circle

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)
ANY = 0.0, np.inf


def ring(rng, n, center, radius, arc=2 * np.pi):
    angles = arc * rng.random(n)
    return center + radius * np.column_stack([np.cos(angles), np.sin(angles)])


def search(points, samples, tolerance, radii=ANY):
    shape = np.full(5, np.nan)
    return search_circle(np.ascontiguousarray(points.T), len(points), samples, tolerance, *radii, shape), shape


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


# least squares


@laws
@given(seeds, st.floats(0.3, 2 * np.pi), st.integers(3, 200), st.floats(-6, 6))
def test_exact_circles_are_fitted_exactly(seed, arc, n, exponent):
    rng = np.random.default_rng(seed)
    radius = 10.0**exponent
    center = 3 * radius * rng.standard_normal(2)
    angles = rng.uniform(0, 2 * np.pi) + arc * np.linspace(0, 1, n, endpoint=False)
    found, size = fit_circle(center + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
    # rounding of 1e-15 radii, over the height of the arc and once more in Taubin's moments
    atol = 1e-9 * radius / min(arc * (1 - 1 / n), 2.0) ** 4
    assert np.allclose(found, center, rtol=0, atol=atol)
    assert abs(size - radius) < atol


@laws
@given(seeds, st.floats(1.0, 2 * np.pi), st.floats(-3, 3))
def test_the_least_squares_circle_follows_motion_and_scale(seed, arc, exponent):
    rng = np.random.default_rng(seed)
    points = ring(rng, 100, [0, 0], 1.0, arc) + 0.02 * rng.standard_normal((100, 2))
    scale, angle = 10.0**exponent, rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = 100 * scale * rng.standard_normal(2)
    center, radius = fit_circle(points, steps=20)
    moved_center, moved_radius = fit_circle(scale * points @ turn.T + shift, steps=20)
    again_center, again_radius = fit_circle(rng.permutation(points), steps=20)
    assert np.allclose(moved_center, scale * turn @ center + shift, rtol=0, atol=1e-6 * scale)
    assert np.isclose(moved_radius, scale * radius, rtol=1e-6)
    assert np.allclose([*again_center, again_radius], [*center, radius], rtol=0, atol=1e-9)


@laws
@given(seeds, st.floats(1.0, 2 * np.pi))
def test_it_is_the_least_squares_of_the_distances(seed, arc):
    """A step in any direction makes the sum of squared orthogonal distances greater."""
    rng = np.random.default_rng(seed)
    points = ring(rng, 80, [2, -1], 1.0, arc) + 0.03 * rng.standard_normal((80, 2))

    def loss(x, y, r):
        return ((np.hypot(points[:, 0] - x, points[:, 1] - y) - r) ** 2).sum()

    center, radius = fit_circle(points, steps=20)
    best = loss(*center, radius)
    for step in 1e-3 * np.concatenate([np.eye(3), -np.eye(3)]):
        assert loss(center[0] + step[0], center[1] + step[1], radius + step[2]) > best


@pytest.mark.parametrize("arc_deg", [360, 180, 90])
def test_its_errors_are_those_of_the_noise(arc_deg):
    n, sigma, trials, arc = 200, 0.01, 200, np.radians(arc_deg)
    rng = np.random.default_rng(arc_deg)
    errors = []
    for _ in range(trials):
        points = ring(rng, n, [3, 4], 1.0, arc) + sigma * rng.standard_normal((n, 2))
        center, radius = fit_circle(points)
        errors.append([*center - [3, 4], radius - 1.0])
    c1, c2 = np.sin(arc / 2) / (arc / 2), (1 + np.sin(arc) / arc) / 2
    middle = np.array([np.cos(arc / 2), np.sin(arc / 2)])
    along, across = np.array(errors)[:, :2] @ middle, np.array(errors)[:, :2] @ [-middle[1], middle[0]]
    k = sigma**2 / n
    expected = [k / (c2 - c1**2), k / (1 - c2), k * c2 / (c2 - c1**2)]
    ratios = [
        (values**2).mean() / one for values, one in zip((along, across, np.array(errors)[:, 2]), expected, strict=True)
    ]
    # chi-squared with as many degrees of freedom as trials; on the short arc second order adds a few percent
    assert np.allclose(ratios, 1.0, rtol=0, atol=4 * np.sqrt(2 / trials) + 0.05)


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 2)),
        np.ones((1, 2)),
        np.eye(2),
        np.ones((20, 2)),
        np.column_stack([np.arange(20.0), np.zeros(20)]),
        np.column_stack([np.zeros(20), np.arange(20.0)]),
        np.column_stack([np.arange(20.0), np.arange(20.0)]),
        np.repeat(np.eye(2), 10, axis=0),
    ],
    ids=["none", "one", "two", "one again and again", "level", "upright", "slanting", "two again and again"],
)
def test_what_is_no_circle_has_none(points):
    assert fit_circle(points) is None


@laws
@given(seeds)
def test_points_about_a_line_have_no_circle_or_a_large_one(seed):
    rng = np.random.default_rng(seed)
    direction, shift = rng.standard_normal((2, 2))
    direction /= np.linalg.norm(direction)
    along = np.sort(rng.uniform(-1, 1, 30))
    points = shift + along[:, None] * direction + 1e-12 * rng.standard_normal((30, 2))
    found = fit_circle(points)
    # what is bent by 1e-12 over a length of 2 has a radius of 1 / 1e-12 or so
    assert found is None or found[1] > 1e6
