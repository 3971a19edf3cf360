"""Surfaces as they are: short, small, concentric, rounded, rough, and with a noise that is known badly."""

import numpy as np
import pytest

from cylx import extract


def wall(count, radius, height, rng, middle=(0.0, 0.0)):
    """Draw from a cylinder about the z axis, from zero up."""
    turn = 2 * np.pi * rng.random(count)
    around = np.array(middle) + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.column_stack([around, height * rng.random(count)])


def face(count, side, height, rng, hole=0.0):
    """Draw from a square with a round hole."""
    points = np.column_stack([side * (rng.random((count, 2)) - 0.5), np.full(count, height)])
    return points[np.linalg.norm(points[:, :2], axis=1) > hole]


def cap(count, radius, height, rng):
    """Draw from a disc."""
    turn, away = 2 * np.pi * rng.random(count), radius * np.sqrt(rng.random(count))
    return np.column_stack([away * np.cos(turn), away * np.sin(turn), np.full(count, height)])


def noisy(points, sigma, rng):
    """Add noise, and look at it from anywhere."""
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return (points + sigma * rng.standard_normal(points.shape)) @ turn.T


def radii(extraction):
    return sorted(fit.cylinder.radius for fit in extraction.cylinders)


@pytest.mark.parametrize("seed", range(2))
def test_a_bore_of_eighty_points_is_found(seed):
    rng = np.random.default_rng(seed)
    plate = np.concatenate([face(6000, 6.0, z, rng, hole=0.22) for z in (0.0, 0.4)])
    found = extract(noisy(np.concatenate([plate, wall(80, 0.22, 0.4, rng)]), 0.0, rng))
    assert radii(found) == pytest.approx([0.22], rel=0.01)
    assert found.cylinders[0].cylinder.height == pytest.approx(0.4, rel=0.15)


@pytest.mark.parametrize("seed", range(2))
def test_a_disc_is_found_by_its_rim(seed):
    rng = np.random.default_rng(seed)
    disc = np.concatenate([wall(1500, 1.0, 0.15, rng), cap(4000, 1.0, 0.0, rng), cap(4000, 1.0, 0.15, rng)])
    found = extract(noisy(disc, 0.0, rng))
    assert radii(found) == pytest.approx([1.0], rel=0.01)
    assert found.cylinders[0].cylinder.height == pytest.approx(0.15, rel=0.1)


@pytest.mark.parametrize("inner", [0.6, 0.8])
@pytest.mark.parametrize("sigma", [0.0, 0.003])
def test_the_walls_of_an_open_tube_are_two_cylinders(inner, sigma):
    rng = np.random.default_rng(3)
    tube = np.concatenate([wall(3500, 1.0, 4.0, rng), wall(3000, inner, 4.0, rng)])
    assert radii(extract(noisy(tube, sigma, rng))) == pytest.approx([inner, 1.0], rel=0.005)


@pytest.mark.parametrize("sigma", [0.002, 0.006])
def test_a_pipe_that_lies_on_a_floor_is_a_cylinder(sigma):
    rng = np.random.default_rng(4)
    pipe = wall(3500, 0.3, 5.0, rng)
    pipe = np.column_stack([pipe[:, 2] - 2.5, pipe[:, 0], pipe[:, 1] + 0.3])
    found = extract(noisy(np.concatenate([face(5000, 8.0, 0.0, rng), pipe]), sigma, rng))
    assert radii(found) == pytest.approx([0.3], rel=0.01)
    assert not found.blends


def test_a_rounded_edge_is_found_once_with_its_radius():
    """A quarter of a turn between two planes; whether it counts as a cylinder or as a blend is left open here."""
    rng = np.random.default_rng(6)
    turn = 0.5 * np.pi * rng.random(3000)
    edge = np.column_stack([np.cos(turn), np.sin(turn), 8 * rng.random(3000)])
    away, up, along = 3 * rng.random(6000), 8 * rng.random(6000), np.ones(6000)
    sides = [np.column_stack([along, -away, up]), np.column_stack([-away, along, up])]
    found = extract(noisy(np.concatenate([edge, *sides]), 0.002, rng))
    kinds = [*found.cylinders, *found.blends]
    assert len(kinds) == 1
    assert kinds[0].cylinder.radius == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize("roughness", [0.02, 0.04])
def test_bark_makes_no_tree_less_of_a_stem(roughness):
    """Deviations from the radius that neighbours share, as large as four noises; it has no other shape."""
    rng = np.random.default_rng(3)
    stem = wall(15000, 1.0, 6.0, rng)
    waves, phases = rng.standard_normal((200, 3)), 2 * np.pi * rng.random(200)
    bark = 1 + roughness * np.sqrt(2 / 200) * np.cos(stem @ waves.T + phases).sum(axis=1)
    found = extract(noisy(stem * np.column_stack([bark, bark, np.ones(len(bark))]), 0.01, rng))
    assert radii(found) == pytest.approx([1.0], rel=0.03)
    assert found.cylinders[0].cylinder.height == pytest.approx(6.0, rel=0.05)


@pytest.mark.parametrize("given", [["scene.noise=0.0033"], ["scene.noise=0.01"], ["scene.noise=0.03"], []])
def test_a_noise_that_is_given_wrong_by_three_changes_nothing(given):
    rng = np.random.default_rng(5)
    scene = [wall(4000, 0.5, 3.0, rng, (-1.5, 0)), wall(2500, 0.25, 3.0, rng, (1.5, 0)), face(5000, 9.0, 0.0, rng)]
    points = noisy(np.concatenate(scene), 0.01, rng)
    assert radii(extract(points, overrides=given)) == pytest.approx([0.25, 0.5], rel=0.01)


SPACING_OF_BARS = 0.4


def rounded_bar(rng, wide, high, length, sigma):
    """Draw points of a bar with edges of radius one, evenly over its four sides; its ends are open."""
    flats, quarter = np.array([wide, high, wide, high]), 0.5 * np.pi
    lengths = np.ravel(np.column_stack([flats, np.full(4, quarter)]))
    count = int(lengths.sum() * length / SPACING_OF_BARS**2)
    s = rng.uniform(0.0, lengths.sum(), count)
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    which = np.clip(np.searchsorted(starts, s, "right") - 1, 0, 7)
    s, side = s - starts[which], which // 2
    turn = side * quarter
    corner = 0.5 * np.array([[wide, high], [-wide, high], [-wide, -high], [wide, -high]])
    # each flat ends where the next edge begins; they go about the bar from its upper side on, leftwards
    flat = which % 2 == 0
    along = np.column_stack([-np.cos(turn), -np.sin(turn)])
    out = np.column_stack([-np.sin(turn), np.cos(turn)])
    angle = turn + quarter + s
    points = np.where(
        flat[:, None],
        corner[side] + out + s[:, None] * along,
        corner[(side + 1) % 4] + np.column_stack([np.cos(angle), np.sin(angle)]),
    )
    whole = np.column_stack([points, rng.uniform(-0.5 * length, 0.5 * length, count)])
    return whole + sigma * rng.standard_normal((count, 3))


@pytest.mark.parametrize("wide", [1.0, 2.0, 6.0])
def test_each_rounded_edge_of_a_bar_is_a_blend_of_its_own(wide):
    rng = np.random.default_rng(5)
    points = rounded_bar(rng, wide, 12.0, 40.0, 0.2 * SPACING_OF_BARS)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    found = extract(points @ turn)
    assert found.cylinders == ()
    corners = np.array([[x, y, 0.0] for x in (-0.5 * wide, 0.5 * wide) for y in (-6.0, 6.0)]) @ turn
    axis = turn[2]
    met = set()
    for blend in found.blends:
        away = np.asarray(blend.cylinder.point) - corners
        away -= np.outer(away @ axis, axis)
        distances = np.linalg.norm(away, axis=1)
        assert distances.min() < 0.2
        assert blend.cylinder.radius == pytest.approx(1.0, abs=0.12)
        met.add(int(distances.argmin()))
    assert len(met) >= 3
    assert len(found.blends) == len(met)
