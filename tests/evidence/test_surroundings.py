"""What lies inside and just outside of a surface: caps and other walls are forgiven, clutter is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.evidence.measures import Shell
from cylx.evidence.surroundings import ball_share, emptiness

RADIUS = 1.0
laws = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def wall(rng, half, count, radius=RADIUS, sigma=0.004, turn_deg=360.0):
    """Draw heights, distances and angles of points on a wall."""
    distances = radius + sigma * rng.standard_normal(count)
    return rng.uniform(-half, half, count), distances, np.radians(turn_deg) * (rng.random(count) - 0.5)


def cap(rng, height, inner, outer, count, sigma=0.004):
    """Draw from a ring across the axis."""
    distances = np.sqrt(rng.uniform(inner**2, outer**2, count))
    return height + sigma * rng.standard_normal(count), distances, rng.uniform(-np.pi, np.pi, count)


def measured(*parts, half, deviation=0.004, flat=False):
    """Give the points inside and outside, as shares; `flat` says which part is of planes."""
    heights, distances, angles = (np.concatenate(column) for column in zip(*parts, strict=True))
    kept = np.abs(heights) <= half
    of_planes = np.concatenate([np.full(len(part[0]), flat and k > 0) for k, part in enumerate(parts)])[kept]
    residuals = distances[kept] - RADIUS
    on = (np.abs(residuals) < 3 * deviation) & ~of_planes
    shell = Shell(np.arange(kept.sum()), heights[kept] / half, residuals, angles[kept], on, of_planes, deviation)
    return emptiness(shell, RADIUS, half)


@laws
@given(seeds, st.floats(0.05, 3.0))
def test_a_bare_wall_is_empty(seed, half):
    rng = np.random.default_rng(seed)
    assert measured(wall(rng, half, 2000), half=half) == (0.0, 0.0)


@laws
@given(seeds, st.floats(0.05, 0.5), st.booleans(), st.booleans())
def test_caps_and_plates_at_the_ends_do_not_count(seed, half, plates, both):
    rng = np.random.default_rng(seed)
    limits = (RADIUS, 2.5) if plates else (0.0, RADIUS)
    ends = [cap(rng, sign * half, *limits, 4000) for sign in ((-1, 1) if both else (1,))]
    assert max(measured(wall(rng, half, 800), *ends, half=half)) < 0.03


@pytest.mark.parametrize("seed", range(3))
def test_plates_that_the_noise_spreads_over_much_of_a_disc_hardly_count(seed):
    rng, half, sigma = np.random.default_rng(seed), 0.1, 0.025
    plates = [cap(rng, sign * half, RADIUS, 1.5, 4000, sigma) for sign in (-1, 1)]
    bare = wall(rng, half, 1600, sigma=sigma)
    beside = measured(bare, *plates, half=half, deviation=sigma)[1]
    # as many points all over the height count much more
    spread = [(rng.uniform(-half, half, 4000), *one[1:]) for one in plates]
    assert 3 * beside < measured(bare, *spread, half=half, deviation=sigma)[1]


@pytest.mark.parametrize("half", [0.1, 0.5, 2.0])
def test_what_fills_it_counts(half):
    rng = np.random.default_rng(1)
    filled = rng.uniform(-half, half, 4000), np.sqrt(rng.random(4000)), rng.uniform(-np.pi, np.pi, 4000)
    inside, outside = measured(wall(rng, half, 800), filled, half=half)
    assert inside > 0.3
    assert outside < 0.05


@pytest.mark.parametrize("radius", [1.1, 1.25, 1.45])
@pytest.mark.parametrize("half", [1.0, 3.0])
def test_an_outer_wall_does_not_count(radius, half):
    rng = np.random.default_rng(2)
    assert measured(wall(rng, half, 2000), wall(rng, half, 2000, radius), half=half) == (0.0, 0.0)


@pytest.mark.parametrize("turn_deg", [60, 180])
def test_a_piece_of_a_wall_is_no_outer_wall(turn_deg):
    rng = np.random.default_rng(3)
    _, outside = measured(wall(rng, 1.0, 2000), wall(rng, 1.0, 1000, 1.2, turn_deg=turn_deg), half=1.0)
    assert outside > 0.3


def test_clutter_about_a_rough_thing_counts_though_much_of_it_is_as_far_off():
    rng = np.random.default_rng(4)
    rough, sigma = wall(rng, 2.0, 2000, sigma=0.05), 0.05
    clutter = wall(rng, 2.0, 2000, 1.3, sigma=0.05)
    assert measured(rough, half=2.0, deviation=sigma)[1] < 0.05
    assert measured(rough, clutter, half=2.0, deviation=sigma)[1] > 0.5
    # the same about a smooth one would be a wall
    assert measured(wall(rng, 2.0, 2000), wall(rng, 2.0, 2000, 1.3), half=2.0)[1] == 0.0


def test_points_of_planes_outside_do_not_count():
    rng = np.random.default_rng(5)
    beside = rng.uniform(-2, 2, 3000), rng.uniform(1.05, 1.4, 3000), rng.uniform(-0.5, 0.5, 3000)
    assert measured(wall(rng, 2.0, 2000), beside, half=2.0)[1] > 0.5
    assert measured(wall(rng, 2.0, 2000), beside, half=2.0, flat=True)[1] == 0.0


def test_without_points_on_it_a_surface_is_not_empty():
    rng = np.random.default_rng(6)
    assert measured(wall(rng, 1.0, 100, radius=2.0), half=1.0) == (1.0, 1.0)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_unit_is_no_matter(scale):
    rng = np.random.default_rng(7)
    heights, distances, angles = (
        np.concatenate(both) for both in zip(wall(rng, 1.0, 500), cap(rng, 0.1, 0, 1, 500), strict=True)
    )
    none = np.zeros(len(heights), bool)
    one, other = (
        emptiness(Shell(np.arange(len(heights)), heights, k * (distances - 1), angles, ~none, none, 0.004 * k), k, k)
        for k in (1.0, scale)
    )
    assert one == pytest.approx(other)


def spokes(rng, count, half, each=300):
    """Draw the sides of webs that go inwards from a wall."""
    way = 2 * np.pi * rng.integers(0, count, count * each) / count + rng.choice([-0.06, 0.06], count * each)
    distances = rng.uniform(0.3, 1.0, count * each)
    return rng.uniform(-half, half, count * each), distances, (way + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("half", [0.3, 1.0])
def test_spokes_and_webs_do_not_count(count, half):
    rng = np.random.default_rng(0)
    assert measured(wall(rng, half, 3000), spokes(rng, count, half), half=half)[0] < 0.05


def test_what_lies_about_on_most_sides_counts():
    rng = np.random.default_rng(0)
    inside, _ = measured(wall(rng, 1.0, 3000), spokes(rng, 40, 1.0), half=1.0)
    assert inside > 0.5


def balls_share(parts, half, deviation=0.004):
    """Give how much of a ball goes on beside a band about the z axis."""
    heights, distances, angles = (np.concatenate(column) for column in zip(*parts, strict=True))
    points = np.column_stack([distances * np.cos(angles), distances * np.sin(angles), heights])
    model = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, RADIUS])
    return ball_share(points, model, half, deviation)


@laws
@given(seeds, st.floats(0.1, 0.3))
def test_a_ball_goes_on_above_or_below_its_band(seed, half):
    rng = np.random.default_rng(seed)
    heights = RADIUS * rng.uniform(-0.3, 1.0, 6000)  # equal heights of a ball have equal areas
    distances = np.sqrt(RADIUS**2 - heights**2)
    ball = heights, distances + 0.004 * rng.standard_normal(6000), rng.uniform(-np.pi, np.pi, 6000)
    assert balls_share([ball], half) > 0.7


@laws
@given(seeds, st.floats(0.1, 0.3), st.floats(0.3, 0.9))
def test_neither_walls_about_the_same_axis_nor_plates_are_a_ball(seed, half, smaller):
    rng = np.random.default_rng(seed)
    short = wall(rng, half, 2000)
    longer = wall(rng, RADIUS, int(2000 * smaller / half), smaller)
    assert balls_share([short, cap(rng, half, smaller, RADIUS, 1000), longer], half) < 0.3
    assert balls_share([short, cap(rng, half, 0.0, 3.0, 9000)], half) < 0.1
    box = rng.uniform(-RADIUS, RADIUS, (3, 9000))
    filled = box[2], np.hypot(box[0], box[1]), np.arctan2(box[1], box[0])
    assert balls_share([short, filled], half) < 0.3
