"""`cylx export`: which files are written, what is refused before, and what is said."""

import csv
import json
import re
import sys
from pathlib import Path

import pytest

from tests.support.pcf import read_pcf

GOLDEN = Path(__file__).resolve().parents[2] / "sample_data" / "golden"
PIPES = GOLDEN / "pipes.cylinders.json"


@pytest.fixture
def result(tmp_path):
    """A result that may be changed."""
    return json.loads(PIPES.read_text(encoding="utf-8"))


def test_a_table_and_a_mesh_are_written(run_cylx, tmp_path):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    done = run_cylx("export", PIPES, tmp_path / "a.csv", tmp_path / "a.OBJ")
    said = f"{PIPES}: 6 cylinders, written to {tmp_path / 'a.csv'}, {tmp_path / 'a.OBJ'}\n"
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", said)
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()))
    assert [float(row["radius"]) for row in rows] == [
        cylinder["radius"] for cylinder in json.loads(PIPES.read_text(encoding="utf-8"))["cylinders"]
    ]
    assert (tmp_path / "a.OBJ").read_text(encoding="utf-8").count("\no cylinder ") == 6


def test_programs_are_told_what_was_written(run_cylx, tmp_path, result):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    for cylinder in result["cylinders"]:
        cylinder["axis_point"][1] += 5e6
    result["cylinders"][1]["height"] = 0.0
    (tmp_path / "r.json").write_text(json.dumps(result), encoding="utf-8")
    names = [str(tmp_path / "a.csv"), str(tmp_path / "a.stl")]
    done = run_cylx("export", tmp_path / "r.json", *names, "--units", "mm", "--json")
    answer = json.loads(done.stdout)
    files = answer.pop("files")
    assert answer == {"result": str(tmp_path / "r.json"), "cylinders": 6, "flat": [1], "units": "mm"}
    assert [file["file"] for file in files] == names
    assert [file["bytes"] for file in files] == [Path(name).stat().st_size for name in names]
    assert (files[0]["offset"], files[1]["offset"][1] // 10) == (None, 500000)


def test_what_is_less_sure_is_left_out(run_cylx, tmp_path, result):
    result["cylinders"][2]["confidence"] = 0.5
    (tmp_path / "r.json").write_text(json.dumps(result), encoding="utf-8")
    done = run_cylx("export", tmp_path / "r.json", tmp_path / "a.csv", "--min-confidence", 0.6)
    assert done.exit_code == 0
    rows = csv.DictReader((tmp_path / "a.csv").read_text(encoding="utf-8").splitlines())
    assert [row["id"] for row in rows] == ["0", "1", "3", "4", "5"]
    del result["cylinders"][0]["confidence"]
    (tmp_path / "r.json").write_text(json.dumps(result), encoding="utf-8")
    failed = run_cylx("export", tmp_path / "r.json", tmp_path / "b.csv", "--min-confidence", 0.6)
    line = f"cylx: {tmp_path / 'r.json'}: its cylinders have no confidence; leave --min-confidence out\n"
    assert (failed.exit_code, failed.stderr) == (3, line)


def test_what_is_taken_off_and_what_is_left_out_is_said(run_cylx, tmp_path, result):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    for cylinder in result["cylinders"]:
        cylinder["axis_point"][1] += 5e6
    result["cylinders"][1]["height"] = 0.0
    (tmp_path / "r.json").write_text(json.dumps(result), encoding="utf-8")
    done = run_cylx("export", tmp_path / "r.json", tmp_path / "a.stl", tmp_path / "a.obj", tmp_path / "a.csv")
    assert done.exit_code == 0
    _, flat, offset = done.stderr.splitlines()
    assert flat == "warning: height 0, written to tables only: cylinder 1"
    assert re.fullmatch(
        r"warning: .*a\.stl: add -?\d+ 500000\d -?\d+ to all coordinates; they are too large .*", offset
    )


@pytest.fixture
def joined(tmp_path, result):
    """A file with a result that has two fittings."""
    evidence = {"inliers": 9, "rms": 0.0, "coverage": 0.5, "std": {}}
    for number, one in enumerate(result["cylinders"][:2]):
        cap = {"id": number, "kind": "cap", "joins": [one["id"]], "ends": ["end"], "confidence": 0.9 - 0.5 * number}
        place = {"center": one["end"], "axis": one["axis_direction"], "radius": one["radius"]}
        result.setdefault("fittings", []).append({**cap, **place, **evidence})
    result["runs"] = []
    (tmp_path / "r.json").write_text(json.dumps(result), encoding="utf-8")
    return tmp_path / "r.json"


@pytest.mark.parametrize(
    ("options", "said", "caps"),
    [
        ([], "6 cylinders and 2 fittings", ["cap 0", "cap 1"]),
        (["--min-confidence", "0.6"], "6 cylinders and 1 fitting", ["cap 0"]),
        (["--min-confidence", "0.95"], "6 cylinders", []),
    ],
)
def test_fittings_are_written_too(run_cylx, tmp_path, joined, options, said, caps):
    done = run_cylx("export", joined, tmp_path / "a.pcf", tmp_path / "a.csv", "--units", "m", *options)
    assert (done.exit_code, done.stdout) == (0, "")
    assert f": {said}, written to " in done.stderr
    _, pipelines = read_pcf((tmp_path / "a.pcf").read_bytes())
    parts = [part for components in pipelines.values() for part in components]
    assert [part.values["COMPONENT-ATTRIBUTE1"] for part in parts if part.kind == "CAP"] == caps
    assert sum(part.kind == "PIPE" for part in parts) == int(said[0])


def test_programs_are_told_the_number_of_fittings(run_cylx, tmp_path, joined):
    done = run_cylx("export", joined, tmp_path / "a.pcf", "--units", "m", "--json")
    assert {"cylinders": 6, "fittings": 2}.items() <= json.loads(done.stdout).items()


@pytest.mark.parametrize(
    ("name", "options", "code", "said"),
    [
        ("a.dwg", [], 2, "a.dwg: .dwg is not a known format; use one of .ply, .obj, .glb, .stl, .csv, .step, "),
        ("a", [], 2, "a: has no suffix that names a format; use one of .ply"),
        ("a.dxf", [], 2, "a.dxf: .dxf has a unit of length; give that of the scan by --units: m, mm, cm, in, ft"),
        ("a.pcf", [], 2, "a.pcf: .pcf has a unit of length; give that of the scan by --units"),
        ("a.glb", [], 2, "a.glb: .glb has a unit of length; give that of the scan by --units"),
        ("a.dxf", ["--units", "km"], 2, "Invalid value for '--units'"),
        ("none/a.csv", [], 4, "a.csv: the folder"),
        ("there.csv", [], 4, "there.csv: exists already; choose another name, or give --overwrite"),
        ("a.csv", ["--min-confidence", "2"], 2, "Invalid value for '--min-confidence'"),
    ],
)
def test_what_cannot_be_written_is_refused_before(run_cylx, tmp_path, name, options, code, said):
    (tmp_path / "there.csv").write_text("mine", encoding="utf-8")
    failed = run_cylx("export", PIPES, tmp_path / "first.csv", tmp_path / name, *options)
    assert (failed.exit_code, failed.stdout) == (code, "")
    assert said in failed.stderr
    assert failed.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["there.csv"]
    assert (tmp_path / "there.csv").read_text(encoding="utf-8") == "mine"


def test_a_missing_extra_is_named_before_anything_is_written(run_cylx, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    failed = run_cylx("export", PIPES, tmp_path / "a.csv", tmp_path / "a.ply")
    line = f"cylx: {tmp_path / 'a.ply'}: .ply needs trimesh, which is not installed; pip install 'cylx[mesh]'\n"
    assert (failed.exit_code, failed.stdout, failed.stderr) == (2, "", line)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{}", "cylx_version: is missing"),
        ("[1]", "is not a JSON object"),
        ("hello", "not JSON"),
        ('{"schema": "cylx.rejected/1"}', "schema"),
    ],
)
def test_what_is_no_result_is_an_input_that_cannot_be_used(run_cylx, tmp_path, text, said):
    (tmp_path / "r.json").write_text(text, encoding="utf-8")
    failed = run_cylx("export", tmp_path / "r.json", tmp_path / "a.csv")
    assert (failed.exit_code, failed.stdout) == (3, "")
    assert failed.stderr.startswith(f"cylx: {tmp_path / 'r.json'}")
    assert said in failed.stderr
    assert failed.stderr.count("\n") == 1


def test_files_are_replaced_when_that_is_asked_for_and_all_or_none(run_cylx, tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("old", encoding="utf-8")
    written = []

    def fail_on_the_second(path, data, **others):
        written.append(path)
        if len(written) == 2:
            raise OSError(28, "No space left on device")
        Path(path).write_bytes(data)

    with monkeypatch.context() as patch:
        patch.setattr("cylx.io.outputs.write_bytes", fail_on_the_second)
        assert run_cylx("export", PIPES, tmp_path / "a.csv", tmp_path / "b.csv", "--overwrite").exit_code == 4
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "old"
    assert run_cylx("export", PIPES, tmp_path / "a.csv", "--overwrite").exit_code == 0
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").startswith("id,")


@pytest.mark.parametrize(("first", "second"), [("a.csv", "a.csv"), ("r.csv", "b.csv")])
def test_two_names_of_one_file_are_refused(run_cylx, tmp_path, first, second):
    (tmp_path / "r.csv").write_bytes(PIPES.read_bytes())
    failed = run_cylx("export", tmp_path / "r.csv", tmp_path / first, tmp_path / second, "--overwrite")
    assert failed.exit_code == 2
    assert (tmp_path / "r.csv").read_bytes() == PIPES.read_bytes()
