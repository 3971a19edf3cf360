"""Many scans in several processes, with nothing faked: the same bytes, and what is left when they are stopped."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from cylx import synthetic
from cylx.cli import main
from cylx.cli.batch import memory, workers
from cylx.cli.batch.workers import Lost, Workers
from cylx.io import temporary_beside, write_cloud
from tests.support.patience import PATIENCE

POSIX = pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
SLEEP = "(__import__('time').monotonic(), __import__('time').sleep(0.15), __import__('time').monotonic())"
KILL = "__import__('os').kill(__import__('os').getpid(), 9)"
NO_PARENT_IGNORES = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with six small scans, one of them broken."""
    folder = tmp_path_factory.mktemp("batch")
    (folder / "scans").mkdir()
    for seed in range(5):
        write_cloud(folder / "scans" / f"{seed}.ply", synthetic.single(points=600, seed=seed).points)
    (folder / "scans" / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 99999999999\n")
    return folder


def command(folder, out, *options):
    code = f"{NO_PARENT_IGNORES}\nfrom cylx.cli import main\nmain(prog_name='cylx')"
    return [sys.executable, "-c", code, "extract", "scans", "--out-dir", str(folder / out), *options]


@pytest.fixture(scope="module")
def whole(place):
    """What comes out in one go, in one process."""
    before = Path.cwd()
    os.chdir(place)
    try:
        done = CliRunner().invoke(main, ["extract", "scans", "--out-dir", str(place / "whole")], prog_name="cylx")
    finally:
        os.chdir(before)
    assert done.exit_code == 6
    return contents(place / "whole")


@pytest.fixture
def started(place):
    """Start a batch of two processes, and wait until some results are there; leaves nothing running."""
    running = []

    def start(out):
        for _ in range(20):  # the machine may be too busy to see the first results before the last
            shutil.rmtree(place / out, ignore_errors=True)
            process = subprocess.Popen(
                command(place, out, "--jobs", "2"), cwd=place, stderr=subprocess.PIPE, start_new_session=True
            )
            running.append(process)
            while process.poll() is None and len(list((place / out).glob("[!.]*.json"))) < 2:
                time.sleep(0.01)
            if process.poll() is None:
                return process
        raise AssertionError("it is always done before it can be stopped")

    yield start
    for process in running:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_two_processes_give_the_same_bytes(place, whole, tmp_path):
    options = ["--jobs", "2", "--profile", str(tmp_path / "times.json")]
    done = subprocess.run(command(place, "two", *options), cwd=place, capture_output=True, check=False, text=True)
    assert done.returncode == 6
    assert "cylx: scans/broken.ply: the file ends within the PLY header" in done.stderr
    assert done.stderr.splitlines()[-2].split()[:5] == ["6", "5", "1", "0", "5"]
    assert contents(place / "two") == whole
    profile = json.loads((tmp_path / "times.json").read_bytes())
    assert [Path(entry["file"]).name for entry in profile["inputs"]] == [f"{i}.ply" for i in range(5)]
    assert profile["peak_memory_bytes"] is None or profile["peak_memory_bytes"] > 50_000_000


@POSIX
def test_ctrl_c_leaves_whole_files_only(place, whole, started):
    process = started("stopped")
    os.killpg(process.pid, signal.SIGINT)  # as the terminal does: to all of them
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert said.decode().splitlines()[-1] == "cylx: interrupted"
    assert b"Traceback" not in said
    left = contents(place / "stopped")
    assert left
    assert left.items() <= whole.items()
    assert "summary.json" not in left


@POSIX
def test_what_was_killed_goes_on_to_the_same_bytes(run_cylx, place, whole, started, monkeypatch):
    process = started("killed")
    process.kill()
    process.communicate(timeout=PATIENCE)  # the others hold its standard error, and end when they see that it is gone
    left = contents(place / "killed")
    assert 0 < len(left) < len(whole)
    assert left.items() <= whole.items()
    monkeypatch.chdir(place)
    done = run_cylx("extract", "scans", "--out-dir", place / "killed", "--resume")
    assert done.exit_code == 6
    assert int(done.stderr.splitlines()[-2].split()[3]) > 0
    assert contents(place / "killed") == whole


# the processes themselves


def outcome(tasks, most=2, after_death=lambda process: None, needs=None):
    with Workers(eval, most, after_death) as pool:
        return dict(pool.run(tasks, needs or [0] * len(tasks)))


@POSIX
def test_one_that_dies_takes_nothing_with_it(tmp_path):
    leave = (
        f"__import__('cylx.io').io.temporary_beside(__import__('pathlib').Path({str(tmp_path)!r}, 'x'), '.tmp').touch()"
    )
    dead = []
    answers = outcome(["1 + 1", f"[{leave}, {KILL}]", "2 + 2", KILL, "3 + 3"], after_death=dead.append)
    assert answers == {0: 2, 1: Lost(-9), 2: 4, 3: Lost(-9), 4: 6}
    assert len(dead) == 2
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(temporary_beside(tmp_path / "x", "").name[:15])
    assert f"-{dead[0]}-" in left.name or f"-{dead[1]}-" in left.name


def most_at_once(spans):
    return max(sum(start <= moment < end for start, _, end in spans) for moment, _, _ in spans)


@pytest.mark.parametrize(("available", "needs", "most"), [(100, 90, 1), (200, 90, 2), (10, 90, 1), (None, 90, 2)])
def test_memory_decides_how_many_work_at_once(monkeypatch, available, needs, most):
    monkeypatch.setattr(workers, "free_memory", lambda: available)
    monkeypatch.setattr(workers, "memory_held", lambda process: 0)
    spans = outcome([SLEEP] * 4, needs=[needs] * 4).values()
    assert most_at_once(spans) <= most
    assert len(spans) == 4


def test_those_that_are_no_longer_needed_end():
    pool = Workers(eval, 2, lambda process: None)
    running = pool.run(["1", "__import__('time').sleep(6000)"], [0, 0])
    assert next(running) == (0, 1)
    (busy,), (idle,) = [[worker.pid for worker in some] for some in (pool._busy.values(), pool._idle)]
    running.close()  # and does not wait until they have done their work
    assert not memory.memory_held(busy)
    pool.close()
    assert not memory.memory_held(idle)


def test_processes_stay_for_the_next_tasks():
    with Workers(eval, 2, lambda process: None) as pool:
        first, second = ({pid for _, pid in pool.run(["__import__('os').getpid()"] * 3, [0] * 3)} for _ in range(2))
    assert 1 <= len(first | second) <= 2
    assert not any(memory.memory_held(pid) for pid in first | second)


def test_memory_is_told_or_unknown():
    assert memory.free_memory() is None or memory.free_memory() > 1e6
    assert memory.memory_held(os.getpid()) == 0 or memory.memory_held(os.getpid()) > 1e6
    assert memory.memory_held(999999999) == 0
    assert memory.cores() >= 1
    assert memory.memory_needed("no such file") == memory.BASE
