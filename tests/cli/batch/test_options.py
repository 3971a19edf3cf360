"""How many scans are done at once."""

import pytest

from cylx.cli.batch.options import BatchOptions
from cylx.cli.options.batch import Processes


@pytest.mark.parametrize(
    ("jobs", "available", "processes"),
    [(None, 1e9, None), (3, 1e6, 3), (9, 1e9, 4), (0, 0.9e9, 3), (0, 1e5, 1), (0, None, 4)],
)
def test_jobs_are_as_many_as_there_is_room_for(monkeypatch, jobs, available, processes):
    monkeypatch.setattr("cylx.cli.batch.options.free_memory", lambda: available)
    monkeypatch.setattr("cylx.cli.batch.options.cores", lambda: 8)
    assert BatchOptions(None, False, jobs, False, None).processes(list("abcd")) == processes
    assert Processes().convert("auto", None, None) == 0
