"""Numbers as values of options: none is NaN, and none takes thousands of digits."""

import numpy as np
import pytest

from cylx.records import PointCloud, Selection
from cylx.scene import select

GIVEN = {
    "--voxel=nan": "Invalid value for '--voxel': 'nan' is not a number",
    "--classes=" + "9" * 5000: "Invalid value for '--classes': '9999",
    "--classes=1000000000": "Invalid value for '--classes': '1000000000' is not a list of class numbers such as 2,6",
    "--every=1e30": "Invalid value for '--every': '1e30' is not a valid integer range",
}


@pytest.mark.parametrize("option", GIVEN, ids=range(len(GIVEN)))
def test_impossible_numbers_are_refused_in_one_short_line(run_cylx, option):
    shown = run_cylx("info", "none.ply", option)
    assert (shown.exit_code, shown.stdout, shown.stderr.count("\n")) == (2, "", 1)
    assert shown.stderr.startswith(f"cylx: {GIVEN[option]}")
    assert len(shown.stderr) < 600


@pytest.mark.parametrize("command", [["evaluate", "a", "b", "--min-f1"], ["diff", "a", "b", "--radius"]])
def test_no_bar_is_nan(run_cylx, command):
    assert run_cylx(*command, "nan").exit_code == 2


def test_every_of_more_than_there_are_is_the_first():
    cloud = PointCloud(np.arange(30.0).reshape(10, 3))
    assert select(cloud, Selection(every=10**30)).points.tolist() == [[0, 1, 2]]
