"""`cylx extract --report` and `--png`: files, refusals, exit codes."""

import sys
from pathlib import Path

import pytest

from cylx.cli.batch.jobs import plan_jobs

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


def test_the_others_are_kept_if_the_picture_cannot_be_drawn(run_cylx, scan, tmp_path, monkeypatch):
    def fail(_):
        raise MemoryError

    monkeypatch.setattr("cylx.report.png_of", fail)
    options = ["--png", tmp_path / "a.png", "--report", tmp_path / "a.html"]
    assert run_cylx("extract", scan, *options).exit_code == 3
    assert names(tmp_path) == ["a.html", "scan.annotated.ply", "scan.cylinders.json", "scan.xyz"]
