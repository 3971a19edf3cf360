"""`cylx stems`: the table, the files beside it, and what is refused."""

import csv
import io
import json
import sqlite3

import jsonschema
import laspy
import numpy as np
import plyfile
import pytest

from cylx.io import write_cloud
from cylx.results.stems import COLUMNS, stems_schema
from cylx.synthetic.stand import forest

ORIGIN = (432000.0, 5410000.0, 310.0)


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """Write a small plot with map coordinates."""
    folder = tmp_path_factory.mktemp("plot")
    plot = forest(5, side=6.0, spacing=0.02, shrubs_per_hectare=100).moved(offset=ORIGIN)
    write_cloud(folder / "plot.ply", plot.points)
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    las.header.scales, las.header.offsets = [0.0005] * 3, ORIGIN
    las.x, las.y, las.z = plot.points.T
    las.classification = np.where(plot.labels == -2, 2, 5)
    las.write(folder / "plot.las")
    return folder, plot


def test_all_files_are_written_and_agree(run_cylx, scan, tmp_path):
    folder, plot = scan
    names = [tmp_path / name for name in ("a.csv", "a.json", "a.gpkg")]
    done = run_cylx(
        "stems", folder / "plot.ply", *(part for name in names for part in ("-o", name)), "--annotated",
        tmp_path / "a.ply", "--report", tmp_path / "a.html", "--ground", "lowest",
    )  # fmt: skip
    assert (done.exit_code, done.stdout) == (0, "")
    document = json.loads(names[1].read_text())
    jsonschema.validate(document, stems_schema())
    rows = list(csv.DictReader(io.StringIO(names[0].read_text())))
    assert list(rows[0]) == list(COLUMNS)
    assert len(rows) == len(document["stems"]) >= 2
    for row, stem in zip(rows, document["stems"], strict=True):
        true = min(plot.stems, key=lambda one: np.hypot(one.x - stem["x"], one.y - stem["y"]))
        assert float(row["dbh"]) == pytest.approx(stem["dbh"], rel=1e-5) == pytest.approx(true.dbh, rel=0.03)
        assert float(row["x"]) == pytest.approx(true.x, abs=0.05)
    with sqlite3.connect(names[2]) as base:
        assert base.execute("SELECT id, dbh FROM stems").fetchall() == [(s["id"], s["dbh"]) for s in document["stems"]]
    trees = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]["treeID"]
    assert [int((trees == s["id"]).sum()) for s in document["stems"]] == [s["points"] for s in document["stems"]]
    page = (tmp_path / "a.html").read_text()
    assert page.count("<circle") == len(rows)
    assert "script" not in page.lower()
    assert f"{len(rows)} stems" in done.stderr


def test_las_keeps_its_points_and_gets_tree_ids(run_cylx, scan, tmp_path):
    folder, _ = scan
    out = tmp_path / "out.las"
    done = run_cylx("stems", folder / "plot.las", "--annotated", out, "--json")
    document = json.loads(done.stdout)
    assert document["ground_by"] == "classes"
    before, after = laspy.read(folder / "plot.las"), laspy.read(out)
    assert (before.X == after.X).all()
    assert (before.classification == after.classification).all()
    ids = np.asarray(after["treeID"])
    assert set(np.unique(ids)) == {0, *(stem["id"] for stem in document["stems"])}


def test_the_same_input_gives_the_same_bytes(run_cylx, scan, tmp_path):
    for name in ("a.json", "b.json"):
        run_cylx("stems", scan[0] / "plot.ply", "-o", tmp_path / name, "--ground", "lowest")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["-o", "a.xlsx"], 2, "is no format of stems"),
        (["-o", "a.geojson"], 4, "the scan says no CRS"),
        (["--annotated", "a.laz"], 4, "neither LAS nor LAZ"),
        (["--min-dbh", "-1"], 2, "min-dbh"),
    ],
)
def test_what_cannot_be_done_is_refused(run_cylx, scan, tmp_path, monkeypatch, args, code, said):
    monkeypatch.chdir(tmp_path)
    done = run_cylx("stems", scan[0] / "plot.ply", *args, "--ground", "lowest")
    assert (done.exit_code, said in done.stderr) == (code, True), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_cloud_too_large_for_a_plot_is_refused(run_cylx, tmp_path):
    rng = np.random.default_rng(0)
    write_cloud(tmp_path / "mm.ply", rng.uniform(0, 20000, (1000, 3)))
    done = run_cylx("stems", tmp_path / "mm.ply")
    assert (done.exit_code, "give its unit by --units" in done.stderr) == (3, True)
