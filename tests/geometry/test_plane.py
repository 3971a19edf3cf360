"""The plane: points in it and beside it, and directions drawn evenly."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.plane import Plane, random_directions

seeds = st.integers(0, 2**32 - 1)

scales = st.floats(-4, 4).map(lambda exponent: 10.0**exponent)

laws = settings(max_examples=50, deadline=None)


@laws
@given(seeds, scales)
def test_a_plane_takes_its_own_points_apart_and_together(seed, scale):
    rng = np.random.default_rng(seed)
    plane = Plane(scale * rng.standard_normal(3), random_directions(1, rng)[0])
    points = scale * rng.standard_normal((20, 3))
    heights = (points - plane.point) @ plane.normal
    again = plane.lift(plane.project(points)) + heights[:, None] * plane.normal
    assert np.allclose(again, points, rtol=0, atol=1e-14 * scale * 10)
    flat = rng.standard_normal((20, 2))
    assert np.allclose(plane.project(plane.lift(flat)), flat, rtol=0, atol=1e-13 * max(1.0, scale))
    assert np.allclose(((plane.lift(flat) - plane.point) @ plane.normal), 0, rtol=0, atol=1e-13 * max(1.0, scale))
    assert np.allclose(np.linalg.norm(plane.lift_vectors(flat), axis=1), np.linalg.norm(flat, axis=1), rtol=1e-14)


def test_random_directions_cover_the_sphere_evenly():
    directions = random_directions(20000, np.random.default_rng(0))
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-15)
    # each coordinate of an even direction is uniform in [-1, 1]: mean 0, variance 1/3, fourth moment 1/5
    error = 5.0 / np.sqrt(20000)
    assert np.abs(directions.mean(axis=0)).max() < error
    assert np.allclose(directions.T @ directions / 20000, np.eye(3) / 3, rtol=0, atol=error)
    assert np.allclose((directions**4).mean(axis=0), 0.2, rtol=0, atol=error)
