"""Damage one file of the kernels' cache in many ways: the next run succeeds, with the same bytes, and replaces it.

Run it from the root of the project: `python -m tests.faults.kernel_files`. It prints a table, and its exit code is 1 if
anything was wrong. The first run compiles all kernels, unless `NUMBA_CACHE_DIR` names a folder that has them: a copy of
it is damaged.
"""

import argparse
import hashlib
import os
import pickle
import random
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

from cylx import synthetic
from cylx.geometry.kernels import _MAGIC, SUFFIX
from cylx.io import write_cloud
from tests.support.patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
DIGEST = len(_MAGIC) + 32
"""Where the body of a file begins."""


def with_body(body):
    """Return a file with a body and its digest."""
    return _MAGIC + hashlib.sha256(body).digest() + body


def flip(data, place):
    data = bytearray(data)
    data[place % len(data)] ^= 4
    return bytes(data)


def blank(data, start, size):
    start = int(start * len(data))
    return data[:start] + bytes(len(data[start : start + size])) + data[start + size :]


def other_key(data):
    stamp, key, rest = pickle.loads(data[DIGEST:])
    return with_body(pickle.dumps((stamp, key + " ", rest)))


def other_stamp(data):
    stamp, key, rest = pickle.loads(data[DIGEST:])
    return with_body(pickle.dumps((flip(stamp, 0), key, rest)))


def other_code(data):
    stamp, key, _ = pickle.loads(data[DIGEST:])
    return with_body(pickle.dumps((stamp, key, pickle.dumps(("no", "code")))))


CHANGES = {
    **{f"bit at {place}": partial(flip, place=place) for place in (0, 7, 14, 30, 45, 46, 47, 60, 300, 5000, -300, -1)},
    **{f"cut after {size}": lambda data, size=size: data[:size] for size in (0, 1, len(_MAGIC), 30, DIGEST, 1000)},
    "cut in half": lambda data: data[: len(data) // 2],
    "one byte short": lambda data: data[:-1],
    "one byte more": lambda data: data + b"\0",
    "twice": lambda data: data * 2,
    "first byte lost": lambda data: data[1:],
    "zeros": lambda data: bytes(len(data)),
    "first page of zeros": partial(blank, start=0, size=4096),
    "a page of zeros in the middle": partial(blank, start=0.5, size=4096),
    "last half of zeros": partial(blank, start=0.5, size=1 << 40),
    "noise": lambda data: random.Random(0).randbytes(len(data)),
    "text": lambda data: b"hello\n",
    "lines of Windows": lambda data: data.replace(b"\n", b"\r\n"),
    "whole, of noise": lambda data: with_body(random.Random(0).randbytes(1000)),
    "whole, of nothing": lambda data: with_body(b""),
    "whole, of another shape": lambda data: with_body(pickle.dumps(["stamp"])),
    "whole, of another key": other_key,
    "whole, of another stamp": other_stamp,
    "whole, without code": other_code,
}
"""What becomes of the bytes of a file."""


def changed(path, change):
    path.write_bytes(change(path.read_bytes()))


def as_folder(path):
    path.unlink()
    path.mkdir()


def as_link(path, target):
    path.unlink()
    path.symlink_to(target)


def swapped(path):
    """Put the file of another kernel in its place."""
    path.write_bytes(next(other for other in sorted(path.parent.glob(f"*{SUFFIX}")) if other != path).read_bytes())


def littered(path):
    """Leave what a killed run and Numba itself would leave."""
    path.with_name(f"{path.name}.tmp.1").write_bytes(b"half")
    path.with_name(path.name.partition(".")[0] + ".nbi").write_bytes(b"no index")
    path.unlink()


DAMAGES = {
    **{name: partial(changed, change=change) for name, change in CHANGES.items()},
    "gone": Path.unlink,
    "of another kernel": swapped,
    "a folder": as_folder,
    "a link to nothing": partial(as_link, target="nothing"),
    "a link to itself": lambda path: as_link(path, path.name),
    "read-only and empty": lambda path: (path.write_bytes(b""), path.chmod(0o400)),
    "leftovers of a killed run": littered,
}
"""What becomes of a file, by its path."""
NOT_REPLACED = {"a folder"}
"""What a run does without, and leaves as it is."""
LISTING = """
import sys
from cylx.geometry import kernels
content = kernels._content
def listed(path, expected):
    found = content(path, expected)
    if found is not None:
        with open("used", "a") as file:
            print(path, file=file)
    return found
kernels._content = listed
from cylx.__main__ import run
run()
"""
"""Python that notes which files a run reads: what a kernel calls is a part of its own file."""


class Cache:
    """A folder with a scan and the kernels that its extraction needs."""

    def __init__(self, folder):
        self.folder, self.kernels = folder, folder / "kernels"
        write_cloud(folder / "scan.ply", synthetic.single(points=600).points)
        known = os.environ.get("NUMBA_CACHE_DIR")
        if known and Path(known).is_dir():
            shutil.copytree(known, self.kernels)
        self.right = self.run()
        assert self.run("-c", LISTING) == self.right == (0, "", self.right[2])
        self.used = sorted(map(Path, set((folder / "used").read_text(encoding="utf-8").splitlines())))

    def run(self, *program):
        """Extract the scan; return exit code, what was said, and the bytes of the result."""
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        command = [sys.executable, *(program or ("-m", "cylx")), "extract", "scan.ply", "-q", "--no-annotate"]
        env = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(self.kernels)}
        done = subprocess.run(command, cwd=self.folder, env=env, capture_output=True, check=False, timeout=PATIENCE)
        result = self.folder / "scan.cylinders.json"
        data = result.read_bytes() if result.is_file() else b""
        result.unlink(missing_ok=True)
        return done.returncode, done.stderr.decode(), data

    def faults_of(self, name, path):
        """Damage a file, and run; return what was wrong."""
        DAMAGES[name](path)
        code, said, data = self.run()
        faults = [f"exit code {code}"] * (code != 0) + [f"said {said[:200]!r}"] * bool(said)
        faults += ["other bytes"] * (data != self.right[2])
        if name not in NOT_REPLACED and not is_whole(path):
            faults.append("the file is not replaced")
        return faults


def is_whole(path):
    """Return whether a file has the digest that it says."""
    data = path.read_bytes() if path.is_file() else b""
    return data[:DIGEST] == with_body(data[DIGEST:])[:DIGEST]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="of the choice of files")
    rng, wrong = random.Random(parser.parse_args().seed), 0
    with tempfile.TemporaryDirectory(prefix="cylx-kernels-") as place:
        cache = Cache(Path(place))
        print(f"{'damage':32} {'kernel':40} outcome", flush=True)
        for name in DAMAGES:
            path = rng.choice(cache.used)
            whole = path.read_bytes()
            faults = cache.faults_of(name, path)
            wrong += bool(faults)
            print(f"{name:32} {path.name[:40]:40} {', '.join(faults) or 'well'}", flush=True)
            if path.is_dir():
                path.rmdir()
            path.unlink(missing_ok=True)
            path.write_bytes(whole)
    print(f"{len(DAMAGES)} kinds of damage, {wrong} with faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
