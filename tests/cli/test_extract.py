"""`cylx extract`: names of outputs, streams, exit codes, batches."""

import json
import os
import sys

import jsonschema
import numpy as np
import pytest
from plyfile import PlyData

import cylx.io
from cylx.cli.batch.jobs import plan_jobs
from cylx.cli.options.configuration import METHODS
from cylx.cli.terminal.display import Messages
from cylx.config import load_config
from cylx.errors import InputError, OutputError, UsageError
from cylx.io.staging import known_name
from cylx.results import rejections_schema, result_schema
from cylx.synthetic import single
from tests.support.terminals import on_a_terminal

pytestmark = pytest.mark.usefixtures("fake_pipeline")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def scans(tmp_path, scan):
    """Three scans in a folder."""
    paths = [tmp_path / f"{name}.xyz" for name in "abc"]
    for path in paths:
        path.write_bytes(scan.read_bytes())
    scan.unlink()
    return paths


# one scan


def test_it_writes_both_files_beside_the_scan(run_cylx, scan):
    done = run_cylx("extract", scan)
    assert (done.exit_code, done.stdout) == (0, "")
    assert names(scan.parent) == ["scan.annotated.ply", "scan.cylinders.json", "scan.xyz"]
    content = json.loads(scan.with_name("scan.cylinders.json").read_bytes())
    jsonschema.validate(content, result_schema())
    assert [content["input"]["file"], len(content["cylinders"])] == ["scan.xyz", 2]
    vertices = PlyData.read(scan.with_name("scan.annotated.ply"))["vertex"]
    assert set(vertices["cylinder_id"]) == {0}


def test_the_conversation_is_on_standard_error(run_cylx, scan):
    said = run_cylx("extract", scan).stderr.splitlines()
    written = f"{scan.with_name('scan.cylinders.json')} and {scan.with_name('scan.annotated.ply')}"
    assert said[0] == f"{scan}: 2 cylinders, written to {written}"
    assert said[1] == "warning: made by hand"
    assert said[2].split()[:4] == ["id", "radius", "height", "coverage"]
    assert said[4].split() == ["0", "1", "4", "360°", "24", "0.25", "-", "0.000", "0.000", "1.000"]
    assert len(said) == 6


def test_blends_are_counted_but_not_in_the_table(run_cylx, scan, fake_pipeline):
    plain = run_cylx("extract", scan).stderr.splitlines()
    fake_pipeline.blends = 3
    said = run_cylx("extract", scan, "--overwrite").stderr.splitlines()
    assert said[0].startswith(f"{scan}: 2 cylinders and 3 blends, written to ")
    assert said[1:] == plain[1:]
    content = json.loads(scan.with_name("scan.cylinders.json").read_bytes())
    assert [len(content["cylinders"]), len(content["blends"])] == [2, 3]


@pytest.mark.parametrize(
    ("options", "expected"), [([], True), (["--blends"], True), (["--no-blends"], False),
                              (["--set", "verification.blends=false"], False)]
)  # fmt: skip
def test_blends_are_looked_for_unless_that_is_switched_off(run_cylx, scan, fake_pipeline, options, expected):
    run_cylx("extract", scan, *options)
    ((_, config, _),) = fake_pipeline.calls
    assert config.verification.blends is expected


def test_the_option_beats_the_configuration(run_cylx, scan, fake_pipeline, tmp_path):
    (tmp_path / "my.yaml").write_text("verification: {blends: false}")
    run_cylx("extract", scan, "-c", tmp_path / "my.yaml", "--blends")
    ((_, config, _),) = fake_pipeline.calls
    assert config.verification.blends is True


def test_quiet_says_nothing_and_verbose_says_more(run_cylx, scan):
    assert run_cylx("extract", scan, "-q").stderr == ""
    said = run_cylx("extract", scan, "-v", "--overwrite").stderr
    assert "spacing 0.25, noise 0, extent 5" in said
    assert "slicing" in said
    assert "too few points 2" in said


def test_a_long_table_is_cut_short(run_cylx, scan, fake_pipeline):
    fake_pipeline.found = 50
    said = run_cylx("extract", scan).stderr
    assert "… and 30 more; -v shows them all" in said
    assert len(said.splitlines()) == 25
    assert len(run_cylx("extract", scan, "--overwrite", "-v").stderr.splitlines()) > 54


def test_no_cylinder_is_an_answer(run_cylx, scan, fake_pipeline):
    fake_pipeline.found = 0
    done = run_cylx("extract", scan)
    assert done.exit_code == 0
    assert done.stderr.startswith(f"{scan}: 0 cylinders, written to ")
    assert len(done.stderr.splitlines()) == 2
    assert json.loads(scan.with_name("scan.cylinders.json").read_bytes())["cylinders"] == []


def test_dash_puts_the_json_alone_on_standard_output(run_cylx, scan):
    done = run_cylx("extract", scan, "-o", "-")
    jsonschema.validate(json.loads(done.stdout), result_schema())
    assert names(scan.parent) == ["scan.xyz"]


def test_standard_input_goes_to_standard_output(run_cylx, scan):
    done = run_cylx("extract", "-", input=scan.read_bytes())
    assert (done.exit_code, json.loads(done.stdout)["input"]["file"]) == (0, "-")
    assert names(scan.parent) == ["scan.xyz"]


def test_the_same_scan_gives_the_same_bytes(run_cylx, scan, tmp_path):
    for name in ("one.json", "two.json"):
        assert run_cylx("extract", scan, "-o", tmp_path / name, "--no-annotate").exit_code == 0
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


@pytest.mark.parametrize(
    ("scan", "options", "result", "annotated"),
    [
        ("a/scan.ply", {}, "a/scan.cylinders.json", "a/scan.annotated.ply"),
        ("scan.v2.ply", {}, "scan.v2.cylinders.json", "scan.v2.annotated.ply"),
        ("scan", {}, "scan.cylinders.json", "scan.annotated.ply"),
        ("scan.ply", {"annotate": False}, "scan.cylinders.json", None),
        ("a/scan.ply", {"output": "b/out.json"}, "b/out.json", "b/out.annotated.ply"),
        ("a/scan.ply", {"output": "b/x.cylinders.json"}, "b/x.cylinders.json", "b/x.annotated.ply"),
        ("a/scan.ply", {"output": "b/"}, "b/scan.cylinders.json", "b/scan.annotated.ply"),
        ("scan.ply", {"output": "-"}, "-", None),
        ("scan.ply", {"output": "/dev/stdout"}, "-", None),
        ("a/scan.ply", {"output": "-", "annotate": True}, "-", "a/scan.annotated.ply"),
        ("scan.ply", {"output": "-", "annotated": "x.ply"}, "-", "x.ply"),
        ("scan.ply", {"annotated": "-"}, "scan.cylinders.json", "-"),
        ("-", {}, "-", None),
        ("-", {"output": "out.json"}, "out.json", "out.annotated.ply"),
        ("-", {"output": "b/"}, "b/stdin.cylinders.json", "b/stdin.annotated.ply"),
        ("-", {"annotated": "x.ply"}, "-", "x.ply"),
    ],
)
def test_outputs_have_these_names(scan, options, result, annotated):
    (job,) = plan_jobs([scan], **{"output": None, "annotate": None, "annotated": None, **options})
    assert (job.result, job.annotated) == (result, annotated)


def test_an_existing_folder_takes_the_outputs(run_cylx, scan, tmp_path):
    (tmp_path / "results").mkdir()
    assert run_cylx("extract", scan, "-o", tmp_path / "results").exit_code == 0
    assert names(tmp_path / "results") == ["scan.annotated.ply", "scan.cylinders.json"]


@pytest.mark.parametrize(
    ("scans", "options", "message"),
    [
        (["a.ply", "a.ply"], {}, "a.cylinders.json: is asked for by two outputs; choose another name"),
        (
            ["a.ply", "./a.pcd"],
            {},
            "a.cylinders.json: would be the result of a.ply and of ./a.pcd; rename one of them, or run each by itself"
            " into its own folder",
        ),
        (["a.ply"], {"output": "a.ply"}, "a.ply: is an input as well as an output; choose another name"),
        (["a.ply"], {"annotated": "./a.ply"}, "./a.ply: is an input as well as an output; choose another name"),
        (["a.ply"], {"output": "x", "annotated": "x"}, "x: is asked for by two outputs; choose another name"),
        (
            ["a.ply"],
            {"output": "-", "annotated": "-"},
            "standard output: is asked for by two outputs; choose another name",
        ),
        (
            ["a.ply"],
            {"annotate": False, "annotated": "x"},
            "--annotated: contradicts --no-annotate; leave one of them out",
        ),
        (["-"], {"annotate": True}, "--annotate: the annotated cloud has no name; give one by --annotated FILE"),
        (["a.ply", "-"], {}, "-: standard input is one of several inputs; give it alone"),
        (
            ["a.ply", "b.ply"],
            {"annotated": "x.ply"},
            "--annotated: names one file for several inputs; leave it out, or give one input",
        ),
        (["a.ply", "b.ply"], {"output": "-"}, "-o -: is one file for several inputs; give a folder, or one input"),
        (["a.ply", "b.ply"], {"output": "old"}, "-o old: is one file for several inputs; give a folder, or one input"),
    ],
)
def test_outputs_in_the_way_of_each_other_are_refused(tmp_path, monkeypatch, scans, options, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old").touch()
    with pytest.raises(UsageError) as caught:
        plan_jobs(scans, **{"output": None, "annotate": None, "annotated": None, **options})
    assert str(caught.value).removeprefix("./") == message.removeprefix("./")


@pytest.mark.parametrize("existing", ["scan.cylinders.json", "scan.annotated.ply", "times.json", "no.json"])
def test_what_exists_is_refused_before_computing(run_cylx, scan, fake_pipeline, existing):
    scan.with_name(existing).write_text("precious")
    others = ["--profile", scan.with_name("times.json"), "--rejected", scan.with_name("no.json")]
    failed = run_cylx("extract", scan, *others)
    place = scan.with_name(existing)
    line = f"cylx: {place}: exists already; choose another name, or give --overwrite\n"
    assert (failed.exit_code, failed.stderr) == (4, line)
    assert fake_pipeline.calls == []
    assert place.read_text() == "precious"
    assert names(scan.parent) == sorted([existing, "scan.xyz"])


def test_the_profile_must_not_be_another_output(run_cylx, scan):
    for options in (["-o", "-", "--profile", "-"], ["--profile", scan.with_name("scan.cylinders.json")]):
        failed = run_cylx("extract", scan, *options)
        assert (failed.exit_code, failed.stdout) == (2, "")
        assert "is asked for by two outputs" in failed.stderr


def test_overwrite_replaces_it(run_cylx, scan):
    scan.with_name("scan.cylinders.json").write_text("old")
    assert run_cylx("extract", scan, "--overwrite").exit_code == 0
    assert json.loads(scan.with_name("scan.cylinders.json").read_bytes())["schema"] == "cylx.cylinders/1"


JSON, ANNOTATED, REJECTED = "scan.cylinders.json", "scan.annotated.ply", "no.json"
REFUSED = OutputError("it", "cannot be written: no space left on device", "free some space")


@pytest.mark.parametrize(
    ("broken", "failure", "code", "left"),
    [
        (JSON, REFUSED, 4, []),
        (REJECTED, REFUSED, 4, [ANNOTATED, JSON]),
        (ANNOTATED, REFUSED, 4, [REJECTED, JSON]),
        (ANNOTATED, MemoryError(), 3, [REJECTED, JSON]),
        (ANNOTATED, ZeroDivisionError("oh"), 1, [REJECTED, JSON]),
        (ANNOTATED, KeyboardInterrupt(), 130, []),
    ],
)
@pytest.mark.parametrize("old", [False, True])
def test_the_json_is_kept_when_another_output_fails(run_cylx, scan, monkeypatch, broken, failure, code, left, old):
    kept = [ANNOTATED, REJECTED, JSON] if old else []
    for name in kept:
        scan.with_name(name).write_text("old")

    def refusing(write):
        def refuse(path, *args, **settings):
            write(path, *args, **settings)
            if known_name(path).endswith(broken):
                raise failure

        return refuse

    for name in ("write_text", "write_annotated"):
        monkeypatch.setattr(f"cylx.io.{name}", refusing(getattr(cylx.io, name)))
    done = run_cylx("extract", scan, "-q", "--rejected", scan.with_name(REJECTED), *["--overwrite"] * old)
    assert done.exit_code == code
    assert len(done.stderr.splitlines()) == 1
    if isinstance(failure, ZeroDivisionError):
        assert done.stderr.endswith(f"the input was {scan}, and the output {scan.with_name(broken)}\n")
    assert names(scan.parent) == sorted([*(left or kept), "scan.xyz"])
    assert all((scan.with_name(name).read_bytes() == b"old") is (not left) for name in left or kept)


def test_all_outputs_that_fail_are_named_in_one_line(run_cylx, scan, fake_pipeline, monkeypatch):
    folder = scan.with_name("gone")
    folder.mkdir()

    def seek_meanwhile(*args, **kwargs):
        folder.rmdir()
        return fake_pipeline(*args, **kwargs)

    monkeypatch.setattr("cylx.pipeline.extract_cylinders", seek_meanwhile)
    options = ["--annotated", folder / "a.ply", "--rejected", folder / REJECTED]
    done = run_cylx("extract", scan, *options)
    assert done.exit_code == 4
    first, *_, last = done.stderr.splitlines()
    assert first == f"{scan}: 2 cylinders, written to {scan.with_name(JSON)}"
    fault = f"the folder {str(folder)!r} does not exist; create it first"
    assert last == f"cylx: {folder / 'a.ply'}, {folder / REJECTED}: {fault}"
    assert names(scan.parent) == [JSON, scan.name]


@pytest.mark.parametrize(
    "failure", [KeyboardInterrupt(), MemoryError(), InputError("scan.xyz", "all points are equal", "x")]
)
def test_a_failure_of_the_pipeline_leaves_nothing_behind(run_cylx, scan, fake_pipeline, failure):
    fake_pipeline.found = failure
    failed = run_cylx("extract", scan, "--profile", scan.with_name("times.json"))
    assert failed.exit_code in {130, 3}
    assert len(failed.stderr.splitlines()) == 1
    assert names(scan.parent) == ["scan.xyz"]


def test_require_counts_after_writing(run_cylx, scan):
    assert run_cylx("extract", scan, "--require", 2).exit_code == 0
    failed = run_cylx("extract", scan, "--require", 3, "--overwrite", "-q")
    line = f"cylx: {scan}: cylinders: 2 found, 3 required; look at the scan, or require fewer\n"
    assert (failed.exit_code, failed.stderr) == (5, line)
    assert names(scan.parent) == ["scan.annotated.ply", "scan.cylinders.json", "scan.xyz"]


def test_profile_has_the_times_of_the_stages(run_cylx, scan, tmp_path):
    assert run_cylx("extract", scan, "--profile", tmp_path / "times.json").exit_code == 0
    profile = json.loads((tmp_path / "times.json").read_bytes())
    (run,) = profile["inputs"]
    assert list(run["stages"]) == ["reading", "slicing", "writing"]
    assert run["stages"]["slicing"] == 0.5
    assert (run["points"], run["cylinders"]) == (24, 2)
    assert profile["peak_memory_bytes"] > 10_000_000 or sys.platform == "win32"
    assert "seconds" not in scan.with_name("scan.cylinders.json").read_text()


# what was not accepted


def test_rejected_has_what_was_not_accepted(run_cylx, scan, tmp_path):
    done = run_cylx("extract", scan, "--rejected", tmp_path / "no.json")
    assert (done.exit_code, done.stdout) == (0, "")
    assert names(tmp_path) == ["no.json", "scan.annotated.ply", "scan.cylinders.json", "scan.xyz"]
    first = done.stderr.splitlines()[0]
    written = [tmp_path / name for name in ("scan.cylinders.json", "scan.annotated.ply", "no.json")]
    assert first == f"{scan}: 2 cylinders, written to {written[0]}, {written[1]} and {written[2]}"
    content = json.loads((tmp_path / "no.json").read_bytes())
    jsonschema.validate(content, rejections_schema())
    assert [rejected["reason"] for rejected in content["rejected"]] == ["agreement"]
    assert "rejected" not in json.loads(scan.with_name("scan.cylinders.json").read_bytes())
    assert run_cylx("extract", scan, "--rejected", tmp_path / "no.json", "--overwrite", "-q").exit_code == 0
    assert json.loads((tmp_path / "no.json").read_bytes()) == content


def test_rejected_may_go_to_standard_output(run_cylx, scan):
    done = run_cylx("extract", scan, "--rejected", "-")
    assert json.loads(done.stdout)["schema"] == "cylx.rejected/1"
    assert names(scan.parent) == ["scan.annotated.ply", "scan.cylinders.json", "scan.xyz"]


def test_rejected_of_several_scans_goes_into_a_folder(run_cylx, scans, tmp_path, fake_pipeline):
    for name in ("all.json", "-", str(tmp_path / "a.xyz")):
        failed = run_cylx("extract", *scans, "--rejected", name)
        line = f"cylx: --rejected {name}: is one file for several inputs; give a folder, or one input\n"
        assert (failed.exit_code, failed.stderr) == (2, line)
    gone = f"{tmp_path}/gone/"
    failed = run_cylx("extract", *scans, "--rejected", gone)
    assert (failed.exit_code, failed.stderr) == (4, f"cylx: {gone}: no such folder; create it first\n")
    assert fake_pipeline.calls == []
    (tmp_path / "no").mkdir()
    assert run_cylx("extract", *scans, "--rejected", tmp_path / "no", "--no-annotate").exit_code == 0
    assert names(tmp_path / "no") == ["a.rejected.json", "b.rejected.json", "c.rejected.json"]


# options


def test_what_is_known_reaches_the_pipeline(run_cylx, scan, fake_pipeline):
    options = ["--axis", "0,-2,1", "--axis-tolerance", 5, "--axis-sd", 0.5, "--min-coverage", 60, "-o", "-"]
    options += ["--known-radius", "0.5:0.01"]
    assert run_cylx("extract", scan, *options).exit_code == 0
    assert run_cylx("extract", scan, "--axis", "y", "--known-radius", "0.5", "-o", "-").exit_code == 0
    scan.with_name("pipes.csv").write_text("radius,name\n0.5,DN\n")
    assert run_cylx("extract", scan, "--catalogue", scan.with_name("pipes.csv"), "-o", "-").exit_code == 0
    (_, config, _), (_, other, _), (_, listed, _) = fake_pipeline.calls
    assert [(entry.name, entry.radius) for entry in listed.scene.catalogue] == [("DN", 0.5)]
    assert (config.scene.axis, config.scene.axis_tolerance_deg) == ([0, -2, 1], 5)
    assert config.verification.min_coverage_deg == 60
    assert (config.scene.axis_sd_deg, config.scene.known_radius, config.scene.known_radius_sd) == (0.5, 0.5, 0.01)
    assert (other.scene.axis_sd_deg, other.scene.known_radius, other.scene.known_radius_sd) == (None, 0.5, None)
    assert (other.scene.axis, other.scene.axis_tolerance_deg) == ([0, 1, 0], 10)


def test_options_reach_the_pipeline(run_cylx, scan, tmp_path, fake_pipeline):
    (tmp_path / "my.yaml").write_text("slicing: {planes: 1, thickness: 0.5}\npreset: paper\nseed: 3")
    options = ["-c", tmp_path / "my.yaml", "--set", "slicing.planes=2", "--set", "slicing.min_points=9", "--planes", 7]
    options += ["--radius", ":2.5", "--max-cylinders", 4, "--threads", 2, "-o", "-"]
    assert run_cylx("extract", scan, *options).exit_code == 0
    ((cloud, config, threads),) = fake_pipeline.calls
    assert (len(cloud.points), threads) == (24, 2)
    assert (config.preset, config.seed, config.max_cylinders) == ("paper", 3, 4)
    assert (config.slicing.planes, config.slicing.thickness, config.slicing.min_points) == (7, 0.5, 9)
    assert (config.scene.radius_min, config.scene.radius_max) == (None, 2.5)


@pytest.mark.parametrize(
    ("value", "bounds"), [("0.1:2", (0.1, 2)), ("1e-3:", (0.001, None)), (":5", (None, 5)), ("2:2", (2, 2))]
)
def test_radius_may_leave_a_side_open(run_cylx, scan, fake_pipeline, value, bounds):
    assert run_cylx("extract", scan, "--radius", value).exit_code == 0
    scene = fake_pipeline.calls[0][1].scene
    assert (scene.radius_min, scene.radius_max) == bounds


@pytest.mark.parametrize(
    ("value", "fault"),
    [
        ("3:1", "'3:1' has its smallest radius above its largest; write 1:3"),
        ("3", "'3' is not MIN:MAX, such as 0.01:0.2, 0.01: or :0.2"),
        (":", "':' is not MIN:MAX, such as 0.01:0.2, 0.01: or :0.2"),
        ("1:2:3", "'1:2:3' is not MIN:MAX, such as 0.01:0.2, 0.01: or :0.2"),
        ("a:2", "'a' is not a number"),
        ("0:2", "'0' is not a radius; it must be > 0 and finite"),
        ("1:inf", "'inf' is not a radius; it must be > 0 and finite"),
        ("nan:1", "'nan' is not a radius; it must be > 0 and finite"),
    ],
)
def test_an_impossible_radius_is_refused(run_cylx, scan, value, fault):
    failed = run_cylx("extract", scan, "--radius", value)
    line = f"cylx: Invalid value for '--radius': {fault}; see 'cylx extract --help'\n"
    assert (failed.exit_code, failed.stderr) == (2, line)


# batches


def test_several_scans_are_taken_one_after_the_other(run_cylx, scans, tmp_path):
    done = run_cylx("extract", *scans, "--profile", tmp_path / "times.json", "--no-annotate")
    assert done.exit_code == 0
    assert [path.with_suffix(".cylinders.json").is_file() for path in scans] == [True] * 3
    assert [run["file"] for run in json.loads((tmp_path / "times.json").read_bytes())["inputs"]] == list(
        map(str, scans)
    )


def test_a_failing_scan_does_not_stop_the_rest(run_cylx, scans, tmp_path):
    scans[1].write_text("no points in here\n")
    failed = run_cylx("extract", *scans, tmp_path / "none.xyz", "-q")
    assert failed.exit_code == 6
    one, two, three = failed.stderr.splitlines()
    assert one.startswith(f"cylx: {scans[1]}:")
    assert two.startswith(f"cylx: {tmp_path / 'none.xyz'}: no such file")
    assert three == "cylx: 2 of 4 inputs: failed; see the lines above; the others are done"
    assert [path.with_suffix(".cylinders.json").is_file() for path in scans] == [True, False, True]


def test_too_few_cylinders_in_one_of_several_is_a_failure(run_cylx, scans):
    failed = run_cylx("extract", *scans, "-q", "--require", 3)
    assert failed.exit_code == 6
    assert failed.stderr.count("2 found, 3 required") == 3
    assert all(path.with_suffix(".cylinders.json").is_file() for path in scans)


def test_a_batch_is_refused_as_a_whole_if_an_output_exists(run_cylx, scans, fake_pipeline):
    scans[2].with_suffix(".annotated.ply").touch()
    assert run_cylx("extract", *scans).exit_code == 4
    assert fake_pipeline.calls == []


def test_a_batch_goes_into_a_folder(run_cylx, scans, tmp_path):
    failed = run_cylx("extract", *scans, "-o", tmp_path / "results")
    assert (failed.exit_code, failed.stderr) == (4, f"cylx: {tmp_path / 'results'}: no such folder; create it first\n")
    (tmp_path / "results").mkdir()
    assert run_cylx("extract", *scans, "-o", tmp_path / "results", "--no-annotate").exit_code == 0
    results = [f"{name}.cylinders.json" for name in "abc"]
    assert names(tmp_path / "results") == [*results, "summary.csv", "summary.json"]


def test_the_same_name_in_two_folders_is_fine(run_cylx, scan, tmp_path):
    (tmp_path / "other").mkdir()
    twin = tmp_path / "other" / "scan.xyz"
    twin.write_bytes(scan.read_bytes())
    assert run_cylx("extract", scan, twin).exit_code == 0
    failed = run_cylx("extract", scan, twin, "-o", tmp_path, "--overwrite")
    line = (
        f"cylx: {tmp_path / 'scan.cylinders.json'}: would be the result of {scan} and of {twin}; rename one of them, or"
    )
    assert (failed.exit_code, failed.stderr) == (2, f"{line} run each by itself into its own folder\n")


# on a terminal


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_progress_is_shown_on_a_terminal_only(run_cylx, scan, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    assert "\x1b" not in run_cylx("extract", scan).stderr
    shown = on_a_terminal(lambda: show_progress(Messages()))
    assert "compiling (the first time only)" in shown
    assert "1/2" in shown
    assert on_a_terminal(lambda: show_progress(Messages(quiet=True))) == ""


# methods


@pytest.mark.parametrize("method", METHODS)
def test_the_method_reaches_the_pipeline(run_cylx, scan, fake_pipeline, method):
    assert run_cylx("extract", scan, "--method", method).exit_code == 0
    (call,) = fake_pipeline.calls
    assert call[1] == load_config(options={"method": method})
    content = json.loads(scan.with_name("scan.cylinders.json").read_bytes())
    assert content["method"] == content["config"]["method"] == method


def test_a_competitor_answers_in_the_same_form(run_cylx, tmp_path, monkeypatch):
    monkeypatch.undo()  # the pipeline itself is asked
    scene = single(points=1500, sigma=0.01, seed=1)
    np.savetxt(tmp_path / "can.xyz", scene.points)
    done = run_cylx("extract", tmp_path / "can.xyz", "--method", "line-fit")
    assert (done.exit_code, done.stdout) == (0, "")
    assert names(tmp_path) == ["can.annotated.ply", "can.cylinders.json", "can.xyz"]
    content = json.loads((tmp_path / "can.cylinders.json").read_bytes())
    jsonschema.validate(content, result_schema())
    assert content["method"] == "line-fit"
    (cylinder,) = content["cylinders"]
    # a least-squares fit of 1500 points has 2e-4 of standard deviation
    assert cylinder["radius"] == pytest.approx(1.0, abs=1e-3)
    assert not {"payoff", "confidence", "uncertainty"} & set(cylinder)
    ids = PlyData.read(tmp_path / "can.annotated.ply")["vertex"]["cylinder_id"]
    assert (ids == 0).sum() == cylinder["inliers"] > 1400


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (["--method", "ransac"], "Invalid value for '--method': 'ransac' is not one of "),
        (["--method", "GT"], "Invalid value for '--method': 'GT' is not one of "),
        (
            ["--method", "tran", "--known-radius", "1"],
            "scene.known_radius: is for method gt alone, and the method is tran",
        ),
        (
            ["--method", "jin", "--axis", "z", "--axis-sd", "1"],
            "scene.axis_sd_deg: is for method gt alone, and the method is jin",
        ),
        (
            ["--set", "method=7"],
            "--set method: 7 is not one of its values; choose gt or msac or line-fit or tran or jin",
        ),
        (
            ["--set", "slicing.inclination_deg=[0, 10]"],
            "slicing.inclination_deg: is given without the axis it refers to",
        ),
    ],
)
def test_a_method_that_there_is_not_or_that_cannot_do_it_is_refused(run_cylx, scan, fake_pipeline, options, fault):
    failed = run_cylx("extract", scan, *options)
    (line,) = failed.stderr.splitlines()
    assert (failed.exit_code, fake_pipeline.calls) == (2, [])
    assert line.startswith(f"cylx: {fault}")
    assert names(scan.parent) == ["scan.xyz"]


def show_progress(messages):
    with messages.progress() as observer:
        observer.stage_started("compiling", None)
        observer.stage_finished("compiling", 1.0)
        observer.stage_started("slicing", 2)
        observer.stage_advanced(1)
