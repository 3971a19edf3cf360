"""The first run: two processes share the compiling, and neither is left behind or needed."""

import subprocess
import sys

import numpy as np

from cylx.api import warmup
from tests.support.patience import PATIENCE


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
