"""`cylx runs`: the runs of a result, with and without its scan, and what is written of them."""

import csv
import io
import json

import jsonschema
import numpy as np
import plyfile
import pytest

from cylx.config import load_config
from cylx.io import write_text
from cylx.records import Extraction, PointCloud, Scene
from cylx.results import Result, result_schema
from tests.support.pipework import NOISE, Pipework, X, Y


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """Write a result without runs, and its scan: two straights with an elbow between them, and a flange."""
    folder = tmp_path_factory.mktemp("plant")
    work = Pipework()
    work.pipe([-1, 0, 0], [0, 0, 0], 0.05, over=(0, 0.02))
    end, onward = work.bend([0, 0, 0], X, Y, 0.15, np.pi / 2, 0.05)
    work.pipe(end, end + onward, 0.05, over=(0.02, 0))
    work.flange(np.array([-0.6, 0, 0]), X, 0.05, 0.1, 0.05)
    points, labels = work.cloud()
    residuals = np.zeros(len(points), np.float32)
    scene = Scene(0.016, NOISE, 2.0)
    found = Extraction(tuple(work.fits), labels, residuals, PointCloud(points), scene, (), load_config())
    write_text(folder / "plant.cylinders.json", Result.of(found).to_json())
    np.savetxt(folder / "plant.xyz", points, fmt="%.6f")
    return folder


def test_runs_are_written_beside_the_result(run_cylx, plant, tmp_path):
    out = tmp_path / "out.json"
    done = run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", out)
    assert done.exit_code == 0
    assert done.stdout == ""
    assert "1 run with 1 elbow, 1 flange, written to" in done.stderr
    document = json.loads(out.read_text())
    jsonschema.validate(document, result_schema())
    assert sorted(one["kind"] for one in document["fittings"]) == ["elbow", "flange"]
    assert [run["cylinders"] for run in document["runs"]] in ([[0, 1]], [[1, 0]])
    again = run_cylx("runs", out)
    assert (again.exit_code, "1 run with 1 elbow, 1 flange" in again.stderr) == (0, True)


def test_the_same_input_gives_the_same_bytes(run_cylx, plant, tmp_path):
    for name in ("a.json", "b.json"):
        run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", tmp_path / name)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_without_a_scan_the_axes_tell(run_cylx, plant):
    done = run_cylx("runs", plant / "plant.cylinders.json", "-o", "-")
    document = json.loads(done.stdout)
    assert [one["kind"] for one in document["fittings"]] == ["elbow"]
    assert document["fittings"][0]["inliers"] == 0


def test_the_bill_of_quantities_is_a_table(run_cylx, plant):
    done = run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "--table")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert [row["item"] for row in rows] == ["pipe", "elbow", "flange"]
    pipe, elbow, _ = rows
    assert (pipe["count"], float(pipe["length"])) == ("2", pytest.approx(2.0, abs=0.05))
    assert (elbow["angle_deg"], float(elbow["bend_radius"])) == ("90", pytest.approx(0.15, rel=0.05))
    assert pipe["size"] == elbow["size"]


def test_points_have_their_fitting_and_their_run(run_cylx, plant, tmp_path):
    cloud = tmp_path / "annotated.ply"
    out = tmp_path / "out.json"
    run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", out, "--annotated", cloud)
    vertices = plyfile.PlyData.read(cloud)["vertex"].data
    document = json.loads(out.read_text())
    for fitting in document["fittings"]:
        own = vertices["fitting_id"] == fitting["id"]
        assert own.sum() == fitting["inliers"]
        assert (vertices["cylinder_id"][own] == -1).all()
        assert (vertices["run_id"][own] == 0).all()
    assert (vertices["run_id"][vertices["cylinder_id"] >= 0] == 0).all()
    assert (vertices["run_id"] == -1).sum() == ((vertices["cylinder_id"] < 0) & (vertices["fitting_id"] < 0)).sum()


def test_runs_as_built_keep_what_was_measured(run_cylx, plant, tmp_path):
    out = tmp_path / "fit.json"
    done = run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", out, "--fit-runs")
    document = json.loads(out.read_text())
    (elbow,) = (one for one in document["fittings"] if one["kind"] == "elbow")
    assert elbow["angle_deg"] == pytest.approx(90.0, abs=1e-6)
    assert all(one["applied"] for one in document["adjustments"])
    assert {one["what"] for one in document["adjustments"]} == {"meeting", "angle_deg", "radius"}
    assert any("measured" in one for one in document["cylinders"])
    assert "constraints applied, 0 refused" in done.stderr


def test_the_report_shows_runs_and_parts(run_cylx, plant, tmp_path):
    page, out = tmp_path / "page.html", tmp_path / "out.json"
    run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", out, "--report", page)
    text = page.read_text()
    assert '"parts"' in text
    assert '"runs": [' in text or '"runs":[' in text


def test_two_results_with_runs_are_compared(run_cylx, plant, tmp_path):
    one, other = tmp_path / "one.json", tmp_path / "other.json"
    run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", one)
    document = json.loads(one.read_text())
    document["fittings"] = [fitting for fitting in document["fittings"] if fitting["kind"] != "elbow"]
    document["runs"] = [dict(document["runs"][0], id=i, cylinders=[i], fittings=[]) for i in (0, 1)]
    other.write_text(json.dumps(document))
    assert run_cylx("diff", one, one).stdout == "the same 2 cylinders and 2 fittings\n"
    failed = run_cylx("diff", one, other, "--json")
    assert failed.exit_code == 1
    told = [(found["kind"], found["of"], found["what"]) for found in json.loads(failed.stdout)["differences"]]
    assert told == [("missing", "fittings", "elbow"), ("parted", "runs", "run")]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--annotated", "x.ply"], "--annotated: needs the points; name the scan after the result"),
        (["--report", "x.html"], "--report: needs the points; name the scan after the result"),
    ],
)
def test_what_needs_points_needs_a_scan(run_cylx, plant, arguments, said):
    failed = run_cylx("runs", plant / "plant.cylinders.json", *arguments)
    assert failed.exit_code == 2
    assert said in failed.stderr


def test_an_existing_file_is_kept(run_cylx, plant, tmp_path):
    out = tmp_path / "out.json"
    out.write_text("mine")
    failed = run_cylx("runs", plant / "plant.cylinders.json", "-o", out)
    assert (failed.exit_code, out.read_text()) == (4, "mine")


def test_tiles_and_runs_exclude_each_other(run_cylx, plant):
    failed = run_cylx("extract", plant / "plant.xyz", "--runs", "--tile", "1")
    assert failed.exit_code == 2
    assert "--runs: does not work with tiles" in failed.stderr


def test_a_cloud_of_another_place_is_told(run_cylx, plant, tmp_path):
    moved, out = tmp_path / "moved.xyz", tmp_path / "out.json"
    np.savetxt(moved, np.loadtxt(plant / "plant.xyz") + 5.0, fmt="%.6f")
    done = run_cylx("runs", plant / "plant.cylinders.json", moved, "-o", out)
    (said,) = json.loads(out.read_text())["warnings"]
    assert said.startswith("2 of 2 cylinders have hardly any points in the cloud; ")
    assert f"warning: {said}" in done.stderr
    right = run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", "-")
    assert json.loads(right.stdout)["warnings"] == []


def test_the_labels_of_another_result_are_not_taken(run_cylx, plant, tmp_path):
    clouds, out = [tmp_path / f"{name}.ply" for name in "ab"], tmp_path / "out.json"
    document = json.loads((plant / "plant.cylinders.json").read_text())
    first, second = document["cylinders"]
    document["cylinders"] = [dict(second, id=0), dict(first, id=1)]
    (tmp_path / "other.json").write_text(json.dumps(document))
    for cloud, result in zip(clouds, (plant / "plant.cylinders.json", tmp_path / "other.json"), strict=True):
        run_cylx("runs", result, plant / "plant.xyz", "-o", out, "--overwrite", "--annotated", cloud)
    answers = [run_cylx("runs", plant / "plant.cylinders.json", cloud, "-o", "-").stdout for cloud in clouds]
    inliers = [[one["inliers"] for one in json.loads(answer)["cylinders"]] for answer in answers]
    assert inliers[0] == pytest.approx(inliers[1], rel=0.02)
    assert min(inliers[0]) > 0


def test_what_is_not_there_cannot_be_joined(run_cylx, plant, tmp_path):
    out = tmp_path / "out.json"
    run_cylx("runs", plant / "plant.cylinders.json", plant / "plant.xyz", "-o", out)
    document = json.loads(out.read_text())
    document["cylinders"].pop()
    out.write_text(json.dumps(document))
    failed = run_cylx("runs", out, "--table")
    assert failed.exit_code == 3
    assert "joins cylinder 1, which is not there" in failed.stderr
