"""Pipes that are none: those in the place of another."""

import numpy as np

from cylx.runs.parts import drop_twins
from cylx.runs.pipes import Pipe, Surroundings
from cylx.runs.tracing import Trace
from tests.support.pipework import Pipework

R = 0.05


def test_a_pipe_in_the_place_of_another_is_none():
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], R)
    points, labels = work.cloud()
    near = Surroundings(points, labels, 0.016, 0.002)
    known = np.diag([1e-8, 1e-8, 1e-6, 1e-6, 1e-8])

    def pipe(low, high, beside, label, source):
        start, end = np.array([low, beside, 0.0]) - near.origin, np.array([high, beside, 0.0]) - near.origin
        return Pipe(start, end, R, 0.002, known, label, source)

    own, twin, beside = pipe(-1, 0, 0, 0, 0), pipe(-0.6, -0.2, 0, 7, None), pipe(-0.6, -0.2, 0.2, 8, None)
    trace = Trace([own, twin, beside], near, followed={(1, "end"), (2, "start")})
    near.label(np.flatnonzero(near.labels == 0)[:50], 7)
    left = drop_twins(trace)
    assert [one.label for one in left.pipes] == [0, 8]
    assert left.followed == {(1, "start")}
    assert not (near.labels == 7).any()
    assert drop_twins(left) is left
