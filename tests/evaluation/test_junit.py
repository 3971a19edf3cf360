"""A comparison as JUnit XML: each entry is a test, whatever the files say."""

from xml.etree import ElementTree

from cylx.evaluation import compare
from cylx.evaluation.junit import junit


def cylinder(number, **others):
    shape = {"axis_point": [10 * number, 0, 0], "axis_direction": [0, 0, 1], "radius": 1, "height": 4, "inliers": 100}
    return {"id": number, **shape, **others}


def fitting(number, **others):
    return {"id": number, "kind": "elbow", "center": [10 * number, 5, 0], "bend_radius": 2.0, "angle_deg": 90, **others}


def read(a, b, names=("golden/a.json", "new/b.json")):
    """Give the comparison, the one suite, and the failure of each test by its class and name."""
    comparison = compare(a, b)
    root = ElementTree.fromstring(junit(a, b, comparison, names))
    (suite,) = root
    assert [root.get(key) for key in ("tests", "failures", "errors")] == [
        suite.get(key) for key in ("tests", "failures", "errors")
    ]
    assert int(suite.get("tests")) == len(suite.findall("testcase"))
    assert int(suite.get("failures")) == len(suite.findall("testcase/failure"))
    tests = {(case.get("classname"), case.get("name")): case.find("failure") for case in suite}
    assert len(tests) == len(suite)
    return comparison, suite, tests


def test_the_same_results_pass_all_tests():
    a = {"cylinders": [cylinder(0), cylinder(1)], "blends": [cylinder(0)]}
    comparison, suite, tests = read(a, a)
    assert comparison.same
    assert set(tests.values()) == {None}
    assert suite.get("name") == "golden/a.json and new/b.json"
    assert list(tests) == [
        ("golden.a_json.cylinders", "cylinder 0"),
        ("golden.a_json.cylinders", "cylinder 1"),
        ("golden.a_json.blends", "blend 0"),
    ]


def test_the_counts_are_those_of_the_comparison_and_each_failure_says_why():
    a = {"cylinders": [cylinder(0), cylinder(1), cylinder(2)], "blends": [cylinder(4)]}
    b = {"cylinders": [cylinder(2), cylinder(0, radius=1.01, inliers=50), cylinder(7)], "blends": []}
    comparison, suite, tests = read(a, b)
    only_b = comparison.cylinders_b - comparison.matched
    assert int(suite.get("tests")) == comparison.cylinders_a + only_b + comparison.blends_a == 5
    failed = {name: failure for (_, name), failure in tests.items() if failure is not None}
    assert {name: failure.get("type") for name, failure in failed.items()} == {
        "cylinder 0": "resized",
        "cylinder 1": "missing",
        "cylinder 7 of B": "extra",
        "blend 4": "missing",
    }
    lines = failed["cylinder 0"].text.split("\n")
    assert lines[0] == "resized: radius: A 1, B 1.01, difference 0.01, tolerance 0.005 (id 0 in A, 0 in B)"
    assert lines[1].startswith("recounted: inliers: A 100, B 50, ")
    assert failed["cylinder 0"].get("message") == "; ".join(lines)
    assert failed["cylinder 7 of B"].text == "extra: cylinder 7 of radius 1 is only in B"
    assert sum(len(failure.text.split("\n")) for failure in failed.values()) == len(comparison.differences)


def test_fittings_and_runs_are_tests_too():
    runs = [{"id": 0, "cylinders": [0], "length": 4}, {"id": 1, "cylinders": [1], "length": 4}]
    joined = [{"id": 0, "cylinders": [0, 1], "length": 8}]
    cylinders = [cylinder(0), cylinder(1)]
    a = {"cylinders": cylinders, "fittings": [fitting(0), fitting(1)], "runs": runs}
    b = {"cylinders": cylinders, "fittings": [fitting(0, angle_deg=80), fitting(3)], "runs": joined}
    comparison, suite, tests = read(a, b)
    failed = {name: failure.get("type") for (_, name), failure in tests.items() if failure is not None}
    assert failed == {"fitting 0": "moved", "fitting 1": "missing", "fitting 3 of B": "extra", "run 1": "joined"}
    counts = comparison.piping.counts
    only_b = counts["fittings_b"] - counts["fittings_matched"]
    assert int(suite.get("tests")) == 2 + counts["fittings_a"] + only_b + counts["runs_a"]


def test_texts_of_others_are_harmless():
    nasty = "a\x00\x1b[2J\ud800\ufffe<&\"'>]]>\n.json"
    a = {"cylinders": [], "fittings": [fitting(0, kind=nasty)]}
    _, suite, tests = read(a, {"cylinders": []}, (f"../{nasty}", "-"))
    (failure,) = tests.values()
    assert "<&\"'>]]>" in failure.text
    for text in (suite.get("name"), failure.text, failure.get("message"), suite[0].get("classname")):
        assert text.isprintable()


def test_entries_without_ids_or_with_the_same_are_told_apart():
    without = [{key: value for key, value in cylinder(number).items() if key != "id"} for number in range(2)]
    same = [{**one, "id": 3} for one in without]
    assert [name for _, name in read({"cylinders": without}, {"cylinders": []})[2]] == ["cylinder 0", "cylinder 1"]
    assert [name for _, name in read({"cylinders": same}, {"cylinders": []})[2]] == ["cylinder 3", "cylinder 3 (2)"]


def test_the_same_comparison_gives_the_same_bytes_and_none_has_no_tests():
    a = {"cylinders": []}
    assert junit(a, a, compare(a, a), ("a", "b")) == junit(a, a, compare(a, a), ("a", "b"))
    assert read(a, a)[1].get("tests") == "0"
