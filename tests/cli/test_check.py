"""`cylx check`: valid files of each format, and the first fault of others."""

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "sample_data" / "golden" / "room.cylinders.json"


@pytest.fixture
def changed(tmp_path):
    """Write a golden result with a change; gives its file."""

    def write(change):
        document = json.loads(GOLDEN.read_text(encoding="utf-8"))
        change(document)
        path = tmp_path / "changed.json"
        path.write_text(json.dumps(document), encoding="utf-8")
        return path

    return write


def test_a_valid_file_gets_a_line(run_cylx):
    done = run_cylx("check", GOLDEN)
    assert (done.exit_code, done.stdout, done.stderr) == (0, f"{GOLDEN}: valid, cylx.cylinders/1\n", "")
    done = run_cylx("check", GOLDEN, "--quiet")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")


CHANGES = {
    "cylinders.0.radius: -1.0 is out of range": lambda result: result["cylinders"][0].update(radius=-1.0),
    "cylinders.1.rmse: is missing": lambda result: result["cylinders"][1].pop("rmse"),
    "colour: unknown key": lambda result: result.update(colour="red"),
    "has no schema; give": lambda result: result.pop("schema"),
    "has the schema 'cylx.cylinders/9'; give": lambda result: result.update(schema="cylx.cylinders/9"),
    "has the schema 7; give": lambda result: result.update(schema=7),
}


@pytest.mark.parametrize(("said", "change"), CHANGES.items(), ids=range(len(CHANGES)))
def test_a_fault_has_its_place(run_cylx, changed, said, change):
    path = changed(change)
    done = run_cylx("check", path, GOLDEN)
    assert (done.exit_code, done.stdout) == (3, f"{GOLDEN}: valid, cylx.cylinders/1\n")
    assert done.stderr.startswith(f"cylx: {path}: {said}")
    assert done.stderr.count("\n") == 1


def test_as_json_all_files_have_an_entry(run_cylx, changed):
    path = changed(lambda result: result.update(cylinders=None))
    done = run_cylx("check", GOLDEN, path, "--json")
    first, second = json.loads(done.stdout)
    assert done.exit_code == 3
    assert first == {"file": str(GOLDEN), "valid": True, "schema": "cylx.cylinders/1", "fault": None}
    assert (second["valid"], second["schema"], second["fault"]["place"]) == (False, None, f"{path}: cylinders")


@pytest.mark.parametrize(
    ("home", "name", "schema"),
    [
        ("cylx.results.rejected", "Rejections", "cylx.rejected/1"),
        ("cylx.results.stems", "Stems", "cylx.stems/1"),
        ("cylx.deviation.document", "Deviations", "cylx.deviation/1"),
    ],
)
def test_other_formats_are_checked_by_their_own_models(run_cylx, tmp_path, home, name, schema):
    """Their keys are asked for, so each is read by its own model."""
    import importlib

    model = getattr(importlib.import_module(home), name)
    path = tmp_path / "one.json"
    path.write_text(json.dumps({"schema": schema}), encoding="utf-8")
    done = run_cylx("check", path)
    missing = [key for key, field in model.model_fields.items() if field.is_required()]
    assert done.exit_code == 3
    assert done.stderr == f"cylx: {path}: {missing[0]}: is missing; add it\n"
