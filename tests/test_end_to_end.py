"""The whole chain with nothing faked: make a scene, find its cylinders, judge them, compare runs, stop midway."""

import json
import os
import subprocess
import sys

import jsonschema
import numpy as np
import pytest
from plyfile import PlyData

from cylx.io import write_cloud
from cylx.results import result_schema
from cylx.synthetic import single
from tests.support.patience import PATIENCE

STAGES = ["reading", "scene", "curvature", "slicing", "candidates", "clustering", "averaging", "labelling", "writing"]
INTERRUPT = """
import json, os, signal, sys
import cylx
import cylx.cli.terminal.stopwatch, cylx.pipeline
from cylx.cli import main
cylx.extract(cylx.read_cloud(sys.argv[-1]), threads=1)
stages, kept = json.loads(sys.argv.pop(1)), cylx.cli.terminal.stopwatch.Stopwatch
for stage in stages:
    class Interrupted(kept):
        def stage_started(self, name, total):
            if name == stage:
                os.kill(os.getpid(), signal.SIGINT)
            super().stage_started(name, total)
    process = os.fork()
    if process == 0:
        cylx.cli.terminal.stopwatch.Stopwatch = Interrupted
        main(prog_name="cylx")
    print(stage, os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
"""
"""A process with all imports and kernels that becomes another one for each stage."""


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A room with three cylinders and other things."""
    from click.testing import CliRunner

    from cylx.cli import main

    path = tmp_path_factory.mktemp("room") / "room.ply"
    options = ["--points", "6000", "--cylinders", "3", "--coverage", "200", "--sigma", "0.001", "--seed", "3"]
    assert CliRunner().invoke(main, ["synth", "multi", str(path), *options]).exit_code == 0
    return path


@pytest.fixture
def scan(room, tmp_path):
    """The room in a folder of its own."""
    path = tmp_path / "room.ply"
    path.write_bytes(room.read_bytes())
    return path


@pytest.fixture
def can(tmp_path):
    """A scan that takes a moment."""
    path = tmp_path / "can.ply"
    write_cloud(path, single(points=1000).points)
    return path


def test_cylinders_are_found_written_and_judged_whatever_the_threads(run_cylx, room, scan, tmp_path):
    done = run_cylx("extract", scan, "--require", 3, "--threads", 3)
    assert (done.exit_code, done.stdout) == (0, "")
    content = json.loads(scan.with_suffix(".cylinders.json").read_bytes())
    jsonschema.validate(content, result_schema())
    unknown = {"axis", "axis_sd_deg", "known_radius", "known_radius_sd", "catalogue"}
    assert {key for key, value in content["config"]["scene"].items() if value is None} == unknown
    vertices = PlyData.read(scan.with_suffix(".annotated.ply"))["vertex"]
    assert len(vertices) == 6000
    counts = np.bincount(vertices["cylinder_id"] + 1)[1:]
    assert counts.tolist() == [cylinder["inliers"] for cylinder in content["cylinders"]]
    truth = room.with_suffix(".truth.json")
    judged = run_cylx("evaluate", scan.with_suffix(".cylinders.json"), truth, "--min-f1", 1, "--max-angle", 0.5)
    assert judged.exit_code == 0, judged.stdout
    again = run_cylx("extract", scan, "-o", tmp_path / "one.json", "--no-annotate", "--threads", 1)
    assert again.exit_code == 0
    assert (tmp_path / "one.json").read_bytes() == scan.with_suffix(".cylinders.json").read_bytes()
    assert run_cylx("diff", tmp_path / "one.json", scan.with_suffix(".cylinders.json")).exit_code == 0


def test_a_result_can_be_had_again_from_its_configuration(run_cylx, scan, tmp_path):
    run_cylx("extract", scan, "--no-annotate", "--max-cylinders", 2, "--seed", 1)
    first = json.loads(scan.with_suffix(".cylinders.json").read_bytes())
    (tmp_path / "again.yaml").write_text(json.dumps(first["config"]))
    again = json.loads(run_cylx("extract", scan, "-o", "-", "-c", tmp_path / "again.yaml").stdout)
    assert again["config"] == first["config"]
    assert len(again["cylinders"]) == 2
    (tmp_path / "again.json").write_text(json.dumps(again))
    assert run_cylx("diff", scan.with_suffix(".cylinders.json"), tmp_path / "again.json").exit_code == 0


def test_the_paper_runs_too(run_cylx, tmp_path):
    run_cylx("synth", "single", tmp_path / "can.xyz", "--points", 4000)
    done = run_cylx("extract", tmp_path / "can.xyz", "--preset", "paper", "--planes", 20, "--max-cylinders", 1)
    assert done.exit_code == 0
    limits = ["--max-angle", 3, "--max-radius-error", 0.05, "--min-f1", 1]
    judged = run_cylx("evaluate", tmp_path / "can.cylinders.json", tmp_path / "can.truth.json", *limits)
    assert judged.exit_code == 0, judged.stdout


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_an_interrupt_in_any_stage_leaves_nothing_behind(can):
    command = [sys.executable, "-c", INTERRUPT, json.dumps(STAGES), "extract", str(can)]
    done = subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE, text=True)
    assert (done.returncode, done.stdout) == (0, "".join(f"{stage} 130\n" for stage in STAGES)), done.stderr
    assert done.stderr == "cylx: interrupted\n" * len(STAGES)
    assert [path.name for path in can.parent.iterdir()] == ["can.ply"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no broken pipes")
def test_a_reader_that_goes_away_ends_it_quietly(can):
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "cylx", "extract", str(can), "-o", "-", "-q"]
    stopped = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, check=False)
    os.close(writer)
    assert (stopped.returncode, stopped.stderr) == (141, b"")


@pytest.mark.skipif(os.name == "nt", reason="there is no such shell")
def test_pipes_can_be_built_of_it(can):
    line = f'cat "{can}" | "{sys.executable}" -m cylx extract - -q | head -n 2'
    piped = subprocess.run(["/bin/sh", "-c", line], capture_output=True, check=True)
    assert (piped.stdout, piped.stderr) == (b'{\n  "schema": "cylx.cylinders/1",\n', b"")
