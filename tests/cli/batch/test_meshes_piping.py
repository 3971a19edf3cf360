"""The mesh beside a result is the one that `cylx export` writes of it, with its fittings."""

import json
from pathlib import Path

import pytest

from cylx.cli.batch.meshes import mesh_of
from cylx.results import Result
from tests.support.piping import piping

GOLDEN = Path(__file__).resolve().parents[3] / "sample_data" / "golden" / "pipes.cylinders.json"


def test_the_mesh_beside_a_result_has_its_fittings(run_cylx, tmp_path):
    pytest.importorskip("trimesh", reason="needs cylx[mesh]")
    cylinders, fittings, runs = piping()
    plain = Result.parse(json.loads(GOLDEN.read_text(encoding="utf-8")), "it")
    content = plain.model_copy(update={"cylinders": cylinders, "fittings": fittings, "runs": runs})
    (tmp_path / "r.json").write_text(content.to_json(), encoding="utf-8")
    data, remarks = mesh_of("a.obj", content)
    assert remarks == []
    assert data is not None
    assert data.startswith(b"# 14 cylinders, 15 fittings\n")
    assert run_cylx("export", tmp_path / "r.json", tmp_path / "a.obj").exit_code == 0
    assert (tmp_path / "a.obj").read_bytes() == data
