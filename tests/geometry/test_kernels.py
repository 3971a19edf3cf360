"""Compiled kernels are kept where possible; whatever happens to the files, the next run gives the right answer."""

import importlib
import os
import shutil
import subprocess
import sys
import tempfile

import pytest

from cylx.geometry.kernels import njit

SOURCE = """
from cylx.geometry.kernels import damaged_files, folder_of, is_kept, njit, times_compiled

SHIFT = 1.0

@njit(cache=True, nogil=True)
def kernel(x):
    return x + SHIFT
"""


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Import a module with one kernel as a new process would; `kept` are its files."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "some_kernels.py").write_text(SOURCE)

    def load():
        sys.modules.pop("some_kernels", None)
        importlib.invalidate_caches()
        return importlib.import_module("some_kernels")

    yield load
    sys.modules.pop("some_kernels", None)


def kept(folder):
    return sorted((folder / "kept").rglob("*.nbc"))


def foreign(data):
    """Give the file of another kernel, which is whole."""
    import hashlib
    import pickle

    from cylx.geometry.kernels import _MAGIC

    body = pickle.dumps((b"another stamp", "another key", b""))
    return _MAGIC + hashlib.sha256(body).digest() + body


DAMAGES = {
    "empty": lambda data: b"",
    "cut off": lambda data: data[: len(data) // 2],
    "one byte short": lambda data: data[:-1],
    "zeros": lambda data: bytes(len(data)),
    "text": lambda data: b"hello\n",
    "foreign": foreign,
    **{f"bit {place}": lambda data, place=place: flipped(data, place) for place in (0, 5, 20, 60, 300, -9)},
}


def flipped(data, place):
    data = bytearray(data)
    data[place] ^= 4
    return bytes(data)


def test_what_is_kept_is_not_compiled_again(kernels, tmp_path):
    first = kernels()
    assert first.kernel(1.0) == 2.0
    (file,) = kept(tmp_path)
    assert first.is_kept(first.kernel)
    assert str(file.parent) == first.folder_of(first.kernel)
    assert [path.name for path in file.parent.iterdir()] == [file.name]
    second = kernels()
    assert second.kernel(1.0) == 2.0
    assert (first.times_compiled(first.kernel), second.times_compiled(second.kernel)) == (1, 0)


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_file_is_named_and_replaced(kernels, tmp_path, damage):
    kernels().kernel(1.0)
    (file,) = kept(tmp_path)
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    again = kernels()
    assert (file.name in again.damaged_files()) is (damage is not foreign)
    assert again.kernel(1.0) == 2.0
    assert again.times_compiled(again.kernel) == 1
    assert file.name not in again.damaged_files()
    last = kernels()
    assert last.kernel(1.0) == 2.0
    assert last.times_compiled(last.kernel) == 0


@pytest.mark.parametrize("change", ["SHIFT = 1.0", "x + SHIFT"])
def test_another_source_is_another_kernel(kernels, tmp_path, change):
    kernels().kernel(1.0)
    other = {"SHIFT = 1.0": "SHIFT = 5.0", "x + SHIFT": "5.0 * x + SHIFT"}[change]
    source = tmp_path / "some_kernels.py"
    source.write_text(SOURCE.replace(change, other))
    os.utime(source, (2e9, 2e9))  # Python itself tells sources of one length and second apart by nothing else
    assert kernels().kernel(1.0) == 6.0


def test_the_time_of_the_source_does_not_count(kernels, tmp_path):
    """Images and caches are unpacked with other times, or with whole seconds."""
    kernels().kernel(1.0)
    os.utime(tmp_path / "some_kernels.py", (1e9, 1e9))
    later = kernels()
    assert later.kernel(1.0) == 2.0
    assert later.times_compiled(later.kernel) == 0


def test_a_folder_that_fails_costs_no_answer(kernels, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", fail)
    assert kernels().kernel(1.0) == 2.0
    assert kept(tmp_path) == []


@pytest.mark.skipif(os.name == "nt", reason="Windows opens folders in another way")
def test_without_a_folder_nothing_is_kept(kernels, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", fail)
    monkeypatch.setattr("os.makedirs", fail)
    loaded = kernels()
    assert not loaded.is_kept(loaded.kernel)
    monkeypatch.setattr("pathlib.Path.write_bytes", fail)
    assert loaded.kernel(1.0) == 2.0


def test_kept_kernels_are_read_where_nothing_can_be_saved(kernels, tmp_path, monkeypatch):
    """A container whose image was warmed by root, and is run by somebody else."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    kernels().kernel(1.0)

    def fail(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", fail)
    loaded = kernels()
    assert loaded.kernel(1.0) == 2.0
    assert loaded.times_compiled(loaded.kernel) == 0
    shutil.rmtree(tmp_path / "__pycache__")


def test_kernels_of_the_installation_serve_who_may_write_at_home_only(kernels, tmp_path, monkeypatch):
    """A container whose image was warmed by root, run by a user with a home of its own."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    kernels().kernel(1.0)
    monkeypatch.setattr("numba.core.caching.AppDirs.user_cache_dir", str(tmp_path / "home"), raising=False)
    whole, here = tempfile.TemporaryFile, str(tmp_path / "__pycache__")

    def fail_here(*args, dir=None, **options):  # noqa: A002  as tempfile has it
        if dir == here:
            raise PermissionError(13, "Permission denied")
        return whole(*args, dir=dir, **options)

    monkeypatch.setattr("tempfile.TemporaryFile", fail_here)
    loaded = kernels()
    assert loaded.folder_of(loaded.kernel).startswith(str(tmp_path / "home"))
    assert loaded.kernel(1.0) == 2.0
    assert loaded.times_compiled(loaded.kernel) == 0
    assert loaded.kernel(1) == 2.0
    (file,) = (tmp_path / "home").rglob("*.nbc")
    assert str(file.parent) == loaded.folder_of(loaded.kernel)
    shutil.rmtree(tmp_path / "__pycache__")


def test_every_kernel_is_kept():
    with pytest.raises(ValueError, match="every kernel is kept"):
        njit(cache=False)


def test_kernels_are_compiled_though_numba_is_told_not_to(tmp_path):
    code = "import cylx; from cylx.geometry.morton import find_cell; print(find_cell.stats is not None)"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True, env=environment)
    assert done.stdout == "True\n"
