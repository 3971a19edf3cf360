"""E57 files of public reports, made anew by the makers in ../shared/cases, with what is right for each."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud
from tests.support.patience import PATIENCE

MAKER = Path(__file__).resolve().parents[3] / "shared" / "cases" / "e57-quirks" / "make.py"
if not MAKER.exists() and os.environ.get("CI") != "true":
    pytest.skip("the makers of ../shared/cases are not here", allow_module_level=True)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cases")
    subprocess.run([sys.executable, str(MAKER)], cwd=folder, check=True, capture_output=True, timeout=PATIENCE)
    return folder


@pytest.mark.parametrize(
    ("name", "moved", "points"),
    [
        ("plain", 0, 20_000),
        ("zeroquat", 0, 20_000),
        ("zeroquat_tr", [5, 6, 7], 20_000),
        ("nonunit", 0, 20_000),
        ("empty2nd", 0, 20_000),
        ("two", 0, 20_000),
        ("invalid", 0, 16_000),
        ("phantom", 0, 52_000),
    ],
)
def test_what_is_odd_is_right(made, name, moved, points):
    plain, cloud = read_cloud(made / "plain.e57").points, read_cloud(made / f"{name}.e57")
    assert (cloud.rows, len(cloud.points)) == (max(points, 20_000), points)
    kept = plain[cloud.valid[:20_000]] if cloud.valid is not None else plain
    assert np.abs(cloud.points[: len(kept)] - kept - moved).max() < 2e-6


@pytest.mark.parametrize("name", ["spherical", "notreally", "trunc", "bitflip"])
def test_what_is_damaged_is_one_line(made, run_cylx, name):
    with pytest.raises(InputError):
        read_cloud(made / f"{name}.e57")
    shown = run_cylx("info", made / f"{name}.e57")
    assert (shown.exit_code, shown.stdout, shown.stderr.count("\n")) == (3, "", 1)
    assert shown.stderr.startswith(f"cylx: {made / name}.e57: ")
