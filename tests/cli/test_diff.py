"""`cylx diff`: same or not, and what differs."""

import json
from dataclasses import fields
from xml.etree import ElementTree

import pytest

from cylx.cli.diff import diff
from cylx.evaluation import Tolerances


def cylinder(number, **others):
    shape = {"axis_point": [10 * number, 0, 0], "axis_direction": [0, 0, 1], "radius": 1, "height": 4, "inliers": 100}
    return {"id": number, **shape, **others}


@pytest.fixture
def compare(run_cylx, tmp_path):
    """Compare two lists of cylinders."""

    def run(a, b, *options):
        for name, cylinders in (("a.json", a), ("b.json", b)):
            (tmp_path / name).write_text(json.dumps({"cylinders": cylinders}))
        return run_cylx("diff", tmp_path / "a.json", tmp_path / "b.json", *options)

    return run


def test_the_same_cylinders_in_another_order_are_the_same(compare):
    done = compare([cylinder(0), cylinder(1)], [cylinder(1), cylinder(0)])
    assert (done.exit_code, done.stdout, done.stderr) == (0, "the same 2 cylinders\n", "")


def test_what_differs_is_shown(compare):
    other = [cylinder(0, radius=1.01), cylinder(5)]
    failed = compare([cylinder(0), cylinder(1)], other)
    assert (failed.exit_code, failed.stderr) == (1, "")
    header, _, *rows = [line.split() for line in failed.stdout.splitlines()]
    assert header[:3] == ["what", "id", "in"]
    assert rows == [
        ["resized", "0", "0", "radius", "1", "1.01", "0.01", "0.005"],
        ["missing", "1", "cylinder", "1"],
        ["extra", "5", "cylinder", "1"],
    ]


def test_blends_are_compared_too(run_cylx, tmp_path):
    for name, blends in (("a", [cylinder(0)]), ("b", [cylinder(0)]), ("c", [cylinder(0, radius=1.01), cylinder(3)])):
        (tmp_path / f"{name}.json").write_text(json.dumps({"cylinders": [cylinder(0)], "blends": blends}))
    done = run_cylx("diff", tmp_path / "a.json", tmp_path / "b.json")
    assert (done.exit_code, done.stdout) == (0, "the same 1 cylinder and 1 blend\n")
    failed = run_cylx("diff", tmp_path / "a.json", tmp_path / "c.json")
    assert failed.exit_code == 1
    assert [line.split() for line in failed.stdout.splitlines()[2:]] == [
        ["resized", "blend", "0", "blend", "0", "radius", "1", "1.01", "0.01", "0.005"],
        ["extra", "blend", "3", "blend", "1"],
    ]
    content = json.loads(run_cylx("diff", tmp_path / "a.json", tmp_path / "c.json", "--json").stdout)
    assert (content["blends_a"], content["blends_b"], content["blends_matched"]) == (1, 2, 1)
    assert {entry["of"] for entry in content["differences"]} == {"blends"}


def test_json_has_the_same(compare):
    failed = compare([cylinder(0)], [cylinder(0, inliers=50)], "--json")
    content = json.loads(failed.stdout)
    assert failed.exit_code == 1
    assert content["same"] is False
    assert [entry["kind"] for entry in content["differences"]] == ["recounted"]
    assert json.loads(compare([], [], "--json").stdout)["same"] is True


@pytest.mark.parametrize(
    ("change", "option", "tight", "loose"),
    [
        ({"axis_direction": [0, 0.1, 1]}, "--angle", 5.7, 5.8),
        ({"axis_point": [0.1, 0, 0]}, "--offset", 0.09, 0.11),
        ({"radius": 1.02}, "--radius", 0.019, 0.021),
        ({"height": 4.5}, "--height", 0.08, 0.1),
        ({"inliers": 90}, "--inliers", 0.09, 0.11),
    ],
)
def test_each_tolerance_can_be_set(compare, change, option, tight, loose):
    slack = {"--angle": 9, "--offset": 1, "--radius": 1, "--height": 1, "--inliers": 1}
    others = [str(part) for name, value in slack.items() if name != option for part in (name, value)]
    assert compare([cylinder(0)], [cylinder(0, **change)], *others, option, tight).exit_code == 1
    assert compare([cylinder(0)], [cylinder(0, **change)], *others, option, loose).exit_code == 0


def test_a_fault_names_the_file_it_is_in(compare, tmp_path):
    failed = compare([cylinder(0)], [cylinder(0, radius="x")])
    line = f"cylx: {tmp_path / 'b.json'}: cylinders[0].radius: is not a number: 'x'; give a number\n"
    assert (failed.exit_code, failed.stdout, failed.stderr) == (3, "", line)


def test_a_missing_file_is_no_difference(run_cylx, tmp_path):
    failed = run_cylx("diff", tmp_path / "a.json", tmp_path / "b.json")
    assert (failed.exit_code, failed.stderr) == (3, f"cylx: {tmp_path / 'a.json'}: no such file; check the path\n")


@pytest.mark.parametrize(("radius", "code", "failures"), [(1, 0, "0"), (1.01, 1, "1")])
def test_a_junit_file_is_written_and_changes_no_exit_code(compare, tmp_path, radius, code, failures):
    plain = compare([cylinder(0)], [cylinder(0, radius=radius)])
    done = compare([cylinder(0)], [cylinder(0, radius=radius)], "--junit", tmp_path / "diff.xml")
    assert (done.exit_code, done.stdout, done.stderr) == (code, plain.stdout, "")
    root = ElementTree.parse(tmp_path / "diff.xml").getroot()
    assert (root.tag, root.get("tests"), root.get("failures")) == ("testsuites", "1", failures)
    shown = compare([cylinder(0)], [cylinder(0, radius=radius)], "--junit", "-")
    assert (shown.exit_code, shown.stdout.encode()) == (code, (tmp_path / "diff.xml").read_bytes())


def test_a_junit_file_that_is_there_is_replaced_only_if_told_so(compare, tmp_path):
    (tmp_path / "diff.xml").write_text("mine")
    failed = compare([cylinder(0)], [cylinder(0)], "--junit", tmp_path / "diff.xml")
    assert (failed.exit_code, failed.stdout) == (4, "")
    assert "exists already; choose another name, or give --overwrite" in failed.stderr
    assert (tmp_path / "diff.xml").read_text() == "mine"
    assert compare([cylinder(0)], [cylinder(0)], "--junit", tmp_path / "diff.xml", "--overwrite").exit_code == 0
    assert ElementTree.parse(tmp_path / "diff.xml").getroot().get("tests") == "1"


@pytest.mark.parametrize(
    ("name", "others", "change", "code", "fault"),
    [
        ("a.json", ["--overwrite"], {}, 2, "is an input as well as an output"),
        ("-", ["--json"], {}, 2, "goes to standard output, and so does --json; give --junit a file"),
        ("none/diff.xml", [], {}, 4, "does not exist; create it first"),
        (".", [], {}, 4, "is a folder"),
        ("diff.xml", [], {"radius": "x"}, 3, "is not a number"),
        ("diff.xml", [], {"axis_direction": [0, 0, 0]}, 3, "b.json"),
        ("diff.xml", [], {"id": "x"}, 3, "is not a whole number"),
    ],
)
def test_what_is_wrong_with_a_junit_file_is_said_and_none_is_written(
    compare, tmp_path, name, others, change, code, fault
):
    path = name if name == "-" else tmp_path / name
    failed = compare([cylinder(0)], [cylinder(0, **change)], "--junit", path, *others)
    assert (failed.exit_code, failed.stdout) == (code, "")
    assert fault in failed.stderr
    assert failed.stderr.count("\n") == 1
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.json", "b.json"]
    assert json.loads((tmp_path / "a.json").read_text()) == {"cylinders": [cylinder(0)]}


def test_the_tolerances_are_those_of_the_library():
    options = {option.name: option.default for option in diff.params}
    assert {field.name: options[field.name] for field in fields(Tolerances)} == {
        field.name: field.default for field in fields(Tolerances)
    }
