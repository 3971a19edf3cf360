"""The same kind of scene with more and more points: how time and memory grow.

The scenes are given in any order. `cylx extract` runs as a whole process, with everything compiled. The memory is held
to 1 GB and 100 bytes a point, the time of the largest scene to the time of the one with a million points.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from pictures import COLORS, PICTURES, can_draw, open_picture, save_picture
from runs import extract, require_scenes, truth_of, warm_up
from tables import Bars, print_header, print_row

from cylx.evaluation import evaluate

REFERENCE = 1_000_000  # points
ROOM_MB, BYTES_A_POINT = 1000, 100


def allowed_mb(points):
    """Give the memory that a scene may need, MB."""
    return ROOM_MB + BYTES_A_POINT * points / 1e6


def measure(scene, folder, times, bars):
    """Print the row of a scene; return its points, seconds and peak memory, None if it could not be extracted."""
    truth = json.loads(truth_of(scene).read_text(encoding="utf-8"))
    points = truth["points"]
    run, result = extract(scene, folder, times=times)
    verdict = bars.at_most(None if result is None else run.peak_mb, allowed_mb(points))
    if result is None:
        print_row(scene.stem, str(points), *["-"] * 5, verdict)
        return None
    f1 = f"{evaluate(truth, result).f1:.3f}"
    times, peaks = [run.seconds, run.seconds / points * 1e6], [f"{run.peak_mb:.0f}", run.peak_mb * 1e6 / points]
    print_row(scene.stem, str(points), f1, *times, *peaks, verdict)
    return points, run.seconds, run.peak_mb


def compare_times(rows, bars, bar):
    """Say how the time grew from a million points to the largest scene."""
    near = next((row for row in rows if REFERENCE / 2 < row[0] < REFERENCE * 2), None)
    most = max(rows, default=None)
    if near is None or near == most:
        print("\nThe growth needs a scene of about a million points, and a larger one.")
        bars.at_most(None, bar)
        return
    ratio = most[1] / near[1]
    verdict = bars.at_most(ratio, bar)
    print(
        f"\n{most[0] / near[0]:.3g} times the points take {ratio:.3g} times as long"
        f" ({most[0]} and {near[0]} points){'; bar ' + verdict if verdict else ''}."
    )


def draw(rows, folder):
    """Draw time and memory against the number of points, both logarithmic, with lines that grow as the points do."""
    points, seconds, peaks = zip(*sorted(rows), strict=True)
    figure, (left, right) = open_picture(panels=2)
    left.plot(points, seconds, "o-", color=COLORS[0], label="measured")
    middle = min(range(len(points)), key=lambda i: abs(points[i] - REFERENCE))
    linear = [seconds[middle] * n / points[middle] for n in points]
    left.plot(points, linear, "--", color="#888888", label="slope 1")
    left.set_ylabel("seconds")
    right.plot(points, peaks, "o-", color=COLORS[0], label="measured")
    allowed = [allowed_mb(n) for n in points]
    right.plot(points, allowed, "--", color="#888888", label="1 GB + 100 B a point")
    right.set_ylabel("peak memory, MB")
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("points")
        axis.legend(frameon=False, fontsize="small")
    save_picture(figure, folder, "growth", "seconds and peak memory by the number of points")


def main():
    """Print a row a scene, the growth, and the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="SCENE.ply", nargs="+", type=Path)
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="run each N times and give the median time")
    parser.add_argument("--max-ratio", type=float, metavar="BAR", help="exit with 1 if the time grows by more")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help="where they go (default: docs/pictures)")
    a = parser.parse_args()
    require_scenes(a.scenes)
    draws = can_draw()
    bars = Bars()
    print_header("scene", "points", "F1", "seconds", "µs a point", "peak MB", "bytes a point", "bar")
    with tempfile.TemporaryDirectory() as folder:
        warm_up(folder)
        rows = [measure(scene, folder, a.repeat, bars) for scene in a.scenes]
    rows = [row for row in rows if row is not None]
    compare_times(rows, bars, a.max_ratio)
    if draws and rows:
        draw(rows, a.pictures)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
