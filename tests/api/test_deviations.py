"""`cylx.measure_deviations`: the same as the command, from arrays and files, and with cylinders as the design."""

import json

import numpy as np
import pytest

import cylx
from cylx.errors import UsageError
from cylx.io import write_cloud
from tests.support.tanks import tank

ASIDE = np.array([60.0, -80.0, 5.0])


def test_deviations_of_files_are_those_of_the_command(run_cylx, tmp_path):
    points, shape, _ = tank(points=20_000)
    write_cloud(tmp_path / "tank.ply", points)
    entry = {"name": "A", "start": shape.start.tolist(), "end": shape.end.tolist(), "radius": shape.radius}
    (tmp_path / "tank.json").write_text(json.dumps({"cylinders": [entry]}))
    done = run_cylx("deviation", tmp_path / "tank.ply", tmp_path / "tank.json", "--dent", 0.01, "--tilt", 1, "--json")
    assert done.exit_code == 1
    compared = cylx.measure_deviations(tmp_path / "tank.ply", tmp_path / "tank.json", dent=0.01, tilt_deg=1)
    assert compared.verdict == "fail"
    assert [(one.of, one.verdict) for one in compared.checks[0]] == [
        ("found", "pass"), ("tilt_deg", "pass"), ("dent", "fail"),
    ]  # fmt: skip
    assert compared.to_document().to_object() == json.loads(done.stdout)
    assert repr(compared) == "Comparison(1 cylinder, fail)"


def test_cylinders_may_be_the_design():
    points, shape, _ = tank(points=20_000, dent=0.0)
    other = cylx.Cylinder(shape.point + ASIDE, shape.direction, 1.0, 2.0)
    compared = cylx.measure_deviations(points, [shape, other], radius=0.01)
    there, missing = compared.deviations
    assert abs(there.measured.radius) < 4 * there.measured.radius_sd + 1e-4
    assert missing.measured is None
    assert compared.verdict == "fail"  # the other is not there
    assert set(np.unique(compared.labels)) == {0}
    assert cylx.measure_deviations(points, [shape], radius=0.01).verdict == "pass"


def test_units_of_a_design_must_fit(tmp_path):
    points, shape, _ = tank(points=20_000, dent=0.0)
    entry = {"name": "A", "start": (1000 * shape.start).tolist(), "end": (1000 * shape.end).tolist(), "radius": 3000.0}
    (tmp_path / "tank.json").write_text(json.dumps({"cylinders": [entry]}))
    write_cloud(tmp_path / "tank.ply", points)
    compared = cylx.measure_deviations(tmp_path / "tank.ply", tmp_path / "tank.json", units="m", design_units="mm")
    assert compared.scale == pytest.approx(0.001)
    assert compared.deviations[0].measured.radius == pytest.approx(0.0, abs=0.001)
    with pytest.raises(UsageError, match="no unit of length"):
        cylx.measure_deviations(points, [shape], design_units="ells")
