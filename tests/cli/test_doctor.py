"""`cylx doctor`: what is well, what is not, and what to do about it."""

import json
import re
import sys
from importlib.metadata import metadata, requires

import pytest

from cylx.cli import doctor
from cylx.cli.doctor import Check


@pytest.fixture
def bare(monkeypatch):
    """Look at one extra only, since they take seconds to import."""
    monkeypatch.setattr(doctor, "extras_there_are", lambda: {"plots"})


@pytest.fixture
def well(monkeypatch, bare):
    """Leave out the extraction, which other tests do."""
    monkeypatch.setattr(doctor, "check_extraction", lambda observer: Check("extraction", "ok", "made by hand"))


def test_here_all_is_well(run_cylx, bare):
    done = run_cylx("doctor", "--json")
    content = json.loads(done.stdout)
    checks = {check["name"]: check for check in content["checks"]}
    assert (done.exit_code, content["works"], done.stderr) == (0, True, "")
    assert {check["state"] for check in content["checks"] if check["needed"]} == {"ok"}
    assert {"Python", "numpy", "open3d", "kernels", "machine"} <= set(checks)
    assert checks["extraction"]["detail"].startswith("finds a cylinder of radius 1 as ")
    assert list(checks["Python"]) == ["name", "state", "detail", "remedy", "needed"]


def test_it_is_shown_as_a_table(run_cylx, well):
    done = run_cylx("doctor")
    lines = done.stdout.splitlines()
    assert (done.exit_code, done.stderr) == (0, "")
    assert lines[0].split() == ["what", "state", "detail", "remedy"]
    assert lines[-1] == "cylinders can be found"


def test_a_missing_extra_is_no_fault(run_cylx, well, monkeypatch):
    monkeypatch.setattr(doctor, "extras_there_are", lambda: {"mesh"})
    monkeypatch.setitem(sys.modules, "trimesh", None)
    monkeypatch.setattr(doctor, "_version", lambda name: None if name == "trimesh" else "1.0")
    done = run_cylx("doctor", "--json")
    (check,) = (check for check in json.loads(done.stdout)["checks"] if check["name"] == "trimesh")
    assert done.exit_code == 0
    assert (check["state"], check["remedy"]) == ("missing", "pip install 'cylx[mesh]'")
    assert check["detail"] == "is not installed, for export of PLY, OBJ, GLB and STL"


def test_a_needed_package_that_is_missing_is_one(run_cylx, well, monkeypatch):
    monkeypatch.setattr(doctor, "check_open3d", lambda: Check("open3d", "broken", "does not load", "mend it"))
    done = run_cylx("doctor")
    assert done.exit_code == 1
    assert re.search(r"open3d +broken +does not load +mend it", done.stdout)
    assert done.stdout.endswith("cylinders cannot be found: see what is missing or broken\n")


def test_a_library_that_fails_when_it_is_imported_is_broken(tmp_path, monkeypatch):
    (tmp_path / "pye57.py").write_text("raise OSError('libxerces-c.so: cannot open\\nfor some reason')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "pye57", raising=False)
    check = doctor.check_extra("pye57")
    assert check.state == "broken"
    assert check.detail.endswith(", but libxerces-c.so: cannot open")
    assert not check.needed


def test_kernels_that_cannot_be_kept_are_told_of(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert doctor.check_kernels().detail.endswith(f"NUMBA_CACHE_DIR={tmp_path}")
    monkeypatch.setattr("cylx.api.warmup.kernels_are_kept", lambda: False)
    check = doctor.check_kernels()
    assert (check.state, check.needed) == ("broken", False)
    assert check.remedy == "set NUMBA_CACHE_DIR to a writable folder"
    monkeypatch.setattr("cylx.api.warmup.kernel_folder", lambda: None)
    check = doctor.check_kernels()
    assert check.detail.startswith("cannot be saved: no folder is writable; ")


def test_damaged_kernels_are_named(monkeypatch):
    monkeypatch.setattr("cylx.api.warmup.damaged_kernels", lambda: ["a.nbc", "b.nbc", "c.nbc", "d.nbc"])
    check = doctor.check_kernels()
    assert (check.state, check.needed) == ("broken", False)
    assert check.detail.startswith("4 damaged in ")
    assert check.detail.endswith(": a.nbc, b.nbc, c.nbc, …")
    assert check.remedy == "nothing to do: they are compiled again"


@pytest.mark.parametrize(
    ("free", "detail", "remedy"),
    [
        (None, "free memory unknown", ""),
        (5 << 30, "5.0 GB of memory free", ""),
        (1 << 29, "0.5 GB of memory free", "close other programs, or thin large scans"),
    ],
)
def test_memory(free, detail, remedy, monkeypatch):
    monkeypatch.setattr(doctor, "free_memory", lambda: free)
    check = doctor.check_machine()
    assert (check.state, check.remedy) == ("ok", remedy)
    assert check.detail.endswith(detail)


@pytest.mark.parametrize(
    ("radii", "said"), [([], "finds: none"), ([1.02], "finds: 1.02"), ([1.0, 0.5], "finds: 1, 0.5")]
)
def test_a_wrong_answer_is_a_fault(radii, said, monkeypatch, make_extraction):
    from dataclasses import replace

    from cylx.geometry.cylinder import Cylinder

    found = make_extraction()
    (fit, *_) = found.cylinders
    fits = [replace(fit, cylinder=Cylinder((0, 0, 0), (0, 0, 1), radius, 4.0)) for radius in radii]
    monkeypatch.setattr("cylx.api.extract", lambda *_, **__: replace(found, cylinders=tuple(fits)))
    check = doctor.check_extraction()
    assert (check.state, check.needed) == ("broken", True)
    assert check.detail.endswith(said)


def test_a_crash_is_a_fault_and_no_crash(monkeypatch):
    def fail(*_, **__):
        raise ZeroDivisionError("float division")

    monkeypatch.setattr("cylx.api.extract", fail)
    assert doctor.check_extraction().detail == "ZeroDivisionError: float division"


def test_it_checks_what_the_package_needs_and_offers():
    needs = [re.match(r"[\w-]+", line)[0].lower() for line in requires("cylx") if "extra ==" not in line]
    assert {name for name in needs if "open3d" not in name and "libusb" not in name} == {
        name.lower() for name in doctor.NEEDED
    }
    offered = set(metadata("cylx").get_all("Provides-Extra")) - {"test", "lint", "bench", "docs"}
    assert offered <= {extra for extra, _ in doctor.LIBRARIES.values()}
