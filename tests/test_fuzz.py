"""A short run of the fuzzers, the same inputs each time; `python -m tests.fuzz.run` runs them for longer."""

import random
import subprocess
import sys
from pathlib import Path

import pytest

from cylx.errors import InputError
from tests.fuzz.mutate import mutate
from tests.fuzz.run import all_targets, fuzz, judge
from tests.fuzz.targets import TARGETS
from tests.support.patience import PATIENCE

INPUTS = 60
"""Mutated inputs of each target, besides its seeds."""
PATIENT = 60.0
"""Seconds for an input: the machine may be busy."""


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_but_success_and_documented_errors(name, tmp_path):
    seeds, _ = TARGETS[name]
    counts, kinds = fuzz(name, TARGETS[name], inputs=len(seeds) + INPUTS, findings=tmp_path, slowest=PATIENT)
    assert (dict(kinds), counts["inputs"]) == ({}, len(seeds) + INPUTS)
    assert counts["success"] + counts["error"] == counts["inputs"]


def crash(_data):
    raise ZeroDivisionError("on purpose")


def talk(_data):
    raise InputError("scan", "a" * 399 + "b" * 2000, "stop")


def test_a_defect_is_found_counted_and_kept(tmp_path):
    counts, kinds = fuzz("crash", ([b"a"], crash), inputs=30, findings=tmp_path)
    assert (counts["defect"], counts["success"], counts["error"]) == (30, 0, 0)
    assert len(kinds) == 1
    kept = [path for path in (tmp_path / "crash").iterdir() if path.suffix == ".why"]
    assert 0 < len(kept) <= 20
    assert "ZeroDivisionError" in kept[0].read_text()
    assert kept[0].with_suffix("").is_file()


def test_what_is_no_defect_is_counted_apart():
    assert judge(len, b"a") == "success"
    assert judge(talk, b"a") == "error"


def test_the_same_seed_gives_the_same_inputs():
    seeds, _ = TARGETS["ply"]
    first, second = ([mutate(random.Random(7), seeds[0], seeds) for _ in range(3)] for _ in range(2))
    assert first == second
    assert len({mutate(random.Random(k), seeds[0], seeds) for k in range(200)}) > 150


def test_every_target_has_small_seeds():
    for name, (seeds, _) in all_targets().items():
        assert seeds, name
        assert max(map(len, seeds)) < 20_000, name


def test_the_command_prints_a_table():
    root = Path(__file__).resolve().parents[1]
    command = [sys.executable, "-m", "tests.fuzz.run", "--target", "override", "--inputs", "20"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    header, row, total = done.stdout.splitlines()
    assert header.split() == ["target", "inputs", "successes", "errors", "defects"]
    assert (row.split()[:2], total.split()[:2]) == (["override", "20"], ["all", "20"])
