"""What the candidates say of a cylinder: the quick search by place against a look at all of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.game.agreement import (
    AGREEING,
    BESIDE,
    CONCENTRIC,
    ENOUGH_WINDOWS,
    LEAST_TELLING_SHARE,
    LIKE_RADIUS,
    TOUCHING,
    Neighbourhood,
    is_contradicted,
)
from cylx.records import Candidates, Segment

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=60, deadline=None)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def a_segment(rng):
    """Give a cylinder; its axis is often one of the coordinates, where a search by place has its corners."""
    direction = unit(rng.standard_normal(3)) if rng.random() < 0.6 else np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
    model = np.array([*(5 * rng.standard_normal(3)), *direction, np.exp(rng.uniform(-2, 1))])
    return Segment(model, np.exp(rng.uniform(-2, 2)), 0.0)


def models_about(rng, segment, count):
    """Give candidates that mostly are the cylinder, some hardly and some not at all, all along it and beside."""
    point, direction, radius = segment.point, segment.direction, segment.radius
    sloppy = rng.choice([0.0, 0.05, 0.3, 2.0], (count, 1))
    points = point + 1.6 * segment.half * rng.uniform(-1, 1, (count, 1)) * direction
    points = points + radius * sloppy * rng.standard_normal((count, 3))
    directions = unit(direction + 0.5 * sloppy * rng.standard_normal((count, 3))) * rng.choice([-1, 1], (count, 1))
    radii = radius * np.exp(0.5 * sloppy[:, 0] * rng.standard_normal(count))
    return np.column_stack([points, directions, radii])


def candidates_about(rng, segment, count=200):
    windows = segment.radius * np.exp(rng.uniform(-2, 2, count))
    return Candidates(models_about(rng, segment, count), np.arange(count), np.zeros(count), np.full(count, 20), windows)


def distances(points, segment):
    """Give heights and distances from the axis."""
    offsets = points - segment.point
    heights = offsets @ segment.direction
    return heights, np.linalg.norm(offsets - heights[:, None] * segment.direction, axis=1)


def same(models, segment, offset, cosine, radius):
    """Tell which models agree with a cylinder; offset in its radii."""
    _, apart = distances(models[:, :3], segment)
    turns = np.abs(models[:, 3:6] @ segment.direction)
    alike = (apart < offset * segment.radius) & (turns > cosine) & (np.abs(models[:, 6] / segment.radius - 1) < radius)
    return alike & touching(models, segment)


def touching(models, segment):
    """Tell which models may touch a cylinder where their windows are: axes lie as far apart as radii differ."""
    _, apart = distances(models[:, :3], segment)
    return np.abs(apart - np.abs(models[:, 6] - segment.radius)) <= TOUCHING * segment.radius


@laws
@given(seeds)
def test_agreement_is_that_of_all_candidates_of_the_best_scale(seed):
    rng = np.random.default_rng(seed)
    segment = a_segment(rng)
    candidates = candidates_about(rng, segment)
    heights, apart = distances(candidates.points, segment)
    least = LEAST_TELLING_SHARE * min(segment.radius, 1.2 * segment.half)
    near = (candidates.windows > least) & (np.abs(heights) < segment.half) & (apart < segment.radius)
    near &= touching(candidates.models, segment)
    # a pipe on the same axis that is much thinner or thicker is another one
    ratio = candidates.radii / segment.radius
    near &= (ratio > LIKE_RADIUS) & (ratio < 1 / LIKE_RADIUS)  # and of a detail: a rim, a dent
    near &= ~(
        same(candidates.models, segment, *AGREEING[:2], np.inf) & ((ratio <= CONCENTRIC) | (ratio >= 1 / CONCENTRIC))
    )
    agreeing = near & same(candidates.models, segment, *AGREEING)
    scales = np.clip(np.log2(candidates.windows / least), 0, 7).astype(int)
    counts = [(int(agreeing[scales == k].sum()), int(near[scales == k].sum())) for k in range(8)]
    told = [count for count in counts if count[1] >= ENOUGH_WINDOWS]
    expected = max(told, key=lambda c: (c[0] + 1) / (c[1] + 2)) if told else (int(agreeing.sum()), int(near.sum()))
    assert Neighbourhood(candidates).agreement(segment) == expected


UPRIGHT = np.array([0.0, 0, 0, 0, 0, 1, 1])
"""A cylinder of radius 1 about the z axis."""


def windows_on(model, count, *, size, inliers=100, radius=1.0):
    """Give windows laid evenly about a cylinder, of a size and a number of points, that say one radius."""
    turns = 2 * np.pi * np.arange(count) / count
    out = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(count)])
    models = np.column_stack([(model[6] - radius) * out, np.tile(model[3:6], (count, 1)), np.full(count, radius)])
    return Candidates(
        models, np.arange(count), np.zeros(count), np.full(count, inliers), np.full(count, size), model[6] * out
    )


def test_one_scale_at_which_the_windows_agree_is_enough():
    # large windows on the wall of a tube see its other wall, too: they say another radius
    segment = Segment(UPRIGHT, 2.0, 0.001)
    good, mixed = windows_on(UPRIGHT, 20, size=0.2), windows_on(UPRIGHT, 40, size=0.6, radius=0.85)
    assert Neighbourhood(Candidates.joined([good, mixed])).agreement(segment) == (20, 20)
    assert Neighbourhood(mixed).agreement(segment) == (0, 40)


@pytest.mark.parametrize("spread", [1e-4, 1e-3])
def test_windows_on_the_other_wall_have_no_say(spread):
    segment = Segment(UPRIGHT, 2.0, spread)
    inner = windows_on(np.array([0.0, 0, 0, 0, 0, 1, 0.88]), 40, size=0.2, radius=0.88)
    assert Neighbourhood(inner).agreement(segment) == (0, 0)
    assert Neighbourhood(Candidates.joined([inner, windows_on(UPRIGHT, 9, size=0.2)])).agreement(segment) == (9, 9)
    # of a rough average, which has no spread yet, nobody knows on which wall it lies
    assert Neighbourhood(inner).agreement(Segment(UPRIGHT, 2.0, 0.0)) == (0, 40)


@pytest.mark.parametrize(("inliers", "told"), [(25, False), (100, False), (2500, True)])
def test_windows_that_the_noise_blurs_have_no_say(inliers, told):
    # 2 deviations over w^2 sqrt(n) is to be 0.08 of the curvature at most
    segment = Segment(UPRIGHT, 2.0, 0.04)
    blurred = windows_on(UPRIGHT, 20, size=0.2, inliers=inliers, radius=0.7)
    assert (Neighbourhood(blurred).agreement(segment)[1] > 0) == told
    assert Neighbourhood(windows_on(UPRIGHT, 20, size=0.95, inliers=inliers)).agreement(segment) == (20, 20)


@laws
@given(seeds, st.floats(0.01, 1.0), st.floats(1, 60), st.floats(0.01, 0.9))
def test_those_who_agree_are_all_who_do_and_are_alive(seed, offset, angle_deg, radius):
    rng = np.random.default_rng(seed)
    segment = a_segment(rng)
    candidates = candidates_about(rng, segment)
    alive = rng.random(len(candidates)) < 0.7
    heights, apart = distances(candidates.points, segment)
    near = (np.abs(heights) < segment.half + segment.radius) & (apart < segment.radius)
    expected = near & alive & same(candidates.models, segment, offset, np.cos(np.radians(angle_deg)), radius)
    found = Neighbourhood(candidates).agreeing(segment, alive, offset, angle_deg, radius)
    assert np.array_equal(np.sort(found), np.flatnonzero(expected))


@laws
@given(seeds, st.floats(-3, 3))
def test_counts_do_not_know_unit_place_or_order(seed, exponent):
    rng = np.random.default_rng(seed)
    segment = a_segment(rng)
    candidates = candidates_about(rng, segment)
    scale, shift = 2.0 ** round(3 * exponent), rng.standard_normal(3)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]

    def moved(models):
        return np.column_stack([scale * models[:, :3] @ turn.T + shift, models[:, 3:6] @ turn.T, scale * models[:, 6]])

    order = rng.permutation(len(candidates))
    others = candidates.take(order)
    others = Candidates(moved(others.models), others.parents, others.extents, others.inliers, scale * others.windows)
    there = Segment(moved(segment.model[None])[0], scale * segment.half, 0.0)
    near, near_there = Neighbourhood(candidates), Neighbourhood(others)
    assert near_there.agreement(there) == near.agreement(segment)
    alive = np.ones(len(candidates), bool)
    there_too = order[near_there.agreeing(there, alive, 0.3, 10.0, 0.2)]
    assert set(there_too) == set(near.agreeing(segment, alive, 0.3, 10.0, 0.2))


@laws
@given(seeds)
def test_windows_count_only_where_they_were_laid_on_the_surface(seed):
    rng = np.random.default_rng(seed)
    segment = a_segment(rng)
    candidates = candidates_about(rng, segment)
    across = unit(np.cross(segment.direction, rng.standard_normal((len(candidates), 3))))
    height = segment.half * rng.choice([0.5, 1.5], len(candidates))
    distance = segment.radius * (1 + BESIDE * rng.choice([-2, -0.9, 0, 0.9, 2], len(candidates)))
    places = segment.point + height[:, None] * segment.direction + distance[:, None] * across
    on = (height < segment.half) & (np.abs(distance / segment.radius - 1) < BESIDE)
    everywhere = segment.point + segment.radius * across
    assert Neighbourhood(replace(candidates, places=places)).agreement(segment) == Neighbourhood(
        replace(candidates.take(on), places=everywhere[on])
    ).agreement(segment)


def test_a_window_of_an_unknown_place_counts():
    segment = Segment(np.array([0.0, 0, 0, 0, 0, 1, 1]), 2.0, 0.0)
    candidates = Candidates(np.tile(segment.model, (9, 1)), np.arange(9), np.zeros(9), np.full(9, 20), np.ones(9))
    assert np.isnan(candidates.places).all()
    assert Neighbourhood(candidates).agreement(segment) == (9, 9)


def test_nobody_says_nothing():
    segment = Segment(np.array([0.0, 0, 0, 0, 0, 1, 1]), 2.0, 0.0)
    assert Neighbourhood(Candidates.joined([])).agreement(segment) == (0, 0)
    assert len(Neighbourhood(Candidates.joined([])).agreeing(segment, np.zeros(0, bool), 0.1, 5.0, 0.1)) == 0


@pytest.mark.parametrize(
    ("counts", "contradicted"),
    [((0, 0), False), ((0, 11), False), ((0, 12), True), ((1, 12), True), ((2, 12), False), ((4, 30), False),
     ((4, 31), True), ((16, 100), False), ((16, 101), True), ((100, 500), False), ((1000, 3000), False)],
)  # fmt: skip
def test_few_who_agree_among_many_contradict(counts, contradicted):
    assert is_contradicted(counts) is contradicted


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 300), st.integers(0, 300))
def test_more_who_agree_never_contradict_more(consistent, others):
    near = consistent + others
    if not is_contradicted((consistent, near)):
        assert not is_contradicted((consistent + 1, near + 1))
        assert others == 0 or not is_contradicted((consistent + 1, near))
    assert not is_contradicted((max(consistent, near // 3), near))
