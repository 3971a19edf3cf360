"""Clusters in rounds: threads change no byte, pieces of a pipe become one, and pipes side by side stay apart."""

import math

import numpy as np
import pytest

from cylx.config import Config
from cylx.geometry.cylinder import Cylinder
from cylx.pipeline import extract_cylinders
from cylx.pipeline.rounds import ROUND
from cylx.records import PointCloud
from cylx.results import Result
from cylx.synthetic import multi
from cylx.synthetic.surfaces import Mantle, Wall

SPACING, SIGMA = 0.035, 0.005
AROUND = 0.0, 2 * math.pi


def run(points, threads=1):
    return extract_cylinders(PointCloud.from_array(points), Config(), threads=threads)


@pytest.fixture(scope="module")
def pipes():
    """A room with a dozen pipes, and what is found in it."""
    scene = multi(points=20000, cylinders=12, planes=1, boxes=1, spheres=1, cones=1, seed=11)
    return scene, run(scene.points)


def test_nearly_all_of_many_pipes_are_found_and_nothing_else(pipes):
    scene, found = pipes
    shapes = [true.cylinder for true in scene.cylinders]
    owners = set()
    for fit in found.cylinders:
        near = [errors(fit.cylinder, true) for true in shapes]
        best = min(range(12), key=lambda i: max(near[i]))
        assert max(near[best]) < 0.05
        owners.add(best)
    assert len(owners) == len(found.cylinders) >= 11


@pytest.mark.parametrize("threads", [2, 5])
def test_rounds_in_threads_give_the_same_bytes(pipes, threads):
    scene, found = pipes
    stages = {stage.name: stage for stage in found.stages}
    assert stages["verification"].considered > ROUND  # more than one round
    other = run(scene.points, threads)
    assert Result.of(other).to_json() == Result.of(found).to_json()
    assert np.array_equal(other.labels, found.labels)
    assert np.array_equal(other.residuals, found.residuals, equal_nan=True)
    assert len(other.rejected) == len(found.rejected)


def test_the_size_of_a_round_is_no_matter_for_what_is_found(pipes, monkeypatch):
    scene, found = pipes
    assert ROUND > 1
    monkeypatch.setattr("cylx.pipeline.rounds.ROUND", 1)
    other = run(scene.points)
    assert len(other.cylinders) == len(found.cylinders)
    for fit in found.cylinders:
        assert min(max(errors(one.cylinder, fit.cylinder)) for one in other.cylinders) < 0.01


def errors(found, true):
    """Give offset and error of the radius in radii, and the sine of the angle."""
    offset = np.linalg.norm(np.cross(found.point - true.point, true.direction))
    across = np.linalg.norm(np.cross(found.direction, true.direction))
    return offset / true.radius, abs(found.radius / true.radius - 1), across


def scan(rng, pipes, others=()):
    """Give points of pipes, each (cylinder, (first angle, arc)), and of other surfaces, all as dense."""
    surfaces = [*(Mantle(shape, *arc) for shape, arc in pipes), *others]
    points = [surface.sample(rng, round(surface.area / SPACING**2)) for surface in surfaces]
    return np.concatenate(points) + SIGMA * rng.standard_normal((sum(map(len, points)), 3))


def assert_found(points, expected, seed):
    """Look at the points from anywhere; expect these cylinders from end to end and no others."""
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    found = [fit.cylinder for fit in run(points @ turn.T).cylinders]
    assert len(found) == len(expected)
    for shape in expected:
        true = Cylinder(turn @ shape.point, turn @ shape.direction, shape.radius, shape.height)
        nearest = min(found, key=lambda one: max(errors(one, true)))
        offset, radius, angle = errors(nearest, true)
        # of about 4000 points with a noise of 3 % of the radius
        assert offset < 0.02
        assert radius < 0.02
        assert angle < 0.01
        ends = sorted([(nearest.start - true.point) @ true.direction, (nearest.end - true.point) @ true.direction])
        assert np.allclose(ends, [-0.5 * true.height, 0.5 * true.height], rtol=0, atol=3 * SPACING)


Y = np.array([0.0, 1, 0])


@pytest.mark.parametrize("gap", [0.3, 0.6])
def test_two_pieces_of_one_pipe_become_one_cylinder(gap):
    rng = np.random.default_rng(1)
    pipe = Cylinder([0, 0, 0], [0.3, 1, 0.2], 0.2, 4.0)
    points = scan(rng, [(pipe, AROUND)])
    heights = points @ pipe.direction
    assert_found(points[(heights < -0.2) | (heights > -0.2 + gap)], [pipe], 1)


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_parallel_pipes_that_touch_stay_apart(shift):
    pipes = [Cylinder([0, 0, 0], Y, 0.2, 3.0), Cylinder([0.4, shift, 0], Y, 0.2, 3.0)]
    assert_found(scan(np.random.default_rng(2), [(pipe, AROUND) for pipe in pipes]), pipes, 2)


@pytest.mark.parametrize(("height", "direction"), [(0.0, [1, 0, 0]), (0.36, [1, 0.5, 0])], ids=["through", "touching"])
def test_pipes_that_cross_stay_whole(height, direction):
    pipes = [Cylinder([0, 0, 0], Y, 0.2, 4.0), Cylinder([0, 0, height], direction, 0.15, 4.0)]
    assert_found(scan(np.random.default_rng(3), [(pipe, AROUND) for pipe in pipes]), pipes, 3)


@pytest.mark.parametrize("first", [1.0, 4.0])
def test_a_half_shell_about_a_pipe_is_a_cylinder_of_its_own(first):
    pipes = [Cylinder([0, 0, 0], Y, 0.15, 3.0), Cylinder([0, 0, 0], Y, 0.4, 3.0)]
    assert_found(scan(np.random.default_rng(4), [(pipes[0], AROUND), (pipes[1], (first, math.pi))]), pipes, 4)


def test_a_pipe_on_a_floor_is_whole_and_the_floor_is_none():
    pipe = Cylinder([1.5, 1.5, 0.2], [0.4, 1, 0], 0.2, 2.5)
    floor = Wall(np.array([3.0, 3.0, 1.0]), 2, 0.0)
    assert_found(scan(np.random.default_rng(5), [(pipe, AROUND)], [floor]), [pipe], 5)
