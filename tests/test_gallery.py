"""The scripts of the gallery run, print what their page shows, and draw its pictures."""

import contextlib
import io
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

from cylx.errors import UsageError
from tests.support.texts import same

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "gallery.md"
SCRIPTS = sorted((ROOT / "docs" / "gallery").glob("*.py"))
LARGEST = 150_000
pytestmark = pytest.mark.usefixtures("remembering")


@pytest.fixture
def play(tmp_path, monkeypatch):
    """Run a script of the gallery in a folder of its own, with the samples; give its names and what it printed."""
    for name in ("pipes.ply", "golden/pipes.cylinders.json"):
        copy = tmp_path / "sample_data" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "sample_data" / name, copy)
    monkeypatch.chdir(tmp_path)

    def run(name):
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            names = runpy.run_path(str(ROOT / "docs" / "gallery" / f"{name}.py"))
        return names, printed.getvalue()

    return run


def pixels(path):
    from matplotlib.image import imread

    return imread(path)[:, :, :3]


def test_the_page_tells_of_every_script():
    assert [path.stem for path in SCRIPTS] == ["ci_regression", "desk_objects", "pipe_rack", "tree_stems"]
    assert sorted(re.findall(r"\]\(gallery/(\w+)\.py\)", PAGE.read_text(encoding="utf-8"))) == [
        path.stem for path in SCRIPTS
    ]


def check_desk_objects(names, printed):
    assert len(names["found"].cylinders) == 3
    for fit in names["found"].cylinders:
        true = min(
            (one.shape.radius for one in names["cylinders"].values()), key=lambda r: abs(r - fit.cylinder.radius)
        )
        assert abs(fit.cylinder.radius - true) < 4 * fit.radius_sd


def check_pipe_rack(names, printed):
    found = names["found"]
    assert all(fit.nominal.decision == "snapped" for fit in found.cylinders)
    for pipe, name in zip(names["pipes"], names["names"], strict=True):
        near = min(found.cylinders, key=lambda fit: np.linalg.norm(fit.cylinder.point[1:] - pipe.shape.point[1:]))
        assert near.nominal.name == name
    hit = found.cylinders[names["dented"]].cylinder
    assert np.linalg.norm(hit.point[1:] - names["pipes"][1].shape.point[1:]) < 2.0
    assert names["deepest"] < 2 * names["usual"] < 0


def check_tree_stems(names, printed):
    deviations = [fit.radius_sd for fit in names["found"].cylinders]
    assert names["matched"].sum() == names["STEMS"] == len(deviations)
    assert (np.abs(names["errors"]) < 2 * np.array(deviations)).mean() >= 0.8


def check_ci_regression(names, printed):
    assert printed.startswith("same of 6 cylinders\n")
    kinds = {(one.kind, one.id_a) for one in names["outcome"].differences}
    assert kinds == {("resized", 2), ("missing", 5)}


CHECKS = {
    check.__name__.removeprefix("check_"): check
    for check in (check_desk_objects, check_pipe_rack, check_tree_stems, check_ci_regression)
}


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_finds_prints_and_draws_what_the_page_shows(path, play, tmp_path, request):
    names, printed = play(path.stem)
    CHECKS[path.stem](names, printed)
    (drawn,) = tmp_path.glob("*.png")
    shown = ROOT / "docs" / "pictures" / f"gallery-{path.stem.replace('_', '-')}.png"
    page = PAGE.read_text(encoding="utf-8")
    pattern = rf"(<!-- printed by gallery/{path.stem}\.py -->\n```text\n)(.*?)(?=```)"
    (block,) = (found[2] for found in re.finditer(pattern, page, re.DOTALL))
    if request.config.getoption("--regen"):
        page = re.sub(pattern, lambda found: found[1] + printed, page, count=1, flags=re.DOTALL)
        PAGE.write_text(page, encoding="utf-8", newline="\n")
        shutil.copy(drawn, shown)
        block = printed
    assert same(block, printed), "pytest tests/test_gallery.py --regen"
    assert f"](pictures/{shown.name})" in page
    assert shown.stat().st_size < LARGEST
    # fonts differ from machine to machine, and so does what a layout makes of them: as many coloured dots will do
    ink = [float((pixels(one).std(axis=2) > 0.1).mean()) for one in (drawn, shown)]
    assert ink[0] == pytest.approx(ink[1], rel=0.3)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_opens_as_a_notebook(path):
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# %% [markdown]\n# # ")
    cells = re.split(r"^# %%", text, flags=re.MULTILINE)[1:]
    for cell in cells:
        kind, _, body = cell.partition("\n")
        assert kind in ("", " [markdown]")
        if kind:
            assert all(line.startswith("#") for line in body.splitlines() if line)


def test_without_matplotlib_an_example_says_what_to_install(play, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    with pytest.raises(UsageError, match=r"cylx\[plots\]"):
        play("desk_objects")
