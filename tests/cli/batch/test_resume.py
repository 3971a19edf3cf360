"""What is taken from an earlier run, and what is not believed."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from tests.cli.batch.test_batch import extract, pipeline, scans  # noqa: F401  fixtures
from tests.conftest import POINTS

OUTPUTS = ("--report", "a.html", "--png", "a.png", "--rejected", "r.json", "-o", "a.json")
ALL = ("a.json", "a.annotated.ply", "a.html", "a.png", "r.json")


@pytest.fixture
def run(run_cylx, tmp_path, monkeypatch, pipeline):  # noqa: F811
    monkeypatch.chdir(tmp_path)
    np.savetxt("a.xyz", POINTS, fmt="%.6f")

    def go(*options):
        pipeline.calls = ()
        done = run_cylx("extract", "a.xyz", *OUTPUTS, "--resume", *options)
        return len(pipeline.calls), done.exit_code, done.stderr

    return go


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("left", [0, 0.5, -1], ids=["empty", "half", "without the last byte"])
def test_an_output_cut_short_is_made_again(run, name, left):
    assert run()[:2] == (1, 0)
    assert run()[:2] == (0, 0)
    whole = Path(name).read_bytes()
    Path(name).write_bytes(whole[: int(left * len(whole)) if left >= 0 else left])
    assert run()[:2] == (int(left != -1 or name not in ("a.json", "r.json", "a.html")), 0)
    assert Path(name).read_bytes().rstrip() == whole.rstrip()


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_an_annotated_cloud_of_another_length_is_made_again(run, suffix):
    options = ("--annotated", f"b{suffix}")
    assert [run(*options)[0], run(*options)[0]] == [1, 0]
    with Path(f"b{suffix}").open("ab") as file:
        file.write(b"\0")
    assert run(*options)[0] == 1


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_an_annotated_las_cut_short_is_made_again(run_cylx, tmp_path, monkeypatch, pipeline, suffix):  # noqa: F811
    laspy = pytest.importorskip("laspy")
    monkeypatch.chdir(tmp_path)
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.x, cloud.y, cloud.z = POINTS.T
    cloud.write(f"a{suffix}")
    command = ("extract", f"a{suffix}", "--annotated", f"b{suffix}", "--resume")
    for calls in (1, 1):
        assert run_cylx(*command).exit_code == 0
        assert len(pipeline.calls) == calls
    os.truncate(f"b{suffix}", Path(f"b{suffix}").stat().st_size // 2)
    assert run_cylx(*command).exit_code == 0
    assert len(pipeline.calls) == 2


def test_a_page_of_another_result_is_made_again(run):
    run()
    page = Path("a.html").read_text(encoding="utf-8")
    Path("a.html").write_text(page.replace('"radius":1.0', '"radius":1.5', 1), encoding="utf-8")
    assert run()[0] == 1
    assert Path("a.html").read_text(encoding="utf-8") == page


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.html", b"<html><title>my notes</title></html>"),
        ("a.png", b"\x89PNG\r\n\x1a\nmine"),
        ("a.json", b'{"schema": "mine"}'),
        ("a.annotated.ply", b"ply\nformat ascii 1.0\n"),
        ("r.json", b"[]"),
    ],
)
def test_files_of_the_user_are_left_alone(run, name, content):
    run()
    Path(name).write_bytes(content)
    calls, code, said = run()
    assert (calls, code) == (0, 4)
    assert f"{name}: exists already, and cylx did not write it" in said
    assert Path(name).read_bytes() == content


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb"])
def test_a_mesh_of_the_user_is_left_alone(run, suffix):
    pytest.importorskip("trimesh")
    mesh = ("--mesh", f"m{suffix}", "--units", "m") if suffix == ".glb" else ("--mesh", f"m{suffix}")
    assert [run(*mesh)[:2], run(*mesh)[:2]] == [(1, 0), (0, 0)]
    whole = Path(f"m{suffix}").read_bytes()
    Path(f"m{suffix}").write_bytes(whole[:-20])
    assert run(*mesh)[:2] == (1, 0)
    assert Path(f"m{suffix}").read_bytes() == whole
    Path(f"m{suffix}").write_bytes(b"# a mesh of mine\n")
    assert run(*mesh)[:2] == (0, 4)


@pytest.mark.parametrize("spoil", ["{}", "", '{"schema": "cylx.result/1", "cylinders": [{}]}'])
def test_a_result_damaged_before_the_summary_does_not_stop_it(run_cylx, scans, monkeypatch, pipeline, spoil):  # noqa: F811
    from cylx.cli.batch import batch

    summed_up = batch.Batch._sum_up

    def spoiled(self):
        Path("results/00.cylinders.json").write_text(spoil)
        summed_up(self)

    monkeypatch.setattr(batch.Batch, "_sum_up", spoiled)
    assert extract(run_cylx).exit_code == 6
    assert len(json.loads(Path("results/summary.json").read_text())["files"]) == 20
    assert "scans/00.xyz" not in Path("results/summary.csv").read_text()
    assert "scans/01.xyz" in Path("results/summary.csv").read_text()
