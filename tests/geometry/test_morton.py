"""Morton order and cells: the same points as by brute force, in an order that knows only where they are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import cylinder_coordinates
from cylx.geometry.morton import BITS, cell_starts, find_cell, gather_ball, interleave, morton_codes, thin

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=30, deadline=None)


def sorted_cloud(seed, n=400, kind="mixed"):
    """Give points in Morton order, codes, and the side of the smallest cell."""
    rng = np.random.default_rng(seed)
    points = {
        "box": 10 * rng.random((n, 3)),
        "line": np.outer(10 * rng.random(n), [1, 0.01, 0.5]),
        "twins": np.repeat(10 * rng.random((n // 4, 3)), 4, axis=0),
        "mixed": np.concatenate([10 * rng.random((n // 2, 3)), 5 + 0.01 * rng.standard_normal((n - n // 2, 3))]),
    }[kind]
    points -= points.min(axis=0)
    unit = points.max() / (2**BITS - 2)
    codes = morton_codes(points, unit)
    order = np.argsort(codes, kind="stable")
    return np.ascontiguousarray(points[order]), codes[order], unit, rng


kinds = st.sampled_from(["box", "line", "twins", "mixed"])


@given(st.integers(0, 2**21 - 1))
@settings(max_examples=100, deadline=None)
def test_bits_are_spread_by_three(value):
    assert interleave(value) == sum(((value >> k) & 1) << (3 * k) for k in range(21))


@laws
@given(seeds)
def test_a_code_is_the_bits_of_its_cell(seed):
    rng = np.random.default_rng(seed)
    places = rng.integers(0, 2**21, (50, 3))
    unit = 0.125  # so that no place is rounded
    expected = [interleave(int(x)) << 2 | interleave(int(y)) << 1 | interleave(int(z)) for x, y, z in places]
    codes = morton_codes(unit * (places + rng.random((50, 3)) * 0.99), unit)
    assert codes.tolist() == expected
    level = int(rng.integers(1, 21))
    assert np.array_equal(codes >> (3 * level), morton_codes(unit * places, unit * 2**level))


@pytest.mark.parametrize("bad", [[-1e-9, 0, 0], [0, 2.0**21, 0], [0, np.nan, 0], [0, 0, np.inf]])
def test_places_outside_the_cube_are_refused(bad):
    with pytest.raises(ValueError, match="2\\^21 unit"):
        morton_codes(np.array([[1.0, 1, 1], bad]), 1.0)


def test_no_points_are_no_cells():
    nothing = morton_codes(np.empty((0, 3)), 1.0)
    cells, starts = cell_starts(nothing, 3)
    assert len(nothing) == len(cells) == 0
    assert starts.tolist() == [0]
    assert thin(nothing, 3).tolist() == []


@laws
@given(seeds, kinds, st.integers(0, 20))
def test_every_cell_is_one_run(seed, kind, level):
    _, codes, _, _ = sorted_cloud(seed, kind=kind)
    cells, starts = cell_starts(codes, level)
    assert (np.diff(cells) > 0).all()
    assert starts[0] == 0
    assert starts[-1] == len(codes)
    assert (np.diff(starts) > 0).all()
    assert np.array_equal(np.repeat(cells, np.diff(starts)), codes >> (3 * level))
    for position, cell in enumerate(cells.tolist()):
        assert find_cell(cells, cell) == position
    missing = np.setdiff1d(np.concatenate([cells - 1, cells + 1]), cells)
    assert all(find_cell(cells, int(code)) == -1 for code in missing)


@laws
@given(seeds, kinds, st.integers(12, 20), st.floats(-3, 1.5))
def test_a_ball_holds_the_points_within_its_radius(seed, kind, level, exponent):
    points, codes, unit, rng = sorted_cloud(seed, kind=kind)
    cells, starts = cell_starts(codes, level)
    side, radius = unit * 2.0**level, 10.0**exponent
    radius = min(radius, 60 * side)  # so that not too many cells are looked at
    found = np.empty(len(points), np.int64)
    for center in np.vstack([points[rng.integers(len(points), size=3)], 14 * rng.random((3, 3)) - 2]):
        n = gather_ball(points, cells, starts, side, center, radius, found)
        expected = np.flatnonzero(((points - center) ** 2).sum(axis=1) < radius**2)
        assert np.array_equal(np.sort(found[:n]), expected)


def test_a_ball_stops_when_there_is_no_more_room():
    points, codes, unit, _ = sorted_cloud(1)
    cells, starts = cell_starts(codes, 18)
    found = np.full(11, -1)
    assert gather_ball(points, cells, starts, unit * 2.0**18, points[5], 50.0, found[:10]) == 10
    assert len(np.unique(found[:10])) == 10
    assert found[10] == -1


@laws
@given(seeds, kinds, st.integers(0, 20), st.booleans())
def test_thinning_picks_one_point_of_each_cell(seed, kind, level, some):
    _, codes, _, rng = sorted_cloud(seed, kind=kind)
    keep = rng.random(len(codes)) < 0.5 if some else None
    chosen = thin(codes, level, keep)
    asked = np.arange(len(codes)) if keep is None else np.flatnonzero(keep)
    assert (np.diff(chosen) > 0).all()
    assert np.isin(chosen, asked).all()
    assert np.array_equal(codes[chosen] >> (3 * level), np.unique(codes[asked] >> (3 * level)))


@laws
@given(seeds, st.sampled_from(["box", "mixed"]), st.integers(0, 20))
def test_thinning_does_not_know_the_order_the_points_came_in(seed, kind, level):
    points, codes, unit, rng = sorted_cloud(seed, kind=kind)
    shuffled = points[rng.permutation(len(points))]
    again = morton_codes(shuffled, unit)
    order = np.argsort(again)
    assert np.array_equal(shuffled[order][thin(again[order], level)], points[thin(codes, level)])


def test_thinning_favours_no_corner_of_the_cells():
    points = np.random.default_rng(0).random((60000, 3))
    codes = morton_codes(points, 2.0**-20)
    order = np.argsort(codes)
    chosen = thin(codes[order], 17)  # 512 cells of about 117 points
    place = (points[order][chosen] * 8) % 1
    assert len(place) == 512
    # uniform in the cell: mean 1/2, variance 1/12
    assert np.abs(place.mean(axis=0) - 0.5).max() < 5 * np.sqrt(1 / 12 / 512)


@laws
@given(seeds, kinds, st.integers(1, 100))
def test_a_hollow_cylinder_holds_the_points_it_should(seed, kind, occupancy):
    points, codes, _, rng = sorted_cloud(seed, kind=kind)
    cells = Cells(points, codes, occupancy)
    assert cells.points is points
    for _ in range(8):
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        model = np.concatenate([10 * rng.random(3), direction, [np.nan]])
        low, high = np.sort(rng.uniform(-8, 8, 2))
        inner, outer = rng.choice([0.0, 1.0, 3.0]), rng.uniform(2, 9)
        heights, distances, _ = cylinder_coordinates(points, model[:3], direction)
        expected = (heights >= low) & (heights <= high) & (distances >= inner) & (distances <= outer)
        assert np.array_equal(cells.near_cylinder(model, low, high, inner, outer), np.flatnonzero(expected))


def test_nothing_is_in_an_empty_cylinder():
    points, codes, _, _ = sorted_cloud(3)
    model = np.array([5.0, 5, 5, 0, 0, 1, 1])
    cells = Cells(points, codes)
    assert len(cells.near_cylinder(model, 1.0, -1.0, 0.0, 9.0)) == 0
    assert len(cells.near_cylinder(model, -1.0, 1.0, 9.0, 3.0)) == 0
    assert len(cells.near_cylinder(model, -99.0, 99.0, 0.0, 99.0)) == len(points)


def test_an_infinite_height_is_no_bound():
    points, codes, _, _ = sorted_cloud(4)
    model = np.array([5.0, 5, 5, 0, 1, 0, 1])
    found = Cells(points, codes).near_cylinder(model, -np.inf, np.inf, 0.0, 2.0)
    assert np.array_equal(found, np.flatnonzero(np.hypot(points[:, 0] - 5, points[:, 2] - 5) <= 2.0))
