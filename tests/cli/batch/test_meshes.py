"""`cylx extract --mesh`: files, refusals, exit codes."""

import sys

import pytest

from cylx.cli.batch.jobs import plan_jobs

pytestmark = pytest.mark.usefixtures("fake_pipeline")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("name", "begins"), [("a.ply", b"ply\n"), ("a.OBJ", b"# 2 cylinders"), ("a.stl", b"cylx"), ("a.glb", b"glTF")]
)
def test_a_mesh_is_written_beside_the_rest_and_is_that_of_export(run_cylx, scan, tmp_path, name, begins):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    done = run_cylx("extract", scan, "--no-annotate", "--mesh", tmp_path / name, "--units", "mm")
    assert (done.exit_code, done.stdout) == (0, "")
    result = tmp_path / "scan.cylinders.json"
    assert done.stderr.splitlines()[0].endswith(f"written to {result} and {tmp_path / name}")
    assert names(tmp_path) == sorted([name, "scan.cylinders.json", "scan.xyz"])
    mesh = (tmp_path / name).read_bytes()
    assert mesh.startswith(begins)
    (tmp_path / "again").mkdir()
    assert run_cylx("export", result, tmp_path / "again" / name, "--units", "mm").exit_code == 0
    assert (tmp_path / "again" / name).read_bytes() == mesh


def test_of_several_scans_they_go_into_a_folder(run_cylx, scan, tmp_path):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    (tmp_path / "twin.xyz").write_bytes(scan.read_bytes())
    (tmp_path / "meshes").mkdir()
    options = ["-q", "--mesh", tmp_path / "meshes", "--out-dir", tmp_path / "results"]
    assert run_cylx("extract", scan, tmp_path / "twin.xyz", *options).exit_code == 0
    assert names(tmp_path / "meshes") == ["scan.cylinders.obj", "twin.cylinders.obj"]


def test_no_cylinder_has_no_mesh_and_is_done_all_the_same(run_cylx, scan, tmp_path, fake_pipeline):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    command = ["extract", scan, "--no-annotate", "--mesh", tmp_path / "a.obj"]
    assert run_cylx(*command).exit_code == 0
    assert (tmp_path / "a.obj").exists()
    fake_pipeline.found = 0
    done = run_cylx(*command, "--overwrite")
    assert done.exit_code == 0
    assert done.stderr.splitlines()[0].endswith(f"0 cylinders, written to {tmp_path / 'scan.cylinders.json'}")
    assert f"warning: {tmp_path / 'a.obj'}: not written, as there are no cylinders" in done.stderr.splitlines()
    assert names(tmp_path) == ["scan.cylinders.json", "scan.xyz"]  # nor is there that of the cylinders before


def test_what_is_resumed_needs_its_mesh(run_cylx, scan, tmp_path):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    command = ["extract", scan, "--no-annotate", "--mesh", tmp_path / "a.obj", "--resume"]
    assert " before" not in run_cylx(*command).stderr
    first = (tmp_path / "a.obj").read_bytes()
    (tmp_path / "a.obj").unlink()
    assert run_cylx(*command).exit_code == 0
    assert (tmp_path / "a.obj").read_bytes() == first


@pytest.mark.parametrize(("found", "left"), [(2, True), (0, False)])
def test_what_is_done_is_what_would_be_written(tmp_path, found, left):
    (job,) = plan_jobs(["scan.xyz"], None, False, None, mesh="a.stl", units="m")
    assert (job.outputs, job.units) == (["scan.cylinders.json", "a.stl"], "m")
    assert ("a.stl" in job.written(found)) is left


def test_the_others_are_kept_if_the_mesh_cannot_be_written(run_cylx, scan, tmp_path, monkeypatch):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("cylx.io.write_bytes", fail)
    assert run_cylx("extract", scan, "--mesh", tmp_path / "a.stl").exit_code == 4
    assert names(tmp_path) == ["scan.annotated.ply", "scan.cylinders.json", "scan.xyz"]


def test_what_is_taken_off_far_from_the_origin_is_said(run_cylx, scan, tmp_path, monkeypatch, make_extraction):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    from cylx.geometry.cylinder import Cylinder

    monkeypatch.setattr("cylx.export.drawing.Cylinder", lambda point, *rest: Cylinder(point + 5e7, *rest))
    done = run_cylx("extract", scan, "--mesh", tmp_path / "a.stl", "--no-annotate")
    line = f"warning: {tmp_path / 'a.stl'}: add 50000000 50000000 50000002 to all coordinates; they are too large for"
    assert done.exit_code == 0
    assert line in done.stderr


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (
            ["--mesh", "a.csv"],
            2,
            "--mesh a.csv: .csv is not a mesh format; use .ply, .obj, .glb or .stl; 'cylx export' writes",
        ),
        (["--mesh", "a.dwg"], 2, "a.dwg: .dwg is not a known format; use one of .ply, .obj"),
        (["--mesh", "-"], 2, "-: has no suffix that names a format; use one of .ply"),
        (["--mesh", "a.glb"], 2, "a.glb: .glb has a unit of length; give that of the scan by --units: m, mm, cm"),
        (["--mesh", "there.stl"], 4, "there.stl: exists already; choose another name, or give --overwrite"),
        (["--mesh", "none/a.stl"], 4, "none/a.stl: the folder"),
        (["--mesh", "a.stl", "--report", "a.stl"], 2, "a.stl: is asked for by two outputs; choose another name"),
        (["other.xyz", "--mesh", "all.obj"], 2, "--mesh all.obj: is one file for several inputs; give a folder, or"),
        (["other.xyz", "--mesh", "gone/"], 4, "gone/: no such folder; create it first"),
    ],
)
def test_what_cannot_be_is_refused_before_computing(
    run_cylx, scan, tmp_path, monkeypatch, fake_pipeline, options, code, said
):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.stl").write_text("mine", encoding="utf-8")
    (tmp_path / "other.xyz").write_bytes(scan.read_bytes())
    failed = run_cylx("extract", "scan.xyz", *options)
    assert (failed.exit_code, failed.stdout, fake_pipeline.calls) == (code, "", [])
    assert failed.stderr.startswith(f"cylx: {said}")
    assert failed.stderr.count("\n") == 1
    assert names(tmp_path) == ["other.xyz", "scan.xyz", "there.stl"]
    assert (tmp_path / "there.stl").read_text(encoding="utf-8") == "mine"


def test_without_trimesh_it_is_refused_before_computing(run_cylx, scan, tmp_path, monkeypatch, fake_pipeline):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    failed = run_cylx("extract", scan, "--mesh", tmp_path / "a.obj")
    line = f"cylx: {tmp_path / 'a.obj'}: .obj needs trimesh, which is not installed; pip install 'cylx[mesh]'\n"
    assert (failed.exit_code, failed.stderr, fake_pipeline.calls) == (2, line, [])
