"""The kernels of Jin and Lee: the sphere of most points, and rows of spheres."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.baselines.jin import _search_sphere, _straight

seeds = st.integers(0, 2**32 - 1)

laws = settings(max_examples=30, deadline=None)


@laws
@given(seeds, st.floats(0, 0.4))
def test_the_sphere_of_most_points_is_found(seed, strays):
    rng = np.random.default_rng(seed)
    center, radius = 5 * rng.standard_normal(3), np.exp(rng.uniform(-2, 2))
    directions = rng.standard_normal((60, 3))
    on = center + radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    off = center + radius * rng.uniform(-3, 3, (int(60 * strays), 3))
    points = np.concatenate([on, off])
    samples = np.array([rng.permutation(len(points))[:4] for _ in range(150)])
    sphere = np.full(4, np.nan)
    # a quarter of the samples hold no stray; the worst of them is ill-conditioned, but the best counts
    assert _search_sphere(points, samples, 1e-5 * radius, 0.0, np.inf, sphere) >= 60
    assert np.allclose(sphere, [*center, radius], rtol=0, atol=1e-4 * radius)
    assert _search_sphere(points, samples, 1e-5 * radius, 1.01 * radius, np.inf, sphere) < 60
    assert _search_sphere(points, samples, 1e-5 * radius, 0.0, 0.99 * radius, sphere) < 60


def test_points_of_a_plane_have_no_sphere():
    points = np.column_stack([np.random.default_rng(0).integers(0, 9, (30, 2)), np.zeros(30)]).astype(float)
    samples = np.random.default_rng(1).integers(30, size=(50, 4))
    assert _search_sphere(points, samples, 0.1, 0.0, np.inf, np.empty(4)) == 0


def test_spheres_are_straight_along_a_line_and_not_about_a_bend():
    line = np.column_stack([np.linspace(0, 9, 40), np.zeros((40, 2)), np.ones(40)])
    assert _straight(line, 0.7).all()
    ball = np.column_stack([0.5 * np.random.default_rng(0).standard_normal((200, 3)), np.full(200, 2.0)])
    assert not _straight(ball, 0.7).any()
    assert not _straight(line[:3], 0.0).any()  # too few to tell
