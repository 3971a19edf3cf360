"""Fixtures of the tests: the command line in process and out of it, and a pipeline that answers at once."""

import inspect
import os
import signal
import subprocess
import sys
from pathlib import Path

# otherwise each worker rewrites the assertions of all tests anew, and each process compiles the package; git ignores it
if os.environ.pop("PYTHONDONTWRITEBYTECODE", ""):
    sys.dont_write_bytecode = False

import pytest
from click.testing import CliRunner
from hypothesis import settings

from tests.support.patience import PATIENCE

# the examples are the same in every run; `pytest --hypothesis-profile search` looks for others, and for longer
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("search", max_examples=1000, deadline=None)
settings.load_profile("same")

# a worker for each core, and no more threads: small matrices take twice as long where threads wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# what a shell runs in the background ignores them, and so would all that the tests start; handlers are not inherited
for name, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", lambda *_: None)):
    if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) is signal.SIG_IGN:
        signal.signal(getattr(signal, name), handler)

KERNELS = Path(__file__).resolve().parents[1] / ".pytest_cache" / "kernels"
os.environ["NUMBA_CACHE_DIR"] = str(KERNELS)

import numpy as np  # noqa: E402  reads the number of threads

CIRCLE = np.linspace(0, 2 * np.pi, 24, endpoint=False)
POINTS = np.round(np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE), np.arange(24) % 5]), 6)


def pytest_sessionstart(session):
    """Compile the kernels once where several workers would each compile them."""
    if (getattr(session.config.option, "numprocesses", None) or 0) > 1 and not hasattr(session.config, "workerinput"):
        code = "from cylx.api.warmup import *; compile_kernels(SilentObserver())"
        subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).resolve().parents[1], check=False)


SLOW = ("tests/test_docs_run.py", "tests/tiles/", "tests/cli/test_extract_tiles.py", "tests/faults/test_kills.py")
"""What begins with these goes first, so that no worker is left alone with one of them in the end."""


def pytest_collection_modifyitems(items):
    """Put the slow tests first."""
    items.sort(key=lambda item: not item.nodeid.startswith(SLOW))


def pytest_addoption(parser):
    parser.addoption("--regen", action="store_true", help="Write the golden results anew; read the diff.")


def pytest_xdist_auto_num_workers(config):
    """Give a worker for each core; none where few tests were asked for, which would wait for it, or where files of ours
    are written, which is done one after the other."""
    few = config.args_source is config.ArgsSource.ARGS and len(config.args) < 4
    if few or config.option.keyword or config.option.regen:
        return 0
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


@pytest.fixture(scope="session", autouse=True)
def _kept_readers():
    """Read LAS, E57 and designs in processes that stay, as starting one for each file takes a quarter of a second."""
    if not sys.platform.startswith("linux"):
        yield
        return
    from cylx.io import isolated
    from tests.support.kept_readers import KeptReaders

    readers, fresh = KeptReaders(), (isolated.read_isolated, isolated.ask_isolated)
    isolated.read_isolated, isolated.ask_isolated = readers.read_isolated, readers.ask_isolated
    yield
    isolated.read_isolated, isolated.ask_isolated = fresh
    readers.close()


@pytest.fixture(scope="session")
def kept_extractions(tmp_path_factory):
    """A folder for what extractions gave, the same for all workers of this run."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "extractions"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def extract_file(kept_extractions):
    """Extract a file by default settings, once for all tests that want its cylinders."""
    from cylx.config import Config
    from cylx.io import read_cloud
    from cylx.pipeline import extract_cylinders
    from cylx.records import SilentObserver
    from tests.support.warm import remembered

    extract_once = remembered(extract_cylinders, kept_extractions)
    return lambda path: extract_once(read_cloud(path), Config(), observer=SilentObserver())


@pytest.fixture
def remembering(kept_extractions, monkeypatch):
    """Let the same points be extracted once by the same settings, for tests about what is done with the cylinders."""
    import cylx.api
    import cylx.pipeline
    from tests.support.warm import remembered

    extract_once = remembered(cylx.pipeline.extract_cylinders, kept_extractions)
    monkeypatch.setattr(cylx.pipeline, "extract_cylinders", extract_once)
    monkeypatch.setattr(cylx.api, "extract_cylinders", extract_once)


@pytest.fixture
def run_cylx():
    """Run the command line in this process: `run_cylx("info", path)` gives exit_code, stdout and stderr."""
    from cylx.cli import main

    separate = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}

    def run(*args, **settings):
        return CliRunner(**separate).invoke(main, [str(arg) for arg in args], prog_name="cylx", **settings)

    return run


@pytest.fixture
def spawn_cylx():
    """Run the command line in a process of its own; `prelude` is Python run there before it."""

    def spawn(*args, prelude="", **settings):
        code = f"{prelude}\nfrom cylx.cli import main\nmain(prog_name='cylx')"
        command = [sys.executable, "-c", code, *(str(arg) for arg in args)]
        return subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE, **settings)

    return spawn


@pytest.fixture
def scan(tmp_path):
    """A small scan that can be read."""
    path = tmp_path / "scan.xyz"
    np.savetxt(path, POINTS, fmt="%.6f")
    return path


@pytest.fixture
def make_extraction():
    """Make an extraction of a cloud by hand: cylinders of radius 1, 2, … on the z axis, all points on the first."""
    from cylx.config import Config
    from cylx.geometry.cylinder import Cylinder
    from cylx.records import CylinderFit, Extraction, PointCloud, RejectedFit, Scene, StageReport

    def make(cloud=None, config=None, *, cylinders=2, rejected=1, blends=None):
        cloud = PointCloud(POINTS) if cloud is None else cloud
        shapes = [Cylinder((0, 0, 2), (0, 0, 1), i + 1.0, 4.0) for i in range(cylinders)]
        fits = [
            CylinderFit(shape, max(24 - i, 1), 0.25, 2 * np.pi, 3, 0.5, evidence={"slope": 0.125})
            for i, shape in enumerate(shapes)
        ]
        refused = CylinderFit(Cylinder((1, 0, 0), (0, 1, 0), 0.5, 1.0), 7, 0.125, np.pi, 3, 0.5)
        arcs = [Cylinder((3 + 2 * i, 0, 2), (0, 0, 1), 0.5, 4.0) for i in range(blends or 0)]
        return Extraction(
            cylinders=tuple(fits),
            labels=np.full(len(cloud.points), 0 if fits else -1, np.int32),
            residuals=np.full(len(cloud.points), 0.0 if fits else np.nan, np.float32),
            cloud=cloud,
            scene=Scene(spacing=0.25, noise=0.0, extent=5.0),
            stages=(StageReport("slicing", 40, 38, {"too few points": 2}),),
            config=config or Config(),
            warnings=("made by hand",),
            rejected=(RejectedFit(refused, "agreement"),) * rejected,
            blends=None if blends is None else tuple(CylinderFit(arc, 5, 0.25, np.pi / 2, 3, 0.5) for arc in arcs),
        )

    return make


@pytest.fixture
def fake_pipeline(monkeypatch, make_extraction):
    """Put a pipeline in place that answers at once; `calls` has what it was asked, `found` and `blends` its answer."""

    class FakePipeline:
        def __init__(self):
            self.calls, self.found, self.blends = [], 2, None

        def __call__(self, cloud, config, *, threads=None, observer=None):
            self.calls.append((cloud, config, threads))
            observer.stage_started("slicing", 2)
            observer.stage_advanced(2)
            observer.stage_finished("slicing", 0.5)
            if isinstance(self.found, BaseException):
                raise self.found
            return make_extraction(cloud, config, cylinders=self.found, blends=self.blends)

    fake = FakePipeline()
    monkeypatch.setattr("cylx.api.warmup.kernels_are_cold", lambda: False)  # there is nothing to practise
    monkeypatch.setattr("cylx.pipeline.extract_cylinders", fake)
    return fake
