"""Scenes that used to mislead, from end to end: rings, rods, zeros, walls in walls, forks, elbows and fillets.

Each kind of `../shared/cases` comes with variations of it that are made here.
"""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cylx.api import extract

CASES = Path(__file__).resolve().parents[2] / "shared" / "cases"
needs_cases = pytest.mark.skipif(
    not (CASES.exists() or os.environ.get("CI") == "true"), reason="the cases of ../shared/cases are not here"
)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Return a function that gives a cloud of a case, which is made once."""

    @cache
    def make(name):
        folder = tmp_path_factory.mktemp(name)
        surroundings = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        subprocess.run([sys.executable, CASES / name / "make.py"], cwd=folder, env=surroundings, check=True)
        return folder

    return lambda name, file: np.load(make(name) / f"{file}.npy").astype(np.float64)


def pipe(rng, point, axis, radius, height, step, noise=0.0, arc_deg=360.0):
    """Draw a pipe; of less than a full turn it is the side towards the third of its axes."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    count = round(np.radians(arc_deg) * radius * height / step**2)
    second = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    second /= np.linalg.norm(second)
    first = np.cross(second, axis)
    turn, z = np.radians(arc_deg) * (rng.random(count) - 0.5), height * (rng.random(count) - 0.5)
    own = radius + noise * rng.standard_normal(count)
    across = (own * np.cos(turn))[:, None] * first + (own * np.sin(turn))[:, None] * second
    return np.asarray(point, float) + across + z[:, None] * axis


def plate(rng, middle, sides, step, noise=0.0, hole=0.0):
    """Draw a plate across the z axis, with a hole in its middle."""
    points = np.array([*sides, 0.0]) * (rng.random((round(sides[0] * sides[1] / step**2), 3)) - 0.5)
    points = points[np.linalg.norm(points, axis=1) >= hole]
    points[:, 2] = noise * rng.standard_normal(len(points))
    return points + middle


def shapes(points):
    """Give the cylinders that are found in points."""
    return [fit.cylinder for fit in extract(points).cylinders]


def radii(found):
    return sorted(round(one.radius, 6) for one in found)


def assert_are(found, known, within=0.02):
    """Expect as many cylinders, each with a point of the axis, the direction and the radius of a known one."""
    assert radii(found) == pytest.approx(sorted(radius for _, _, radius in known), rel=within)
    assert_have(found, known, within)


def assert_have(found, known, within=0.02):
    """Expect each of the known ones among those found, once."""
    for point, along, radius in known:
        axis = np.asarray(along, float) / np.linalg.norm(along)
        near = [
            one
            for one in found
            if np.linalg.norm(np.cross(one.point - point, axis)) < max(2 * within, 0.05) * radius
            and np.linalg.norm(np.cross(one.direction, axis)) < 0.02
            and abs(one.radius / radius - 1) < within
        ]
        assert len(near) == 1, (point, axis, radius)


@needs_cases
@pytest.mark.parametrize("file", ["frames1", "frames5"])
def test_pillars_are_found_in_one_turn_of_a_scanner_and_in_several(case, file):
    pillars = [((3, 0.5, 0), UP, 0.3), ((-2, 4.5, 0), UP, 0.3), ((-5, -5, 0), UP, 0.3)]
    found = shapes(case("velodyne-accumulated", file))
    assert_have(found, pillars, within=0.04)
    assert file == "frames5" or len(found) == 3


def turns_of_a_scanner(seed, turns, pillars, noise):
    """Scan pillars in a square room by rings of beams, several times from one place."""
    rng, out = np.random.default_rng(seed), []
    elevation = np.radians(np.arange(-12, 13, 3.0))
    for _ in range(turns):
        azimuth = np.radians(np.arange(0, 360, 0.3) + 0.3 * rng.random())
        a, e = (each.ravel() for each in np.meshgrid(azimuth, elevation, indexing="ij"))
        way = np.column_stack([np.cos(a), np.sin(a)])
        reach = 8.0 / np.abs(way).max(axis=1)
        for (x, y), radius in pillars:
            along = way @ [x, y]
            square = radius**2 - (x**2 + y**2 - along**2)
            hit = (square > 0) & (along > 0)
            reach[hit] = np.minimum(reach[hit], along[hit] - np.sqrt(square[hit]))
        range_ = reach / np.cos(e) + noise * rng.standard_normal(len(reach))
        out.append(range_[:, None] * np.column_stack([way * np.cos(e)[:, None], np.sin(e)]))
    return np.concatenate(out).astype(np.float32).astype(np.float64)


PILLARS = [((3.0, 1.0), 0.25), ((-2.0, 2.5), 0.35)]
KNOWN_PILLARS = [((x, y, 0.0), UP, radius) for (x, y), radius in PILLARS]


@pytest.mark.parametrize("seed", range(2))
def test_other_pillars_are_found_in_one_turn(seed):
    assert_are(shapes(turns_of_a_scanner(seed, 1, PILLARS, 0.01)), KNOWN_PILLARS, within=0.04)


@pytest.mark.parametrize("seed", range(2))
def test_two_turns_hide_no_pillar(seed):
    found = extract(turns_of_a_scanner(seed, 2, PILLARS, 0.01))
    assert_have([one.cylinder for one in (*found.cylinders, *found.blends)], KNOWN_PILLARS, within=0.04)


@needs_cases
@pytest.mark.parametrize(
    ("file", "radius", "count"), [("rods", 0.006, 5), ("scaffold", 0.024, 14), ("scaffold_ground20", 0.024, 14)]
)
def test_thin_rods_alone_are_found(case, file, radius, count):
    assert radii(shapes(case("thin-rods-only", file))) == pytest.approx([radius] * count, rel=0.02)


@pytest.mark.parametrize(("radius", "count", "step"), [(0.006, 4, 0.004), (0.004, 3, 0.003)])
def test_other_thin_rods_are_found(radius, count, step):
    rng = np.random.default_rng(1)
    known = [((0.1 * i, 0.02 * i, 0.0), (0.2 * i - 0.2, 1.0, 0.1 * i), radius) for i in range(count)]
    assert_are(shapes(np.concatenate([pipe(rng, *one, 1.2, step, 0.0005 * radius / 0.006) for one in known])), known)


def test_a_truss_of_tubes_is_found():
    rng = np.random.default_rng(0)
    tubes = [((2 * i, 0, 0), UP, 0.03, 4) for i in range(3)]
    tubes += [((2, 0, z), (1, 0, 0), 0.03, 5) for z in (-1, 1)] + [((1, 0, 0), (1, 0, 1), 0.03, 2.4)]
    points = np.concatenate([pipe(rng, *one, 0.022, 0.003) for one in tubes])
    assert_are(shapes(points), [one[:3] for one in tubes])


@needs_cases
@pytest.mark.parametrize("file", ["z30", "z70"])
def test_zeros_are_no_points(case, file):
    known = [((1.4, 1.5, 1.1), UP, 0.12), ((2.1, 2.0, 1.05), (1, 0.3, 0.2), 0.08)]
    assert_are(shapes(case("zeros-invalid", file)), known)


@pytest.mark.parametrize(("share", "shift"), [(0.4, (0.0, 0.0, 0.0)), (0.6, (3.5, 2.2, 0.4))])
def test_zeros_in_another_room_are_no_points(share, shift):
    rng = np.random.default_rng(0)
    known = [((3, 2, 1), UP, 0.15), ((4, 2.5, 1), (0.3, 1, 0.2), 0.1)]
    parts = [pipe(rng, *one, height, 0.02, 0.002) for one, height in zip(known, (1.2, 1.0), strict=True)]
    points = np.concatenate([*parts, plate(rng, (3.5, 2.2, 0.4), (2, 2), 0.02, 0.002)]) - shift
    zeros = np.zeros((round(len(points) * share / (1 - share)), 3))
    found = shapes(rng.permutation(np.concatenate([points, zeros])))
    assert_are(found, [(np.array(point) - shift, axis, radius) for point, axis, radius in known])


@needs_cases
def test_rings_and_profiles_give_nothing_false(case):
    for file in ("sensor", "sensor_rot"):
        found = extract(case("profile-rings", file))
        assert radii(one.cylinder for one in (*found.cylinders, *found.blends)) == pytest.approx([20.0], rel=0.01)
    assert all(abs(one.radius / 1.5 - 1) < 0.03 for one in shapes(case("profile-rings", "tunnel")))


@pytest.mark.parametrize(("gap", "count"), [(0.2, 400), (0.3, 500)])
def test_rings_that_lie_closer_are_a_tunnel(gap, count):
    rng, turn = np.random.default_rng(0), np.linspace(0, 2 * np.pi, count, endpoint=False)
    turn, z = np.tile(turn, 20), np.repeat(gap * np.arange(20), count)
    own = 1.5 + 0.003 * rng.standard_normal(len(turn))
    attitude = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    points = np.column_stack([own * np.cos(turn), own * np.sin(turn), z]) @ attitude.T
    assert_are(shapes(points), [(np.zeros(3), attitude[:, 2], 1.5)], within=0.005)


@needs_cases
@pytest.mark.parametrize(
    ("file", "known"),
    [
        ("concentric", [((0, 0, 1), UP, 0.1), ((0, 0, 1), UP, 0.07)]),
        ("insulation", [((0, 0, 0), UP, 0.05), ((0, 0, 0), UP, 0.08)]),
        ("halfburied", [((0, 0, 0), (1, 0, 0), 0.15)]),
        ("touching", [((0, 0, 0), UP, 0.08), ((0.16, 0, 0), UP, 0.08)]),
        ("rack", [((0.1 * i, 0, 0.05), (0, 1, 0), 0.05) for i in range(6)]),
        ("tunnel", [((0, 0, 0), (0, 1, 0), 3.0)]),
        ("few200", [((0, 0, 0), UP, 1.0)]),
        ("rebar", [((0.1 * i, 0, 0.5), (0, 1, 0), 0.006) for i in range(5)]),
        ("taper", []),
        ("few60", []),
    ],
)
def test_pipes_in_on_and_beside_others_are_found(case, file, known):
    assert_are(shapes(case("algo-basic", file)), known)


@needs_cases
def test_a_quarter_of_a_pipe_between_two_floors_is_found(case):
    found = extract(case("algo-basic", "buried90"))
    middle = (0, 0, -0.15 * np.cos(np.radians(45)))
    assert_are([one.cylinder for one in (*found.cylinders, *found.blends)], [(middle, (1, 0, 0), 0.15)], within=0.03)


def test_another_pipe_in_a_pipe_is_found():
    rng = np.random.default_rng(5)
    known = [((0, 0, 0), UP, 0.2), ((0, 0, 0.2), UP, 0.15)]
    parts = [pipe(rng, *one, height, 0.018, 0.001) for one, height in zip(known, (1.2, 1.5), strict=True)]
    assert_are(shapes(np.concatenate(parts)), known)


def test_another_pipe_that_goes_on_wider_is_found():
    rng = np.random.default_rng(6)
    known = [((0, 0, 0), (1, 0, 0), 0.06), ((1.1, 0, 0), (1, 0, 0), 0.09)]
    parts = [pipe(rng, *one, height, 0.012, 0.001) for one, height in zip(known, (1.2, 1.0), strict=True)]
    assert_are(shapes(np.concatenate(parts)), known)


@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_two_bores_in_line_through_a_fork_are_two(noise):
    rng, parts = np.random.default_rng(0), []
    for low in (0.0, 1.6):
        parts.append(pipe(rng, (0, 0, low + 0.3), UP, 0.25, 0.6, 0.05, noise))
        parts += [plate(rng, (0, 0, level), (2, 2), 0.05, noise, hole=0.25) for level in (low, low + 0.6)]
    found = shapes(np.concatenate(parts))
    assert radii(found) == pytest.approx([0.25] * 2, rel=0.01)
    assert sorted(one.point[2] for one in found) == pytest.approx([0.3, 1.9], abs=0.02)
    assert [one.height for one in found] == pytest.approx([0.6] * 2, abs=0.06)


def test_two_walls_without_noise_on_a_plate_are_two():
    rng = np.random.default_rng(0)
    walls = [pipe(rng, (0, 0, 0), UP, radius, 1.0, 0.04) for radius in (1.0, 0.8)]
    found = shapes(np.concatenate([*walls, plate(rng, (0, 0, -0.5), (3, 3), 0.04)]))
    assert radii(found) == pytest.approx([0.8, 1.0], rel=1e-4)


def test_a_wide_ring_is_no_cylinder_in_any_piece():
    rng, ring, noise = np.random.default_rng(0), 12.0, 0.005
    turn, along = rng.uniform(-np.pi, np.pi, (2, 15000))
    kept = rng.random(15000) * (ring + 1) < ring + np.cos(turn)
    away = ring + np.cos(turn[kept])
    points = np.column_stack([away * np.cos(along[kept]), away * np.sin(along[kept]), np.sin(turn[kept])])
    assert shapes(points + noise * rng.standard_normal(points.shape)) == []


@pytest.mark.parametrize("radius", [0.3, 0.4])
def test_a_fillet_in_noise_is_a_blend_of_its_radius(radius):
    rng, step = np.random.default_rng(0), 0.03
    side, half = 0.9, np.pi / 4
    count = round(2 * (2 * side + 2 * half * radius) / step**2)
    along = rng.uniform(-side - half * radius, side + half * radius, count)
    turn = np.clip(along / radius, -half, half)
    past = along - turn * radius
    x, y = radius * np.cos(turn) - past * np.sin(turn), radius * np.sin(turn) + past * np.cos(turn)
    points = np.column_stack([x, y, 2 * rng.random(count)])
    found = extract(points + 0.2 * step * rng.standard_normal(points.shape))
    assert found.cylinders == ()
    assert radii(one.cylinder for one in found.blends) == pytest.approx([radius], rel=0.04)
