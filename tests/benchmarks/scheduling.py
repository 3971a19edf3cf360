"""How long a cloud in tiles takes on how many workers: the steps measured on one scene, and their schedule simulated.

Each step of each tile is timed by itself, in processor seconds of one worker. For larger clouds, tiles are drawn from
those measured, and the reading, cutting and writing of the one process that hands out the work grows with the points.
A free worker takes the next task; all wait at the end of each step. Disks and networks are taken for fast enough; the
last table says how much they have to bear.

With `--kept`, what was measured is written down, and is not measured again; `--result` keeps what was found, which
`cylx evaluate` and `cylx diff` compare.
"""

import argparse
import heapq
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from tables import print_header, print_row

from cylx.config import Config
from cylx.io import open_scratch, stream_cloud
from cylx.records import Selection
from cylx.results import Result
from cylx.tiles.run import Options, extract_in_tiles
from cylx.tiles.search import WHOLE

STEPS = ("search_tile", "gather_tile", "join_group", "label_tile")
POINTS, WORKERS = (10**8, 10**9, 10**10), (1, 2, 8, 64)
SCRATCH_BYTES, TRAVELLING_BYTES = 100, 150
"""Of a point: on the scratch disk, and read and written there by all processes together."""
SECONDS_IN_AN_HOUR = 3600.0


class Timed:
    """Runs tasks in this process, and notes the processor seconds of each."""

    def __init__(self):
        self.seconds = {step: {} for step in STEPS}

    def run(self, work, numbers, waited):
        """Yield the number and the answer of each task."""
        step = work.args[0].__name__
        for number in numbers:
            waited()
            started = time.process_time()
            answer = work(number)
            self.seconds[step][number] = time.process_time() - started
            yield number, answer


class Steps:
    """Notes the processor seconds of the steps of the process that hands out the work."""

    def __init__(self):
        self.seconds, self.started = {}, 0.0

    def stage_started(self, name, total):
        """Begin a step."""
        self.started = time.process_time()

    def stage_advanced(self, steps):
        """Go on."""

    def stage_finished(self, name, seconds):
        """End a step."""
        self.seconds[name] = time.process_time() - self.started


def measured(scene, size, memory, output):
    """Extract a scene in tiles; give what was measured as plain data."""
    timed, steps = Timed(), Steps()
    with tempfile.TemporaryDirectory() as folder, open_scratch(Path(folder), str(scene), {}, resume=False) as scratch:
        clouds = [stream_cloud(scene, scratch.path("spool"))]
        started = time.process_time()
        found = extract_in_tiles(
            clouds, Selection(), Config(), Options(size, None, memory, 1), scratch, timed, steps
        ).extraction
        total = time.process_time() - started
    if output is not None:
        output.write_text(Result.of(found).to_json(), encoding="utf-8")
    reading = steps.seconds["reading"] + steps.seconds["cutting"]
    about = {"found": str(found), "points": sum(found.rows), "total": total, "reading": reading}
    return about | {"steps": {step: sorted(map(list, each.items())) for step, each in timed.seconds.items()}}


def show(about):
    """Print what was measured; give the points, the seconds of the tasks, and those of the process by itself."""
    seconds = {step: dict(each) for step, each in about["steps"].items()}
    serial = about["total"] - sum(sum(each.values()) for each in seconds.values())
    print_header("step", "tasks", "seconds", "median", "longest")
    for step, each in seconds.items():
        times = [*each.values()] or [0.0]
        print_row(step, str(len(each)), f"{sum(times):.1f}", f"{np.median(times):.2f}", f"{max(times):.2f}")
    print_row("reading and cutting", "1", f"{about['reading']:.1f}", "", "")
    print_row("the rest", "1", f"{serial - about['reading']:.1f}", "", "")
    points, total = about["points"], about["total"]
    shares = f"{total / points * 1e6:.1f} µs a point, {100.0 * serial / total:.1f} % of them by one process"
    print(f"\n{about['found']}: {shares}.\n")
    return points, seconds, serial


def schedule(tasks, workers):
    """Give the time until the last of some tasks is done, each taken in turn by the worker that is free first."""
    free = [0.0] * workers
    for seconds in tasks:
        heapq.heapreplace(free, free[0] + seconds)
    return max(free)


def simulated(points, workers, scene, rng):
    """Give the seconds of a cloud of so many points on so many workers, and the seconds of work in it."""
    measured_points, seconds, serial = scene
    times, total = points / measured_points, serial * points / measured_points
    lasts = total
    for step, each in seconds.items():
        here = [one for number, one in each.items() if number != WHOLE]
        tasks = list(rng.choice(here, round(times * len(here)))) if here else []
        if step == "search_tile" and WHOLE in each:
            tasks = [each[WHOLE], *tasks]  # there is one, whatever the size of the cloud
        lasts += schedule(tasks, workers)
        total += sum(tasks)
    return lasts, total


def main():
    """Print what was measured, and what follows from it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="one of those of tiles.py")
    parser.add_argument("--tile", type=float, help="greatest side of a tile, m")
    parser.add_argument("--memory", type=float, default=0.8, help="of a worker, GB")
    parser.add_argument("--kept", type=Path, metavar="FILE.json", help="what was measured before, or is from now on")
    parser.add_argument("--result", type=Path, metavar="FILE.json", help="write what was found")
    a = parser.parse_args()
    if a.kept is not None and a.kept.is_file():
        about = json.loads(a.kept.read_text(encoding="utf-8"))
    else:
        about = measured(a.scene, a.tile, a.memory * 1e9, a.result)
        if a.kept is not None:
            a.kept.write_text(json.dumps(about, indent=1), encoding="utf-8")
    scene = show(about)
    print_header("points", "workers", "hours", "times as fast", "busy", "scratch TB", "GB a second")
    for points in POINTS:
        for workers in WORKERS:
            lasts, total = simulated(points, workers, scene, np.random.default_rng(0))
            hours, disk = lasts / SECONDS_IN_AN_HOUR, points * SCRATCH_BYTES / 1e12
            rate, busy = points * TRAVELLING_BYTES / lasts / 1e9, total / lasts / workers
            print_row(
                f"{points:.0e}",
                str(workers),
                f"{hours:.2f}",
                f"{total / lasts:.1f}",
                f"{100 * busy:.0f} %",
                f"{disk:.2f}",
                f"{rate:.3f}",
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
