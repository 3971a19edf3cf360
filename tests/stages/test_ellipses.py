"""Ellipses of a slice: its connected pieces, and in each every ellipse there is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cylx.config import EllipsesConfig
from cylx.geometry.plane import Plane
from cylx.records import Slice
from cylx.stages.ellipses import fit_ellipses, split_pieces

seeds = st.integers(0, 2**32 - 1)
FLOOR = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
RINGS = [((0, 0), 2.0, 1.0, 0.3), ((9, 1), 1.5, 1.5, 0.0), ((3, 8), 3.0, 1.2, 2.0)]


def ring(center, major, minor, angle, n, rng, sigma=0.01):
    """Give noisy points of an ellipse."""
    phases = rng.uniform(0, 2 * np.pi, n)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    clean = np.column_stack([major * np.cos(phases), minor * np.sin(phases)]) @ turn.T + center
    return clean + sigma * rng.standard_normal((n, 2))


def find(points, *, seed=0, radii=(0.1, 10.0), **changes):
    config = EllipsesConfig(**changes)
    return fit_ellipses(
        Slice(FLOOR, points),
        config,
        min_points=20,
        link=0.8,
        tolerance=0.05,
        radius_range=radii,
        rng=np.random.default_rng(seed),
    )


def scene(rng, outliers=0):
    own = [ring(*shape, 150, rng) for shape in RINGS]
    return rng.permutation(np.concatenate([*own, rng.uniform(-3, 11, (outliers, 2))]))


@pytest.mark.parametrize("pieces", [True, False])
@pytest.mark.parametrize("outliers", [0, 60])
def test_every_ellipse_is_found(pieces, outliers):
    fits = find(scene(np.random.default_rng(1), outliers), pieces=pieces, min_share=0.1, iterations=600)
    found = sorted((fit.ellipse for fit in fits if fit.inliers > 100), key=lambda e: e.center[0])
    assert len(found) == 3
    for ellipse, (center, major, minor, _) in zip(found, sorted(RINGS), strict=True):
        assert np.allclose(ellipse.center, center, atol=0.03)
        assert np.isclose(ellipse.semi_major, major, atol=0.03)
        assert np.isclose(ellipse.semi_minor, minor, atol=0.03)
    if not outliers:
        assert len(fits) == 3
        assert all(fit.inliers >= 145 and fit.plane is FLOOR for fit in fits)


def test_no_point_supports_two_ellipses():
    points = scene(np.random.default_rng(2), 60)
    fits = find(points, pieces=False, min_share=0.0, min_inliers=6)
    assert sum(fit.inliers for fit in fits) <= len(points)


def test_the_same_generator_gives_the_same_ellipses():
    points = scene(np.random.default_rng(3), 60)
    one, again = find(points, seed=5), find(points, seed=5)
    assert [fit.ellipse.semi_major for fit in one] == [fit.ellipse.semi_major for fit in again]


@pytest.mark.parametrize(
    ("limits", "count"),
    [
        ({"max_per_slice": 2}, 2),
        ({"max_aspect": 1.2}, 1),
        ({"min_inliers": 1000}, 0),
        ({"min_share": 0.5, "pieces": False}, 0),
    ],
    ids=["count", "aspect", "inliers", "share"],
)
def test_limits_hold(limits, count):
    assert len(find(scene(np.random.default_rng(4), 5), **limits)) == count


@pytest.mark.parametrize("radii", [(1.1, 10.0), (0.1, 1.3), (1.1, 1.3)])
def test_radii_out_of_range_are_not_looked_for(radii):
    fits = find(scene(np.random.default_rng(4), 5), radii=radii)
    assert fits
    assert all(radii[0] <= fit.ellipse.semi_minor <= radii[1] for fit in fits)
    whole = sorted(fit.ellipse.semi_minor for fit in fits if fit.inliers > 140)
    assert np.allclose(whole, [r for r in (1.0, 1.2, 1.5) if radii[0] <= r <= radii[1]], atol=0.03)


def test_there_is_nothing_in_a_line_or_in_noise():
    rng = np.random.default_rng(5)
    assert find(np.column_stack([np.linspace(0, 9, 300), 0.01 * rng.standard_normal(300)])) == []
    assert find(rng.uniform(0, 9, (400, 2))) == []
    assert find(np.empty((0, 2))) == []


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(1, 80), st.floats(0.3, 3))
def test_pieces_are_the_connected_squares(seed, n, link):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 12, (n, 2)) + rng.uniform(-1e3, 1e3, 2)
    squares = np.floor((points - points.min(axis=0)) / link)
    touch = np.abs(squares[:, None] - squares).max(axis=2) <= 1
    count, label = connected_components(coo_array(touch), directed=False)
    pieces = split_pieces(points, link)
    assert np.array_equal(np.sort(np.concatenate(pieces)), np.arange(n))
    assert len(pieces) == count
    assert all(len(set(label[piece])) == 1 for piece in pieces)


def test_points_within_a_link_are_in_one_piece():
    rng = np.random.default_rng(6)
    points = rng.uniform(0, 12, (60, 2))
    owner = np.empty(60, int)
    for number, piece in enumerate(split_pieces(points, 1.0)):
        owner[piece] = number
    near = np.linalg.norm(points[:, None] - points, axis=2) < 1.0
    assert (owner[:, None] == owner)[near].all()
    assert len(set(owner)) > 1


def test_pieces_come_by_where_they_are():
    rng = np.random.default_rng(7)
    points = rng.uniform(0, 12, (60, 2))
    order = rng.permutation(60)
    one = [set(map(tuple, points[piece])) for piece in split_pieces(points, 1.0)]
    assert one == [set(map(tuple, points[order][piece])) for piece in split_pieces(points[order], 1.0)]


def test_no_points_are_no_pieces():
    assert split_pieces(np.empty((0, 2)), 1.0) == []
