"""Pipes of one line that were taken for one."""

import numpy as np
import pytest

from cylx.runs.changes import changed
from cylx.runs.pipes import Pipe
from tests.support.pipework import NOISE, Pipework, fit_of

R = 0.05


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
