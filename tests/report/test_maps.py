"""The map of a cylinder: where a dent is, what is not seen, how large it may be."""

import numpy as np
import pytest

from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.report.maps import EMPTY, unroll


def dented(depth=0.01, noise=0.001, count=40_000):
    """A slanted pipe of radius 0.5 and height 4, dented between 60° and 120° from its frame in its upper quarter."""
    rng = np.random.default_rng(5)
    pipe = Cylinder((10, 20, 30), (0.3, -0.2, 0.93), 0.5, 4.0)
    across, along = axis_basis(pipe.direction)
    angles, heights = rng.uniform(-np.pi, np.pi, count), rng.uniform(-2, 2, count)
    inside = (np.abs(np.degrees(angles) - 90) < 30) & (heights > 1)
    residuals = rng.normal(0, noise, count) - depth * inside
    radii = 0.5 + residuals
    rings = (radii * np.cos(angles))[:, None] * across + (radii * np.sin(angles))[:, None] * along
    return pipe, pipe.point + heights[:, None] * pipe.direction + rings, residuals, (across, along)


def test_a_dent_is_where_it_is_in_the_map():
    pipe, points, residuals, (across, along) = dented()
    found = unroll(points, residuals, pipe, noise=0.001)
    rows, columns = found.means.shape
    assert (found.means > EMPTY).all()
    means = found.means / 127 * found.reach
    zero = np.degrees(np.arctan2(along[0], across[0]))  # it stands: angle 0 is turned to x
    assert found.zero == "x"
    angles = (np.arange(columns) + 0.5) * 360 / columns - 180 + zero
    away = np.abs((angles - 90 + 180) % 360 - 180)
    levels = (np.arange(rows) + 0.5) / rows
    edge, step = 360 / columns, 1 / rows
    dent = (away[None, :] < 30 - edge) & (levels[:, None] > 0.75 + step)
    rest = (away[None, :] > 30 + edge) | (levels[:, None] < 0.75 - step)
    assert dent.sum() > 10
    assert means[dent] == pytest.approx(-0.01, abs=0.002)
    assert means[rest] == pytest.approx(0, abs=0.002)
    assert 0.008 < found.limit <= found.reach < 0.013


def test_what_is_not_seen_is_empty_in_the_map():
    pipe, points, residuals, (across, _) = dented(depth=0)
    seen = (points - pipe.point) @ across > 0
    found = unroll(points[seen], residuals[seen], pipe, noise=0.001)
    assert np.mean(found.means[0] > EMPTY) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(("height", "count"), [(0.0, 50), (1e3, 50), (1e-6, 500), (1.0, 0), (4.0, 100_000)])
def test_a_map_has_at_most_72_by_48_cells(height, count):
    rng = np.random.default_rng(0)
    angles = rng.uniform(-np.pi, np.pi, count)
    heights = height * rng.uniform(-0.5, 0.5, count)
    points = np.column_stack([np.cos(angles), np.sin(angles), heights])
    found = unroll(points, rng.normal(0, 0.01, count), Cylinder((0, 0, 0), (0, 0, 1), 1.0, height), 0.01)
    rows, columns = found.means.shape
    assert 1 <= rows <= 48
    assert 8 <= columns <= 72
    assert np.isfinite([found.reach, found.limit]).all()
    assert (found.means > EMPTY).any() == (count > 0)
