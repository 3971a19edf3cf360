"""The stems of a plot: found with their diameters, wherever it lies, in whatever unit, and in a part of it."""

from dataclasses import replace

import numpy as np
import pytest

from cylx.records import PointCloud
from cylx.stems import find_stems
from cylx.stems.rings import fit_ring
from cylx.synthetic.stand import forest

SIDE = 8.0


@pytest.fixture(scope="module")
def plot():
    return forest(5, side=SIDE, spacing=0.014, slope=0.3, shrubs_per_hectare=600)


@pytest.fixture(scope="module")
def found(plot):
    return find_stems(PointCloud(plot.points), ground="lowest")


def pairs_of(plot, stems):
    """Pair each true stem of 10 cm with the one found at its place."""
    out = []
    for true in plot.stems:
        near = [one for one in stems if np.hypot(one.foot[0] - true.x, one.foot[1] - true.y) < 0.15]
        if true.dbh > 0.1 and true.arc > np.pi / 2:
            assert len(near) == 1, true
            out.append((true, near[0]))
    return out


def test_every_stem_is_found_with_its_diameter(plot, found):
    pairs = pairs_of(plot, found.stems)
    assert len(pairs) == len(found.stems) >= 4
    for true, one in pairs:
        assert one.dbh == pytest.approx(true.dbh, rel=0.02)
        assert one.lean == pytest.approx(true.lean, abs=np.radians(1.0))
        assert one.foot[2] == pytest.approx(true.ground, abs=0.04)
        assert 0 < one.dbh_sd < 0.03 * one.dbh
        assert one.arc == pytest.approx(true.arc, abs=np.radians(25.0))
        assert one.lowest < 0.6
        assert one.highest > 5.0


def test_the_points_of_a_stem_have_its_number(plot, found):
    for k, one in enumerate(found.stems):
        true = min(range(len(plot.stems)), key=lambda i: abs(plot.stems[i].x - one.foot[0]))
        mine = plot.labels[found.labels == k]
        assert (mine == true).mean() > 0.9
        assert one.points == len(mine)


def test_neither_place_unit_nor_order_matter(plot, found):
    rng = np.random.default_rng(0)
    moved = plot.points[rng.permutation(len(plot.points))] + [432000.0, 5410000.0, 800.0]
    there = find_stems(PointCloud(moved), ground="lowest")
    millimetres = find_stems(PointCloud(plot.points * 1000.0), unit=0.001, ground="lowest")
    assert len(there.stems) == len(millimetres.stems) == len(found.stems)
    for a, b, c in zip(found.stems, there.stems, millimetres.stems, strict=True):
        assert b.dbh == pytest.approx(a.dbh, rel=1e-3)
        assert b.foot - [432000.0, 5410000.0, 800.0] == pytest.approx(a.foot, abs=2e-3)
        assert c.dbh == pytest.approx(a.dbh, rel=1e-6)
        assert c.foot / 1000.0 == pytest.approx(a.foot, abs=1e-6)


def test_a_part_of_a_plot_has_the_stems_that_the_whole_has_there(plot, found):
    inside = plot.points[:, 0] < 5.0
    part = find_stems(PointCloud(plot.points[inside]), ground="lowest").stems
    whole = [one for one in found.stems if one.foot[0] < 4.0]
    assert len(whole) >= 2
    for one in whole:
        (same,) = [other for other in part if np.hypot(*(one.foot - other.foot)[:2]) < 0.05]
        assert same.dbh == pytest.approx(one.dbh, rel=2e-3)


@pytest.mark.parametrize("by", ["classes", "cloth"])
def test_the_ground_is_found_in_other_ways(plot, found, by):
    if by == "cloth":
        pytest.importorskip("CSF")
    cloud = PointCloud(plot.points)
    if by == "classes":
        table = np.zeros(len(plot.points), [("x", "f8"), ("y", "f8"), ("z", "f8"), ("classification", "u1")])
        table["classification"] = np.where(plot.labels == -2, 2, 5)
        cloud = replace(cloud, table=table)
    other = find_stems(cloud, ground=None if by == "classes" else by)
    assert other.ground.by == by
    for true, one in pairs_of(plot, other.stems):
        assert one.foot[2] == pytest.approx(true.ground, abs=0.04)
    assert len(other.stems) == len(found.stems)


def test_without_stems_there_are_none():
    rng = np.random.default_rng(1)
    ground = np.column_stack([rng.uniform(0, 5, (20000, 2)), rng.normal(0, 0.01, 20000)])
    leaves = rng.normal([2.5, 2.5, 3.0], 0.8, (20000, 3))
    assert find_stems(PointCloud(np.concatenate([ground, leaves])), ground="lowest").stems == ()


def test_an_oval_is_measured_and_not_forced():
    rng = np.random.default_rng(2)
    angle, heights = rng.uniform(-np.pi, np.pi, 3000), rng.uniform(-0.4, 0.4, 3000)
    radius = 0.2 * (1 + 0.12 * np.cos(2 * angle)) + rng.normal(0, 0.002, 3000)
    ring = fit_ring(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), heights, (0.01, 0.0, 0.18))
    assert ring.roundness == pytest.approx(0.88 / 1.12, abs=0.02)
    assert ring.radius == pytest.approx(0.2, rel=0.005)


def test_sides_with_more_points_weigh_no_more():
    rng = np.random.default_rng(3)
    angle = np.concatenate([rng.uniform(-0.5, 0.5, 20000), rng.uniform(-np.pi, np.pi, 1500)])
    heights = rng.uniform(-0.4, 0.4, len(angle))
    radius = 0.2 * (1 + 0.03 * np.cos(2 * angle)) + rng.normal(0, 0.002, len(angle))
    ring = fit_ring(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), heights, (0.0, 0.0, 0.2))
    assert ring.radius == pytest.approx(0.2, rel=0.005)


def ring_of_a_made_stem(seed, *, arc, uneven):
    """Fit a ring to 500 points of a stem of 12 cm with a noise of 25 mm, of which some sides are seen more often."""
    rng = np.random.default_rng(seed)
    eyes, often = rng.uniform(-np.pi, np.pi, 6), rng.lognormal(0.0, uneven, 6)
    angle = rng.uniform(-arc / 2, arc / 2, 8000)
    density = (often * np.clip(np.cos(angle[:, None] - eyes), 0.0, None)).sum(axis=1) + 0.02 * often.sum()
    angle = angle[rng.random(len(angle)) < density / density.max()][:500]
    waves = np.arange(2, 8)
    swing = rng.normal(0.0, 0.01 / (waves - 1.0), (2, len(waves)))
    turns = np.outer(angle, waves)
    radius = 0.12 * (1.0 + np.cos(turns) @ swing[0] + np.sin(turns) @ swing[1])
    place = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]) + rng.normal(0.0, 0.025, (len(angle), 2))
    ring = fit_ring(place, rng.uniform(-0.4, 0.4, len(angle)), (0.01, -0.01, 0.125), shared=True)
    return (ring.radius - 0.12) / ring.radius_sd


@pytest.mark.parametrize(("arc", "uneven"), [(2 * np.pi, 0.0), (2 * np.pi, 1.0), (3.5, 0.5)])
def test_radii_are_as_certain_as_stated(arc, uneven):
    off = np.array([ring_of_a_made_stem(seed, arc=arc, uneven=uneven) for seed in range(60)])
    # of 60 rings 41 and 57 are expected; the bounds are three standard deviations away
    assert 30 <= (np.abs(off) < 1).sum() <= 52
    assert (np.abs(off) < 2).sum() >= 52


def test_a_tree_without_ground_stands_at_its_foot():
    pytest.importorskip("CSF")
    rng = np.random.default_rng(4)
    angle, z = rng.uniform(-np.pi, np.pi, 20000), rng.uniform(0.0, 6.0, 20000)
    stem = np.column_stack([0.15 * np.cos(angle), 0.15 * np.sin(angle), z + 3.7])
    plot = find_stems(PointCloud(stem + rng.normal(0, 0.004, stem.shape)), ground="cloth")
    (one,) = plot.stems
    assert one.foot[2] == pytest.approx(3.7, abs=0.05)
    assert one.dbh == pytest.approx(0.3, rel=0.01)
