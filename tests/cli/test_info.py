"""`cylx info`: what is in a file."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from cylx.api import extract
from cylx.io import write_cloud
from cylx.synthetic import single

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def scene():
    return single(points=2000, seed=1)


def test_it_shows_what_is_in_a_file(run_cylx, tmp_path, scene):
    path = tmp_path / "can.ply"
    write_cloud(path, scene.points, properties={"intensity": np.arange(2000, dtype=np.uint16)})
    shown = run_cylx("info", path)
    assert (shown.exit_code, shown.stderr) == (0, "")
    facts = {line[:9].strip(): line[9:] for line in shown.stdout.splitlines()}
    assert list(facts) == [
        "file", "format", "points", "fields", "min", "max", "size", "extent", "spacing", "noise", "radii", "memory",
    ]  # fmt: skip
    assert facts["memory"] == "0.25 GB for cylx extract"
    assert facts["points"] == "2000, 2000 of them finite"
    assert facts["fields"] == "x (float64), y (float64), z (float64), intensity (uint16)"
    assert float(facts["noise"]) == pytest.approx(scene.sigma, rel=0.2)


def test_json_has_the_same(run_cylx, tmp_path, scene):
    path = tmp_path / "can.xyz"
    write_cloud(path, scene.points, properties=None)
    shown = run_cylx("info", path, "--json")
    facts = json.loads(shown.stdout)
    assert (facts["file"], facts["format"], facts["points"], facts["finite"]) == (str(path), "xyz", 2000, 2000)
    assert facts["bounds"]["min"] == pytest.approx(scene.points.min(axis=0).tolist(), abs=1e-6)
    assert facts["size"] == pytest.approx(np.ptp(scene.points, axis=0).tolist(), abs=1e-6)
    assert facts["extent"] == pytest.approx(float(np.linalg.norm(np.ptp(scene.points, axis=0))), abs=1e-6)
    assert set(facts["scene"]) == {"spacing", "noise"}
    assert facts["warnings"] == []


@pytest.mark.skipif(os.name == "nt", reason="files with holes take their whole size there")
def test_a_file_of_very_many_points_is_only_looked_at(run_cylx, tmp_path, scene):
    many, piece = 1_000_000_000, 2000
    table = np.lib.format.open_memmap(tmp_path / "huge.npy", "w+", np.float32, (many, 3))  # takes no place as yet
    for first in np.linspace(0, many - (1 << 16), 16).astype(int):
        table[first : first + (1 << 16)] = np.nan
        table[first : first + piece // 16] = scene.points[: piece // 16]
    table[:piece] = scene.points
    del table
    shown = run_cylx("info", tmp_path / "huge.npy", "--json")
    assert shown.exit_code == 0
    facts = json.loads(shown.stdout)
    assert (facts["points"], facts["format"]) == (many, "npy")
    assert "finite" not in facts
    assert "sha256" not in facts
    assert facts["sampled"] == piece + 15 * (piece // 16)
    assert facts["extract_memory_bytes"] > 1e11
    assert facts["warnings"][-1]["kind"] == "sample"
    assert f"{facts['sampled']} of them looked at" in run_cylx("info", tmp_path / "huge.npy").stdout


def test_the_radii_are_those_that_are_looked_for(run_cylx, tmp_path, scene):
    path = tmp_path / "can.ply"
    write_cloud(path, scene.points, properties=None)
    radius = json.loads(run_cylx("info", path, "--json").stdout)["radius"]
    limits = extract(path).config.scene
    assert (radius["min"], radius["max"]) == (limits.radius_min, limits.radius_max)
    assert radius["found_from"] == 2 * radius["min"]


@pytest.mark.skipif(os.name == "nt", reason="such names are refused there")
def test_a_name_of_several_lines_is_shown_on_one(run_cylx, tmp_path, scene, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_cloud("can.ply", scene.points, properties=None)
    Path("can.ply").rename("a\nformat   las\t.ply")
    shown = run_cylx("info", "a\nformat   las\t.ply")
    assert shown.stdout.splitlines()[:2] == ["file     a\\u000aformat   las\\u0009.ply", "format   ply"]


def test_standard_input_will_do(run_cylx, tmp_path, scene):
    write_cloud(tmp_path / "can.ply", scene.points, properties=None)
    shown = run_cylx("info", "-", input=(tmp_path / "can.ply").read_bytes())
    assert shown.stdout.splitlines()[:2] == ["file     -", "format   ply"]


@pytest.mark.parametrize(
    ("lines", "finite", "fault"),
    [
        (["1 1 1"] * 9, 9, "all points are equal"),
        ([f"{i} 0 0" for i in range(9)], 9, "all points lie on one line"),
        (["0 0 0", "1 2 3", "2 0 1"], 3, "only 3 usable points"),
    ],
)
def test_a_cloud_without_shape_is_shown_with_a_warning(run_cylx, tmp_path, lines, finite, fault):
    path = tmp_path / "odd.xyz"
    path.write_text("\n".join(lines))
    shown = run_cylx("info", path)
    assert shown.exit_code == 0
    assert shown.stderr == f"warning: {path}: {fault}; no cylinders can be found in it\n"
    assert f"{len(lines)}, {finite} of them finite" in shown.stdout
    assert "spacing" not in shown.stdout


def test_a_missing_file_is_named(run_cylx, tmp_path):
    failed = run_cylx("info", tmp_path / "none.ply")
    line = f"cylx: {tmp_path / 'none.ply'}: no such file; check the path\n"
    assert (failed.exit_code, failed.stdout, failed.stderr) == (3, "", line)


def test_what_will_go_wrong_is_said_and_is_in_the_json(run_cylx, tmp_path, scene):
    path = tmp_path / "can.xyz"
    write_cloud(path, np.vstack([scene.points, [[500, 0, 0]]]), properties=None)
    shown = run_cylx("info", path, "--json")
    (caution,) = json.loads(shown.stdout)["warnings"]
    assert (list(caution), caution["kind"]) == (["kind", "fault", "remedy"], "strays")
    assert shown.stderr == f"warning: {path}: {caution['fault']}; {caution['remedy']}\n"
    cut = run_cylx("info", path, "--crop", caution["remedy"].rpartition(" ")[2])
    assert (cut.exit_code, cut.stderr) == (0, "")
    assert "selected 2000\n" in cut.stdout
    assert (
        run_cylx("info", path, "--crop", "-9,-9,-9:9,9,9", "--every", 4).stderr == ""
    )  # what was left out is not missing


def test_a_cloud_without_shape_is_unusable_in_the_json(run_cylx, tmp_path):
    (tmp_path / "odd.xyz").write_text("1 1 1\n" * 9)
    facts = json.loads(run_cylx("info", tmp_path / "odd.xyz", "--json").stdout)
    (caution,) = facts["warnings"]
    assert (caution["kind"], caution["fault"]) == ("unusable", "all points are equal")
    assert not {"scene", "radius"} & set(facts)


@pytest.mark.parametrize(("available", "scarce"), [(None, False), (1e6, True), (1e12, False)])
def test_memory_that_may_not_suffice_is_told_of(run_cylx, tmp_path, scene, monkeypatch, available, scarce):
    path = tmp_path / "can.xyz"
    write_cloud(path, scene.points, properties=None)
    monkeypatch.setattr("cylx.cli.info.free_memory", lambda: available)
    fault = "'cylx extract' needs about 0.25 GB, and 0.001 GB are free; take a part of the scan by --crop or --voxel"
    shown = run_cylx("info", path)
    assert (shown.exit_code, shown.stderr) == (0, f"warning: {path}: {fault}\n" if scarce else "")


def test_every_warning_is_told_of():
    source = (ROOT / "cylx" / "scene" / "cautions.py").read_text(encoding="utf-8")
    source += (ROOT / "cylx" / "cli" / "info.py").read_text(encoding="utf-8")
    kinds = set(re.findall(r'(?:Caution\(|kind, remedy = )"(\w+)"', source))
    page = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8")
    table = page.partition("## A first look\n")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == kinds
    assert len(kinds) == 14
