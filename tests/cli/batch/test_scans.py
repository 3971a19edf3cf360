"""Which scans are meant: names, folders and patterns."""

from pathlib import Path

import pytest

from cylx.cli.batch.scans import find_scans
from cylx.cli.batch.summary import COLUMNS
from cylx.errors import InputError


@pytest.fixture
def tree(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (
        "b.ply",
        "a.PCD",
        "notes.md",
        ".hidden.ply",
        "a.annotated.ply",
        "sub/c.xyz",
        ".git/d.ply",
        "sub/x.dat",
    ):
        (tmp_path / "s" / name).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / "s" / name).touch()
    (tmp_path / "s" / "summary.csv").write_text(",".join(COLUMNS) + "\n")
    (tmp_path / "s" / "sub" / "summary.csv").write_text("x,y,z\n")


@pytest.mark.parametrize(
    ("given", "recursive", "found"),
    [
        (["s"], False, ["s/a.PCD", "s/b.ply"]),
        (["s/"], True, ["s/a.PCD", "s/b.ply", "s/sub/c.xyz", "s/sub/summary.csv"]),
        (["s/*.ply"], False, ["s/b.ply"]),
        (["s/*"], False, ["s/a.PCD", "s/b.ply"]),
        (["s/**/*.xyz"], False, ["s/sub/c.xyz"]),
        (["s/sub/*.dat"], False, ["s/sub/x.dat"]),
        (["s/[ab].*"], False, ["s/a.PCD", "s/b.ply"]),
        (["s/b.ply", "s", "./s/b.ply"], False, ["s/b.ply", "s/a.PCD"]),
        (["s/a.annotated.ply", "gone.ply", "-"], False, ["s/a.annotated.ply", "gone.ply", "-"]),
    ],
)
def test_folders_and_patterns_are_expanded(tree, given, recursive, found):
    assert [Path(name).as_posix() for name in find_scans(given, recursive=recursive)] == found


def test_a_name_that_looks_like_a_pattern_is_a_name(tree, tmp_path):
    (tmp_path / "[ab].ply").touch()
    assert find_scans(["[ab].ply"], recursive=False) == ["[ab].ply"]


def test_a_folder_that_may_not_be_read_is_refused(tree, monkeypatch):
    def refuse(path):
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr("os.scandir", refuse)
    with pytest.raises(InputError, match=r"^s: cannot be read: permission denied; change its permissions"):
        find_scans(["s"], recursive=False)
