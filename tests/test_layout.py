"""The folders of the tests: each file in one tests a module of cylx, and can be found from the module's name."""

from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
PACKAGE = TESTS.parent / "cylx"
APART = {"benchmarks", "fuzz", "training", "support"}
"""Folders without tests."""
OF_ALL = {"faults"}
"""Folders with tests of the whole program."""
FILES = sorted(
    path.relative_to(TESTS) for path in TESTS.rglob("*.py") if path.parent != TESTS and path.name != "__init__.py"
)


def is_in_its_place(path, package=PACKAGE):
    """Tell whether a test file, relative to the tests, is called after a module of the same folder or after the folder.

    An underscore and more may follow the name: `test_extract_report.py` tests a part of `extract.py`.
    """
    folder = package / path.parent
    words = path.stem.removeprefix("test_").split("_")
    names = ["_".join(words[:n]) for n in range(1, len(words) + 1)]
    room = path.parent.name if (folder / "__init__.py").exists() else None
    return path.name.startswith("test_") and any(name == room or (folder / f"{name}.py").exists() for name in names)


def test_every_test_file_mirrors_a_module():
    strangers = [path.as_posix() for path in FILES if path.parts[0] not in APART | OF_ALL and not is_in_its_place(path)]
    assert strangers == [], "name them after the module they test"


def test_what_is_apart_has_no_tests():
    assert [path.as_posix() for path in FILES if path.parts[0] in APART and path.name.startswith("test_")] == []


def test_every_folder_of_tests_is_a_package():
    """Files of the same name clash otherwise."""
    folders = {TESTS / path.parent for path in FILES if path.parts[0] not in {"benchmarks", "training"}}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == []


@pytest.mark.parametrize(
    ("path", "right"),
    [
        ("cli/test_extract.py", True),
        ("cli/test_extract_report.py", True),
        ("cli/test_cli.py", True),
        ("cli/test_extracting.py", False),
        ("cli/extract.py", False),
        ("cli/test_batch.py", False),  # a folder
        ("gone/test_gone.py", False),
    ],
)
def test_what_counts_as_in_its_place(tmp_path, path, right):
    (tmp_path / "cli" / "batch").mkdir(parents=True)
    for name in ("__init__.py", "extract.py", "batch/__init__.py"):
        (tmp_path / "cli" / name).touch()
    assert is_in_its_place(Path(path), tmp_path) == right
