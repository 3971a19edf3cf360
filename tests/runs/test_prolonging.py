"""Pipes found along runs: as long as they are, and none where there is only a wall, a bore or a turned part."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cylx.runs.flatness import is_flat
from cylx.runs.pieces import settled
from cylx.runs.pipes import Pipe, Surroundings
from cylx.runs.prolonging import prolonged
from tests.support.pipework import DENSITY, NOISE, Pipework, X, Y, fit_of, of_kind

R = 0.05
KNOWN = np.diag([1e-8, 1e-8, 1e-6, 1e-6, 1e-8])


def surroundings(work):
    points, labels = work.cloud()
    return Surroundings(points, labels, 1 / np.sqrt(DENSITY), NOISE)


def pipe_of(near, start, end, radius=R, label=7):
    return Pipe(np.asarray(start) - near.origin, np.asarray(end) - near.origin, radius, NOISE, KNOWN, label)


@pytest.mark.parametrize("length", [0.4, 2.5])
def test_a_pipe_goes_as_far_as_its_points(length):
    work = Pipework()
    work.pipe([0, 0, 0], [length, 0, 0], R, known=False)
    work.pipe([length + 4 * R, 0, 0], [length + 1, 0, 0], R, known=False)  # behind a hole: another one
    near = surroundings(work)
    found = prolonged(pipe_of(near, [0, 0, 0], [0.3, 0, 0]), "end", near)
    assert found.end + near.origin == pytest.approx([length, 0, 0], abs=0.03)
    assert found.start + near.origin == pytest.approx([0, 0, 0], abs=0.01)


def test_a_pipe_found_behind_an_elbow_is_as_long_as_it_is():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    end, onward = work.bend([0, 0, 0], X, Y, 0.15, math.pi / 2, R)
    work.pipe(end, end + 2.0 * onward, R, known=False)  # more than is looked ahead
    traced = work.traced()
    assert [one.kind for one in traced.piping.fittings] == ["elbow"]
    assert traced.cylinders[1].cylinder.height == pytest.approx(2.0, abs=0.03)


def wall(work, x, y, z):
    """Put points on a wall across z."""
    count = int(DENSITY * np.ptp(x) * np.ptp(y))
    work.add(np.column_stack([work.rng.uniform(*x, count), work.rng.uniform(*y, count), np.full(count, z)]))


def test_a_strip_of_a_wall_is_flat_and_a_pipe_is_not():
    work = Pipework()
    wall(work, (0, 1), (-0.5, 0.5), 0.0)
    near = surroundings(work)
    assert is_flat(pipe_of(near, [0.1, 0, R], [0.9, 0, R]), near)
    narrow = Pipework(seen=0.25)
    narrow.pipe([0, 0, 0], [1, 0, 0], R, known=False)
    near = surroundings(narrow)
    assert not is_flat(pipe_of(near, [0, 0, 0], [1, 0, 0]), near)


def concave(fit, sd):
    """Give a fit as of a bore, with an uncertain radius."""
    covariance = fit.covariance.copy()
    covariance[4, 4] = sd**2
    return replace(fit, covariance=covariance, side="concave")


@pytest.mark.parametrize(("within", "is_pipe"), [(0, True), (400, False)])
def test_two_pipes_taken_for_one_are_no_bore_and_one_with_things_in_it_is(within, is_pipe):
    work = Pipework(seen=0.6)
    work.cone([0, 0, 0], [1, 0, 0], R, R, 0)
    work.cone([1.1, 0, 0.7 * R - R], [2, 0, 0.7 * R - R], 0.7 * R, 0.7 * R, 0)
    work.add(np.column_stack([work.rng.uniform(0.1, 0.9, within), *work.rng.uniform(-0.3 * R, 0.3 * R, (2, within))]))
    near = surroundings(work)
    pipe = Pipe.of(0, concave(fit_of([0, 0, 0], [2, 0, 0], R), 0.02 * R), near.origin, NOISE)
    assert pipe.is_other
    first = max(settled([pipe], near), key=lambda one: one.radius)
    assert first.length == pytest.approx(1.0, abs=0.15)
    assert first.radius == pytest.approx(R, rel=0.02)
    assert first.is_other != is_pipe


def test_two_elbows_in_one_plane_hardly_apart_are_not_one():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    middle, way = work.bend([0, 0, 0], X, Y, 0.25, math.pi / 2, R)
    aside = -X
    start = middle + 0.06 * way
    work.pipe(middle, start, R, known=False)
    end, onward = work.bend(start, way, aside, 0.08, math.pi / 4, R)
    work.pipe(end, end + onward, R)
    angles = [math.degrees(one.angle) for one in of_kind(work.traced(), "elbow")]
    assert len(angles) == 2  # how they share the turn is hardly told: the pipe between them is short
    assert sum(angles) == pytest.approx(135.0, abs=1.0)
    assert max(angles) < 100.0


@pytest.mark.parametrize(("length", "kinds"), [(0.2, []), (1.0, ["cap", "reducer"])])
def test_a_turned_part_is_no_run(length, kinds):
    work = Pipework()
    work.pipe([-length, 0, 0], [0, 0, 0], R)
    work.cone([0, 0, 0], [0.1, 0, 0], R, 0.6 * R)
    work.pipe([0.1, 0, 0], [0.25, 0, 0], 0.6 * R)
    work.disc(np.array([-length, 0, 0]), X, 0.0, R)
    assert sorted(one.kind for one in work.traced().piping.fittings) == kinds
