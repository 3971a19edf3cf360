"""`cylx warmup`: one line about what was compiled, and where it is."""

import pytest

from cylx.api.warmup import Warmed
from cylx.cli.warmup import said

LINES = {
    "compiled 3 kernels in 4.2 s; 5 kept in /k": Warmed(3, 5, "/k", 4.21),
    "compiled 1 kernel in 4.2 s; 1 kept in /k": Warmed(1, 1, "/k", 4.21),
    "all 5 kernels are there already, in /k (0.5 s)": Warmed(0, 5, "/k", 0.51),
    "compiled 5 kernels in 9.0 s, but they cannot be kept: set NUMBA_CACHE_DIR to a writable folder": Warmed(
        5, 0, None, 9.0
    ),
    "all kernels are there already, where no more can be kept (0.5 s)": Warmed(0, 5, None, 0.51),
}


@pytest.mark.parametrize(("line", "warmed"), LINES.items(), ids=range(len(LINES)))
def test_one_line_says_what_was_done(run_cylx, monkeypatch, line, warmed):
    monkeypatch.setattr("cylx.api.warmup.warm_up", lambda observer: warmed)
    assert said(warmed) == line
    done = run_cylx("warmup")
    assert (done.exit_code, done.stdout, done.stderr) == (0, f"{line}\n", "")
    done = run_cylx("warmup", "--quiet")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")


def test_a_second_time_all_are_there(run_cylx):
    assert run_cylx("warmup", "-q").exit_code == 0
    done = run_cylx("warmup")
    assert done.exit_code == 0
    assert "are there already, in " in done.stdout
