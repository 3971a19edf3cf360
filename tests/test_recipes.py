"""The recipes in docs/ and the hooks, as far as they run without a container, a package builder or a hosting service.

The `RUN` lines of the Dockerfile are run in a fresh environment, with the folders of the image in a scratch folder.
"""

import json
import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
import sysconfig
import tempfile
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from cylx.version import __version__
from tests.support.patience import PATIENCE

tomllib = pytest.importorskip("tomllib", reason="Python 3.11 reads TOML by itself")

ROOT = Path(__file__).resolve().parents[1]
NOBODY = 54321
"""A user that no machine has."""
WITHOUT_CONDA = {"libusb-package"}
"""What the wheels of open3d need, and its conda package brings."""
POSIX = pytest.mark.skipif(os.name == "nt", reason="the recipes are for a shell of Unix")
BUILDS = pytest.mark.skipif(find_spec("hatchling") is None, reason="without hatchling no wheel can be built")


def instructions(text):
    """Give the (name, argument) of each instruction of a Dockerfile, lines that go on being joined."""
    text = re.sub(r"^#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", " ")
    return [tuple(line.split(None, 1)) for line in text.splitlines() if line.strip()]


@pytest.fixture(scope="module")
def scratch():
    """A folder that every user can reach; those of pytest belong to one alone."""
    folder = Path(tempfile.mkdtemp(prefix="cylx-recipes-"))
    folder.chmod(0o755)
    yield folder
    for one in folder.rglob("*"):
        if one.is_dir() and not one.is_symlink():
            one.chmod(0o755)
    shutil.rmtree(folder, ignore_errors=True)


def fresh_environment(folder):
    """Make an environment that has the libraries of this one, but not cylx; gives the variables of its processes."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True, timeout=PATIENCE)
    (site,) = folder.glob("lib/python*/site-packages")
    builder = find_spec("hatchling")
    sources = [Path(sysconfig.get_paths()["purelib"]), *([Path(builder.origin).parents[1]] if builder else [])]
    for one in (one for source in sources for one in source.iterdir()):
        if not (one.name.lower().startswith(("cylx", "__editable__", "_cylx")) or (site / one.name).exists()):
            (site / one.name).symlink_to(one)
    nothing_to_fetch = {"PIP_NO_BUILD_ISOLATION": "0", "PIP_NO_INDEX": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    return {"PATH": f"{folder}/bin:/usr/bin:/bin", **nothing_to_fetch}


def others_can_run_it():
    """Tell whether the interpreter and its libraries lie where every user may go; the home of root is its own."""
    places = Path(sys.executable).resolve(), Path(sysconfig.get_paths()["purelib"]).resolve() / "numpy"
    return all(one.stat().st_mode & stat.S_IXOTH for place in places for one in place.parents)


def shell(line, folder, environment, user=None):
    """Run a line as another user, if there can be one, or the same; gives what it says."""
    other = user is not None and not os.geteuid() and others_can_run_it()
    one = {"user": user, "group": user, "extra_groups": []} if other else {}
    command = ["/bin/sh", "-euc", line]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False, **one
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def image(scratch):
    """Run the Dockerfile; gives the variables of its containers, without a home, and the folder for their data."""
    environment, here = fresh_environment(scratch / "python"), scratch
    for name, argument in instructions((ROOT / "docs" / "docker" / "Dockerfile").read_text(encoding="utf-8")):
        if name == "WORKDIR":
            here = scratch / argument.lstrip("/")
            here.mkdir()
        elif name == "COPY" and not argument.startswith("--from"):  # the other stage has the same folders here
            *sources, target = argument.split()
            assert all((ROOT / source).exists() for source in sources)
            for source in sources:
                copy_from_checkout(ROOT / source, here / ("" if target == "./" else target))
        elif name == "ENV":
            environment.update([argument.split("=")])
        elif name == "RUN" and not argument.startswith("apt-get"):
            shell(argument.replace("/wheels", str(scratch / "wheels")), here, environment)
    read_only(scratch / "python")
    here.chmod(0o777)
    return {name: environment[name] for name in ("PATH", "NUMBA_CPU_NAME")}, here


def read_only(folder):
    """Let everybody read a folder, and nobody write to it; what links lead to stays as it is."""
    for one in [folder, *folder.rglob("*")]:
        if not one.is_symlink():
            one.chmod(0o555 if one.is_dir() or os.access(one, os.X_OK) else 0o444)


def copy_from_checkout(source, target):
    """Copy a file into a folder, or a folder to another; a checkout has kernels beside its files."""
    if source.is_file():
        shutil.copy(source, target)
        return
    shutil.copytree(source, target)
    (target / "__pycache__").mkdir(exist_ok=True)
    (target / "__pycache__" / "left.nbc").write_bytes(b"of the checkout")


@POSIX
@BUILDS
def test_the_image_serves_another_user_without_a_home(image):
    environment, data = image
    shutil.copy(ROOT / "sample_data" / "pipes.ply", data)
    assert re.match(r"all \d\d+ kernels are there already", shell("cylx warmup", data, environment, NOBODY))
    assert shell("cylx extract pipes.ply --quiet && ls", data, environment, NOBODY).split() == [
        "pipes.annotated.ply", "pipes.cylinders.json", "pipes.ply",
    ]  # fmt: skip
    found = json.loads((data / "pipes.cylinders.json").read_text(encoding="utf-8"))
    assert len(found["cylinders"]) == 6


@POSIX
@BUILDS
def test_the_image_serves_a_user_with_a_home(image, tmp_path_factory, scratch):
    """Who may write somewhere compiles nothing that is in the image."""
    environment, data = image
    home = scratch / "home"
    home.mkdir()
    os.chown(home, *((NOBODY, NOBODY) if not os.geteuid() else (-1, -1)))
    said = shell("cylx warmup", data, {**environment, "HOME": str(home)}, NOBODY)
    assert re.match(r"all \d\d+ kernels are there already", said)


@POSIX
@BUILDS
def test_no_kernels_of_the_checkout_get_into_the_image(image, scratch):
    assert list((scratch / "src").rglob("left.nbc"))
    assert not list((scratch / "python").rglob("left.nbc"))


RECIPE = (ROOT / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8")


def test_the_conda_recipe_asks_for_what_the_project_asks_for():
    recipe, project = yaml.safe_load(RECIPE), tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    about, asked = project["project"], recipe["requirements"]
    needs = {re.match(r"([\w-]+)(.*)", need.partition(";")[0].strip()).groups() for need in about["dependencies"]}
    names = {(name.lower().replace("open3d-cpu", "open3d"), bound) for name, bound in needs}
    assert {tuple(need.split()) for need in asked["run"]} == {
        *((name, bound) for name, bound in names if name not in WITHOUT_CONDA),
        ("python", about["requires-python"]),
    }
    assert {need.replace(" ", "") for need in asked["host"]} == {
        *project["build-system"]["requires"], "pip", f"python{about['requires-python']}",
    }  # fmt: skip
    assert recipe["context"]["version"] == __version__
    assert recipe["build"]["python"]["entry_points"] == [" = ".join(*about["scripts"].items())]
    told = recipe["about"]
    assert (recipe["package"]["name"], told["summary"], told["license"]) == ("cylx", about["description"], "Apache-2.0")
    assert (ROOT / told["license_file"]).is_file()
    assert (ROOT / "docs" / "conda" / recipe["source"]["path"]).resolve() == ROOT


@POSIX
@BUILDS
def test_the_conda_recipe_builds_and_its_tests_pass(scratch):
    recipe = yaml.safe_load(RECIPE)
    environment = fresh_environment(scratch / "conda")
    (scratch / "source").mkdir()
    for name in (".gitignore", "pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "cylx"):
        copy_from_checkout(ROOT / name, scratch / "source" / (name if name == "cylx" else ""))
    shell(recipe["build"]["script"], scratch / "source", environment)
    python, script = (test.get("python") or test["script"] for test in recipe["tests"])
    for name in python["imports"]:
        where = shell(f"python -c 'import {name}; print({name}.__file__)'", scratch, environment)
        assert where.startswith(str(scratch / "conda"))
    said = [shell(line, scratch, environment) for line in script]
    assert said[0] == f"cylx {__version__}\n"


def hooks():
    return yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))


def test_the_hook_is_called_for_results_alone():
    (hook,) = hooks()
    for name in ("a.cylinders.json", "deep/down/b.rejected.json", "c.stems.json", "d.deviation.json"):
        assert re.search(hook["files"], name)
    for name in ("package.json", "a.truth.json", "cylinders.json.md", "cylinders.json"):
        assert not re.search(hook["files"], name)
    used = (ROOT / "docs" / "howto-ci.md").read_text(encoding="utf-8")
    assert f"- id: {hook['id']}\n" in used


def test_the_hook_stops_a_commit_of_what_is_no_result(run_cylx, tmp_path):
    (hook,) = hooks()
    program, *arguments = shlex.split(hook["entry"])
    assert program == "cylx"
    golden = sorted((ROOT / "sample_data" / "golden").glob("*.cylinders.json"))
    done = run_cylx(*arguments, *golden)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    merged = tmp_path / "merged.cylinders.json"
    merged.write_text("<<<<<<< ours\n" + golden[0].read_text(encoding="utf-8"), encoding="utf-8")
    done = run_cylx(*arguments, golden[0], merged, golden[1])
    assert (done.exit_code, done.stdout) == (3, "")
    assert done.stderr.startswith(f"cylx: {merged}:1:1: not JSON")
