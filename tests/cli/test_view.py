"""`cylx view`: the window, and what is refused."""

import sys

import numpy as np
import pytest

import cylx.optional.open3d
from cylx.io import read_cloud
from cylx.palette import cylinder_colors

pytestmark = pytest.mark.usefixtures("fake_pipeline")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


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
