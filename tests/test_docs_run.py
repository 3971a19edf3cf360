"""The code blocks of the documentation are run, and give what the pages show.

Bash and Python blocks of a page are run in their order, in a folder with the files of `sample_data` that a fresh clone
has. A text block after one of them is its output, a JSON block after `<!-- from FILE: KEYS -->` a part of a file: the
words must agree, the numbers nearly. `--regen` writes them anew.
"""

import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest
import yaml

from cylx.pipeline import extract_cylinders
from cylx.version import __version__ as cylx_version
from tests.support import warm
from tests.support.patience import PATIENCE
from tests.support.texts import same

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES = [
    path for path in PAGES if path.name != "benchmarks.md"
]  # its commands take long and have a runner of their own
RUN, READ = {"bash", "python"}, {"text", "json", "yaml", "make"}  # make and workflows have tests of their own
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?")


class Block(NamedTuple):
    """A fenced block: its language, its text and where that is, what is noted and what stands before it."""

    language: str
    text: str
    start: int
    end: int
    source: str
    follows: bool


def blocks_of(page):
    """Give the fenced blocks of a page; a block follows the one before it if nothing is between them."""
    last = -1
    for found in re.finditer(r"(?:<!-- from (.*?) -->\n)?^```(\w*)\n(.*?)^```$", page, re.DOTALL | re.MULTILINE):
        between = page[last : found.start()].strip() if last >= 0 else "the beginning"
        yield Block(found[2], found[3], found.start(3), found.end(3), found[1] or "", not between)
        last = found.end()


def test_what_counts_as_the_same():
    assert same("a 1.00 -0.5\n───", "a  1.01   -0.5  ─")
    assert not same("a 1.0", "a 1.2")
    assert not same("a 1.0", "b 1.0")
    assert not same("a 1.0", "a 1.0 1.0")


def without_installing(line):
    """Leave out of a line what installs: the tests run in what is installed already."""
    if not line.startswith("pip install"):
        return line
    rest = line.partition(" && ")[2]
    return "" if rest.startswith("pytest") else rest


def shorten(value):
    """Cut the digits of numbers that nobody reads."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, list):
        return [shorten(item) for item in value]
    return {key: shorten(item) for key, item in value.items()} if isinstance(value, dict) else value


def excerpt(source, folder):
    """Give a part of a JSON file, one key a line, its digits cut."""
    file, _, keys = source.partition(": ")
    keys, _, left_out = keys.partition(", without ")
    value = json.loads((folder / file).read_text(encoding="utf-8"))
    for key in keys.split():
        value = value[int(key) if isinstance(value, list) else key]
    for name in left_out.split(" and "):
        value.pop(name, None)
    text = json.dumps(shorten(value), indent=2, ensure_ascii=False)
    return re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


@pytest.fixture
def clone(tmp_path):
    """A folder with `sample_data` as a fresh clone has it, and without what somebody extracted there."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "sample_data"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    everything = (path.relative_to(ROOT) for path in (ROOT / "sample_data").rglob("*") if path.is_file())
    for name in listed.stdout.split() if listed.returncode == 0 else everything:
        if (ROOT / name).is_file():
            (tmp_path / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / "clone" / name)
    return tmp_path / "clone"


@pytest.fixture(scope="module")
def cylx(kept_extractions):
    """The text of the command `cylx` of this checkout, which is warm already where that is possible."""
    if not warm.POSSIBLE:
        yield f'#!/bin/sh\nexec "{sys.executable}" -m cylx "$@"\n'
        return
    with (
        tempfile.TemporaryDirectory() as folder,
        warm.serving(Path(folder) / "s", kept_extractions),
    ):  # such names must be short
        yield warm.calls(Path(folder) / "s")


@pytest.fixture
def bash(clone, tmp_path, cylx):
    """Run a text by bash in the clone, with `cylx` and `python` of this checkout; gives both its streams."""
    tools = tmp_path / "tools"
    tools.mkdir()
    for name, text in (("cylx", cylx), ("python", f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')):
        (tools / name).write_text(text, encoding="utf-8")
        (tools / name).chmod(0o755)
    path = os.pathsep.join([str(tools), os.environ["PATH"]])
    env = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", "PYTHONIOENCODING": "utf-8"}

    def run(text):
        text = "\n".join(map(without_installing, text.splitlines()))
        command = ["bash", "-euo", "pipefail", "-c", text]
        done = subprocess.run(
            command, cwd=clone, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=PATIENCE, check=False
        )
        assert done.returncode == 0, f"{text}\n{done.stdout.decode()}"
        return done.stdout.decode()

    return run


@pytest.mark.skipif(shutil.which("bash") is None, reason="the pages are written for bash, which is not here")
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_the_code_blocks_run_and_give_what_is_shown(path, bash, clone, monkeypatch, request, kept_extractions):
    monkeypatch.chdir(clone)
    for name in ("cylx.api.extract_cylinders", "cylx.pipeline.extract_cylinders"):
        monkeypatch.setattr(name, warm.remembered(extract_cylinders, kept_extractions))
    page = path.read_text(encoding="utf-8")
    output, names, stale = None, {"__name__": "page"}, []
    for block in blocks_of(page):
        assert block.language in RUN | READ, f"```{block.language}: a language that nobody runs or reads"
        if block.language == "bash":
            output = bash(block.text)
        elif block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as stdout:
                exec(compile(block.text, str(path), "exec"), names)
            output = stdout.getvalue()
        elif block.source or (block.language == "text" and block.follows and output is not None):
            found = excerpt(block.source, clone) if block.source else output
            stale += [] if same(block.text, found) else [(block, found)]
            output = None
    if request.config.getoption("--regen"):
        for block, found in reversed(stale):
            page = page[: block.start] + found + page[block.end :]
        path.write_text(page, encoding="utf-8", newline="\n")
        stale = []
    assert [found for _, found in stale] == [block.text for block, _ in stale], "pytest tests/test_docs_run.py --regen"


def only_block(language, word, page="command-line.md"):
    """Give the text of the block of a language, on a page, that has a word in it."""
    page = (ROOT / "docs" / page).read_text(encoding="utf-8")
    (text,) = (block.text for block in blocks_of(page) if block.language == language and word in block.text)
    return text


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not here")
def test_the_makefile_makes_what_is_missing_or_stale(bash, clone):
    (clone / "Makefile").write_text(only_block("make", "cylx extract"), encoding="utf-8")
    assert "extract sample_data/pipes.ply" in bash("make")
    results = [clone / "sample_data" / f"{name}.cylinders.json" for name in ("pipes", "site_mm")]
    assert all(path.is_file() for path in results)
    assert "extract" not in bash("make")
    os.utime(clone / "sample_data" / "site_mm.ply")
    results[1].unlink()
    again = bash("make")
    assert ("extract sample_data/site_mm.ply" in again, "pipes" in again) == (True, False)


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not here")
def test_the_workflow_fails_when_a_cylinder_has_moved(bash, clone):
    (job,) = yaml.safe_load(only_block("yaml", "runs-on"))["jobs"].values()
    steps = [step["run"] for step in job["steps"] if "run" in step]
    assert len(steps) == 3
    for step in steps:
        said = bash(step)
    assert said == "the same 6 cylinders\n"
    golden = clone / "sample_data" / "golden" / "pipes.cylinders.json"
    golden.write_text(golden.read_text().replace('"radius": 0.15', '"radius": 0.16', 1), encoding="utf-8")
    with pytest.raises(AssertionError, match="radius"):
        bash(steps[-1])


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not here")
def test_the_workflow_with_a_cache_names_its_key_and_writes_the_tests(bash, clone):
    (job,) = yaml.safe_load(only_block("yaml", "runs-on", "howto-ci.md"))["jobs"].values()
    (kept,) = (step["with"] for step in job["steps"] if step.get("uses", "").startswith("actions/cache@"))
    assert kept["path"] == job["env"]["NUMBA_CACHE_DIR"]
    for step in job["steps"]:
        if "run" in step:
            bash(f"export GITHUB_OUTPUT=outputs\n{step['run']}")
    (line,) = (clone / "outputs").read_text(encoding="utf-8").splitlines()
    assert re.fullmatch(rf"key=kernels-{re.escape(cylx_version)}(-[\w.]+)+", line)
    suites = ElementTree.parse(clone / "diff.xml").getroot()
    assert (suites.get("tests"), suites.get("failures")) == ("6", "0")


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not here")
def test_the_job_of_another_server_writes_the_report_that_it_takes(bash, clone):
    (job,) = yaml.safe_load(only_block("yaml", "artifacts", "howto-ci.md")).values()
    for line in job["script"]:
        bash(line)
    assert (clone / job["artifacts"]["reports"]["junit"]).is_file()
