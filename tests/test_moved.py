"""Modules of earlier versions: their old names lead to the new ones, with a warning."""

import re
import sys
from importlib import import_module
from pathlib import Path

import pytest

from cylx.geometry.cylinder import axis_basis, axis_frame
from cylx.moved import MOVED, follow_old_names

CHANGES = (Path(__file__).resolve().parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def forget():
    yield
    for old in MOVED:
        sys.modules.pop(old, None)


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_an_old_name_leads_to_the_new_module_and_warns(old, new):
    with pytest.warns(DeprecationWarning, match=re.escape(f"{old} is {new} now")):
        module = import_module(old)
    home = import_module(new)
    for name in (name for name in vars(home) if not name.startswith("__")):
        assert getattr(module, name) is getattr(home, name)
    assert old.rpartition(".")[2] in CHANGES


def test_what_was_never_there_is_not_found():
    with pytest.raises(ModuleNotFoundError, match=r"cylx\.nothing"):
        import_module("cylx.nothing")


def test_old_names_are_followed_once():
    before = list(sys.meta_path)
    follow_old_names()
    assert sys.meta_path == before


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("cylx", "Rejection", "RejectedFit"),
        ("cylx.records", "Rejection", "RejectedFit"),
    ],
)
def test_an_old_name_of_a_class_leads_to_the_new_one_and_warns(module, old, new):
    home = import_module(module)
    with pytest.warns(DeprecationWarning, match=f"{old} is {new} now"):
        assert getattr(home, old) is getattr(home, new)
    assert f"`{old}`" in CHANGES


def test_the_old_name_of_the_basis_about_an_axis_warns():
    with pytest.warns(DeprecationWarning, match="axis_frame is axis_basis now"):
        first, second = axis_frame((0.0, 0.0, 1.0))
    assert (first == axis_basis((0.0, 0.0, 1.0))[0]).all()
    assert (second == axis_basis((0.0, 0.0, 1.0))[1]).all()
    assert "`axis_frame`" in CHANGES
