"""Processes for tiles: a task whose process dies is done again, and given up in the end."""

import os
from contextlib import closing
from functools import partial

import pytest

from cylx.cli.batch.tile_workers import Processes
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
