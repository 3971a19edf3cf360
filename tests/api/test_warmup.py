"""The first run: two processes share the compiling, and neither is left behind or needed."""

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cylx.api import warmup
from cylx.geometry import kernels
from cylx.records import SilentObserver
from tests.support.patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]


def test_the_end_of_the_method_is_practised_whole(monkeypatch):
    found = []
    assemble = warmup.assemble
    monkeypatch.setattr(warmup, "assemble", lambda *args: found.append(assemble(*args)))
    warmup.practise_the_end()
    # every stage from the game on had something to do
    radii = sorted(fit.cylinder.radius for fit in found[0].cylinders)
    assert np.allclose(radii, 1.0, atol=0.01)
    assert len(radii) == 2
    assert all(fit.covariance is not None for fit in found[0].cylinders)


def test_the_other_process_ends_with_the_practice(monkeypatch):
    started = []
    popen = subprocess.Popen

    def start(command, **options):
        started.append(popen([sys.executable, "-c", "import time; time.sleep(6000)"], **options))
        return started[0]

    monkeypatch.setattr(subprocess, "Popen", start)
    with warmup.second_process():
        assert started[0].poll() is None
    assert started[0].poll() is not None


def test_the_other_process_does_what_it_should():
    process = subprocess.run(
        [sys.executable, "-c", f"from {warmup.__name__} import practise_the_end; practise_the_end()"],
        capture_output=True,
        check=False,
        timeout=PATIENCE,
    )
    assert (process.returncode, process.stdout, process.stderr) == (0, b"", b"")


def test_without_another_process_it_goes_on(monkeypatch):
    def refuse(*_args, **_options):
        raise OSError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    with warmup.second_process():
        pass
    monkeypatch.setattr(sys, "executable", "/opt/blender/blender")
    with warmup.second_process():
        pass


def test_no_kernel_is_compiled_for_a_number_that_a_loop_then_changes():
    """Numba takes a bare 0 for a kind of its own; a count that starts with it would compile its kernels twice."""
    code = """
from numba.core.types import unliteral
from cylx.api.warmup import warm_up
from cylx.geometry.kernels import _kernels
from cylx.records import SilentObserver

warm_up(SilentObserver())
twice = []
for one in _kernels:
    kinds = [tuple(unliteral(kind) for kind in signature) for signature in one.overloads]
    if len(set(kinds)) < len(kinds):
        twice.append(one.py_func.__name__)
assert len(_kernels) > 100
assert not twice, twice
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=False, cwd=ROOT, timeout=PATIENCE, text=True
    )
    assert done.returncode == 0, done.stderr


def test_a_scan_calls_no_practised_kernel_with_arguments_of_another_kind():
    """An array of another layout would be another kernel, compiled when the first scan comes."""
    code = """
import cylx.synthetic
from cylx.api.warmup import warm_up
from cylx.geometry.kernels import _kernels
from cylx.records import SilentObserver

def called():
    return {(one.py_func.__module__, one.py_func.__name__, str(kind)) for one in _kernels for kind in one.overloads}

warm_up(SilentObserver())
before = called()
for cloud in (cylx.read_cloud("sample_data/pipes.ply"), cylx.synthetic.single(points=10000, seed=1).points):
    cylx.extract(cloud)
practised = {kind[:2] for kind in before}  # others are called by these alone, and kept with them
print(sorted(kind for kind in called() - before if kind[:2] in practised))
"""
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=False, timeout=PATIENCE, text=True, cwd=ROOT
    )
    assert (process.returncode, process.stdout) == (0, "[]\n"), process.stderr


@pytest.fixture
def practised(tmp_path, monkeypatch):
    """Warm up one kernel in place of all, each time as a new process would; gives what was done."""
    (tmp_path / "a_kernel.py").write_text(
        "from cylx.geometry.kernels import njit\n\n@njit(cache=True)\ndef kernel(x):\n    return x + 1.0\n"
    )
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(warmup, "kernels_are_cold", lambda: False)

    def run():
        monkeypatch.setattr(kernels, "_known", [])
        monkeypatch.setattr(kernels, "_kernels", [])
        sys.modules.pop("a_kernel", None)
        kernel = importlib.import_module("a_kernel").kernel
        monkeypatch.setattr(warmup, "extract_cylinders", lambda *_, **__: kernel(1.0))
        return warmup.warm_up(SilentObserver())

    yield run
    sys.modules.pop("a_kernel", None)


def test_what_is_compiled_ahead_is_counted_and_not_compiled_again(practised, tmp_path):
    first, second = practised(), practised()
    (file,) = (tmp_path / "kept").rglob("*.nbc")
    assert (first.compiled, first.kept, first.folder) == (1, 1, str(file.parent))
    assert (second.compiled, second.kept, second.folder) == (0, 1, str(file.parent))
    file.write_bytes(b"damaged")
    assert (practised().compiled, practised().compiled) == (1, 0)


def test_what_cannot_be_kept_is_counted_too(practised, monkeypatch):
    def fail(*_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(warmup, "kernels_are_kept", lambda: False)
    monkeypatch.setattr("pathlib.Path.write_bytes", fail)
    done = practised()
    assert (done.compiled, done.kept, done.folder) == (1, 0, None)
