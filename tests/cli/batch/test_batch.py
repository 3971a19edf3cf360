"""Many scans at once: what is done again, what fails, and what is said of all of them."""

import csv
import dataclasses
import io
import json
import os
from pathlib import Path

import numpy as np
import pytest

from cylx.cli.batch.summary import COLUMNS, table_text
from cylx.io import remove_leftovers, temporary_beside
from tests.conftest import POINTS

BROKEN = {"07.xyz": b"", "11.xyz": b"ply, says nobody\n", "13.xyz": b"0 0 0\n1 1 1\n"}


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def pipeline(monkeypatch, make_extraction):
    """Put a pipeline in place that answers at once; `calls` has the names of what it was given, `stop` ends it."""
    from cylx.records import Scene
    from cylx.scene import check_usable, resolve

    class Pipeline:
        calls, stop, found, bug = (), None, 2, None

        def __call__(self, cloud, config, *, threads=None, observer=None):
            self.calls = (*self.calls, Path(cloud.source.file).name)
            if len(self.calls) == self.stop:
                raise KeyboardInterrupt
            if self.bug == self.calls[-1]:
                raise ZeroDivisionError("division by zero")
            check_usable(cloud.points, cloud.source.file)
            known = config.scene
            extent = float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
            scene = Scene(known.spacing or 0.25, known.noise or 0.0, extent, known.given)
            extraction = make_extraction(cloud, resolve(config, scene), cylinders=self.found)
            return dataclasses.replace(extraction, scene=scene)

    fake = Pipeline()
    monkeypatch.setattr("cylx.pipeline.extract_cylinders", fake)
    return fake


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """Twenty scans, three of them broken, in a folder of the working folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "scans"
    folder.mkdir()
    for i in range(20):
        np.savetxt(folder / f"{i:02}.xyz", POINTS * (1 + i / 100), fmt="%.6f")
    for name, content in BROKEN.items():
        (folder / name).write_bytes(content)
    return folder


def extract(run_cylx, *options):
    return run_cylx("extract", "scans", "--out-dir", "results", *options)


# what is done, and what is said of it


def test_what_fails_is_told_of_and_the_rest_goes_on(run_cylx, scans, tmp_path, pipeline):
    failed = extract(run_cylx)
    assert (failed.exit_code, failed.stdout) == (6, "")
    *reasons, header, line, counts, end = failed.stderr.splitlines()
    assert [reason.split(": ")[1] for reason in reasons] == ["scans/07.xyz", "scans/11.xyz", "scans/13.xyz"]
    assert (header.split(), set(line.strip())) == (
        ["files", "done", "failed", "skipped", "cylinders", "seconds"],
        {"─"},
    )
    assert counts.split()[:5] == ["20", "17", "3", "0", "34"]
    assert end == "cylx: 3 of 20 inputs: failed; see the lines above; the others are done"
    written = names(tmp_path / "results")
    assert len(written) == 2 * 17 + 2
    assert {"00.annotated.ply", "19.cylinders.json", "summary.csv", "summary.json"} < set(written)


def test_few_scans_have_a_line_each_and_so_have_many_with_v(run_cylx, scans, pipeline):
    for path in sorted(scans.iterdir())[5:]:
        path.rename(path.with_suffix(".later"))
    said = extract(run_cylx).stderr.splitlines()
    assert said[0] == "scans/00.xyz: 2 cylinders, written to results/00.cylinders.json and results/00.annotated.ply"
    assert said[1] == "warning: scans/00.xyz: made by hand"
    assert len(said) == 2 * 5 + 3
    for path in scans.glob("*.later"):
        path.rename(path.with_suffix(".xyz"))
    assert extract(run_cylx, "-v", "--resume").stderr.count(" cylinders, written to ") == 17
    assert extract(run_cylx, "-q", "--overwrite").stderr.count("\n") == 4


def test_a_bug_in_one_scan_is_no_end_of_the_others(run_cylx, scans, tmp_path, pipeline):
    pipeline.bug = "03.xyz"
    failed = extract(run_cylx, "-q", "--debug")
    assert failed.exit_code == 6
    lines = failed.stderr.splitlines()
    assert (
        "cylx: this is a bug of cylx: ZeroDivisionError: division by zero; run it again with --debug" in failed.stderr
    )
    assert lines[0].startswith("Traceback")
    assert lines[-1].startswith("cylx: 4 of 20 inputs: failed")
    entry = json.loads((tmp_path / "results" / "summary.json").read_bytes())["files"][3]
    assert (entry["status"], entry["exit_code"]) == ("failed", 1)


def test_the_summary_has_every_scan_and_every_cylinder(run_cylx, scans, tmp_path, pipeline):
    extract(run_cylx, "--require", 2)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "results" / "summary.csv").read_text())))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == 34
    result = json.loads((tmp_path / "results" / "01.cylinders.json").read_bytes())["cylinders"][1]
    (row,) = (row for row in rows if (row["file"], row["id"]) == ("scans/01.xyz", "1"))
    for key in ("radius", "height", "inliers", "rmse", "coverage_deg", "support", "payoff"):
        assert float(row[key]) == result[key]
    assert [float(row[f"axis_direction_{axis}"]) for axis in "xyz"] == result["axis_direction"]
    assert (row["confidence"], row["uncertainty_radius"], row["catalogue_name"]) == ("", "", "")
    summary = json.loads((tmp_path / "results" / "summary.json").read_bytes())
    assert (summary["schema"], len(summary["files"])) == ("cylx.summary/1", 20)
    assert summary["files"][0] == {
        "file": "scans/00.xyz", "status": "done", "reason": None, "exit_code": 0, "points": 24, "cylinders": 2,
        "warnings": ["made by hand"],
    }  # fmt: skip
    assert summary["files"][7] == {
        "file": "scans/07.xyz", "status": "failed", "reason": "scans/07.xyz: is empty; check how it was made",
        "exit_code": 3, "points": None, "cylinders": None, "warnings": [],
    }  # fmt: skip


def test_too_few_cylinders_are_in_the_summary_and_fail_again_when_resumed(run_cylx, scans, tmp_path, pipeline):
    before = extract(run_cylx, "--require", 3)
    files = json.loads((tmp_path / "results" / "summary.json").read_bytes())["files"]
    assert [(entry["status"], entry["exit_code"], entry["cylinders"]) for entry in files[:2]] == [("failed", 5, 2)] * 2
    first = contents(tmp_path / "results")
    again = extract(run_cylx, "--require", 3, "--resume")
    assert (before.exit_code, again.exit_code) == (6, 6)
    assert len(pipeline.calls) == 17 + 1 + 1 + 1 - 1  # what cannot be read is not given to it
    assert contents(tmp_path / "results") == first


@pytest.mark.parametrize(
    "name", ["a,b.xyz", 'say "x".xyz', "two\nlines.xyz", "=1+1.xyz", " x.xyz", "ä\u00a0b.xyz", os.fsdecode(b"\xff.xyz")]
)
def test_hostile_names_survive_in_the_table(name):
    cylinder = {key: [0.0, 0.5, 1e-20] for key in ("axis_point", "axis_direction", "start", "end")}
    cylinder |= {"id": 0, "radius": 1.0, "height": 2.0}
    text = table_text([(name, {"cylinders": [cylinder]})])
    header, row = csv.reader(io.StringIO(text, newline=""))
    assert len(row) == len(header) == len(COLUMNS)
    assert row[0] == name.replace("\udcff", "\\xff").replace("=1", "'=1")
    assert row[header.index("end_z")] == "1e-20"
    assert text.encode("utf-8").count(b"\n") == 2 + name.count("\n")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_hostile_names_go_all_the_way(run_cylx, tmp_path, monkeypatch, scans, pipeline):
    for path in scans.iterdir():
        path.unlink()
    hostile = ["=1+1.xyz", 'a,"b\n.xyz', os.fsdecode(b"\xff.xyz"), "[x].xyz"]
    try:
        for name in hostile:
            (scans / name).write_text("\n".join(" ".join(map(str, row)) for row in POINTS))
    except OSError:
        pytest.skip("this file system has no such names")
    assert extract(run_cylx).exit_code == 0
    listed = json.loads((tmp_path / "results" / "summary.json").read_bytes())["files"]
    assert sorted(entry["file"] for entry in listed) == sorted(
        f"scans/{name}".replace("\udcff", "\\xff") for name in hostile
    )
    assert extract(run_cylx, "--resume").exit_code == 0
    assert len(pipeline.calls) == len(hostile)


@pytest.mark.parametrize(
    ("options", "code", "written"),
    [
        (["scans/00.xyz", "--out-dir", "one"], 0, False),
        (["scans/00.xyz", "--out-dir", "one", "--summary"], 0, True),
        (["scans/00.xyz", "--out-dir", "one/deep"], 0, False),
        (["scans/07.xyz", "--out-dir", "one", "--summary"], 3, True),
        (["scans/00.xyz", "--out-dir", "one", "--summary", "--require", "3"], 5, True),
        (["scans", "--out-dir", "one", "--no-summary"], 6, False),
        (["scans", "-o", "one/"], 6, True),
    ],
)
def test_who_gets_a_summary(run_cylx, scans, tmp_path, pipeline, options, code, written):
    assert run_cylx("extract", *options).exit_code == code
    assert ("summary.json" in names(tmp_path / "one")) == written
    if code == 3:
        assert (tmp_path / "one" / "summary.csv").read_text() == ",".join(COLUMNS) + "\n"


@pytest.mark.parametrize(
    ("options", "code", "fault"),
    [
        (["--summary"], 2, "--summary: needs a folder for its files; name one by --out-dir"),
        (["--out-dir", "x", "-o", "y"], 2, "--out-dir: cannot be combined with -o; leave one of them out"),
        (["--out-dir", "scans/00.xyz"], 2, "--out-dir scans/00.xyz: is not a folder; choose another name"),
        (["--out-dir", "scans/00.xyz/x"], 4, "scans/00.xyz/x/: cannot be created: "),
        (["--jobs", "many"], 2, "'many' is not a number of processes or auto"),
        (["--jobs", "-1"], 2, "'-1' is not a number of processes or auto"),
        (["empty"], 3, "empty: is a folder with no scan in it; give files, or a folder of .ply"),
        (["scans/*.ply"], 3, "scans/*.ply: no file matches; check the pattern and the folder"),
        (["twin/00.xyz", "--out-dir", "x"], 2, "would be the result of scans/00.xyz and of twin/00.xyz; "),
    ],
)
def test_what_cannot_be_meant_is_refused_before_computing(run_cylx, scans, tmp_path, pipeline, options, code, fault):
    for name in ("empty", "twin"):
        (tmp_path / name).mkdir()
    (tmp_path / "twin" / "00.xyz").write_bytes(b"0 0 0\n")
    before = sorted(tmp_path.rglob("*"))
    failed = run_cylx("extract", "scans", *options)
    assert (failed.exit_code, failed.stderr.count("\n")) == (code, 1)
    assert fault in failed.stderr
    assert (pipeline.calls, sorted(tmp_path.rglob("*"))) == ((), before)


def test_a_summary_that_is_there_is_not_replaced(run_cylx, scans, tmp_path, pipeline):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "summary.csv").write_text("my own")
    for options in ([], ["--resume"]):
        failed = extract(run_cylx, *options)
        assert failed.exit_code == 4
        assert "results/summary.csv: exists already; give --resume, --overwrite or --no-summary" in failed.stderr
    assert pipeline.calls == ()
    assert extract(run_cylx, "--overwrite").exit_code == 6


# resuming


def test_what_is_done_is_not_done_again(run_cylx, scans, tmp_path, pipeline):
    extract(run_cylx, "--rejected", "scans")
    first, pipeline.calls = contents(tmp_path / "results"), ()
    again = extract(run_cylx, "--rejected", "scans", "--resume")
    assert (again.exit_code, pipeline.calls) == (6, ("13.xyz",))
    assert again.stderr.splitlines()[-2].split()[:5] == ["20", "0", "3", "17", "34"]
    assert contents(tmp_path / "results") == first


def in_result(stem, change):
    return lambda folder: edit(folder, stem, change)


HALF = [f"1{i}" for i in (0, 2, 4, 5, 6, 7, 8, 9)]
HARM = {
    "no cloud": (lambda folder: (folder / "results/03.annotated.ply").unlink(), ["03"]),
    "no result": (lambda folder: (folder / "results/04.cylinders.json").unlink(), ["04"]),
    "half of it": (lambda folder: [path.unlink() for path in (folder / "results").glob("1*")], HALF),
    "version": (in_result("05", lambda result: result.update(cylx_version="0.0.9")), ["05"]),
    "invalid": (in_result("06", lambda result: result.pop("scene")), ["06"]),
    "settings": (in_result("08", lambda result: result["config"].update(seed=1)), ["08"]),
    "name": (in_result("09", lambda result: result["input"].update(file="9.xyz")), ["09"]),
}


@pytest.mark.parametrize("harm", HARM)
def test_what_is_stale_is_done_again(run_cylx, scans, tmp_path, pipeline, harm):
    extract(run_cylx)
    first, pipeline.calls = contents(tmp_path / "results"), ()
    spoil, again = HARM[harm]
    spoil(tmp_path)
    assert extract(run_cylx, "--resume").exit_code == 6
    assert contents(tmp_path / "results") == first
    assert [name for name in pipeline.calls if name != "13.xyz"] == [f"{stem}.xyz" for stem in again]


def test_what_has_changed_is_done_again(run_cylx, scans, tmp_path, pipeline):
    extract(run_cylx)
    first, pipeline.calls = contents(tmp_path / "results"), ()
    np.savetxt(scans / "02.xyz", 3 * POINTS, fmt="%.6f")
    assert extract(run_cylx, "--resume").exit_code == 6
    assert pipeline.calls == ("02.xyz", "13.xyz")
    changed = {name for name, content in contents(tmp_path / "results").items() if first[name] != content}
    assert changed == {"02.annotated.ply", "02.cylinders.json"}


def edit(folder, stem, change):
    path = folder / "results" / f"{stem}.cylinders.json"
    result = json.loads(path.read_bytes())
    change(result)
    path.write_text(json.dumps(result))


@pytest.mark.parametrize(
    ("before", "after", "stale"),
    [
        ([], ["--set", "slicing.planes=7"], True),
        (["--max-cylinders", "3"], [], True),
        (["--radius", ":2"], [], True),
        ([], ["--radius", "0.5:"], True),
        ([], ["--method", "msac"], True),
        (["--axis", "z"], ["--axis", "x"], True),
        (["--set", "scene.noise=0.125"], ["--set", "scene.noise=0.25"], True),
        (["--set", "scene.noise=0.125"], ["--set", "scene.noise=0.125"], False),
        (["--set", "scene.noise=0.125"], [], True),
        (["--set", "scene.spacing=0.5"], [], True),
        ([], ["--set", "scene.spacing=0.25"], True),
        (["--set", "scene.spacing=0.25"], ["--set", "scene.noise=0.125", "--set", "scene.spacing=0.25"], True),
        (["--set", "scene.catalogue=[{radius: 1}]"], ["--set", "scene.catalogue=[{radius: 1}]"], False),
        (["--axis", "z", "--radius", "1:2"], ["--radius", "1:2", "--set", "scene.axis=[0, 0, 1]"], False),
        (["--seed", "3"], ["--threads", "1", "--seed", "3"], False),
    ],
)
def test_other_settings_make_stale(run_cylx, scans, pipeline, before, after, stale):
    extract(run_cylx, *before)
    pipeline.calls = ()
    extract(run_cylx, *after, "--resume")
    assert len(pipeline.calls) == (18 if stale else 1)


def test_a_mesh_in_another_unit_or_of_another_result_is_stale(run_cylx, scans, tmp_path, pipeline):
    def calls(units, *options):
        pipeline.calls = ()
        options = ("--no-annotate", "--mesh", "can.glb", "--units", units, *options)
        assert run_cylx("extract", "scans/00.xyz", *options, "--resume").exit_code == 0
        return len(pipeline.calls)

    assert [calls("mm"), calls("mm")] == [1, 0]
    in_mm = Path("can.glb").read_bytes()
    assert [calls("m"), calls("m")] == [1, 0]
    assert Path("can.glb").read_bytes() != in_mm
    Path("can.glb").write_bytes(in_mm)
    assert calls("m") == 1
    pipeline.found = 0
    assert run_cylx("extract", "scans/00.xyz", "--no-annotate", "--overwrite").exit_code == 0
    assert calls("m") == 1  # none is found, and so there must be no mesh
    assert not Path("can.glb").exists()


@pytest.mark.parametrize("spoil", [b"{}", b"", None])
def test_what_was_rejected_in_another_run_is_stale(run_cylx, scans, tmp_path, pipeline, spoil):
    options = ("extract", "scans/00.xyz", "--no-annotate", "--rejected", "r.json")
    run_cylx(*options)
    before = Path("r.json").read_bytes()
    if spoil is None:
        run_cylx("extract", "scans/00.xyz", "--no-annotate", "--overwrite", "--seed", 1)
        assert run_cylx(*options, "--resume", "--seed", 1).exit_code == 0
        assert b'"seed": 1' in Path("r.json").read_bytes()
        assert len(pipeline.calls) == 3
    else:
        Path("r.json").write_bytes(spoil)
        assert run_cylx(*options, "--resume", "--overwrite").exit_code == 0
        assert Path("r.json").read_bytes() == before


def test_what_was_interrupted_goes_on_to_the_same_bytes(run_cylx, scans, tmp_path, pipeline):
    extract(run_cylx)
    whole = contents(tmp_path / "results")
    pipeline.calls, pipeline.stop = (), 9
    stopped = run_cylx("extract", "scans", "--out-dir", "parts")
    assert (stopped.exit_code, stopped.stderr.splitlines()[-1]) == (130, "cylx: interrupted")
    assert len(names(tmp_path / "parts")) == 2 * 8
    assert run_cylx("extract", "scans", "--out-dir", "parts", "--resume").exit_code == 6
    assert contents(tmp_path / "parts") == whole


def test_one_scan_may_be_resumed_too(run_cylx, scans, tmp_path, pipeline):
    for expected in (1, 1):
        done = run_cylx("extract", "scans/00.xyz", "--resume")
        assert (done.exit_code, len(pipeline.calls)) == (0, expected)
    assert done.stderr.splitlines()[0].endswith("00.annotated.ply before")
    assert run_cylx("extract", "scans/00.xyz", "--resume", "--require", 3).exit_code == 5


@pytest.mark.parametrize("name", ["00.cylinders.json", "00.annotated.ply"])
def test_resuming_replaces_nothing_but_our_own(run_cylx, scans, tmp_path, pipeline, name):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / name).write_text("{}")
    failed = extract(run_cylx, "--resume")
    line = (
        f"cylx: results/{name}: exists already, and cylx did not write it; choose another name, or give --overwrite\n"
    )
    assert (failed.exit_code, failed.stderr, pipeline.calls) == (4, line, ())
    assert extract(run_cylx, "--resume", "--overwrite").exit_code == 6


@pytest.mark.skipif(os.name == "nt", reason="Windows does not tell whether a process has ended")
def test_what_the_dead_left_is_removed(tmp_path):
    mine = temporary_beside(tmp_path / "x.ply", ".ply")
    theirs = tmp_path / mine.name.replace(f"-{os.getpid()}-", "-999999999-")
    elsewhere = tmp_path / (".cylx-00000000" + theirs.name[14:])
    others = [mine, elsewhere, tmp_path / ".cylx-x", tmp_path / "x"]
    for path in (theirs, *others):
        path.touch()
    remove_leftovers(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted(others)
    remove_leftovers(tmp_path, os.getpid())
    assert sorted(tmp_path.iterdir()) == sorted(others[1:])


# how many at once


def test_one_scan_is_done_here_whatever_the_jobs(run_cylx, scans, pipeline):
    assert run_cylx("extract", "scans/00.xyz", "--jobs", "2", "-q").exit_code == 0
    assert pipeline.calls == ("00.xyz",)
