"""Run commands as whole processes: how long they took, and how much memory they needed at most.

Linux counts what a parent weighs towards the peak of its child, so a light process, this file, launches each command.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
SAMPLE = ROOT / "sample_data" / "pipes.ply"

_SCRIPT = Path(sys.executable).with_name("cylx")
CYLX = [str(_SCRIPT)] if _SCRIPT.exists() else [sys.executable, "-m", "cylx"]


@dataclass(frozen=True, slots=True)
class Run:
    """A process that has ended: exit code, wall seconds, peak memory in MB (10^6 bytes), and its standard error."""

    code: int
    seconds: float
    peak_mb: float
    complaint: str = ""


def run(command, **environment):
    """Run a command, with further environment variables, and measure it."""
    launcher = [sys.executable, "-S", __file__, *map(str, command)]
    done = subprocess.run(launcher, capture_output=True, text=True, check=True, env={**os.environ, **environment})
    return Run(**json.loads(done.stdout), complaint=done.stderr.strip())


def run_repeatedly(command, times, **environment):
    """Run a command several times; give the median time, and the largest of the memory peaks and exit codes."""
    runs = [run(command, **environment) for _ in range(times)]
    seconds = statistics.median(each.seconds for each in runs)
    return Run(max(each.code for each in runs), seconds, max(each.peak_mb for each in runs), runs[-1].complaint)


def extract(scan, folder, *, times=1, extra=()):
    """Run `cylx extract` into a folder; return the run and the result, which is None if there is none."""
    output = Path(folder) / f"{Path(scan).stem}.cylinders.json"
    command = [*CYLX, "extract", scan, "-o", output, "--overwrite", "--quiet", *extra]
    measured = run_repeatedly(command, times)
    if measured.code:
        print(f"{scan}: exit {measured.code}: {measured.complaint}", file=sys.stderr)
        return measured, None
    return measured, json.loads(output.read_text(encoding="utf-8"))


def warm_up(folder):
    """Extract a sample, so that what is measured next finds everything compiled."""
    if extract(SAMPLE, folder)[1] is None:
        give_up("cylx cannot extract its own sample")


def truth_of(scene):
    """Name the truth that belongs to a scene."""
    return Path(scene).with_suffix(".truth.json")


def require_scenes(scenes):
    """Give up unless all scenes are there with their truths."""
    lacking = [str(path) for scene in scenes for path in (scene, truth_of(scene)) if not path.is_file()]
    if lacking:
        give_up(f"missing: {', '.join(lacking)}; tests/benchmarks/scenes_make.py makes the scenes")


def give_up(message):
    """End the program because something it needs is missing."""
    print(message, file=sys.stderr)
    sys.exit(2)


def launch(command):
    """Run a command as a child of this light process and print what it took."""
    silence = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    start = time.perf_counter()
    child = os.posix_spawn(command[0], command, os.environ, file_actions=silence)
    _, status, usage = os.wait4(child, 0)
    seconds = time.perf_counter() - start
    unit = 1 if sys.platform == "darwin" else 1024
    peak_mb = usage.ru_maxrss * unit / 1e6
    print(json.dumps({"code": os.waitstatus_to_exitcode(status), "seconds": seconds, "peak_mb": peak_mb}))


if __name__ == "__main__":
    launch(sys.argv[1:])
