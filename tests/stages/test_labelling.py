"""Labels: each point to the cylinder whose surface is nearest, or to none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import Cylinder, cylinder_coordinates, surface_distances
from cylx.geometry.morton import BITS, morton_codes
from cylx.records import IndexedCloud, Noise, Segment
from cylx.stages.labelling import label_points

NOISE = 0.02


def ground_of(points, flatness=None):
    """Give the ground of points that are put into Morton order, and the points so ordered."""
    points = points - points.min(axis=0)
    codes = morton_codes(points, points.max() / (2**BITS - 2))
    order = np.argsort(codes)
    flat = np.zeros(len(points)) if flatness is None else flatness[order]
    return IndexedCloud(
        Cells(np.ascontiguousarray(points[order]), codes[order]), flat, Noise(np.ones(1), np.array([NOISE]))
    ), order


def segment(point, direction, radius, half, spread=NOISE):
    shape = Cylinder(point, direction, radius)
    return Segment(np.concatenate([shape.point, shape.direction, [radius]]), half, spread)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5))
def test_each_point_gets_the_nearest_surface_within_three_deviations(seed, count):
    rng = np.random.default_rng(seed)
    indexed, _ = ground_of(rng.uniform(0, 4, (600, 3)))
    segments = [
        segment(
            rng.uniform(0, 4, 3), rng.standard_normal(3), rng.uniform(0.3, 2), rng.uniform(0.5, 3), rng.uniform(0, 0.1)
        )
        for _ in range(count)
    ]
    labels, residuals = label_points(segments, indexed)
    best = np.full(600, np.inf)
    expected, distance = np.full(600, -1), np.full(600, np.nan)
    for index, one in enumerate(segments):
        heights, _, _ = cylinder_coordinates(indexed.points, one.model[:3], one.model[3:6])
        offset = surface_distances(indexed.points, one.cylinder)
        mine = (np.abs(offset) <= 3 * max(one.spread, NOISE)) & (np.abs(heights) <= one.half) & (np.abs(offset) < best)
        expected[mine], distance[mine], best[mine] = index, offset[mine], np.abs(offset[mine])
    assert labels.dtype == np.int32
    assert np.array_equal(labels, expected)
    assert np.allclose(residuals, distance, rtol=0, atol=1e-12, equal_nan=True)


def test_outside_is_positive():
    points = np.array([[1.02, 0, 0], [0.98, 0, 0], [0, -1.03, 0.5], [0, 0, 0], [3, 3, 3], [-3, -3, -3]])
    indexed, order = ground_of(points)
    _, residuals = label_points([segment((3, 3, 3), (0, 0, 1), 1.0, 1.0)], indexed)
    back = np.empty(6)
    back[order] = residuals
    assert np.allclose(back, [0.02, -0.02, 0.03, np.nan, np.nan, np.nan], atol=1e-12, equal_nan=True)


@pytest.mark.parametrize(("window", "owned"), [(0.0, True), (1.9, True), (2.1, False)])
def test_points_of_something_much_flatter_belong_to_no_pipe(window, owned):
    rng = np.random.default_rng(1)
    turn = rng.uniform(0, 2 * np.pi, 200)
    points = np.column_stack([np.cos(turn), np.sin(turn), rng.uniform(-1, 1, 200)]) + 5
    indexed, _ = ground_of(points, np.full(200, window))
    low = points.min(axis=0)
    labels, _ = label_points([segment(np.array([5, 5, 5]) - low, (0, 0, 1), 1.0, 2.0)], indexed)
    assert (labels == 0).all() == owned
    assert (labels == -1).all() != owned


def test_without_cylinders_nothing_has_a_label():
    indexed, _ = ground_of(np.random.default_rng(2).random((20, 3)))
    labels, residuals = label_points([], indexed)
    assert (labels == -1).all()
    assert np.isnan(residuals).all()
