"""Odd surroundings: closed and full streams, encodings, folders that are gone, limits, and signals."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cylx.cli.terminal import signals
from cylx.cli.terminal.signals import Ended, check_heard, hear, heard
from cylx.io import write_cloud
from cylx.synthetic import single
from tests.support.patience import PATIENCE

pytestmark = pytest.mark.skipif(os.name == "nt", reason="of Unix")
CYLX = f"{sys.executable} -m cylx"
SHORT_OF_FILES = "cp s.xyz t.xyz; ulimit -n 10;"
FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device here")  # noqa: PTH110


@pytest.fixture
def shell(tmp_path):
    """Run a line of a shell in a folder with a scan, `$cylx` being the command."""
    np.savetxt(tmp_path / "s.xyz", np.random.default_rng(0).random((50, 3)), fmt="%.4f")

    def run(line, **environment):
        root = os.path.dirname(os.path.dirname(os.path.abspath(__import__("cylx").__file__)))  # noqa: PTH100, PTH120
        env = {**os.environ, "PYTHONPATH": root, "cylx": CYLX, **environment}
        return subprocess.run(
            ["sh", "-c", line], cwd=tmp_path, env=env, capture_output=True, check=False, timeout=PATIENCE
        )

    return run


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("$cylx config show >o 2>&-", 0, ""),
        ("$cylx info nosuch.xyz 2>&-", 3, ""),
        ("$cylx info s.xyz >&-", 4, "standard output: is closed"),
        pytest.param("$cylx info --json s.xyz >/dev/full", 4, "standard output: cannot be written", marks=FULL),
        pytest.param("$cylx info nosuch.xyz 2>/dev/full", 3, "", marks=FULL),
        ("NUMBA_NUM_THREADS=0 $cylx info s.xyz", 0, ""),
        ("NUMBA_NUM_THREADS=many $cylx info s.xyz", 0, ""),
        ("mkdir d; cd d; rmdir ../d; $cylx info s.xyz", 3, "s.xyz: no such file"),
        ("mkdir d; cd d; rmdir ../d; $cylx synth single a.ply", 3, "the working folder has been removed"),
        (
            "cp s.xyz t.xyz; ulimit -n 10; $cylx extract s.xyz t.xyz -q --jobs 2 --out-dir o",
            2,
            "--jobs: no process can be started",
        ),
    ],
)
def test_it_works_or_is_one_line(shell, line, code, said):
    done = shell(line)
    assert done.returncode == code, done.stderr
    assert said in done.stderr.decode()
    assert done.stderr.count(b"\n") <= 1


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-16"])
def test_json_is_utf8_whatever_the_terminal_is(shell, encoding):
    names = shell("cp s.xyz ü😀.xyz; $cylx config check --json ü😀.xyz", PYTHONIOENCODING=encoding, LC_ALL="C.UTF-8")
    assert json.loads(names.stdout.decode("utf-8"))["file"] == "ü😀.xyz"


def test_modules_in_the_folder_of_the_scans_are_not_run(tmp_path):
    (tmp_path / "scans").mkdir()
    for seed in range(2):
        write_cloud(tmp_path / "scans" / f"{seed}.ply", single(points=300, seed=seed).points)
    for name in ("multiprocessing", "random", "json", "pickle", "numpy", "numba", "cylx"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'a').write(__name__)\n", encoding="utf-8")
    script = tmp_path / "bin" / "cylx"  # as pip writes it: the first place that is searched is its own folder
    script.parent.mkdir()
    run = "import sys\nif __name__ == '__main__':\n    from cylx.__main__ import run\n    run()\n"
    script.write_text(run, encoding="utf-8")
    command = [sys.executable, str(script), "extract", "scans", "--jobs", "2", "-q", "--out-dir", "out"]
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert not (tmp_path / "ran").exists()


def test_a_backend_of_a_notebook_is_no_obstacle():
    pytest.importorskip("matplotlib", reason="needs cylx[plots]")
    code = "from cylx.optional.matplotlib import new_figure; new_figure((1, 1), 50); print('drawn')"
    environment = {**os.environ, "MPLBACKEND": "module://ipympl.backend_nbagg"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True, env=environment)
    assert done.stdout == "drawn\n"


def test_what_libraries_print_stays_off_the_answer_and_quiet_is_quiet(shell, tmp_path):
    (tmp_path / "loud.py").write_text(
        "import os, sys, warnings\n"
        "from cylx.cli.terminal.streams import keep_libraries_apart, occupy_closed_streams\n"
        "occupy_closed_streams(); keep_libraries_apart(quiet=sys.argv[1] == 'quiet')\n"
        "os.write(1, b'noise '); os.write(2, b'noise '); warnings.warn('noise')\n"
        "print('answer'); print('error', file=sys.stderr)\n"
    )
    for mode, noise in (("quiet", False), ("loud", True)):
        done = shell(f"{sys.executable} loud.py {mode}")
        assert done.stdout == b"answer\n"
        assert done.stderr.endswith(b"error\n")
        assert (b"noise" in done.stderr) is noise


@pytest.fixture
def nothing_heard():
    yield
    signals._heard.clear()


@pytest.mark.usefixtures("nothing_heard")
@pytest.mark.parametrize(("name", "raised"), [("SIGINT", KeyboardInterrupt), ("SIGTERM", Ended), ("SIGHUP", Ended)])
def test_what_a_callback_swallows_is_heard_later(name, raised):
    check_heard()
    assert heard() is None
    with pytest.raises(raised):
        hear(getattr(signal, name), None)  # as in a callback, where nobody hears it
    with pytest.raises(raised):
        check_heard()
    assert isinstance(heard(), raised)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_ends_it_by_itself_after_tidying_up(shell, tmp_path, name):
    (tmp_path / "slow.py").write_text(
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from cylx.cli.terminal.startup import own_process\n"
        "from cylx.io.outputs import open_output\n"
        "with own_process(), open_output('out.bin', overwrite=False) as file:\n"
        f"    file.write(b'half'); os.kill(os.getpid(), signal.{name}); file.write(b'whole')\n"
    )
    done = shell(f"exec {sys.executable} slow.py")
    assert done.returncode == -getattr(signal, name), done.stderr
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != "__pycache__") == ["s.xyz", "slow.py"]


def test_the_line_about_a_bug_names_the_input(run_cylx, scan, tmp_path, fake_pipeline):
    shutil.copy(scan, tmp_path / "b.xyz")
    fake_pipeline.found = ZeroDivisionError("oh")
    single = run_cylx("extract", scan, "-q")
    assert single.exit_code == 1
    assert single.stderr.startswith("cylx: this is a bug of cylx: ZeroDivisionError: oh; ")
    assert single.stderr.endswith(f"; the input was {scan}\n")
    many = run_cylx("extract", scan, tmp_path / "b.xyz", "-q").stderr.splitlines()
    assert [line.rpartition(" ")[2] for line in many[:2]] == [str(scan), str(tmp_path / "b.xyz")]
