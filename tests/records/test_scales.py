"""A cloud at one scale: a point of each voxel, and all that were thinned behind it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.config import Config
from cylx.fits.robust import WeightSchedule, fit_cylinder
from cylx.geometry.morton import gather_ball
from cylx.records import Scale
from cylx.scene import make_frame
from cylx.synthetic import multi, single

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=20, deadline=None)


@pytest.fixture(scope="module")
def frame():
    return make_frame(multi(points=4000, cylinders=2, seed=5).points, Config())[0]


def drawn(frame, seed, scale):
    """Give an octave of a part of the cloud, which part it is, and a generator."""
    rng = np.random.default_rng(seed)
    keep = rng.random(len(frame.points)) < rng.choice([0.05, 0.5, 1.0])
    return Scale.of(frame, frame.window * 1.6**scale, keep), keep, rng


def full_voxels(frame, keep, side):
    """Give the voxels that a surface more than touches: an eighth of the points of the fullest one in their block."""
    voxels, counts = np.unique(np.floor(frame.points[keep] / side).astype(int), axis=0, return_counts=True)
    fullest = {}
    for voxel, count in zip(voxels >> 2, counts, strict=True):
        fullest[tuple(voxel)] = max(count, fullest.get(tuple(voxel), 0))
    return {tuple(v) for v, count in zip(voxels, counts, strict=True) if 8 * count >= fullest[tuple(v >> 2)]}


def voxel_side(frame, radius):
    """Give the widest voxel that fits into the radius six times, in powers of two of the smallest window's."""
    side = frame.window / 6
    while 12 * side <= radius:
        side *= 2
    return side


@laws
@given(seed=seeds, scale=st.integers(0, 6))
def test_there_is_one_point_of_each_voxel(frame, seed, scale):
    found, keep, _ = drawn(frame, seed, scale)
    side = voxel_side(frame, found.radius)
    assert np.isclose(frame.unit * 2**found.level, side)
    assert found.radius / 12 < side * (1 + 1e-9) <= found.radius / 6 * (1 + 2e-9)
    own = [tuple(voxel) for voxel in np.floor(frame.points[found.indices] / side).astype(int)]
    assert len(set(own)) == len(own)
    assert set(own) == full_voxels(frame, keep, side)
    assert keep[found.indices].all()
    assert np.array_equal(found.points, frame.points[found.indices])
    assert np.array_equal(found.codes, frame.codes[found.indices])
    assert (np.diff(found.codes) >= 0).all()


@laws
@given(seed=seeds, scale=st.integers(0, 6))
def test_the_members_are_the_kept_points_each_in_the_voxel_of_its_own(frame, seed, scale):
    found, keep, _ = drawn(frame, seed, scale)
    side = voxel_side(frame, found.radius)
    full = full_voxels(frame, keep, side)
    inside = [tuple(voxel) in full for voxel in np.floor(frame.points / side).astype(int)]
    assert np.array_equal(found.members, np.flatnonzero(keep & inside))
    assert found.runs[0] == 0
    assert found.runs[-1] == len(found.members)
    assert (np.diff(found.runs) > 0).all()
    owner = np.repeat(np.arange(len(found.points)), np.diff(found.runs))
    assert np.array_equal(frame.codes[found.members] >> 3 * found.level, (found.codes >> 3 * found.level)[owner])
    assert all(found.indices[i] in found.members[found.runs[i] : found.runs[i + 1]] for i in range(len(found.points)))


@laws
@given(seed=seeds, scale=st.integers(0, 6))
def test_balls_are_gathered_from_the_thinned_points(frame, seed, scale):
    found, _, rng = drawn(frame, seed, scale)
    room = np.empty(len(found.points), np.int64)
    for i in rng.integers(0, len(found.points), 10):
        n = gather_ball(found.points, found.cells, found.starts, found.side, found.points[i], found.radius, room)
        near = np.linalg.norm(found.points - found.points[i], axis=1) <= found.radius
        assert np.array_equal(np.sort(room[:n]), np.flatnonzero(near))


@laws
@given(seed=seeds, scale=st.integers(0, 6))
def test_what_is_marked_spreads_to_the_voxel_and_no_further(frame, seed, scale):
    found, keep, rng = drawn(frame, seed, scale)
    marks, out = rng.random(len(found.points)) < 0.4, rng.random(len(frame.points)) < 0.1
    before = out.copy()
    found.spread(marks, out)
    voxels = frame.codes >> 3 * found.level
    expected = keep & np.isin(voxels, voxels[found.indices[marks]])
    assert np.array_equal(out, before | expected)


@laws
@given(seed=seeds, scale=st.integers(0, 6), enough=st.integers(1, 300))
def test_seeds_lie_in_cells_of_their_own_and_in_smaller_ones_where_there_are_too_few(frame, seed, scale, enough):
    found, _, rng = drawn(frame, seed, scale)
    for keep in (None, rng.random(len(found.points)) < 0.3):
        chosen = found.seeds(enough, keep)
        allowed = np.ones(len(found.points), bool) if keep is None else keep
        assert allowed[chosen].all()
        assert (np.diff(chosen) > 0).all()
        numbers = [len(np.unique(found.codes[allowed] >> 3 * (found.level + shift))) for shift in (4, 3, 2)]
        widest = next((shift for shift, number in zip((4, 3, 2), numbers, strict=True) if number >= enough), 2)
        cells = found.codes[chosen] >> 3 * (found.level + widest)
        assert len(np.unique(cells)) == len(chosen) == numbers[4 - widest]


def test_the_same_points_make_the_same_octaves_in_any_order(frame):
    order = np.random.default_rng(1).permutation(len(frame.points))
    other = make_frame((frame.points * frame.spacing + frame.origin)[order], Config())[0]
    whole = np.ones(len(order), bool)
    for radius in frame.window_radii(1.6):
        plain, again = Scale.of(frame, radius, whole), Scale.of(frame, radius, whole)
        for name in ("points", "codes", "indices", "cells", "starts", "members", "runs"):
            assert np.array_equal(getattr(plain, name), getattr(again, name)), name
        mixed = Scale.of(other, radius * other.window / frame.window, whole)
        assert np.allclose(mixed.points, plain.points, rtol=0, atol=1e-9)


def test_nothing_to_keep_is_an_empty_octave(frame):
    empty = Scale.of(frame, frame.window, np.zeros(len(frame.points), bool))
    assert len(empty.points) == len(empty.members) == len(empty.seeds(10)) == 0
    assert empty.runs.tolist() == [0]


@pytest.mark.parametrize("seed", range(4))
def test_thinning_does_not_bend_a_narrow_arc(seed):
    scene = single(points=10000, sigma=0.005, theta_deg=30, seed=seed)
    cloud = make_frame(scene.points, Config())[0]
    scale = Scale.of(cloud, cloud.window_radii(1.6)[-1], np.ones(len(cloud.points), bool))
    thinned = scene.points[cloud.order[scale.indices]]
    assert len(thinned) < 600
    wide = WeightSchedule(1e3, 1e3, 1.0, np.inf)
    fit = fit_cylinder(thinned, np.array([0, 0, 0, 0, 0, 1, 1.0]), low=-9, high=9, schedule=wide, steps=60)
    sd = 26.8 * 0.005 / (np.sqrt(len(thinned)) * np.radians(30) ** 2)  # of the radius, at the bound for narrow arcs
    assert abs(fit[0][6] - 1) < 3.5 * sd
