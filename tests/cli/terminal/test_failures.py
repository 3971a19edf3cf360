"""Bad input at the command line: one line, the right exit code, nothing written, no traceback."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

PLY = b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
TURN = np.linspace(0, 2 * np.pi, 60, endpoint=False)


def rows(*columns):
    return "\n".join(" ".join(f"{value:.6f}" for value in row) for row in np.column_stack(columns)).encode()


SCANS = {
    "missing": ("none.ply", None, ": no such file"),
    "empty": ("scan.ply", b"", ": is empty"),
    "wrong magic": ("scan.ply", b"solid cube\n", ": is not PLY"),
    "truncated header": ("scan.ply", PLY[:60], ": the file ends within the PLY header"),
    "truncated body": ("scan.ply", PLY + b"0 0 0\n", ": the header promises 2 points, the file holds 1"),
    "promises": (
        "scan.ply",
        PLY.replace(b"vertex 2", b"vertex 99999999999999"),
        ": the header promises 99999999999999",
    ),
    "no z": ("scan.ply", PLY.replace(b"float z", b"float w"), ": the vertex element has no property z"),
    "list": ("scan.ply", PLY.replace(b"float y", b"list uchar float y"), ": the property y is a list"),
    "not finite": ("scan.xyz", b"nan nan nan\ninf 0 0\n" * 5, ": no point has finite coordinates"),
    "too few": ("scan.xyz", b"0 0 0\n1 0 0\n0 1 0\n0 0 1\n", ": only 4 usable points"),
    "all equal": ("scan.xyz", b"1 2 3\n" * 30, ": all points are equal"),
    "on a line": ("scan.xyz", rows(TURN, 2 * TURN, 1 - TURN), ": all points lie on one line"),
    "on a plane": ("scan.xyz", rows(np.cos(TURN), np.sin(TURN), 0 * TURN), ": all points lie on one plane"),
    "ragged": ("scan.xyz", b"0 0 0\n1 2\n", ":2: expected 3 columns, found 2"),
    "words": ("scan.xyz", b"0 0 0\n1 2 three\n", ":2: "),
    "suffix": ("scan.docx", b"PK\x03\x04", ""),
    "pcd": ("scan.pcd", b"VERSION 0.7\nFIELDS x y z\n", ""),
}


@pytest.fixture
def assert_refused(run_cylx, tmp_path):
    """Run `cylx extract`; demand the exit code, one line that says so, and that no file came or went."""

    def demand(code, fault, *args, **settings):
        before = sorted(path.name for path in tmp_path.rglob("*"))
        failed = run_cylx("extract", *args, **settings)
        assert failed.exit_code == code
        assert failed.stdout == ""
        (line,) = failed.stderr.splitlines()
        assert line.startswith("cylx: ")
        assert fault in line
        assert sorted(path.name for path in tmp_path.rglob("*")) == before

    return demand


@pytest.fixture
def in_its_folder(scan, monkeypatch):
    """A scan in the working folder."""
    monkeypatch.chdir(scan.parent)
    return scan


@pytest.mark.parametrize("case", SCANS)
def test_a_scan_that_cannot_be_used_is_refused(assert_refused, tmp_path, case):
    name, content, fault = SCANS[case]
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    assert_refused(3, f"{path}{fault}", path, "--profile", tmp_path / "times.json")


@pytest.mark.parametrize("case", [case for case in SCANS if case not in {"missing", "suffix", "wrong magic"}])
def test_so_is_one_from_standard_input(assert_refused, tmp_path, case):
    _, content, fault = SCANS[case]
    assert_refused(3, fault, "-", "-o", tmp_path / "out.json", input=content)


LONG = "x" * 300  # more than any system takes


@pytest.mark.parametrize(
    ("options", "code", "fault"),
    [
        ([f"{LONG}.xyz"], 3, f"{LONG}.xyz: cannot be read: file name too long"),
        (["scan.xyz", "-o", f"{LONG}.json"], 4, f"{LONG}.json: cannot be written: file name too long"),
        (["scan.xyz", "-o", f"{LONG}/"], 4, f"{LONG}/: cannot be created: file name too long"),
        (["scan.xyz", "--out-dir", LONG], 4, f"{LONG}/: cannot be created: file name too long"),
        (["scan.xyz", "--annotated", f"{LONG}.las"], 4, f"{LONG}.las: cannot be written: file name too long"),
        (["scan.xyz", "--report", f"{LONG}.html"], 4, f"{LONG}.html: cannot be written: file name too long"),
        (["scan.xyz", "-c", f"{LONG}.yaml"], 2, f"{LONG}.yaml: cannot be read: File name too long"),
        (["scan.xyz", "--catalogue", f"{LONG}.csv"], 2, f"{LONG}.csv: cannot be read: File name too long"),
    ],
)
@pytest.mark.skipif(os.name == "nt", reason="other words are said there")
@pytest.mark.usefixtures("in_its_folder")
def test_a_name_that_is_too_long_is_refused(assert_refused, options, code, fault):
    assert_refused(code, fault, *options)


def test_a_folder_that_may_not_be_searched_is_refused(assert_refused, in_its_folder, monkeypatch):
    as_ever = os.stat

    def stat_others(path, *args, **settings):
        if str(path).startswith("secret"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return as_ever(path, *args, **settings)

    monkeypatch.setattr(os, "stat", stat_others)  # whoever runs the tests may be root, who may search them all
    assert_refused(4, "secret/r.json: cannot be written: permission denied", in_its_folder, "-o", "secret/r.json")
    assert_refused(3, "secret/scan.ply: no such file", "secret/scan.ply")


def test_a_folder_is_refused(assert_refused, tmp_path):
    (tmp_path / "scans.ply").mkdir()
    assert_refused(3, "scans.ply: is a folder with no scan in it", tmp_path / "scans.ply")


def test_a_scan_that_may_not_be_read_is_refused(assert_refused, scan, monkeypatch):
    as_ever = Path.open

    def open_others(path, *args, **settings):
        if path == scan:
            raise PermissionError(errno.EACCES, "Permission denied")
        return as_ever(path, *args, **settings)

    monkeypatch.setattr(Path, "open", open_others)
    assert_refused(3, "scan.xyz: may not be read", scan)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("seed: [", ":1: expected the node content"),
        ("slicing: {thicknes: 1}", ": slicing.thicknes: unknown key; did you mean 'thickness'?"),
        ("slicing: {thickness: thick}", ": slicing.thickness: 'thick' is not a number"),
        ("slicing: {thickness: -1}", ": slicing.thickness: -1 is out of range"),
        ("seed: !!python/object/apply:os.system [touch gone]", "apply:os.system is not allowed"),
        ("a: &a [x]\nb: [*a, *a]", ":1: anchors and aliases are not allowed"),
        ("scene: {radius_min: 2, radius_max: 1}", ": scene: radius_min 2 is above radius_max 1"),
        ("- 1", ": has no keys at its top level"),
    ],
)
def test_a_configuration_that_cannot_be_meant_is_refused(assert_refused, scan, text, fault):
    path = scan.with_name("my.yaml")
    path.write_text(text)
    assert_refused(2, fault, scan, "-c", path)


@pytest.mark.parametrize(
    ("options", "code", "fault"),
    [
        (["-c", "none.yaml"], 2, "none.yaml: no such file; 'cylx config init' writes one"),
        (["--set", "slicing.planes"], 2, "--set slicing.planes: has no key and value"),
        (["--set", "preset=best"], 2, "--set preset: 'best' is not one of its values"),
        (["--radius", "3:1"], 2, "'3:1' has its smallest radius above its largest"),
        (["--axis", "1,2"], 2, "--axis': '1,2' is not three numbers such as 0,0,1, nor x, y or z"),
        (["--axis", "w"], 2, "--axis': 'w' is not three numbers such as 0,0,1, nor x, y or z"),
        (["--axis", "0,0,0"], 2, "--axis': '0,0,0' is not a direction; the numbers must be finite and not all 0"),
        (["--axis", "0,inf,0"], 2, "--axis': '0,inf,0' is not a direction"),
        (["--axis", "nan,0,1"], 2, "--axis': 'nan,0,1' is not a direction"),
        (["--axis-tolerance", "5"], 2, "axis tolerance: is given without the axis it refers to; give --axis"),
        (["--axis", "z", "--axis-tolerance", "0"], 2, "'--axis-tolerance': 0.0 is not in the range 0<x<=90"),
        (["--axis", "z", "--axis-tolerance", "91"], 2, "'--axis-tolerance': 91.0 is not in the range 0<x<=90"),
        (["--axis", "z", "--axis-tolerance", "nan"], 2, "scene.axis_tolerance_deg: nan is not a finite number"),
        (["--axis-sd", "1"], 2, "scene.axis_sd_deg: is given without scene.axis; give that, too"),
        (["--axis", "z", "--axis-sd", "0"], 2, "'--axis-sd': 0.0 is not in the range 0<x<=90"),
        (["--known-radius", "0"], 2, "'--known-radius': '0' is not R or R:SD with positive numbers, such as 0.05"),
        (["--known-radius", "1:"], 2, "'1:' is not R or R:SD with positive numbers, such as 0.05 or 0.05:0.001"),
        (["--known-radius", "1:2:3"], 2, "'1:2:3' is not R or R:SD with positive numbers"),
        (["--known-radius", "nan"], 2, "'nan' is not R or R:SD with positive numbers"),
        (
            ["--catalogue", "none.csv"],
            2,
            "none.csv: no such file; give a CSV file with a column 'radius' or 'diameter'",
        ),
        (["--catalogue", "scan.xyz"], 2, "scan.xyz:1: "),
        (["--catalogue", "."], 2, ".: cannot be read: "),
        (["--set", "scene.catalogue=[]"], 2, "--set scene.catalogue: [] is too short; it must have 1 or more entries"),
        (["--min-coverage", "361"], 2, "'--min-coverage': 361.0 is not in the range 0<=x<=360"),
        (["--min-coverage", "-1"], 2, "'--min-coverage': -1.0 is not in the range 0<=x<=360"),
        (["--min-coverage", "wide"], 2, "'--min-coverage': 'wide' is not a valid float"),
        (["--set", "scene.axis=[0, 0, 0]"], 2, "--set scene: axis [0, 0, 0] is not a direction; write [0, 0, 1]"),
        (["--set", "scene.axis=[0, 1]"], 2, "--set scene.axis: [0, 1] is too short; it must have 3 or more entries"),
        (["--set", "scene.axis=z"], 2, "--set scene.axis: 'z' is not a list; write [a, b]"),
        (["--rejected", "gone/no.json"], 4, "gone/no.json: the folder "),
        (["--rejected", "scan.xyz"], 2, "scan.xyz: is an input as well as an output; choose another name"),
        (["--rejected", "scan.cylinders.json"], 2, "scan.cylinders.json: is asked for by two outputs"),
        (["--rejected", "x.json", "--profile", "x.json"], 2, "x.json: is asked for by two outputs"),
        (["--rejected", "-", "-o", "-"], 2, "standard output: is asked for by two outputs; choose another name"),
        (["--seed", "-1"], 2, "--seed"),
        (["--require", "0"], 2, "--require"),
        (["--planes", "0", "--preset", "paper"], 2, "there are no planes"),
        (["-o", "gone/out.json"], 4, "gone/out.json: the folder "),
        (["-o", "scan.xyz/"], 4, "scan.xyz/: cannot be created: "),
        (["--annotated", "gone/out.ply"], 4, "gone/out.ply: the folder "),
        (["--profile", "gone/times.json"], 4, "gone/times.json: the folder "),
        (["--annotated", "."], 4, "is a folder"),
    ],
)
def test_options_that_cannot_be_followed_are_refused(assert_refused, in_its_folder, options, code, fault):
    assert_refused(code, fault, in_its_folder, *options)


def test_a_folder_that_is_read_only_is_refused(assert_refused, scan, monkeypatch):
    monkeypatch.setattr("os.access", lambda *_, **__: False)
    assert_refused(4, "is read-only", scan)
