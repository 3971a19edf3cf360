"""A few kills at random moments and a pair of runs; `python -m tests.faults.kills` does hundreds."""

import os

import pytest

from tests.faults.kills import torture

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")


def test_runs_that_are_killed_leave_nothing_half_and_go_on_to_the_same_bytes():
    assert torture(kills=4, pairs=1, seed=1, show=lambda line: None, scans=2, points=500) == []
