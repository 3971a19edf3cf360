"""`cylx evaluate`: numbers, bars, exit codes."""

import inspect
import json

import pytest

from cylx import evaluation
from cylx.cli.evaluate import evaluate


def cylinder(number, **others):
    return {
        "id": number,
        "axis_point": [10 * number, 0, 0],
        "axis_direction": [0, 0, 1],
        "radius": 1,
        "height": 4,
        **others,
    }


@pytest.fixture
def files(tmp_path):
    """Write a truth of three cylinders, and a result that has two of them and a false one."""
    truth = {"cylinders": [cylinder(0), cylinder(1), cylinder(2)]}
    result = {
        "cylinders": [
            cylinder(0, radius=1.01, axis_point=[0.1, 0, 0]),
            cylinder(1, axis_direction=[0, 0.01, 1]),
            cylinder(7),
        ]
    }
    for name, content in (("result.json", result), ("truth.json", truth)):
        (tmp_path / name).write_text(json.dumps(content))
    return [tmp_path / "result.json", tmp_path / "truth.json"]


def test_it_says_how_good_a_result_is(run_cylx, files):
    done = run_cylx("evaluate", *files)
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "truth 3, found 3, matched 2, duplicates 0, ignored 0",
        "precision 0.6667, recall 0.6667, F1 0.6667",
        "angle     median 0.286°, mean 0.286°, max 0.573°",
        "offset    median 0.05 r, mean 0.05 r, max 0.1 r",
        "radius    median 0.005 r, mean 0.005 r, max 0.01 r",
        "missed    2",
        "false     7",
    ]


def test_fittings_and_runs_have_lines_of_their_own(run_cylx, files):
    bend = {
        "kind": "elbow",
        "joins": [0, 1],
        "center": [0, 3, 0],
        "start": [0, 0, 0],
        "end": [3, 3, 0],
        "normal": [0, 0, 1],
        "radius": 1,
    }
    for path, radius, angle in ((files[0], 3.03, 90.5), (files[1], 3, 90)):
        content = json.loads(path.read_bytes())
        fittings = [
            {**bend, "bend_radius": radius, "angle_deg": angle},
            {"kind": "cap", "joins": [2], "center": [9, radius, 9]},
        ]
        path.write_text(json.dumps({**content, "fittings": fittings, "runs": [{"cylinders": [0, 1]}]}))
    lines = run_cylx("evaluate", *files).stdout.splitlines()
    assert lines[7:] == [
        "elbow     truth 1, found 1, matched 1, ignored 0, precision 1.0000, recall 1.0000, F1 1.0000",
        "cap       truth 1, found 1, matched 1, ignored 0, precision 1.0000, recall 1.0000, F1 1.0000",
        "elbows    bend radius median 0.01, max 0.01, angle median 0.5°, max 0.5°, within 5 % and 1° 1.0000",
        "runs      truth 1, found 1, pairs 1, found 1, matched 1, precision 1.0000, recall 1.0000, F1 1.0000",
    ]


def test_json_has_all_there_is(run_cylx, files):
    content = json.loads(run_cylx("evaluate", *files, "--json", "--min-f1", 0.9).stdout)
    assert content.pop("bars_missed") == ["f1 0.666667 is below --min-f1 0.9"]
    result, truth = (json.loads(path.read_bytes()) for path in files)
    assert content == evaluation.evaluate(truth, result).to_dict()


def test_limits_decide_what_is_a_match(run_cylx, files):
    assert "matched 1" in run_cylx("evaluate", *files, "--angle", 0.5).stdout
    assert "matched 1" in run_cylx("evaluate", *files, "--radius", 0.005).stdout
    assert "matched 0" in run_cylx("evaluate", *files, "--angle", 0.5, "--radius", 0.005).stdout


@pytest.mark.parametrize(
    ("reached", "missed", "line"),
    [
        (["--min-f1", 0.66], ["--min-f1", 0.67], "f1 0.666667 is below --min-f1 0.67"),
        (["--min-precision", 0.66], ["--min-precision", 0.67], "precision 0.666667 is below --min-precision 0.67"),
        (["--min-recall", 0.66], ["--min-recall", 0.67], "recall 0.666667 is below --min-recall 0.67"),
        (["--max-angle", 0.58], ["--max-angle", 0.57], "angle 0.572939 is above --max-angle 0.57"),
        (["--max-offset", 0.11], ["--max-offset", 0.09], "offset 0.1 is above --max-offset 0.09"),
        (
            ["--max-radius-error", 0.0101],
            ["--max-radius-error", 0.0099],
            "radius-error 0.01 is above --max-radius-error 0.0099",
        ),
    ],
)
def test_a_bar_that_is_missed_is_named(run_cylx, files, reached, missed, line):
    assert run_cylx("evaluate", *files, *reached).exit_code == 0
    failed = run_cylx("evaluate", *files, *missed)
    assert (failed.exit_code, failed.stderr) == (1, f"cylx: {line}\n")
    assert failed.stdout.startswith("truth 3")


def test_errors_of_no_match_are_not_small(run_cylx, files, tmp_path):
    (tmp_path / "none.json").write_text('{"cylinders": []}')
    failed = run_cylx("evaluate", tmp_path / "none.json", files[1], "--max-angle", 1)
    line = "cylx: angle is unknown, as nothing was matched, and --max-angle 1 needs it\n"
    assert (failed.exit_code, failed.stderr) == (1, line)
    assert (
        run_cylx("evaluate", tmp_path / "none.json", tmp_path / "none.json", "--max-angle", 1, "--min-f1", 1).exit_code
        == 0
    )


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("", ": is empty"),
        ("{", ":1:2: not JSON"),
        ("[]", ": is not a JSON object"),
        ('{"cylinders": 3}', ": has no list 'cylinders'"),
        ('{"cylinders": [{"axis_point": [0, 0, 0]}]}', ": cylinders[0].axis_direction: is missing"),
    ],
)
def test_a_file_that_is_no_result_is_named(run_cylx, files, content, fault):
    for index in (0, 1):
        before = files[index].read_text()
        files[index].write_text(content)
        failed = run_cylx("evaluate", *files)
        files[index].write_text(before)
        assert (failed.exit_code, failed.stdout) == (3, "")
        assert failed.stderr.startswith(f"cylx: {files[index]}{fault}")
        assert len(failed.stderr.splitlines()) == 1


@pytest.mark.parametrize("options", [["--min-f1", "2"], ["--max-angle", "-1"], ["--angle", "0"], ["--angle", "x"]])
def test_an_impossible_bar_is_refused(run_cylx, files, options):
    failed = run_cylx("evaluate", *files, *options)
    assert (failed.exit_code, failed.stdout, len(failed.stderr.splitlines())) == (2, "", 1)


def test_the_limits_are_those_of_the_library():
    parameters = inspect.signature(evaluation.evaluate).parameters
    options = {option.name: option.default for option in evaluate.params}
    for name in ("angle_deg", "offset", "radius"):
        assert options[name] == parameters[name].default
