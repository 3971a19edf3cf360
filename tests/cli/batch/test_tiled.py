"""Processes for tiles: a task whose process dies is done again, and given up in the end."""

import os
from contextlib import closing
from functools import partial

import pytest

from cylx.cli.batch.tiled import Processes, options_of, processes_for
from cylx.cli.options.tiles import TileOptions
from cylx.errors import InputError, UsageError
from tests.support.tasks import always_die, die_once, refuse, tell, tell_otherwise


@pytest.mark.skipif(os.name == "nt", reason="needs signals")
def test_a_task_whose_process_dies_is_done_again(tmp_path):
    calls = []
    with closing(Processes(2, 1e6)) as pool:
        assert sorted(pool.run(partial(die_once, tmp_path), [0, 1, 2], lambda: calls.append(1))) == [
            (0, 0),
            (1, 10),
            (2, 20),
        ]
    assert calls


@pytest.mark.skipif(os.name == "nt", reason="needs signals")
def test_it_is_given_up_in_the_end():
    with (
        closing(Processes(1, 1e6)) as pool,
        pytest.raises(InputError, match=r"^tile 7: the process that works on it was killed 3 times"),
    ):
        list(pool.run(always_die, [7], lambda: None))


def test_an_error_of_a_task_is_that_of_the_run():
    with closing(Processes(1, 1e6)) as pool, pytest.raises(UsageError, match=r"^here: no; stop$"):
        list(pool.run(refuse, [7], lambda: None))


def test_all_steps_are_run_by_the_same_processes():
    with closing(Processes(1, 1e6)) as pool:
        (first,), (second,) = (list(pool.run(work, [0], lambda: None)) for work in (tell, tell_otherwise))
    assert first[1] == -second[1] != os.getpid()


def test_tiles_do_not_depend_on_the_number_of_processes():
    for memory in (None, 2_000_000_000, 64_000_000_000):
        sizes = {options_of(TileOptions(0.0, memory=memory), jobs, None).memory for jobs in (None, 1, 2, 16)}
        assert len(sizes) == 1
    assert processes_for(TileOptions(0.0, memory=2_000_000_000), 16, 8e8) == 2
    assert processes_for(TileOptions(0.0), 16, 1e9) == 16
    with pytest.raises(UsageError, match=r"^--memory: 0\.5 GB are too little; give at least 0\.77 GB$"):
        options_of(TileOptions(0.0, memory=500_000_000), None, None)
