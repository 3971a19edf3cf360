"""Points in cells: those near a surface, thinned and without the ones that are marked, against a look at all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.cells import Cells
from cylx.geometry.morton import BITS, morton_codes

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)


def drawn(seed, occupancy=8):
    """Give cells of a cloud in lumps, marks of its points, a cylinder among them, half its height and a width."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 600))
    points = 10 * rng.random((6, 3))[rng.integers(0, 6, n)] + 2 * rng.random((n, 3))
    unit = 13.0 / 2**BITS
    codes = morton_codes(points, unit)
    order = np.argsort(codes)
    direction = rng.standard_normal(3)
    model = np.array([*points[rng.integers(n)], *direction / np.linalg.norm(direction), rng.uniform(0.1, 4)])
    half = rng.choice([rng.uniform(0, 8), np.inf])
    cells = Cells(np.ascontiguousarray(points[order]), codes[order], occupancy)
    return rng, cells, rng.random(n), model, half, rng.uniform(0.01, 1.2) * model[6]


def near_surface(points, model, half, width):
    """Tell which points are within `width` of a surface of that height."""
    offsets = points - model[:3]
    heights = offsets @ model[3:6]
    distances = np.linalg.norm(offsets - heights[:, None] * model[3:6], axis=1)
    return (np.abs(heights) <= half) & (np.abs(distances - model[6]) <= width)


@laws
@given(seeds, st.floats(0, 1.1), st.sampled_from([1, 8, 32]))
def test_all_points_near_a_surface_are_given_but_those_marked(seed, limit, occupancy):
    _, cells, marks, model, half, width = drawn(seed, occupancy)
    expected = cells.points[near_surface(cells.points, model, half, width) & (marks < limit)]
    assert np.array_equal(cells.surface_points(model, half, width, None, marks, limit), expected)


@laws
@given(seeds, st.integers(1, 700))
def test_of_many_every_so_manyth_is_taken(seed, most):
    _, cells, marks, model, half, width = drawn(seed)
    near = np.flatnonzero(near_surface(cells.points, model, half, width))
    thinned = near[:: max(1, len(near) // most)]
    found = cells.surface_points(model, half, width, most, np.zeros(len(marks)), 1.0)
    assert np.array_equal(found, cells.points[thinned])
    assert len(found) < 2 * most
    assert len(found) >= min(len(near), most)
    marked = cells.surface_points(model, half, width, most, marks, 0.5)
    assert np.array_equal(marked, cells.points[thinned[marks[thinned] < 0.5]])


@pytest.mark.parametrize("most", [None, 10])
def test_far_from_all_points_there_are_none(most):
    _, cells, marks, model, _, _ = drawn(1)
    model[:3] += 1e3
    assert cells.surface_points(model, 5.0, 0.1, most, marks, 2.0).shape == (0, 3)
