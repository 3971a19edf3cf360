"""Links that are hardly seen, or not at all: bends that are missing, slight ones, pipes of one line taken for one."""

import math

import numpy as np
import pytest

from cylx.runs.changes import changed
from cylx.runs.pipes import Pipe
from cylx.runs.usual_bends import Usual, posterior
from tests.support.pipework import NOISE, Pipework, X, Y, fit_of, of_kind

R = 0.05


def missing(angle_deg, bend_radius, late=0.0):
    """Make two straights with nothing where their bend is; the second one begins `late`."""
    work, angle = Pipework(), math.radians(angle_deg)
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    center, onward = bend_radius * Y, math.cos(angle) * X + math.sin(angle) * Y
    end = center - bend_radius * math.cos(angle) * Y + bend_radius * math.sin(angle) * X
    work.pipe(end + late * onward, end + onward, R)
    return work


@pytest.mark.parametrize(("angle", "bend_radius"), [(90, 0.15), (45, 0.25), (75, 0.1)])
def test_a_bend_that_is_missing_is_assumed_where_both_ends_are_those_of_one_arc(angle, bend_radius):
    traced = missing(angle, bend_radius).traced()
    (found,) = traced.piping.fittings
    assert (found.kind, found.assumed, found.inliers) == ("joint", True, 0)
    assert found.length == pytest.approx(bend_radius * math.radians(angle), rel=0.1)
    assert 0.5 < found.confidence < 0.8
    assert len(traced.piping.runs) == 1


def test_ends_that_are_not_those_of_one_arc_stay_open():
    assert missing(90, 0.15, late=0.1).traced().piping.fittings == ()


def test_a_bend_is_not_assumed_where_something_else_is():
    work = missing(90, 0.15)
    work.cone([0.15, -0.05, 0.0], [0.15, 0.12, 0.0], 0.02, 0.02)
    work.cone([0.02, 0.0, 0.0], [0.13, 0.03, 0.0], 0.02, 0.02)
    assert of_kind(work.traced(), "joint") == []


def test_a_slight_bend_between_pipes_that_were_found_too_long_joins_them():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R, over=(0, 0.1))
    end, onward = work.bend([0, 0, 0], X, Y, 0.1, math.radians(15), R)
    work.pipe(end, end + onward, R, over=(0.1, 0))
    traced = work.traced()
    assert len(traced.piping.runs) == 1
    assert [one.kind for one in traced.piping.fittings] == ["elbow"]
    assert math.degrees(traced.piping.fittings[0].angle) == pytest.approx(15, abs=0.5)


def test_a_pipe_hardly_longer_than_a_weld_joins_an_elbow_and_a_reducer():
    work, small = Pipework(), 0.035
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    end, onward = work.bend([0, 0, 0], X, Y, 0.15, math.pi / 2, R)
    work.pipe(end, end + 0.06 * onward, R, known=False)
    work.cone(end + 0.06 * onward, end + 0.16 * onward, R, small)
    work.pipe(end + 0.16 * onward, end + 1.2 * onward, small)
    traced = work.traced()
    assert sorted(one.kind for one in traced.piping.fittings) == ["elbow", "reducer"]
    assert len(traced.piping.runs) == 1


def flat_reducer(other):
    """Points of two pipes that are flush at the bottom, seen from there, and one cylinder over both."""
    work = Pipework(seen=0.5)
    work.pipe([-1, 0, 0], [0, 0, 0], R, known=False)
    work.cone([0.1, 0, other - R], [1.1, 0, other - R], other, other)
    pipe = Pipe.of(0, fit_of([-1, 0, 0], [1.1, 0, 0], R), np.zeros(3), NOISE)
    return changed(pipe, np.concatenate(work.points))


def test_two_pipes_of_a_flat_reducer_are_told_apart():
    found = flat_reducer(0.035)
    assert found is not None
    assert sorted(one.radius for one in found) == pytest.approx([0.035, R], rel=0.03)
    places = sorted(float(x) for one in found for x in (one.start[0], one.end[0]))
    assert places[0] == pytest.approx(-1, abs=0.02)
    assert -0.15 < places[1] <= places[2] < 0.3


def test_one_pipe_is_not_told_apart():
    assert flat_reducer(R) is None


def test_a_bend_radius_that_points_tell_stays_and_one_that_they_leave_open_is_a_usual_one():
    usual = [Usual(0.15, 0.005, 0.75)]
    radius, std = posterior(0.151, 0.0005, R, usual)
    assert radius == pytest.approx(0.151, abs=0.0003)
    assert std <= 0.00055
    radius, std = posterior(0.17, 0.02, R, usual)
    assert abs(radius - 0.15) < 0.006
    assert 0.004 < std < 0.02
    # what contradicts all usual radii is what it is
    radius, std = posterior(0.25, 0.01, R, usual)
    assert radius == pytest.approx(0.25, abs=0.002)
    assert std == pytest.approx(0.01, rel=0.2)


def test_a_tee_is_told_by_the_points_about_its_saddle():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.pipe([0, R, 0], [0, 1, 0], 0.03)
    (tee,) = of_kind(work.traced(), "tee")
    assert tee.inliers > 25
    assert tee.rms == pytest.approx(NOISE, rel=0.3)
    assert tee.coverage > 0.6
    assert tee.confidence > 0.8
