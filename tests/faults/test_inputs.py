"""Inputs that are cut off, overwritten or replaced while they are read: noticed, and nobody else is hurt."""

import hashlib
import json
import os

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud, write_cloud
from cylx.io.inputs import open_input

POINTS = np.random.default_rng(0).random((20000, 3))
SUFFIXES = (".ply", ".pcd", ".npy", ".xyz")


def written(path):
    if path.suffix == ".npy":
        np.save(path, POINTS)
    else:
        write_cloud(path, POINTS, properties={"label": np.arange(len(POINTS), dtype=np.int32)})
    return path


def cut_off(path):
    os.truncate(path, 100)


def overwritten(path):
    with path.open("r+b") as file:
        file.write(bytes(path.stat().st_size))


def replaced(path):
    other = path.with_name("other" + path.suffix)
    other.write_bytes(path.read_bytes()[:-7] + b"0000000")
    other.replace(path)


def touched(path):
    os.utime(path, (1, 1))


def removed(path):
    path.unlink()


CHANGES = (cut_off, overwritten, replaced)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_read_stays_as_it_was_hashed(tmp_path, suffix, change):
    path = written(tmp_path / f"scan{suffix}")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    cloud = read_cloud(path)
    change(path)
    assert cloud.source.sha256 == digest
    columns = cloud.points if cloud.table is None else np.column_stack([cloud.table[axis] for axis in "xyz"])
    assert np.allclose(columns, POINTS)  # a mapping of a file that is cut off would end the process


@pytest.mark.parametrize("change", [*CHANGES, touched, removed])
def test_a_change_while_cylinders_are_sought_is_noticed(run_cylx, tmp_path, fake_pipeline, monkeypatch, change):
    scans = [written(tmp_path / f"{number}.ply") for number in range(3)]
    seek = fake_pipeline.__class__.__call__

    def seek_and_change(self, cloud, *args, **kwargs):
        if cloud.source.file.endswith("1.ply"):
            change(scans[1])
        return seek(self, cloud, *args, **kwargs)

    monkeypatch.setattr(fake_pipeline.__class__, "__call__", seek_and_change)
    done = run_cylx("extract", *scans, "-q", "--out-dir", tmp_path / "out")
    harmless = change in (touched, removed)
    assert done.exit_code == (0 if harmless else 6)
    results = sorted(path.name for path in (tmp_path / "out").glob("*.cylinders.json"))
    assert results == [f"{number}.cylinders.json" for number in range(3) if harmless or number != 1]
    if not harmless:
        line = f"cylx: {scans[1]}: was changed while its cylinders were sought; run it again when nothing writes to it"
        assert line in done.stderr.splitlines()
        entry = json.loads((tmp_path / "out" / "summary.json").read_bytes())["files"][1]
        assert (entry["status"], entry["exit_code"]) == ("failed", 3)


def test_a_change_while_it_is_copied_is_noticed(tmp_path, monkeypatch):
    path = written(tmp_path / "scan.xyz")
    measure = hashlib.sha256

    def measure_and_change():
        with path.open("ab") as file:
            file.write(b"1 2 3\n")
        return measure()

    monkeypatch.setattr("hashlib.sha256", measure_and_change)
    with pytest.raises(InputError, match=r"scan\.xyz: was changed while it was read"), open_input(path):
        pass


def test_another_run_that_was_faster_keeps_its_output(run_cylx, scan, tmp_path, fake_pipeline, monkeypatch):
    seek = fake_pipeline.__class__.__call__
    theirs = tmp_path / "scan.annotated.ply"

    def seek_meanwhile(self, *args, **kwargs):
        theirs.write_text("theirs")
        return seek(self, *args, **kwargs)

    monkeypatch.setattr(fake_pipeline.__class__, "__call__", seek_meanwhile)
    done = run_cylx("extract", scan, "-q", "--report", tmp_path / "a.html")
    assert done.exit_code == 4
    assert done.stderr.startswith(f"cylx: {theirs}: exists already")
    assert theirs.read_text() == "theirs"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scan.annotated.ply", "scan.xyz"]
    monkeypatch.setattr(fake_pipeline.__class__, "__call__", seek)
    assert run_cylx("extract", scan, "-q", "--overwrite").exit_code == 0
