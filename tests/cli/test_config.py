"""`cylx config`: init, show, check, schema."""

import json

import jsonschema
import pytest

from cylx.config import Config, load_config
from cylx.config.yaml_reader import parse_yaml


@pytest.mark.parametrize("preset", ["auto", "paper"])
def test_init_writes_what_loads_back(run_cylx, tmp_path, preset):
    done = run_cylx("config", "init", tmp_path / "my.yaml", "--preset", preset)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    assert load_config(path=tmp_path / "my.yaml") == load_config(preset=preset)


def test_init_has_a_name_of_its_own(run_cylx, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_cylx("config", "init").exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["cylx.yaml"]


def test_init_does_not_overwrite_by_itself(run_cylx, tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("seed: 7")
    failed = run_cylx("config", "init", path)
    line = f"cylx: {path}: exists already; choose another name, or give --overwrite\n"
    assert (failed.exit_code, failed.stderr, path.read_text()) == (4, line, "seed: 7")
    assert run_cylx("config", "init", path, "--overwrite").exit_code == 0
    assert load_config(path=path) == Config()


def test_init_writes_to_standard_output(run_cylx):
    shown = run_cylx("config", "init", "-")
    assert "# Number of random planes N." in shown.stdout
    assert Config.model_validate(parse_yaml(shown.stdout, "text")) == Config()


def test_show_has_what_the_options_amount_to(run_cylx, tmp_path):
    (tmp_path / "my.yaml").write_text("slicing: {planes: 3}")
    options = ["-c", tmp_path / "my.yaml", "--preset", "paper", "--set", "seed=4", "--radius", "1e-3:"]
    expected = load_config(preset="paper", overrides=["slicing.planes=3", "seed=4", "scene.radius_min=0.001"])
    shown = run_cylx("config", "show", *options)
    assert shown.exit_code == 0
    assert Config.model_validate(parse_yaml(shown.stdout, "text")) == expected
    assert Config.model_validate(json.loads(run_cylx("config", "show", *options, "--json").stdout)) == expected


def test_check_says_yes(run_cylx, tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("preset: paper")
    done = run_cylx("config", "check", path)
    assert (done.exit_code, done.stdout, done.stderr) == (0, f"{path}: valid, preset paper\n", "")


def test_check_says_so_to_programs(run_cylx, tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("preset: paper")
    done = run_cylx("config", "check", path, "--json")
    assert json.loads(done.stdout) == {"file": str(path), "valid": True, "preset": "paper", "faults": []}
    assert (done.exit_code, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("text", "places"),
    [
        (
            "slicing: {thicknes: 3, planes: -1}\nscene: {axis: up}",
            [("scene.axis", None), ("slicing.planes", None), ("slicing.thicknes", None)],
        ),
        ("scene: {axis_sd_deg: 3}", [("scene.axis_sd_deg", None)]),
        ("seed: 1\nseed: 2", [(None, 2)]),
        ("- 1", [(None, None)]),
        (None, [(None, None)]),
    ],
)
def test_check_gives_programs_all_faults(run_cylx, tmp_path, text, places):
    path = tmp_path / "my.yaml"
    if text is not None:
        path.write_text(text)
    failed, plain = run_cylx("config", "check", path, "--json"), run_cylx("config", "check", path)
    answer = json.loads(failed.stdout)
    assert (answer["valid"], answer["preset"]) == (False, None)
    assert [(fault["key"], fault["line"]) for fault in answer["faults"]] == places
    first = answer["faults"][0]
    assert failed.stderr.endswith(f": {first['fault']}; {first['remedy']}\n")
    assert (failed.exit_code, failed.stderr, plain.stdout) == (2, plain.stderr, "")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("slicing: {thicknes: 1}", ": slicing.thicknes: unknown key; did you mean 'thickness'?"),
        ("seed: 1\nseed: 2", ":2: the key 'seed' appears twice; leave one of them out"),
        ("seed: -1", ": seed: -1 is out of range; it must be >= 0"),
        ('"a\\nb": 1', ": a\\nb: unknown key; the keys here are preset, method, "),
    ],
)
def test_check_says_no_in_one_line(run_cylx, tmp_path, text, fault):
    path = tmp_path / "my.yaml"
    path.write_text(text)
    failed = run_cylx("config", "check", path)
    assert (failed.exit_code, failed.stdout) == (2, "")
    assert failed.stderr.startswith(f"cylx: {path}{fault}")
    assert len(failed.stderr.splitlines()) == 1


def test_schema_is_the_one_of_the_configuration(run_cylx):
    schema = json.loads(run_cylx("config", "schema").stdout)
    jsonschema.validate(Config().model_dump(mode="json"), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"slicing": {"planes": -1}}, schema)


def test_schema_is_the_one_of_the_result(run_cylx, make_extraction):
    from cylx.results import Result

    schema = json.loads(run_cylx("config", "schema", "--result").stdout)
    content = Result.of(make_extraction()).to_object()
    jsonschema.validate(content, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**content, "schema": "other/1"}, schema)


def test_schema_is_the_one_of_what_was_rejected(run_cylx, make_extraction):
    from cylx.results import Rejections

    schema = json.loads(run_cylx("config", "schema", "--rejected").stdout)
    content = Rejections.of(make_extraction()).to_object()
    jsonschema.validate(content, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**content, "schema": "other/1"}, schema)
    both = run_cylx("config", "schema", "--rejected", "--result")
    assert (both.exit_code, both.stderr) == (2, "cylx: --rejected: contradicts --result; leave one of them out\n")


@pytest.mark.parametrize("command", ["show", "check", "init", "schema"])
def test_a_wrong_option_is_one_line(run_cylx, command):
    failed = run_cylx("config", command, "--nonsense")
    assert (failed.exit_code, len(failed.stderr.splitlines())) == (2, 1)
