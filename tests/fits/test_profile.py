"""An arc between two lines that touch it: its radius where a circle alone is drawn by the lines."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.fits.profile import Profile, fit_profile, tilt_of

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=12, deadline=None)
COUNT = 900
LENGTH = 2.0
"""Length of the lines, in radii."""


def rounded(rng, turn_deg, noise, radius=1.0, way=0.0, count=COUNT):
    """Draw an arc about zero between two lines that touch it; the middle of the arc is at the angle `way`."""
    half = 0.5 * np.radians(turn_deg)
    along = rng.uniform(-half - LENGTH, half + LENGTH, count)
    turn = np.clip(along, -half, half)
    past = along - turn
    points = np.column_stack([np.cos(turn) - past * np.sin(turn), np.sin(turn) + past * np.cos(turn)])
    points = radius * points + noise * radius * rng.standard_normal(points.shape)
    cosine, sine = np.cos(way), np.sin(way)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def plain_circle(points, middle, half, noise):
    """Fit a circle to the points that lie on it, beginning with the arc and some of what goes on from it."""
    wide = np.abs((np.arctan2(points[:, 1], points[:, 0]) - middle + np.pi) % (2 * np.pi) - np.pi)
    on = (wide < half + 0.35) & (np.linalg.norm(points, axis=1) < 1.5)
    center, radius = np.zeros(2), 1.0
    for _ in range(20):
        away = points[on] - center
        design = np.column_stack([2 * away, np.ones(len(away))])
        shift = np.linalg.lstsq(design, (away**2).sum(axis=1), rcond=None)[0]
        center = center + shift[:2]
        radius = np.sqrt(shift[2] + shift[:2] @ shift[:2])
        on = (np.abs(np.linalg.norm(points - center, axis=1) - radius) < 3 * noise) & (wide < half + 0.6)
    return center, float(radius)


@pytest.mark.parametrize("turn_deg", [60, 90, 180])
@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_the_radius_is_that_of_the_arc_where_a_circle_is_too_large(turn_deg, noise):
    found, plain = [], []
    for seed in range(8):
        points = rounded(np.random.default_rng(seed), turn_deg, noise)
        center, radius = plain_circle(points, 0.0, 0.5 * np.radians(turn_deg), noise)
        plain.append(radius)
        profile = fit_profile(points - center, radius, 0.0, noise)
        if profile is None:
            continue
        found.append(profile.radius)
        assert profile.center + center == pytest.approx([0, 0], abs=0.25)
        assert profile.opening == pytest.approx(0.5 * np.radians(turn_deg), abs=0.06)
        if turn_deg < 180:
            assert np.cos(profile.middle) > 0.99
            assert profile.chi_square < 1.5
    assert len(found) > (7 if turn_deg < 180 else 4)
    assert np.median(found) == pytest.approx(1.0, abs=0.07 if (turn_deg, noise) == (60, 0.05) else 0.03)
    # half a turn says more of its width than a piece of it
    assert np.median(plain) > (1.08 if turn_deg < 180 else 1.01)


@laws
@given(seeds, st.floats(0, 2 * np.pi), st.floats(-5, 5))
def test_the_profile_turns_and_grows_with_the_points(seed, way, power):
    noise, scale = 0.03, np.exp(power)
    one = fit_profile(rounded(np.random.default_rng(seed), 90, noise), 1.2, 0.0, noise)
    points = scale * rounded(np.random.default_rng(seed), 90, noise, way=way)
    other = fit_profile(points, 1.2 * scale, way, noise * scale)
    cosine, sine = np.cos(way), np.sin(way)
    assert other.radius == pytest.approx(scale * one.radius, rel=1e-5)
    turned = scale * np.array([[cosine, -sine], [sine, cosine]]) @ one.center
    assert other.center == pytest.approx(turned, abs=1e-5 * scale)
    assert np.cos(other.middle - one.middle - way) == pytest.approx(1.0)
    assert (other.opening, other.gain, other.edge_gain) == pytest.approx(
        (one.opening, one.gain, one.edge_gain), rel=1e-4
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_profile_is_mirrored_with_the_points(seed):
    points = rounded(np.random.default_rng(seed), 90, 0.03)
    one = fit_profile(points, 1.2, 0.0, 0.03)
    other = fit_profile(points * [1, -1], 1.2, 0.0, 0.03)
    assert other.radius == pytest.approx(one.radius, rel=1e-6)
    assert other.center == pytest.approx(one.center * [1, -1], abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_a_round_gains_on_the_edge_and_a_sharp_edge_does_not(seed, noise):
    rng = np.random.default_rng(seed)
    assert gain_on_the_edge(fit_profile(rounded(rng, 90, noise), 1.2, 0.0, noise)) > 40
    # two lines that meet, and the circle that touches both where it would
    along = rng.uniform(-1, 1, COUNT)
    corner = np.array([np.sqrt(2), 0])
    sides = np.where(along[:, None] > 0, [[-1, 1]], [[-1, -1]]) / np.sqrt(2)
    sharp = corner + 3 * np.abs(along[:, None]) * sides + noise * rng.standard_normal((COUNT, 2))
    assert gain_on_the_edge(fit_profile(sharp, 1.0, 0.0, noise)) < 12


def gain_on_the_edge(profile: Profile | None):
    return 0.0 if profile is None else profile.edge_gain


def test_a_circle_has_no_profile():
    rng = np.random.default_rng(0)
    turn = 2 * np.pi * rng.random(COUNT)
    points = np.column_stack([np.cos(turn), np.sin(turn)]) + 0.01 * rng.standard_normal((COUNT, 2))
    profile = fit_profile(points, 1.0, 0.0, 0.01)
    assert profile is None or profile.chi_square > 2


def test_an_arc_with_one_line_or_with_few_points_has_none():
    rng = np.random.default_rng(1)
    points = rounded(rng, 90, 0.02)
    beside = points @ [-np.sin(np.pi / 4), np.cos(np.pi / 4)]
    along = points @ [np.cos(np.pi / 4), np.sin(np.pi / 4)]
    one_line = points[~((beside > 0.05) & (along > 0.9))]
    assert len(points) - len(one_line) > 200
    assert fit_profile(one_line, 1.0, 0.0, 0.02) is None
    assert fit_profile(points[:15], 1.0, 0.0, 0.02) is None
    assert fit_profile(np.empty((0, 2)), 1.0, 0.0, 0.02) is None


@pytest.mark.parametrize("turn_deg", [45, 90, 135, 180, 220])
@pytest.mark.parametrize("start", [0.8, 1.0, 1.25, 1.5])
def test_the_arc_is_the_same_from_any_first_circle(turn_deg, start):
    points = rounded(np.random.default_rng(3), turn_deg, 0.02)
    # it lies on the middle of the arc
    profile = fit_profile(points - [1.0 - start, 0.0], start, 0.0, 0.02)
    assert profile.radius == pytest.approx(1.0, abs=0.03)
    assert profile.center == pytest.approx([start - 1.0, 0.0], abs=0.05)
    assert 2.0 * np.degrees(profile.opening) == pytest.approx(turn_deg, abs=5.0)


@pytest.mark.parametrize("share", [0.2, 0.4])
def test_what_else_lies_about_does_not_draw_the_arc(share):
    rng = np.random.default_rng(4)
    points = rounded(rng, 90, 0.02)
    others = rng.uniform(-2.5, 2.5, (round(share * COUNT), 2))
    profile = fit_profile(np.concatenate([points, others]), 1.2, 0.0, 0.02)
    assert profile.radius == pytest.approx(1.0, abs=0.05)


@laws
@given(seeds, st.floats(-0.03, 0.03), st.floats(-0.03, 0.03))
def test_the_lean_of_the_axis_is_seen_in_the_points(seed, x, y):
    rng = np.random.default_rng(seed)
    points = rounded(rng, 90, 0.02)
    heights = rng.uniform(-2, 2, COUNT)
    profile = fit_profile(points, 1.0, 0.0, 0.02)
    lean = tilt_of(points + heights[:, None] * [x, y], heights, profile, 0.02)
    assert lean == pytest.approx([x, y], abs=0.006)
    assert tilt_of(np.empty((0, 2)), np.empty(0), profile, 0.02) == pytest.approx([0, 0])


def rounded_box(rng, straight, noise, per_radius=110):
    """Draw the outline of a square whose corners are rounded by arcs of radius 1; one arc's centre is zero."""
    quarter = 0.5 * np.pi
    count = round(4 * (quarter + straight) * per_radius)
    along = (quarter + straight) * rng.random(count)
    turn, past = np.minimum(along, quarter), np.maximum(along - quarter, 0.0)
    corner = rng.integers(0, 4, count)
    points = np.column_stack([np.cos(turn) - past * np.sin(turn), np.sin(turn) + past * np.cos(turn)])
    points += 0.5 * straight  # of a square about zero
    sines, cosines = np.array([0, 1, 0, -1])[corner], np.array([1, 0, -1, 0])[corner]
    points = np.column_stack(
        [cosines * points[:, 0] - sines * points[:, 1], sines * points[:, 0] + cosines * points[:, 1]]
    )
    return points - 0.5 * straight + noise * rng.standard_normal((count, 2))


@pytest.mark.parametrize("straight", [0.6, 0.9, 1.5])
@pytest.mark.parametrize("noise", [0.01, 0.025])
def test_what_the_lines_go_on_into_does_not_draw_the_arc(straight, noise):
    found = []
    for seed in range(6):
        points = rounded_box(np.random.default_rng(seed), straight, noise)
        points = points[np.linalg.norm(points, axis=1) < 2.5]
        profile = fit_profile(points + 0.1 * np.sqrt(0.5), 1.1, 0.25 * np.pi, noise)
        assert (profile.reaches < straight + 0.5).all()
        found.append(profile.radius)
    assert np.median(found) == pytest.approx(1.0, abs=0.03)
    assert found == pytest.approx(np.ones(6), abs=0.06)


def test_a_line_counts_as_far_as_it_goes():
    points = rounded(np.random.default_rng(0), 90, 0.02, count=2000)
    assert fit_profile(points, 1.0, 0.0, 0.02).reaches == pytest.approx([2.0, 2.0])
    cut = points[(points @ [-np.sqrt(0.5), -np.sqrt(0.5)] < 1.2)]
    first, last = fit_profile(cut, 1.0, 0.0, 0.02).reaches
    assert sorted([first, last]) == pytest.approx([1.4, 2.0])  # the stretch in which it ends is the last
