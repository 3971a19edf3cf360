"""Links that are hardly seen, or not at all: bends that are missing, slight ones, and pieces no longer than a weld."""

import math

import pytest

from tests.support.pipework import Pipework, X, Y, of_kind

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
