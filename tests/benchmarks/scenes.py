"""Scenes with many things in them: what is found, how exactly, how fast, and in how much memory.

Each SCENE.ply has its SCENE.truth.json beside it. `cylx extract` runs as a whole process, with everything after `--`
passed on to it, and writes into a folder that is removed afterwards. Families that a prototype of the method was run
on are listed once more, its F1 beside this one; its scenes are of the same families with other seeds.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path
from statistics import fmean

from runs import extract, require_scenes, truth_of, warm_up
from tables import Bars, number, print_header, print_row

from cylx.evaluation import evaluate

COLUMNS = (
    "scene", "points", "to find", "precision", "recall", "F1",
    "angle, °", "offset, r", "radius, %", "seconds", "peak MB",
)  # fmt: skip
PROTOTYPE_F1 = {
    "clutter 300k": (1.000, 0.974, 1.000, 1.000),
    "clutter 1000k": (0.988,),
    "rack 1000k": (0.995, 0.990),
    "ycb-table": (1.000, 1.000, 1.000),
    "ycb-view": (1.000, 1.000),
}  # a scene each, as its own report gives them


def family(truth):
    """Name the family of a scene: scenes of one family differ in their seed only."""
    points = truth.get("params", {}).get("points")
    return truth["family"] + (f" {points // 1000}k" if points else "")


def measures(score, run):
    """Give the numbers of a row, from precision on; None where there is no result."""
    rates = [None, 0.0, 0.0] if score is None else [score.precision, score.recall, score.f1]
    errors = [getattr(score, name, None) for name in ("angle_deg", "offset", "radius")]
    medians = [None if error is None else unit * error.median for unit, error in zip((1, 1, 100), errors, strict=True)]
    return [*rates, *medians, run.seconds, run.peak_mb]


def written(values):
    """Write the numbers of a row: rates in three digits, seconds and memory in fewer."""
    *left, seconds, peak = values
    rates = ["-" if value is None else f"{value:.3f}" for value in left[:3]]
    return [*rates, *(number(value) for value in left[3:]), number(seconds, 2), f"{peak:.0f}"]


def means(rows):
    """Average the rows of a family, column by column; the last column, memory, gets its maximum."""
    columns = [[value for value in column if value is not None] for column in zip(*rows, strict=True)]
    return [*(fmean(column) if column else None for column in columns[:-1]), max(columns[-1])]


def describe(entry):
    """Say in a line what a cylinder is like."""
    keys = ("id", "object", "radius", "height", "coverage_deg", "points", "inliers", "rmse", "support", "payoff")
    known = [
        f"{key} {entry[key]:.4g}" if isinstance(entry[key], float) else f"{key} {entry[key]}"
        for key in keys
        if key in entry
    ]
    return ", ".join(known)


def name_faults(score, truth, result):
    """Give a line for every cylinder that was missed, and for every one that is false."""
    for name, ids, document in (("missed", score.missed, truth), ("false", score.false, result)):
        chosen = [entry for entry in document["cylinders"] if entry["id"] in ids]
        yield from (f"  {name}: {describe(entry)}" for entry in chosen)


def print_beside_the_prototype(families):
    """Print a row for each family the prototype was run on."""
    known = [name for name in families if name in PROTOTYPE_F1]
    if known:
        print()
        print_header("family", "F1, mean", "F1, lowest", "scenes", "the prototype's F1, mean", "lowest", "its scenes")
    for name in known:
        cells = [name]
        for f1 in ([values[2] for _, _, values in families[name]], PROTOTYPE_F1[name]):
            cells += [f"{fmean(f1):.3f}", f"{min(f1):.3f}", str(len(f1))]
        print_row(*cells)


def measure(scene, folder, *, times, extra):
    """Extract one scene and compare it with its truth: the truth, the numbers of its row, and its faults in words."""
    truth = json.loads(truth_of(scene).read_text(encoding="utf-8"))
    run, result = extract(scene, folder, times=times, extra=extra)
    score = None if result is None else evaluate(truth, result)
    return truth, measures(score, run), [] if score is None else [*name_faults(score, truth, result)]


def parse(argv):
    """Read the command line; what follows `--` is for cylx."""
    cut = argv.index("--") if "--" in argv else len(argv)
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="%(prog)s [options] SCENE.ply... [-- OPTION...]",
    )
    parser.add_argument("scenes", metavar="SCENE.ply", nargs="+", type=Path)
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="run each N times and give the median time")
    parser.add_argument("--min-f1", type=float, metavar="BAR", help="exit with 1 if a scene's F1 is smaller")
    parser.add_argument(
        "--faults", action="store_true", help="name on standard error what was missed and what is false"
    )
    return parser.parse_args(argv[:cut]), argv[cut + 1 :]


def main():
    """Print a row a scene, then a row a family."""
    a, extra = parse(sys.argv[1:])
    require_scenes(a.scenes)
    bars, families = Bars(), {}
    print_header(*COLUMNS, *(["bar"] if a.min_f1 is not None else []))
    with tempfile.TemporaryDirectory() as folder:
        warm_up(folder)
        for scene in a.scenes:
            truth, values, faults = measure(scene, folder, times=a.repeat, extra=extra)
            asked = sum(not entry.get("ignore") for entry in truth["cylinders"])
            verdict = [bars.at_least(values[2], a.min_f1)] if a.min_f1 is not None else []
            print_row(scene.stem, str(truth["points"]), str(asked), *written(values), *verdict)
            families.setdefault(family(truth), []).append((truth["points"], asked, values))
            if a.faults:
                print("\n".join([f"{scene.stem}:", *faults]), file=sys.stderr)
    for name, members in families.items():
        points, asked, rows = zip(*members, strict=True)
        if len(rows) > 1:
            label = f"**{name}**, mean of {len(rows)}"
            print_row(
                label,
                f"{fmean(points):.0f}",
                f"{fmean(asked):.3g}",
                *written(means(rows)),
                *([""] if a.min_f1 is not None else []),
            )
    print_beside_the_prototype(families)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
