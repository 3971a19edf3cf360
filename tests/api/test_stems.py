"""`cylx.find_stems`: the same as the command, from arrays and files."""

import json

import pytest

import cylx
from cylx.errors import InputError, UsageError
from cylx.io import write_cloud
from cylx.results.stems import Stems
from cylx.synthetic import forest


@pytest.fixture(scope="module")
def plot():
    return forest(5, side=6.0, spacing=0.02, shrubs_per_hectare=100)


def test_stems_of_a_file_are_those_of_the_command(plot, run_cylx, tmp_path):
    write_cloud(tmp_path / "plot.ply", plot.points)
    done = run_cylx("stems", tmp_path / "plot.ply", "--ground", "lowest", "--min-dbh", 0.15, "--json")
    found = cylx.find_stems(tmp_path / "plot.ply", ground="lowest", min_dbh=0.15)
    assert isinstance(found, cylx.StemPlot)
    assert len(found.stems) >= 1
    assert Stems.of(found, "m").to_object() == json.loads(done.stdout)
    assert min(stem.dbh for stem in found.stems) >= 0.15


def test_stems_in_another_unit_have_the_same_diameters(plot):
    metres = cylx.find_stems(plot.points, ground="lowest")
    millimetres = cylx.find_stems(1000.0 * plot.points, units="mm", ground="lowest")
    assert len(metres.stems) == len(millimetres.stems) >= 2
    for a, b in zip(metres.stems, millimetres.stems, strict=True):
        assert b.dbh == pytest.approx(a.dbh, rel=1e-6)
        assert b.foot == pytest.approx(1000.0 * a.foot, abs=1e-3)


def test_stems_need_a_unit_that_there_is_and_a_plot(plot):
    with pytest.raises(UsageError, match="no unit of length"):
        cylx.find_stems(plot.points, units="ells")
    with pytest.raises(InputError, match="too large for a plot"):
        cylx.find_stems(1000.0 * plot.points)
    with pytest.raises(ValueError, match="scan needs a file"):
        cylx.find_stems(plot.points, scan=1)
