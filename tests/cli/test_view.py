"""`cylx extract --report` and `--png`, and `cylx view`: files, refusals, exit codes."""

import sys
from pathlib import Path

import numpy as np
import pytest

import cylx.optional.open3d
from cylx.cli.batch.jobs import plan_jobs
from cylx.io import read_cloud
from cylx.palette import cylinder_colors

pytestmark = pytest.mark.usefixtures("fake_pipeline")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_the_report_and_the_picture_are_written_beside_the_rest(run_cylx, scan, tmp_path):
    done = run_cylx("extract", scan, "--no-annotate", "--report", tmp_path / "a.html", "--png", tmp_path / "a.png")
    assert (done.exit_code, done.stdout) == (0, "")
    assert names(tmp_path) == ["a.html", "a.png", "scan.cylinders.json", "scan.xyz"]
    written = [tmp_path / name for name in ("scan.cylinders.json", "a.html", "a.png")]
    assert done.stderr.splitlines()[0].endswith(f"written to {written[0]}, {written[1]} and {written[2]}")
    assert (tmp_path / "a.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert str(tmp_path) not in (tmp_path / "a.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("option", ["--report", "--png"])
def test_the_same_scan_gives_the_same_bytes(run_cylx, scan, tmp_path, option):
    for name in ("one", "two"):
        done = run_cylx("extract", scan, "-o", tmp_path / f"{name}.json", "--no-annotate", option, tmp_path / name)
        assert done.exit_code == 0
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_they_go_into_folders(run_cylx, scan, tmp_path):
    twin = tmp_path / "twin.xyz"
    twin.write_bytes(scan.read_bytes())
    (tmp_path / "looks").mkdir()
    looks = tmp_path / "looks"
    assert run_cylx("extract", scan, twin, "-q", "--report", looks, "--png", looks).exit_code == 0
    assert names(looks) == ["scan.cylinders.png", "scan.report.html", "twin.cylinders.png", "twin.report.html"]


def test_they_have_these_names():
    (job,) = plan_jobs(["-"], "out.json", None, None, None, "looks/", "/dev/stdout")
    assert (Path(job.report), job.picture) == (Path("looks/stdin.report.html"), "-")


def test_the_report_may_go_to_standard_output(run_cylx, scan):
    done = run_cylx("extract", scan, "--report", "-", "-q")
    assert done.stdout.startswith("<!doctype html>")
    failed = run_cylx("extract", scan, "--report", "-", "-o", "-")
    assert (failed.exit_code, failed.stderr) == (
        2,
        "cylx: standard output: is asked for by two outputs; choose another name\n",
    )


@pytest.mark.parametrize("option", ["--report", "--png"])
def test_one_file_for_several_scans_is_refused(run_cylx, scan, tmp_path, fake_pipeline, option):
    failed = run_cylx("extract", scan, tmp_path / "b.xyz", option, "all")
    line = f"cylx: {option} all: is one file for several inputs; give a folder, or one input\n"
    assert (failed.exit_code, failed.stderr) == (2, line)
    failed = run_cylx("extract", scan, tmp_path / "b.xyz", option, f"{tmp_path}/gone/")
    assert (failed.exit_code, failed.stderr) == (4, f"cylx: {tmp_path}/gone/: no such folder; create it first\n")
    assert fake_pipeline.calls == []


@pytest.mark.parametrize("option", ["--report", "--png"])
def test_what_exists_is_refused_before_computing(run_cylx, scan, tmp_path, fake_pipeline, option):
    (tmp_path / "old").write_text("precious")
    failed = run_cylx("extract", scan, option, tmp_path / "old")
    line = f"cylx: {tmp_path / 'old'}: exists already; choose another name, or give --overwrite\n"
    assert (failed.exit_code, failed.stderr) == (4, line)
    assert fake_pipeline.calls == []
    assert run_cylx("extract", scan, option, tmp_path / "old", "--overwrite").exit_code == 0
    assert (tmp_path / "old").read_bytes() != b"precious"


def test_a_picture_without_matplotlib_is_refused_before_computing(run_cylx, scan, tmp_path, fake_pipeline, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    failed = run_cylx("extract", scan, "--png", tmp_path / "a.png")
    line = "cylx: the picture: matplotlib is not installed; pip install 'cylx[plots]'\n"
    assert (failed.exit_code, failed.stderr) == (2, line)
    assert fake_pipeline.calls == []
    assert run_cylx("extract", scan, "--report", tmp_path / "a.html").exit_code == 0


def test_a_picture_that_cannot_be_drawn_leaves_nothing_behind(run_cylx, scan, tmp_path, monkeypatch):
    def fail(_):
        raise MemoryError

    monkeypatch.setattr("cylx.report.png_of", fail)
    options = ["--png", tmp_path / "a.png", "--report", tmp_path / "a.html"]
    assert run_cylx("extract", scan, *options).exit_code == 3
    assert names(tmp_path) == ["scan.xyz"]


# the window


@pytest.fixture
def result(run_cylx, scan):
    """A result with its annotated cloud beside it."""
    assert run_cylx("extract", scan, "-q").exit_code == 0
    return scan.with_name("scan.cylinders.json")


@pytest.fixture
def shown(monkeypatch):
    """What would have been shown in a window."""
    calls = []
    monkeypatch.setattr(cylx.optional.open3d, "show_scene", lambda *args: calls.append(args))
    return calls


def test_the_window_has_the_cloud_and_the_cylinders(run_cylx, result, shown):
    assert run_cylx("view", result).exit_code == 0
    ((points, colors, cylinders, tints, title),) = shown
    assert len(points) == 24
    assert np.array_equal(colors, np.tile(cylinder_colors(np.array([0])), (24, 1)))
    assert [radius for _, _, radius in cylinders] == [1.0, 2.0]
    assert np.array_equal(tints, cylinder_colors(np.arange(2)))
    assert title == "cylx: scan.xyz, 2 cylinders"


def test_any_other_cloud_is_grey(run_cylx, result, scan, shown):
    assert run_cylx("view", result, "--cloud", scan).exit_code == 0
    assert set(shown[0][1].ravel()) == {128}
    assert len(read_cloud(scan).points) == len(shown[0][0])


def test_without_the_annotated_cloud_it_must_be_named(run_cylx, result):
    result.with_name("scan.annotated.ply").unlink()
    failed = run_cylx("view", result)
    line = f"cylx: {result}: has no annotated cloud beside it; name the cloud by --cloud FILE\n"
    assert (failed.exit_code, failed.stderr) == (3, line)


def test_what_is_no_result_is_refused(run_cylx, tmp_path):
    (tmp_path / "a.json").write_text("{}")
    failed = run_cylx("view", tmp_path / "a.json")
    assert failed.exit_code == 3
    assert failed.stderr.startswith(f"cylx: {tmp_path / 'a.json'}")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there is always a display")
@pytest.mark.parametrize("display", [None, ":987"])
def test_without_a_display_it_says_so(run_cylx, result, monkeypatch, display):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if display:
        monkeypatch.setenv("DISPLAY", display)
    failed = run_cylx("view", result)
    line = "cylx: the window: there is no display; write a page instead, by cylx extract --report\n"
    assert (failed.exit_code, failed.stderr) == (2, line)
