"""Kill runs at random moments, and start two at once: no half file, no leftover, and the same bytes in the end.

Run it from the root of the project: `python -m tests.faults.kills --kills 200 --pairs 20`. It prints a table, and its
exit code is 1 if anything was wrong. `--ways tiles --kills 50` kills runs in tiles alone, or one of their processes,
which has to be replaced without anybody's doing.
"""

import argparse
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from cylx import synthetic
from cylx.io import write_cloud
from tests.support.patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
SIGNALS = ("SIGKILL", "SIGTERM", "SIGHUP", "SIGINT")
WORKER = "a worker"
"""Kill a process that works for the run instead of the run."""
SINGLE = ["scans/0.ply", "-o", "{out}/", "--report", "{out}/", "--rejected", "{out}/"]
BATCH = ["scans", "--out-dir", "{out}"]
WAYS = {
    "single": SINGLE,
    "batch": BATCH,
    "batch --jobs 2": [*BATCH, "--jobs", "2"],
    "tiles": [*SINGLE, "--tile", "{tile}", "--jobs", "2"],
}
EVERY = 20
"""Kills after which the faults so far are counted."""
QUIET_END = {WORKER: 0, "SIGKILL": -9, "SIGTERM": -15, "SIGHUP": -1, "SIGINT": 130}


class Bench:
    """A folder with scans, and what comes out of them."""

    def __init__(self, folder, ways=tuple(WAYS), *, scans=3, points=1500):
        self.folder = folder
        (folder / "scans").mkdir()
        for seed in range(scans):
            cloud = synthetic.single(points=points, seed=seed).points
            write_cloud(folder / "scans" / f"{seed}.ply", cloud)
            if seed == 0:
                self.tile = f"{0.45 * float(np.ptp(cloud, axis=0).max()):.3g}"
        self.whole, self.seconds = {}, {}
        self.run(ways[0], "warm")
        for way in ways:
            started = time.monotonic()
            assert self.run(way, f"whole {way}").returncode == 0
            self.seconds[way] = time.monotonic() - started
            self.whole[way] = contents(folder / f"whole {way}")

    def command(self, way, out, *options):
        heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"  # a shell may have it ignored
        code = f"{heard}; from cylx.__main__ import run; run()"
        return [
            sys.executable,
            "-c",
            code,
            "extract",
            "-q",
            *(part.format(out=out, tile=self.tile) for part in WAYS[way]),
            *options,
        ]

    def start(self, way, out, *options):
        """Start a run in its own group of processes."""
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        return subprocess.Popen(
            self.command(way, out, *options),
            cwd=self.folder,
            stderr=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": path},
        )

    def run(self, way, out, *options):
        process = self.start(way, out, *options)
        _, said = process.communicate(timeout=PATIENCE)
        process.said = said.decode()
        return process

    def kill_one(self, name, way, after, out):
        """Kill a run, look at what is left, and let another one finish it; give what was wrong."""
        process = self.start(way, out)
        time.sleep(after)
        if name != WORKER:
            os.killpg(process.pid, getattr(signal, name))
        elif workers := below(process.pid):
            with contextlib.suppress(ProcessLookupError):  # it is done
                os.kill(workers[-1], signal.SIGKILL)
        _, said = process.communicate(timeout=PATIENCE)
        wrong = self.faults_of_killed(name, way, out, process.returncode, said.decode())
        resumed = self.run(way, out, "--resume")
        if resumed.returncode != 0 or contents(self.folder / out) != self.whole[way]:
            wrong.append(f"not the same bytes in the end: {resumed.returncode} {resumed.said[:200]}")
        if hidden(self.folder / out):
            wrong.append("something is left for good")
        return wrong

    def faults_of_killed(self, name, way, out, code, said):
        wrong = []
        if code not in (0, QUIET_END[name]):
            wrong.append(f"exit code {code}: {said[:200]}")
        if "Traceback" in said or "bug of" in said:
            wrong.append(said[:300])
        left = contents(self.folder / out)
        if name != "SIGKILL" and hidden(self.folder / out):
            wrong.append("a temporary file is left")
        if not {key: left[key] for key in left if key[0] != "."}.items() <= self.whole[way].items():
            wrong.append("a half or foreign file is left")
        return wrong

    def pair(self, out):
        """Start two runs on one output; exactly one may succeed."""
        (self.folder / out).mkdir()
        both = [self.start("single", out) for _ in range(2)]
        said = [process.communicate(timeout=PATIENCE)[1].decode() for process in both]
        codes = sorted(process.returncode for process in both)
        whole = contents(self.folder / out) == self.whole["single"]
        return [] if codes == [0, 4] and whole else [f"exit codes {codes}, whole: {whole}: {said}"]


def contents(folder):
    """Give the files of a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} if folder.is_dir() else {}


def hidden(folder):
    """Give the temporary files and folders in a folder."""
    return [path.name for path in folder.iterdir() if path.name.startswith(".")] if folder.is_dir() else []


def below(process):
    """Give the processes that a process has started, on Linux."""
    try:
        return [int(one) for one in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


def torture(kills, pairs, seed, show=print, ways=tuple(WAYS), **scans):
    """Kill so many runs, and start so many pairs; give the faults. `scans` are the settings of the bench."""
    rng, faults, counts = random.Random(seed), [], Counter()
    with tempfile.TemporaryDirectory(prefix="cylx-kills-") as place:
        bench = Bench(Path(place), tuple(dict.fromkeys([*ways, *(["single"] if pairs else [])])), **scans)
        for index in range(kills):
            way = ways[index % len(ways)]
            names = (*SIGNALS[1:], SIGNALS[0], WORKER) if way == "tiles" else SIGNALS
            name = names[(index % len(ways) + index // len(ways)) % len(names)]
            after = bench.seconds[way] * rng.uniform(0.15, 1.05)
            wrong = bench.kill_one(name, way, after, f"out{index}")
            counts[way, name, bool(wrong)] += 1
            faults += [f"kill {index}: {way}, {name} after {after:.2f} s: {what}" for what in wrong]
            if (index + 1) % EVERY == 0:
                show(f"{index + 1} kills, {len(faults)} faults")
        for index in range(pairs):
            faults += [f"pair {index}: {what}" for what in bench.pair(f"pair{index}")]
    for (way, name, bad), count in sorted(counts.items()):
        show(f"{way:16} {name:8} {count:4} {'with faults' if bad else 'well'}")
    show(f"{pairs} pairs; {len(faults)} faults")
    return faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    asked = parser.parse_args()
    faults = torture(asked.kills, asked.pairs, asked.seed, ways=tuple(asked.ways))
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
