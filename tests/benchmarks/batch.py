"""Many small scans, some of them broken: what is done, what is said to have failed, and whether stopping matters.

The scans are made here. They are extracted in one go; then again, killed when half the results are there, and resumed.
"""

import argparse
import collections
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from runs import CYLX, warm_up
from tables import number, print_header, print_row

from cylx import synthetic
from cylx.io import write_cloud

POINTS = 1500
BROKEN = [  # suffix, and what is done to the bytes of a sound file
    (".ply", lambda sound: b""),
    (".ply", lambda sound: sound[: len(sound) // 2]),
    (".ply", lambda sound: sound.replace(b"element vertex", b"element vortex")),
    (".pcd", lambda sound: b"VERSION 0.7\nFIELDS x y z\n"),
    (".xyz", lambda sound: b"0 0 0\n" * 20),
]


def make_scans(folder, count, broken):
    """Write the scans, the broken ones evenly among them; return the names of those."""
    step, spoilt = max(count // max(broken, 1), 1), []
    for i in range(count):
        path = folder / f"scan{i:04}.ply"
        write_cloud(path, synthetic.single(points=POINTS, sigma=0.01, theta_deg=120 + i % 240, seed=i).points)
        if i % step == step // 2 and len(spoilt) < broken:
            suffix, spoil = BROKEN[len(spoilt) % len(BROKEN)]
            content = path.read_bytes()
            path.unlink()
            path = path.with_suffix(suffix)
            path.write_bytes(spoil(content))
            spoilt.append(path.name)
    return spoilt


def start(folder, out, jobs, *options):
    """Start a batch."""
    command = [*CYLX, "extract", "scans", "--out-dir", out, "--jobs", str(jobs), *options]
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)


def finish(process):
    """Wait for the end of a batch; return its exit code, and the lines about what failed."""
    _, said = process.communicate()
    lines = [line for line in said.splitlines() if line.startswith("cylx: ")]
    return process.returncode, lines[:-1]


def results(folder):
    """Name the results in a folder."""
    return sorted(path.name for path in folder.glob("*.cylinders.json"))


def same_bytes(one, other):
    """Tell whether two folders hold the same files with the same bytes, hidden ones too."""
    contents = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in (one, other)]
    return contents[0] == contents[1]


def main():
    """Print a row a run, and whether all holds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=200, metavar="N", help="how many (default: 200)")
    parser.add_argument("--broken", type=int, default=10, metavar="N", help="of which broken (default: 10)")
    parser.add_argument("--jobs", default="2", metavar="N", help="as of cylx extract (default: 2)")
    a = parser.parse_args()
    faults = []

    def demand(holds, fault):
        if not holds:
            faults.append(fault)

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        warm_up(folder)
        (folder / "scans").mkdir()
        spoilt = make_scans(folder / "scans", a.scans, a.broken)
        print_header("run", "scans", "results", "reasons", "exit code", "seconds")

        def report(run, began, code, reasons, out):
            seconds = number(time.perf_counter() - began)
            print_row(run, a.scans, len(results(folder / out)), len(reasons), "killed" if code < 0 else code, seconds)

        began = time.perf_counter()
        code, reasons = finish(start(folder, "whole", a.jobs))
        report("in one go", began, code, reasons, "whole")
        demand(code == (6 if spoilt else 0), f"exit code {code}")
        demand(len(results(folder / "whole")) == a.scans - len(spoilt), "not all results are there")
        told = collections.Counter(file for file in spoilt for line in reasons if f"/{file}" in line)
        demand(
            all(told[file] == 1 for file in spoilt) and len(reasons) == len(spoilt), "not every failure has its line"
        )

        began = time.perf_counter()
        process = start(folder, "parts", a.jobs)
        while process.poll() is None and len(results(folder / "parts")) < (a.scans - len(spoilt)) // 2:
            time.sleep(0.01)
        os.kill(process.pid, signal.SIGKILL)
        code, reasons = finish(process)
        report("killed half way", began, code, reasons, "parts")
        demand(len(results(folder / "parts")) < a.scans - len(spoilt), "it was done before it was killed")

        began = time.perf_counter()
        code, reasons = finish(start(folder, "parts", a.jobs, "--resume"))
        report("resumed", began, code, reasons, "parts")
        demand(code == (6 if spoilt else 0), f"exit code {code} when resumed")
        demand(same_bytes(folder / "whole", folder / "parts"), "the bytes are not those of one go")
        files = json.loads((folder / "parts" / "summary.json").read_text(encoding="utf-8"))["files"]
        failed = [Path(entry["file"]).name for entry in files if entry["status"] == "failed"]
        demand(sorted(failed) == sorted(spoilt), "the summary has other failures")
    print()
    print(f"**Missed:** {'; '.join(faults)}." if faults else "Resumed, the same bytes as in one go: met.")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
