"""The name of the annotated cloud where LAS could not be written: see tests/io/test_las_mend.py for the rest."""

import pytest

from cylx.cli.batch.annotated import as_written
from cylx.cli.batch.jobs import Job


@pytest.mark.parametrize(
    ("name", "there", "expected"),
    [
        ("a.annotated.las", ["a.annotated.ply"], "a.annotated.ply"),
        ("a.annotated.las", ["a.annotated.ply", "a.annotated.las"], "a.annotated.las"),
        ("a.annotated.laz", [], "a.annotated.laz"),
        ("a.annotated.pcd", ["a.annotated.ply"], "a.annotated.pcd"),
        (None, ["a.annotated.ply"], None),
    ],
)
def test_a_scan_whose_annotated_cloud_became_ply_is_complete(tmp_path, monkeypatch, name, there, expected):
    monkeypatch.chdir(tmp_path)
    for file in there:
        (tmp_path / file).touch()
    assert as_written(Job("a.las", "a.cylinders.json", name)).annotated == expected
