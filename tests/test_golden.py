"""The samples: made as their README says, found whole, and found as they were before."""

import hashlib
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cylx.cli import main
from cylx.evaluation import compare, evaluate
from cylx.io import read_cloud
from cylx.results import Result

SAMPLE_DATA = Path(__file__).resolve().parents[1] / "sample_data"
SAMPLES = ["pipes.ply", "room.pcd", "paper.xyz", "site_mm.ply"]
README = (SAMPLE_DATA / "README.md").read_text(encoding="utf-8")


def truth_of(sample):
    return (SAMPLE_DATA / sample).with_suffix(".truth.json")


def golden_of(sample):
    """The golden results lie apart from where `cylx extract` writes, which never overwrites."""
    return (SAMPLE_DATA / "golden" / sample).with_suffix(".cylinders.json")


def load(path):
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module", params=SAMPLES)
def sample(request):
    return request.param


@pytest.fixture(scope="module")
def found(sample, request, extract_file):
    text = Result.of(extract_file(SAMPLE_DATA / sample)).to_json()
    if request.config.getoption("--regen"):
        golden_of(sample).write_text(text, encoding="utf-8", newline="\n")
    return json.loads(text)


def test_every_cylinder_is_found_and_nothing_else(sample, found):
    truth = load(truth_of(sample))
    assert not any(true["ignore"] for true in truth["cylinders"])
    score = evaluate(truth, found)
    assert (score.f1, score.missed, score.false) == (1.0, (), ())


def test_the_result_is_the_golden_one(sample, found):
    assert compare(load(golden_of(sample)), found).differences == ()


def test_the_golden_result_is_of_this_very_file_and_by_the_schema(sample):
    golden = load(golden_of(sample))
    Result.parse(golden, sample)
    assert golden["input"]["file"] == sample
    assert golden["input"]["sha256"] == hashlib.sha256((SAMPLE_DATA / sample).read_bytes()).hexdigest()


def test_the_readme_says_how_it_was_made(sample, tmp_path, monkeypatch):
    (command,) = re.findall(rf"^cylx (synth \w+ {re.escape(sample)} .*)$", README, re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    made = CliRunner().invoke(main, shlex.split(command))
    assert made.exit_code == 0, made.output
    truth, again = load(truth_of(sample)), load((tmp_path / sample).with_suffix(".truth.json"))
    assert compare(truth, again).same
    assert {**again, "cylinders": []} == {**truth, "cylinders": []}
    # another machine may round the last bit of a sine the other way; the noise is 200 times larger
    assert np.allclose(read_cloud(SAMPLE_DATA / sample).points, read_cloud(tmp_path / sample).points, rtol=0, atol=1e-5)


def test_the_samples_are_small_and_all_are_told_of():
    outputs = {
        (SAMPLE_DATA / sample).with_suffix(end) for sample in SAMPLES for end in (".cylinders.json", ".annotated.ply")
    }
    ours = [path for path in SAMPLE_DATA.rglob("*") if path.is_file() and path not in outputs]
    clouds = [path.name for path in ours if path.suffix in {".ply", ".pcd", ".xyz"}]
    assert sorted(clouds) == sorted(SAMPLES)
    assert sum(path.stat().st_size for path in ours) <= 6e6
