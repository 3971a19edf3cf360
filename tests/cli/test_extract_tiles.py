"""`cylx extract --tile`: the same result by one process or several, after a kill, and of one file or many."""

import json
import re
import signal

import numpy as np
import pytest
from click.testing import CliRunner

from cylx.cli import main
from cylx.io import read_cloud, write_cloud
from tests.support.tiled import pipe, plane, scene

LONG = ((0, 0, 0), (5, 0.2, 0), 0.1)


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(3)
    return scene(rng, pipe(rng, *LONG, 3500), plane(rng, (0, -1, -0.5), (5, 1, -0.5), 1500))


@pytest.fixture(scope="module")
def whole(points, tmp_path_factory):
    """What comes out in one go, in one process: the bytes by the names of the files."""
    folder = tmp_path_factory.mktemp("whole")
    write_cloud(folder / "scan.ply", points)
    done = CliRunner().invoke(main, ["extract", str(folder / "scan.ply"), "--tile", "2"])
    assert done.exit_code == 0, done.output
    return contents(folder)


@pytest.fixture
def folder(tmp_path, points):
    write_cloud(tmp_path / "scan.ply", points)
    return tmp_path


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file() and path.name != "scan.ply"}


def extract(run_cylx, folder, *options, scan="scan.ply"):
    """Extract in tiles, and give the result."""
    done = run_cylx("extract", folder / scan, "--tile", "2", "--overwrite", *options)
    assert done.exit_code == 0, done.stderr
    return done


def left_in(folder):
    return sorted(path.name for path in folder.iterdir() if path.name.startswith(".cylx"))


def test_tiles_by_processes_give_the_same_bytes(run_cylx, folder, points, whole):
    done = extract(run_cylx, folder, "--jobs", "2", "--scratch", folder / "tiles")
    assert contents(folder) == whole
    assert "1 cylinder, written to" in done.stderr
    assert left_in(folder) == []
    assert list((folder / "tiles").iterdir()) == []
    result = json.loads(whole["scan.cylinders.json"])
    assert result["tiles"]["count"] >= 3
    assert result["tiles"]["size"] == 2.0
    assert result["stages"][-1]["name"] == "joining"
    annotated = read_cloud(folder / "scan.annotated.ply")
    assert (annotated.points == points).all()
    assert (annotated.table["cylinder_id"] == 0).sum() == result["cylinders"][0]["inliers"] > 3300


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs signals")
def test_a_killed_run_is_gone_on_with_to_the_same_bytes(spawn_cylx, run_cylx, folder, whole):
    kill = (
        "import os, cylx.tiles.search as s; keep = s.Scratch.write_json\n"
        "def write(self, name, content):\n"
        "    keep(self, name, content)\n"
        "    if name == 'found-1.json':\n"
        "        os.kill(os.getpid(), 9)\n"
        "s.Scratch.write_json = write"
    )
    died = spawn_cylx("extract", folder / "scan.ply", "--tile", "2", "--overwrite", prelude=kill)
    assert died.returncode == -signal.SIGKILL
    (scratch,) = left_in(folder)
    done = {path.name: path.stat().st_mtime_ns for path in (folder / scratch).glob("found-*.json")}
    assert done
    extract(run_cylx, folder, "--resume")
    assert contents(folder) == whole
    assert left_in(folder) == []


def test_page_picture_and_rejected_are_those_of_the_whole(run_cylx, folder, points):
    pytest.importorskip("matplotlib")
    names = ["r.json", "page.html", "picture.png"]
    wanted = [word for pair in zip(["--rejected", "--report", "--png"], names, strict=True) for word in pair]
    wanted = [word if word.startswith("--") else folder / word for word in wanted]
    extract(run_cylx, folder, *wanted)
    first = contents(folder)
    assert first["picture.png"].startswith(b"\x89PNG")
    result = json.loads(first["scan.cylinders.json"])
    rejected = json.loads(first["r.json"])
    assert rejected["input"] == result["input"]
    (blob,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', first["page.html"].decode(), re.S)
    page = json.loads(blob)
    assert page["result"] == {key: value for key, value in result.items() if key != "config"}
    assert page["rejected_count"] == len(rejected["rejected"])
    assert (page["view"]["total"], page["view"]["count"]) == (len(points), len(points))
    assert len(page["maps"]) == len(result["cylinders"]) == 1
    extract(run_cylx, folder, *wanted, "--jobs", "2")
    assert contents(folder) == first


def test_several_files_are_one_cloud(run_cylx, tmp_path, points):
    pytest.importorskip("laspy")
    import laspy

    site = tmp_path / "site"
    site.mkdir()
    for name, half in (("west", points[points[:, 0] < 3]), ("east", points[points[:, 0] >= 3])):
        header = laspy.LasHeader(version="1.4", point_format=7)
        header.scales, header.offsets = [1e-4] * 3, [0.0] * 3
        cloud = laspy.LasData(header)
        cloud.x, cloud.y, cloud.z = half.T
        cloud.red = np.full(len(half), 7)
        cloud.write(site / f"{name}.las")
    done = run_cylx("extract", site, "--one-cloud", "--tile", "2")
    assert done.exit_code == 0, done.stderr
    result = json.loads((site / "site.cylinders.json").read_text())
    files = [(one["file"], one["format"]) for one in result["input"]["files"]]
    assert files == [("east.las", "las"), ("west.las", "las")]
    assert result["input"]["points"] == len(points)
    (one,) = result["cylinders"]
    assert one["height"] == pytest.approx(5.0, abs=0.05)
    clouds = [laspy.read(site / f"{name}.annotated.las") for name in ("east", "west")]
    assert sum(int((cloud.cylinder_id == 0).sum()) for cloud in clouds) == one["inliers"]
    assert (clouds[0]["orig_red"] == 7).all()
    assert run_cylx("extract", site, "--one-cloud", "--tile", "2").exit_code == 4


def test_a_scan_that_does_not_fit_is_cut_and_told_of(run_cylx, folder, monkeypatch):
    monkeypatch.setattr("cylx.cli.batch.tiled.memory_needed", lambda scan: 9e9)
    done = run_cylx("extract", folder / "scan.ply", "--memory", "2GB", "--no-annotate")
    assert done.exit_code == 0, done.stderr
    assert "9 GB would be needed and 2 GB are there: the scan is cut into tiles" in done.stderr
    result = json.loads((folder / "scan.cylinders.json").read_text())
    assert result["tiles"]["count"] == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tile", "0"], "'0' is neither a length nor auto"),
        (["--tile", "auto", "--memory", "much"], "'much' is no memory such as 4GB"),
        (["--tile", "2", "--runs"], "--runs: does not work with tiles; leave it out, and join what was found by: cylx"),
        (["--tile", "2", "--annotated", "a.pcd"], "--annotated a.pcd: does not work with tiles; choose a name in .ply"),
        (["--tile", "2", "--method", "msac"], "method: msac does not work in tiles; use gt"),
        (["--tile", "2", "--memory", "100MB"], "--memory: 0.1 GB are too little; give at least 0.77 GB"),
        (["--tile", "2", "-o", "-"], "--scratch: is needed if the result goes to standard output; give a folder"),
    ],
)
def test_what_does_not_work_with_tiles_is_refused(run_cylx, folder, monkeypatch, options, message):
    monkeypatch.chdir(folder)
    done = run_cylx("extract", "scan.ply", *options)
    assert done.exit_code == 2
    assert message in done.stderr
    assert left_in(folder) == []


def test_the_workers_of_a_cluster_give_the_same_bytes(run_cylx, folder, whole):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        extract(run_cylx, folder, "--scheduler", cluster.scheduler_address)
    assert contents(folder) == whole


def test_a_scheduler_that_is_not_there_is_an_error(run_cylx, folder, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("cylx.tiles.schedule._CALLED", "0.5s")
    done = run_cylx("extract", folder / "scan.ply", "--scheduler", "tcp://127.0.0.1:1")
    assert done.exit_code == 2
    assert "--scheduler tcp://127.0.0.1:1: does not answer" in done.stderr
