"""The kernels of MSAC: the cylinder of two oriented points, and its loss."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.baselines.msac import _cylinder_through, _loss
from tests.support.drawn import random_model

seeds = st.integers(0, 2**32 - 1)

laws = settings(max_examples=30, deadline=None)

ANY = np.array([0.0, np.inf, 0.0, 0.0, 0.0, -1.0])


def through(points, normals, limits=ANY):
    model = np.full(7, np.nan)
    has_one = _cylinder_through(np.array(points, float), np.array(normals, float), 0, 1, np.array(limits, float), model)
    return model if has_one else None


@laws
@given(seeds, st.floats(0.05, np.pi - 0.05), st.sampled_from([(1, 1), (1, -1), (-1, 1), (-1, -1)]))
def test_two_oriented_points_of_a_cylinder_give_it_back(seed, apart, signs):
    rng = np.random.default_rng(seed)
    point, direction, radius, across = random_model(rng)
    first = rng.uniform(0, 2 * np.pi)
    radial = np.array([np.cos(a) * across[0] + np.sin(a) * across[1] for a in (first, first + apart)])
    points = point + radius * radial + rng.uniform(-9, 9, (2, 1)) * direction
    normals = radial * np.array(signs)[:, None]  # a normal may point either way
    model = through(points, normals)
    atol = 1e-10 * (10 + radius) / np.sin(apart)
    assert np.allclose(np.abs(model[3:6] @ direction), 1.0, rtol=0, atol=1e-12)
    assert np.linalg.norm(np.cross(model[:3] - point, direction)) < atol
    assert abs(model[6] - radius) < atol
    # and the limits hold: radius, and angle to a direction
    assert through(points, normals, [0.9 * radius, 1.1 * radius, 0, 0, 0, -1]) is not None
    assert through(points, normals, [1.1 * radius, np.inf, 0, 0, 0, -1]) is None
    assert through(points, normals, [0, 0.9 * radius, 0, 0, 0, -1]) is None
    tilted = np.cos(0.1) * direction + np.sin(0.1) * across[0]
    assert through(points, normals, [0, np.inf, *-tilted, np.cos(0.11)]) is not None
    assert through(points, normals, [0, np.inf, *tilted, np.cos(0.09)]) is None


def test_two_oriented_points_by_hand():
    # seen along z the normals' lines cross at the origin, 1 and 3 away: the mean is the radius
    model = through([[1, 0, 5], [0, 3, -2]], [[1, 0, 0], [0, 1, 0]])
    assert np.allclose(model, [0, 0, 5, 0, 0, 1, 2])


@pytest.mark.parametrize("normals", [[[1, 0, 0], [1, 0, 0]], [[1, 0, 0], [-1, 0, 0]], [[1, 0, 0], [1, 1e-5, 0]]])
def test_parallel_normals_have_no_cylinder(normals):
    assert through([[1, 0, 0], [2, 1, 0]], normals) is None
    assert through([[1, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 0, 0]]) is None  # nor has one point drawn twice


def test_the_loss_is_the_sum_of_squares_cut_off():
    model = np.array([0, 0, 0, 0, 0, 1, 2.0])
    points = np.array([[2, 0, 7], [2.1, 0, 0], [0, 1.8, -5], [9, 0, 0], [0, 0, 3.0]])
    # distances 0, 0.1, 0.2, 7 and 2, none of them counted above 0.5
    assert _loss(points, model, 0.5, np.inf) == pytest.approx(0.01 + 0.04 + 0.25 + 0.25)
    assert _loss(points, model, 0.5, 0.549) == np.inf  # no better than the record
    assert _loss(points, model, 0.5, 0.551) == pytest.approx(0.55)
