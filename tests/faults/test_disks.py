"""Every write, rename and opening of an output fails once: nothing is half, nothing is left, and the line is right.

The JSON is there whatever happens to the files beside it.
"""

import errno
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("trimesh", reason="needs cylx[mesh]")

OUTPUTS = ("s.cylinders.json", "s.annotated.ply", "s.rejected.json", "s.report.html", "s.cylinders.obj")
OPTIONS = ("--rejected", "{out}", "--report", "{out}", "--mesh", "{out}")
REASONS = (errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EROFS)


class Fault:
    """Counts calls about files in a folder, and lets one of them fail."""

    def __init__(self, folder, number):
        self.folder, self.number, self.left, self.fired = str(folder), number, -1, False

    def __call__(self, path):
        if not str(path).startswith(self.folder) or self.left < 0:
            return
        if self.left == 0:
            self.fired, self.left = True, -1
            raise OSError(self.number, os.strerror(self.number), str(path))
        self.left -= 1


class Failing(io.BufferedWriter):
    """A file whose writes are counted."""

    fault = None

    def write(self, data):
        self.fault(Path(f"/proc/self/fd/{self.fileno()}").readlink())
        return super().write(data)


def watched(monkeypatch, fault, what):
    """Let one kind of calls ask the fault first."""
    if what == "open":
        opened = Path.open

        def open_(path, mode="r", *args, **kwargs):
            if "w" in mode or "x" in mode:
                fault(path)
            return opened(path, mode, *args, **kwargs)

        monkeypatch.setattr(Path, "open", open_)
    elif what == "write":
        opened = Path.open

        def open_written(path, mode="r", *args, **kwargs):
            if "b" not in mode or not set(mode) & {"w", "x"}:
                return opened(path, mode, *args, **kwargs)
            file = Failing(io.FileIO(path, mode.replace("b", "")))
            file.fault = fault
            return file

        monkeypatch.setattr(Path, "open", open_written)
    elif what == "flush":
        monkeypatch.setattr(os, "fsync", lambda file: fault(Path(f"/proc/self/fd/{file}").readlink()))
    else:
        renamed, linked = Path.replace, os.link
        monkeypatch.setattr(Path, "replace", lambda path, to: (fault(to), renamed(path, to))[1])
        monkeypatch.setattr(os, "link", lambda path, to, **how: (fault(to), linked(path, to, **how))[1])


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def put(folder, files):
    for path in folder.iterdir():
        path.unlink()
    for name, data in files.items():
        (folder / name).write_bytes(data)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="the system does not tell the names of open files")
@pytest.mark.parametrize("overwrite", [False, True], ids=["new", "overwrite"])
@pytest.mark.parametrize("what", ["open", "write", "flush", "rename"])
def test_a_disk_that_fails_once(run_cylx, scan, tmp_path, monkeypatch, fake_pipeline, what, overwrite):
    out, whole = tmp_path / "out", tmp_path / "whole"
    out.mkdir()
    old = {name: f"old {name}".encode() for name in OUTPUTS} if overwrite else {}
    scan = scan.rename(tmp_path / "s.xyz")
    command = ["extract", scan, "-q", "-o", f"{out}/", *(part.format(out=f"{out}/") for part in OPTIONS)]
    command += ["--overwrite"] * overwrite
    assert run_cylx(*(str(part).replace(str(out), str(whole)) for part in command)).exit_code == 0
    fault = Fault(out, 0)
    watched(monkeypatch, fault, what)
    right, outcomes = contents(whole), set()
    for place in range(200):
        put(out, old)
        fault.left, fault.fired, fault.number = place, False, REASONS[place % len(REASONS)]
        done = run_cylx(*command)
        if not fault.fired:
            break
        if done.exit_code == 0:  # what was there before could not be kept for a while, and need not be
            continue
        assert done.exit_code == 4, done.stderr
        (line,) = done.stderr.splitlines()
        (name,) = (name for name in OUTPUTS if f"{name}: cannot be written: " in line)
        assert ".cylx-" not in line
        outcomes.add(name)
        assert contents(out) == (old if name == OUTPUTS[0] else {key: right[key] for key in right if key != name})
    assert done.exit_code == 0, done.stderr
    assert outcomes == set(OUTPUTS)
    assert contents(out) == right


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such limit")
def test_a_limit_on_the_size_of_files(tmp_path):
    """A real limit of the system, which the copy of the input meets as well."""
    scan = tmp_path / "s.xyz"
    scan.write_text("".join(f"{i % 17} {i % 13} {i % 7}\n" for i in range(9000)))
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (9000, 9000));"
        "from cylx.io import read_cloud, write_cloud; import sys; cloud = read_cloud(sys.argv[1]);"
        "print(len(cloud.points)); write_cloud(sys.argv[1] + '.ply', cloud.points)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(scan)], capture_output=True, check=False, text=True)
    assert done.stdout.strip() == "9000"
    assert done.stderr.splitlines()[-1].endswith("s.xyz.ply: cannot be written: file too large; choose another path")
    assert [path.name for path in tmp_path.iterdir()] == ["s.xyz"]
