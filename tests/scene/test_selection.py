"""Fewer points for a first look: laws of boxes, voxels, classes and rows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cylx.errors import InputError
from cylx.records import PointCloud, Selection, Source
from cylx.scene import select
from cylx.scene.selection import inside_box, one_a_voxel

clouds = arrays(
    np.float64, st.tuples(st.integers(1, 40), st.just(3)), elements=st.integers(-20, 20).map(lambda n: n / 8)
)
sides = st.sampled_from([0.1, 0.25, 1.0, 7.0])
bounds = st.none() | st.integers(-20, 20).map(lambda n: n / 8)


def sorted_rows(points):
    return points[np.lexsort(points.T)]


@given(clouds, sides, st.randoms(use_true_random=False))
def test_one_point_a_voxel_whatever_their_order(points, side, random):
    chosen = points[one_a_voxel(points, side)]
    order = list(range(len(points)))
    random.shuffle(order)
    assert np.array_equal(sorted_rows(chosen), sorted_rows(points[order][one_a_voxel(points[order], side)]))
    cells = np.floor(points / side)
    assert len(chosen) == len(np.unique(cells, axis=0)) == len(np.unique(np.floor(chosen / side), axis=0))


@given(clouds, sides)
def test_the_point_of_a_voxel_is_the_nearest_to_its_middle(points, side):
    def distances(some):
        return np.linalg.norm(some / side - np.floor(some / side) - 0.5, axis=1)

    chosen = points[one_a_voxel(points, side)]
    for point, distance in zip(chosen, distances(chosen), strict=True):
        mates = points[(np.floor(points / side) == np.floor(point / side)).all(axis=1)]
        assert distance <= distances(mates).min() + 1e-12


@given(clouds, sides)
def test_voxels_of_voxels_are_the_same(points, side):
    chosen = points[one_a_voxel(points, side)]
    assert np.array_equal(chosen[one_a_voxel(chosen, side)], chosen)


@given(clouds, sides, st.integers(0, 2))
def test_what_else_is_in_the_cloud_does_not_matter(points, side, axis):
    low = points[:, axis] < 0
    if low.any():
        whole = points[one_a_voxel(points, side)]
        part = points[low][one_a_voxel(points[low], side)]
        assert np.array_equal(sorted_rows(whole[whole[:, axis] < 0]), sorted_rows(part))


def test_voxels_that_are_many_more_than_points():
    points = np.random.default_rng(0).uniform(-1e6, 1e6, (500, 3))
    points = np.concatenate([points, points[::-1]])
    assert one_a_voxel(points, 1e-6).tolist() == list(range(500))


@given(clouds, st.tuples(bounds, bounds, bounds), st.tuples(bounds, bounds, bounds))
def test_a_box_has_the_points_between_its_corners(points, low, high):
    inside = inside_box(points, (low, high))
    least = [-np.inf if side is None else side for side in low]
    most = [np.inf if side is None else side for side in high]
    assert np.array_equal(inside, ((points >= least) & (points <= most)).all(axis=1))


@given(clouds, st.integers(1, 9), sides)
def test_a_selection_of_a_cloud_is_a_part_of_it_and_stays_the_same(points, every, side):
    cloud = PointCloud.from_array(points)
    selection = Selection(crop=((None, None, None), (9.0, 9.0, 9.0)), voxel=side, every=every)
    chosen = select(cloud, selection)
    assert select(chosen, selection) is chosen
    assert chosen.rows == len(points)
    rows = np.arange(len(points)) if chosen.valid is None else np.flatnonzero(chosen.valid)
    assert np.array_equal(chosen.points, points[rows])
    assert (rows % every == 0).all()
    assert np.array_equal(np.column_stack([chosen.table[axis] for axis in "xyz"]), points)
    assert chosen.source.selection == selection


def test_rows_without_coordinates_are_counted_and_stay_out():
    points = np.arange(30.0).reshape(10, 3)
    points[4] = np.nan
    chosen = select(PointCloud.from_array(points), Selection(every=4))
    assert chosen.valid.tolist() == [True] + [False] * 7 + [True, False]
    assert np.isnan(chosen.table["x"][4])


def test_no_selection_is_the_cloud_itself():
    cloud = PointCloud.from_array(np.ones((3, 3)))
    assert select(cloud, Selection()) is cloud
    assert select(cloud, Selection(every=1)).valid is None


def test_classes_are_those_of_the_table():
    table = np.zeros(6, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("classification", "u1")])
    table["classification"] = [2, 6, 2, 0, 6, 1]
    cloud = PointCloud(np.zeros((6, 3)), table, None, Source("scan.las", "las"))
    assert select(cloud, Selection(classes=(6, 2, 6))).valid.tolist() == [True, True, True, False, True, False]
    assert Selection(classes=(6, 2, 6)).classes == (2, 6)
    with pytest.raises(InputError, match=r"scan\.las: no point is selected; select more; the points lie from 0,0,0 to"):
        select(cloud, Selection(classes=(9,)))


def test_a_cloud_without_classes_says_so():
    cloud = PointCloud(np.zeros((6, 3)), source=Source("scan.ply", "ply"))
    with pytest.raises(InputError, match=r"scan\.ply: its points have no classification; give a LAS or LAZ file"):
        select(cloud, Selection(classes=(2,)))


def test_voxels_that_are_too_small_are_refused():
    cloud = PointCloud(np.full((6, 3), 5e6), source=Source("scan.ply", "ply"))
    with pytest.raises(InputError, match=r"scan\.ply: voxels of 1e-300 are too small for these coordinates"):
        select(cloud, Selection(voxel=1e-300))


def test_a_selection_of_a_selection_is_refused():
    cloud = select(PointCloud.from_array(np.arange(30.0).reshape(10, 3)), Selection(every=2))
    with pytest.raises(ValueError, match="a selection already"):
        select(cloud, Selection(every=3))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"voxel": 0}, "voxel must be > 0"),
        ({"voxel": float("nan")}, "voxel must be > 0"),
        ({"every": 0}, "every must be at least 1"),
        ({"scan": -1}, "scan must be at least 0"),
        ({"classes": ()}, "classes must be one or several"),
        ({"crop": ((0, 0, 2), (1, 1, 1))}, "crop has its smallest z, 2, above its largest, 1"),
        ({"crop": ((0, 0, float("nan")), (1, 1, 1))}, "crop must be finite in z"),
        ({"crop": ((0, 0), (1, 1))}, "two corners of three"),
    ],
)
def test_impossible_selections_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Selection(**values)
