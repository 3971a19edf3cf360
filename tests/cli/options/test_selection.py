"""`cylx extract` and `cylx info` with other formats, and with some of the points only."""

import json

import jsonschema
import laspy
import numpy as np
import pytest
from plyfile import PlyData

import cylx
from cylx.io import read_cloud, write_cloud
from cylx.results import result_schema
from cylx.synthetic import single

ALL = ["--crop", ",,0:,,3", "--voxel", "0.5", "--every", "2", "--classes", "6,2"]


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def write_las(path, points, classes=2):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.0001] * 3, np.floor(points.min(axis=0))
    cloud = laspy.LasData(header)
    cloud.xyz = points
    cloud.classification = np.full(len(points), classes)
    cloud.write(str(path))
    return path


@pytest.fixture
def las(tmp_path, scan):
    points = read_cloud(scan).points
    scan.unlink()
    return write_las(tmp_path / "scan.laz", points, np.arange(len(points)) % 2 * 4 + 2)


def test_las_comes_back_as_las(run_cylx, las, fake_pipeline):
    assert run_cylx("extract", las).exit_code == 0
    assert names(las.parent) == ["scan.annotated.laz", "scan.cylinders.json", "scan.laz"]
    assert (laspy.read(las.with_name("scan.annotated.laz"))["cylinder_id"] == 0).all()
    found = json.loads(las.with_name("scan.cylinders.json").read_bytes())["input"]
    assert list(found) == ["file", "format", "points", "sha256", "bounds"]
    assert found["format"] == "las"


@pytest.mark.parametrize("name", ["out.ply", "out.pcd", "out.LAS", "out"])
def test_another_format_can_be_asked_for(run_cylx, las, tmp_path, fake_pipeline, name):
    assert run_cylx("extract", las, "--annotated", tmp_path / name).exit_code == 0
    beginning = {"out.pcd": b"# .PCD", "out.LAS": b"LASF"}.get(name, b"ply\n")
    assert (tmp_path / name).read_bytes().startswith(beginning)


def test_a_format_that_cannot_hold_the_points_is_refused_before_computing(run_cylx, scan, tmp_path, fake_pipeline):
    done = run_cylx("extract", scan, "--annotated", tmp_path / "out.laz")
    fault = "the input is neither LAS nor LAZ; choose a name that ends in .ply"
    assert (done.exit_code, done.stderr) == (4, f"cylx: {tmp_path / 'out.laz'}: {fault}\n")
    assert fake_pipeline.calls == []
    assert names(tmp_path) == ["scan.xyz"]


def test_a_packed_scan_has_outputs_without_its_gz(run_cylx, scan, tmp_path, fake_pipeline):
    import gzip

    (tmp_path / "scan.xyz.gz").write_bytes(gzip.compress(scan.read_bytes()))
    assert run_cylx("extract", tmp_path / "scan.xyz.gz").exit_code == 0
    assert names(tmp_path) == ["scan.annotated.ply", "scan.cylinders.json", "scan.xyz", "scan.xyz.gz"]


def test_only_selected_points_take_part_and_the_result_says_so(run_cylx, las, tmp_path, fake_pipeline):
    done = run_cylx("extract", las, *ALL, "--annotated", tmp_path / "out.ply")
    assert done.exit_code == 0
    ((cloud, _, _),) = fake_pipeline.calls
    whole = read_cloud(las)
    assert 0 < len(cloud.points) < len(whole.points)
    assert (np.flatnonzero(cloud.valid) % 2 == 0).all()
    content = json.loads((tmp_path / "scan.cylinders.json").read_bytes())
    jsonschema.validate(content, result_schema())
    found = content["input"]
    assert list(found) == ["file", "format", "points", "sha256", "crop", "classes", "every", "voxel", "bounds"]
    assert found["points"] == len(whole.points)
    assert found["crop"] == {"min": [None, None, 0.0], "max": [None, None, 3.0]}
    assert (found["classes"], found["every"], found["voxel"]) == ([2, 6], 2, 0.5)
    assert found["bounds"]["max"] == cloud.points.max(axis=0).tolist()
    labels = PlyData.read(tmp_path / "out.ply")["vertex"]["cylinder_id"]
    assert np.array_equal(labels, np.where(cloud.valid, 0, -1))


def test_info_is_about_the_selected_points(run_cylx, tmp_path):
    scene = single(points=3000, seed=1)
    path = tmp_path / "can.ply"
    write_cloud(path, scene.points)
    shown = run_cylx("info", path, "--every", "2", "--json")
    facts = json.loads(shown.stdout)
    assert (facts["points"], facts["finite"], facts["selected"]) == (3000, 3000, 1500)
    assert facts["bounds"]["min"] == scene.points[::2].min(axis=0).tolist()
    lines = run_cylx("info", path, "--crop", ":0,,").stdout.splitlines()
    assert lines[3] == f"selected {(scene.points[:, 0] <= 0).sum()}"


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (["--crop", "1,2:3,4"], "'1,2:3,4' is not two corners such as 0,0,0:5,5,3, or ,,0:,,3 for z alone"),
        (["--crop", "1,2,3"], "'1,2,3' is not two corners such as 0,0,0:5,5,3, or ,,0:,,3 for z alone"),
        (["--crop", "a,,:,,"], "'a,,:,,' is not two corners such as 0,0,0:5,5,3, or ,,0:,,3 for z alone"),
        (["--crop", "nan,,:,,"], "'nan,,:,,' is not two corners such as 0,0,0:5,5,3, or ,,0:,,3 for z alone"),
        (["--crop", ":"], "':' sets no bound"),
        (["--crop", "0,0,3:1,1,0"], "'0,0,3:1,1,0' has its smallest z above its largest"),
        (["--voxel", "0"], "0.0 is not in the range"),
        (["--every", "0"], "0 is not in the range"),
        (["--classes", "2,ground"], "'2,ground' is not a list of class numbers such as 2,6"),
        (["--scan", "-1"], "-1 is not in the range"),
    ],
)
@pytest.mark.parametrize("command", ["extract", "info"])
def test_impossible_selections_are_refused(run_cylx, scan, fake_pipeline, command, options, fault):
    done = run_cylx(command, scan, *options)
    assert done.exit_code == 2
    assert fault in done.stderr


@pytest.mark.parametrize("value", ["-1,-1,-1:", ":1,1,1", "-1,,:1,,", "-1,-1,-1:1,1,9"])
def test_a_box_may_leave_sides_open(run_cylx, scan, fake_pipeline, value):
    assert run_cylx("extract", scan, "--crop", value).exit_code == 0


def test_nothing_selected_is_one_line(run_cylx, scan):
    done = run_cylx("extract", scan, "--crop", "90,,:,,")
    assert done.exit_code == 3
    assert done.stderr.startswith(f"cylx: {scan}: no point is selected; select more; the points lie from -1,-")


def test_a_scan_is_chosen_of_an_e57_file_only(run_cylx, scan):
    done = run_cylx("extract", scan, "--scan", "0")
    fault = "is neither E57 nor PTX, so no scan can be chosen; leave --scan out"
    assert (done.exit_code, done.stderr) == (3, f"cylx: {scan}: {fault}\n")


def test_all_formats_give_the_same_cylinders(tmp_path):
    points = np.round(np.array([500_000, 5_000_000, 100]) + single(points=3000, seed=1).points, 4)
    for name in ("can.ply", "can.xyz"):
        write_cloud(tmp_path / name, points)
    np.save(tmp_path / "can.npy", points)
    write_las(tmp_path / "can.las", points)
    truth, *others = (cylx.extract(tmp_path / name).cylinders for name in ("can.ply", "can.xyz", "can.npy", "can.las"))
    assert len(truth) == 1
    for (found,) in others:
        assert found.cylinder.radius == pytest.approx(truth[0].cylinder.radius, rel=1e-5)
        assert np.abs(found.cylinder.point - truth[0].cylinder.point).max() < 1e-5


def test_a_selection_in_python(tmp_path):
    scene = single(points=4000, seed=1)
    found = cylx.extract(scene.points, every=2, crop=((None, None, None), (None, None, 90.0)))
    assert len(found.labels) == len(found.cloud.points) == 2000
    assert [round(fit.cylinder.radius, 1) for fit in found.cylinders] == [1.0]
    with pytest.raises(ValueError, match="scan needs a file, and an array was given"):
        cylx.extract(scene.points, scan=0)
