"""Every point is in one tile, and in the margins of those it is near to."""

import numpy as np
import pytest

from cylx.tiles.tree import grow_tree, usual_side


@pytest.fixture
def points():
    rng = np.random.default_rng(0)
    dense, sparse = rng.normal(0, 0.1, (3000, 3)), rng.uniform(-4, 4, (1000, 3))
    return np.concatenate([dense, sparse, [[1e6, 0, 0]]])


@pytest.mark.parametrize("size", [None, 1.5])
def test_each_point_is_inside_one_tile(points, size):
    tree = grow_tree(points, 500, size=size, corner=points.min(axis=0))
    owner, near = np.full(len(points), -1), [set() for _ in points]
    for tile, inside, beside in tree.spread(points, 0.2):
        assert (owner[inside] == -1).all()
        owner[inside] = tile
        for i in beside:
            near[i].add(tile)
    assert (owner >= 0).all()
    low, high = tree.boxes[owner, 0], tree.boxes[owner, 1]
    assert ((points >= low) & (points < high)).all()
    grown = np.stack([tree.boxes[:, 0] - 0.2, tree.boxes[:, 1] + 0.2], axis=1)
    for i in range(0, len(points), 37):
        within = ((points[i] >= grown[:, 0]) & (points[i] < grown[:, 1])).all(axis=1)
        assert near[i] == set(np.flatnonzero(within)) - {owner[i]}
    counts = np.bincount(owner, minlength=len(tree))
    assert counts.max() <= 500
    assert (counts > 0).all()


def test_the_size_is_kept_from_the_corner_on(points):
    tree = grow_tree(points[:-1], 1e9, size=2.0, corner=points.min(axis=0))
    for _, inside, _ in tree.spread(points[:-1], 0.0):
        assert (np.ptp(points[inside], axis=0) <= 2.0).all()
    places = (np.array([cut.place for cut in tree.cuts]) - points.min(axis=0)[[cut.axis for cut in tree.cuts]]) / 2.0
    assert places == pytest.approx(np.rint(places))


def test_what_noise_puts_beyond_a_multiple_gets_no_tile_of_its_own():
    rng = np.random.default_rng(5)
    two = rng.uniform(0, [4, 2, 2], size=(5000, 3))
    noisy = two + 0.004 * rng.standard_normal(two.shape)
    tree = grow_tree(noisy, 1e9, size=2.0, corner=noisy.min(axis=0))
    assert len(tree) == 2
    annex = np.concatenate([noisy, rng.uniform([9, 0, 0], [10, 1, 1], size=(45, 3))])  # less than one in a hundred
    tree = grow_tree(annex, 1e9, size=2.0, corner=annex.min(axis=0))
    owners = {tile: inside for tile, inside, _ in tree.spread(annex, 0.0)}
    assert any((inside >= 5000).all() and len(inside) == 45 for inside in owners.values())


def test_what_cannot_be_cut_is_one_tile():
    same = np.ones((100, 3))
    tree = grow_tree(same, 10, size=None, corner=np.ones(3))
    assert len(tree) == 1
    ((tile, inside, beside),) = tree.spread(same, 1.0)
    assert (tile, len(inside), len(beside)) == (0, 100, 0)
    assert usual_side(tree, same) == 0.0


def test_tiles_are_not_narrower_than_a_few_margins(points):
    tree = grow_tree(points[:3000], 10, size=None, corner=np.zeros(3), margin=0.1)
    assert 1 <= len(tree) <= 12


def test_there_are_no_more_tiles_than_the_points_need():
    points = np.random.default_rng(3).uniform(0, [10, 10, 1], size=(7100, 3))
    tree = grow_tree(points, 1000, size=None, corner=np.zeros(3))
    assert len(tree) == 8
    assert max(len(inside) for _, inside, _ in tree.spread(points, 0.0)) <= 1000
