"""What is at a path, where that can be seen and where it cannot."""

import os

import pytest

from cylx.io.existing import has_anything, has_file, has_folder


def test_files_folders_and_nothing_are_told_apart(tmp_path):
    (tmp_path / "file").write_text("1")
    seen = {
        name: (has_file(tmp_path / name), has_folder(tmp_path / name), has_anything(tmp_path / name))
        for name in ("file", ".", "none", "file/below")
    }
    assert seen == {
        "file": (True, False, True),
        ".": (False, True, True),
        "none": (False, False, False),
        "file/below": (False, False, False),
    }


@pytest.mark.parametrize("path", ["x" * 300, "x/" * 3000, "a\0b", "\ud800"])
def test_a_path_that_nothing_can_have_has_nothing(path):
    assert (has_file(path), has_folder(path), has_anything(path)) == (False, False, False)


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
def test_links_are_followed_and_a_loop_has_nothing(tmp_path):
    for name, target in (("folder", "."), ("loop", "loop"), ("gone", "none")):
        (tmp_path / name).symlink_to(target)
    assert [has_folder(tmp_path / name) for name in ("folder", "loop", "gone")] == [True, False, False]
    assert [has_anything(tmp_path / name) for name in ("folder", "loop", "gone")] == [True, False, False]
