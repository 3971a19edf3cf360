"""What a user gets with `pip install`: the version, the data files and the dependencies that were promised."""

import re
import subprocess
import sys
from importlib.metadata import entry_points, metadata, requires, version
from importlib.resources import files
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import cylx

ROOT = Path(__file__).resolve().parents[1]
PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_there_is_one_version():
    assert version("cylx") == cylx.__version__
    assert 'dynamic = ["version"]' in PROJECT
    assert cylx.__version__ not in PROJECT
    newest = re.search(r"^## (?!Unreleased)(\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest.group(1) == cylx.__version__


DATA = ["py.typed", "presets/auto.yaml", "presets/paper.yaml"]
DATA += [f"report/{name}" for name in ("page.html", "panels.js", "viewer.css", "viewer.js")]


@pytest.mark.parametrize("name", DATA)
def test_the_package_has_its_data(name):
    assert files("cylx").joinpath(name).is_file()


@pytest.mark.parametrize(
    ("name", "beginning"), [("LICENSE", "Apache License"), ("README.md", "# cylx"), ("CHANGELOG.md", "# Changelog")]
)
def test_the_project_has_its_papers(name, beginning):
    assert (ROOT / name).read_text(encoding="utf-8").lstrip().startswith(beginning)


def needed_on(platform, machine):
    environment = {"sys_platform": platform, "platform_machine": machine, "python_version": "3.12", "extra": ""}
    needs = map(Requirement, requires("cylx"))
    return {need.name.lower() for need in needs if need.marker is None or need.marker.evaluate(environment)}


ALWAYS = {"click", "numba", "numpy", "plyfile", "pydantic", "pyyaml", "rich", "scipy"}


@pytest.mark.parametrize(
    ("platform", "machine", "also"),
    [
        ("linux", "x86_64", {"open3d-cpu", "libusb-package"}),
        ("linux", "aarch64", {"open3d", "libusb-package"}),
        ("darwin", "arm64", {"open3d"}),
        ("win32", "AMD64", {"open3d"}),
    ],
)
def test_it_brings_what_it_imports_and_nothing_else(platform, machine, also):
    assert needed_on(platform, machine) == ALWAYS | also


def test_the_metadata_says_what_a_user_wants_to_know():
    about = metadata("cylx")
    assert about["Requires-Python"] == ">=3.10"
    assert about["License-Expression"] == "Apache-2.0"
    assert {"test", "lint"} <= set(about.get_all("Provides-Extra"))
    assert about["Summary"]


def test_the_command_is_there():
    (command,) = (point for point in entry_points(group="console_scripts") if point.name == "cylx")
    assert callable(command.load())


def test_every_public_name_resolves():
    assert len(cylx.__all__) == len(set(cylx.__all__))
    for name in cylx.__all__:
        assert getattr(cylx, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = cylx.nothing


def test_importing_the_package_brings_nothing_heavy():
    code = "import sys, cylx; print([m for m in ('numpy', 'scipy', 'open3d', 'numba', 'pydantic') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
