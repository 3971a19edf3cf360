"""`cylx synth`: scenes as the library makes them, and their truth beside them."""

import inspect
import json
from pathlib import Path

import numpy as np
import pytest

from cylx import synthetic
from cylx.cli.synth import synth
from cylx.io import read_cloud

SMALL = ["--points", 500]


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz"])
def test_it_writes_the_scene_and_its_truth(run_cylx, tmp_path, suffix):
    out = tmp_path / f"can{suffix}"
    options = ["--height", 3, "--sigma", 0.02, "--p", 0.1, "--sigma-o", 0.05, "--theta", 90, "--seed", 4]
    done = run_cylx("synth", "single", out, *SMALL, *options)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    scene = synthetic.single(points=500, height=3, sigma=0.02, p=0.1, sigma_o=0.05, theta_deg=90, seed=4)
    assert np.allclose(read_cloud(out).points, scene.points, rtol=0, atol=1e-9)
    truth = json.loads((tmp_path / "can.truth.json").read_bytes())
    assert truth["cylinders"] == scene.truth()["cylinders"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([out.name, "can.truth.json"])


def test_several_cylinders_with_other_things(run_cylx, tmp_path):
    counts = {"cylinders": 2, "planes": 2, "boxes": 1, "spheres": 0, "cones": 0}
    options = [part for name, count in counts.items() for part in (f"--{name}", count)]
    options += ["--noise", 0.1, "--sigma", 0.001, "--radius", "0.1:0.2", "--coverage", 200, "--room", 3, "--seed", 5]
    assert run_cylx("synth", "multi", tmp_path / "room.ply", *SMALL, *options).exit_code == 0
    scene = synthetic.multi(
        points=500,
        **counts,
        noise=0.1,
        sigma=0.001,
        radius_min=0.1,
        radius_max=0.2,
        coverage_min_deg=200,
        room=3,
        seed=5,
    )
    assert np.array_equal(read_cloud(tmp_path / "room.ply").points, scene.points)
    assert json.loads((tmp_path / "room.truth.json").read_bytes())["cylinders"] == scene.truth()["cylinders"]


def test_scale_and_offset_move_points_and_truth_alike(run_cylx, tmp_path):
    options = ["--scale", 1000, "--offset", "-512345.678,5412345.432,123.4"]
    assert run_cylx("synth", "single", tmp_path / "far.ply", *SMALL, *options).exit_code == 0
    scene = synthetic.single(points=500)
    offset = np.array([-512345.678, 5412345.432, 123.4])
    assert np.allclose(read_cloud(tmp_path / "far.ply").points, 1000 * scene.points + offset, rtol=0, atol=1e-6)
    (cylinder,) = json.loads((tmp_path / "far.truth.json").read_bytes())["cylinders"]
    assert cylinder["axis_point"] == pytest.approx(offset.tolist())
    assert (cylinder["radius"], cylinder["height"]) == (1000, 4000)


def test_single_precision_takes_half_the_room(run_cylx, tmp_path):
    for precision in ("single", "double"):
        run_cylx("synth", "single", tmp_path / f"{precision}.ply", *SMALL, "--precision", precision)
    sizes = [(tmp_path / f"{precision}.ply").stat().st_size for precision in ("single", "double")]
    assert 500 * 12 < sizes[0] < 500 * 24 < sizes[1]


@pytest.mark.parametrize("existing", ["can.ply", "can.truth.json"])
def test_what_exists_stays(run_cylx, tmp_path, existing):
    (tmp_path / existing).write_text("precious")
    failed = run_cylx("synth", "single", tmp_path / "can.ply", *SMALL)
    line = f"cylx: {tmp_path / existing}: exists already; choose another name, or give --overwrite\n"
    assert (failed.exit_code, failed.stderr) == (4, line)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["precious"]
    assert run_cylx("synth", "single", tmp_path / "can.ply", *SMALL, "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("kind", "options", "fault"),
    [
        ("single", ["--p", "2"], "p: must be in [0, 1], not 2.0"),
        ("single", ["--theta", "0"], "theta_deg: must be in (0, 360], not 0.0"),
        ("single", ["--points", "0"], "points: must be > 0, not 0"),
        ("single", ["--points", "many"], "Invalid value for '--points'"),
        (
            "single",
            ["--offset", "1,2"],
            "Invalid value for '--offset': '1,2' is not three numbers such as 100,200,0",
        ),
        ("single", ["--offset", "1,2,x"], "Invalid value for '--offset'"),
        ("single", ["--offset", "1,2,nan"], "offset: must be three finite numbers"),
        ("single", ["--scale", "0"], "scale: must be > 0, not 0.0"),
        ("single", ["--seed", "-1"], "Invalid value for '--seed'"),
        ("multi", ["--radius", "0.1:"], "--radius: one side is empty; give both, such as 0.04:0.16"),
        ("multi", ["--room", "0.1"], ""),
        ("forest", ["--side", "1"], "side: must be 2 to 200 m, not 1.0"),
        ("forest", ["--spacing", "0"], "spacing: must be 0.001 to 0.1 m, not 0.0"),
        ("forest", ["--scanner", "none"], "Invalid value for '--scanner'"),
    ],
)
def test_an_impossible_scene_is_refused(run_cylx, tmp_path, kind, options, fault):
    failed = run_cylx("synth", kind, tmp_path / "out.ply", *options)
    assert failed.exit_code == 2
    assert failed.stderr.startswith(f"cylx: {fault}")
    assert len(failed.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_suffix_is_refused(run_cylx, tmp_path):
    failed = run_cylx("synth", "single", tmp_path / "can.docx", *SMALL)
    assert failed.exit_code == 4
    assert len(failed.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_piping_lists_fittings_and_runs(run_cylx, tmp_path):
    options = ["--runs", 2, "--scanners", 3, "--planes", 1, "--noise", 0.02, "--sigma", 0.001, "--seed", 5]
    done = run_cylx("synth", "piping", tmp_path / "plant.ply", "--points", 2000, *options, "--scale", 1000)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    scene = synthetic.piping(points=2000, runs=2, scanners=3, planes=1, noise=0.02, sigma=0.001, seed=5).moved(1000)
    assert np.array_equal(read_cloud(tmp_path / "plant.ply").points, scene.points)
    assert json.loads((tmp_path / "plant.truth.json").read_bytes()) == scene.truth()


def test_a_forest_lists_its_stems(run_cylx, tmp_path):
    options = ["--side", 5, "--stems-per-hectare", 1200, "--shrubs-per-hectare", 200, "--scanner", "mobile"]
    options += ["--stations", 2, "--slope", 0.3, "--spacing", 0.02, "--seed", 5]
    moved = ["--scale", 1000, "--offset", "5000,6000,7000"]
    done = run_cylx("synth", "forest", tmp_path / "plot.ply", *options, *moved, "--json")
    assert done.exit_code == 0, done.stderr
    plot = synthetic.forest(
        5, side=5, stems_per_hectare=1200, shrubs_per_hectare=200, scanner="mobile", stations=2, slope=0.3, spacing=0.02
    )
    there = plot.moved(1000, (5000, 6000, 7000))
    assert np.array_equal(read_cloud(tmp_path / "plot.ply").points, there.points)
    truth = json.loads((tmp_path / "plot.truth.json").read_bytes())
    assert truth == there.truth()
    assert json.loads(done.stdout)["stems"] == len(truth["stems"]) == 3
    for entry, stem in zip(truth["stems"], plot.stems, strict=True):  # places are moved, diameters are metres
        assert entry["x"] == pytest.approx(1000 * stem.x + 5000)
        assert entry["ground"] == pytest.approx(1000 * stem.ground + 7000)
        assert entry["dbh"] == stem.dbh
    assert (
        synthetic.forest(
            seed=truth["seed"], **{k: v for k, v in truth["params"].items() if k not in {"scale", "offset"}}
        ).points.tolist()
        == plot.points.tolist()
    )


@pytest.mark.parametrize("kind", ["single", "multi", "piping", "forest"])
def test_the_defaults_are_those_of_the_library(kind):
    options = {option.name: option.default for option in synth.commands[kind].params}
    library = {
        name: parameter.default for name, parameter in inspect.signature(getattr(synthetic, kind)).parameters.items()
    }
    if kind == "multi":
        assert options.pop("radius") == f"{library.pop('radius_min')}:{library.pop('radius_max')}"
        assert library.pop("room") is None
    if kind == "piping":
        assert library.pop("points") is None
    assert {name: options[name] for name in library} == library


@pytest.mark.parametrize(("kind", "cylinders"), [("single", 1), ("multi", 5)])
def test_programs_are_told_what_was_written(run_cylx, tmp_path, kind, cylinders):
    done = run_cylx("synth", kind, tmp_path / "a.ply", "--points", 3000, "--json")
    answer = json.loads(done.stdout)
    files = {"file": str(tmp_path / "a.ply"), "truth": str(tmp_path / "a.truth.json")}
    assert answer == {**files, "points": 3000, "cylinders": cylinders}
    assert len(json.loads(Path(answer["truth"]).read_text(encoding="utf-8"))["cylinders"]) == cylinders
    assert run_cylx("synth", kind, tmp_path / "b.ply", "--points", 3000).stdout == ""
