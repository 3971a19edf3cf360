"""The scratch folder: whole files only, locked, emptied or gone on with, and never left without need."""

import numpy as np
import pytest

from cylx.errors import OutputError
from cylx.io import open_scratch


def test_what_is_written_can_be_read(tmp_path):
    with open_scratch(tmp_path, "out.json", {}, resume=False) as scratch:
        scratch.write("a.npz", points=np.eye(3), count=np.array(3))
        assert (scratch.read("a.npz")["points"] == np.eye(3)).all()
        scratch.write_json("b.json", {"a": [1.5, None]})
        assert scratch.read_json("b.json") == {"a": [1.5, None]}
        for start in (0, 4):
            scratch.append("rows", np.arange(start, start + 4.0))
        assert (scratch.rows("rows", np.float64, 2) == np.arange(8.0).reshape(4, 2)).all()
        assert (scratch.part("rows", np.float64, 2, 3) == [2, 3, 4]).all()
        assert (scratch.mapped("rows", np.float64)[-1:] == [7]).all()
        assert len(scratch.rows("none", np.int64)) == 0
        assert not scratch.has("none")
        second = open_scratch(tmp_path, "out.json", {}, resume=False)
        with pytest.raises(OutputError, match="another run is at work there"):
            second.__enter__()
    assert list(tmp_path.iterdir()) == []


def fail_in(folder, manifest, *, resume):
    """Write something, and fail."""
    opened = open_scratch(folder, "out.json", manifest, resume=resume)
    opened.__enter__().write_json("half.json", 1)
    with pytest.raises(KeyError):
        opened.gen.throw(KeyError())


@pytest.mark.parametrize(("first", "second", "there"), [(False, True, False), (True, True, True), (True, False, False)])
def test_a_failed_run_is_gone_on_with_on_request_alone(tmp_path, first, second, there):
    fail_in(tmp_path, {"a": 1}, resume=first)
    assert bool(list(tmp_path.iterdir())) == first
    with open_scratch(tmp_path, "out.json", {"a": 1}, resume=second) as scratch:
        assert scratch.has("half.json") == there
    assert list(tmp_path.iterdir()) == []


def test_another_manifest_begins_anew(tmp_path):
    fail_in(tmp_path, {"a": 1}, resume=True)
    with open_scratch(tmp_path, "out.json", {"a": 2}, resume=True) as scratch:
        assert not scratch.has("half.json")


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").touch()
    refused = open_scratch(tmp_path / "file", "out.json", {}, resume=False)
    with pytest.raises(OutputError, match=r"cannot be written: .*; choose another folder by --scratch$"):
        refused.__enter__()
