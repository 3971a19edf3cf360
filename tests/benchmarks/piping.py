"""Runs of pipe: how well straights, fittings and runs are found in synthetic plants of three sizes, and that none is
invented where there are none. Extracted in this process, with defaults; seconds are those of
all its threads together.

The plants are those of `cylx synth piping`, seen from four places. Scenes without pipes are synthetic rooms, and, where
they are there, CAD parts and trees of `../shared/data`.
"""

import argparse
import sys
import time
from collections import Counter
from itertools import pairwise

import numpy as np
from runs import SHARED
from tables import Bars, print_header, print_row

import cylx
from cylx import synthetic

SIZES = {"small": 3, "middle": 8, "large": 20}  # runs of pipe; 50000 points a run
KINDS = ("elbow", "tee", "cross", "reducer", "flange", "inline", "cap")
BARS = {"elbow": 0.95, "tee": 0.92, "reducer": 0.9, "flange": 0.85}
CONFIDENCES = (0.0, 0.8, 0.95, 1.0)


def rates(matched, false, missed):
    """Give precision, recall and F1."""
    precision, recall = matched / max(matched + false, 1), matched / max(matched + missed, 1)
    return precision, recall, 2 * precision * recall / max(precision + recall, 1e-9)


def plants(runs, seeds):
    """Extract plants of one size; sum up what was matched, false and missed, the confidences, and the times."""
    counts, pairs, good, sure = {}, Counter(), [], []
    seconds = np.zeros(2)
    for seed in seeds:
        scene = synthetic.piping(runs=runs, seed=seed)
        marks = [time.process_time()]
        found = cylx.extract(scene.points)
        marks.append(time.process_time())
        result = cylx.to_dict(cylx.find_runs(found))
        marks.append(time.process_time())
        seconds += [later - earlier for earlier, later in pairwise(marks)]
        score = cylx.evaluate(scene.truth(), result)
        straights = counts.setdefault("straight", np.zeros(3, int))
        straights += [score.matched, len(score.false), len(score.missed)]
        for kind, one in score.fittings.kinds.items():
            counts.setdefault(kind, np.zeros(3, int))
            counts[kind] += [one.matched, len(one.false), len(one.missed)]
            found_ones = (fitting for fitting in result["fittings"] if fitting["kind"] == kind)
            sure += [(fitting["confidence"], fitting["id"] not in one.false) for fitting in found_ones]
        elbows = score.fittings.kinds["elbow"].matched if "elbow" in score.fittings.kinds else 0
        good += [score.fittings.good_elbows] * elbows
        pairs.update(truth=score.runs.pairs_truth, found=score.runs.pairs_predicted, both=score.runs.pairs_matched)
    return counts, pairs, good, sure, seconds


def report_plants(sizes, seeds, bars, held):
    """Print a table of rates, one row a kind and size, and one of how far confidences can be believed."""
    everywhere = []
    print_header("plant", "what", "there", "precision", "recall", "F1", "bar")
    for name in sizes:
        counts, pairs, good, sure, seconds = plants(SIZES[name], range(seeds))
        everywhere += sure
        for kind in ("straight", *KINDS):
            if kind not in counts:
                continue
            matched, false, missed = counts[kind]
            precision, recall, f1 = rates(matched, false, missed)
            bar = BARS.get(kind) if held else None
            said = bars.at_least(f1, bar)
            if kind == "straight" and held:
                said = f"recall {bars.at_least(recall, 0.98)}, precision {bars.at_least(precision, 0.99)}"
            print_row(name, kind, str(matched + missed), precision, recall, f1, said)
        both = pairs["both"]
        precision, recall, f1 = rates(both, pairs["found"] - both, pairs["truth"] - both)
        said = f"precision {bars.at_least(precision, 0.99)}, recall {bars.at_least(recall, 0.95)}" if held else ""
        print_row(name, "pairs in one run", str(pairs["truth"]), precision, recall, f1, said)
        share = float(np.mean(good)) if good else None
        said = bars.at_least(share, 0.9 if held else None)
        print_row(name, "elbows within 5 % and 1°", str(len(good)), share, None, None, said)
        print_row(name, "seconds of processor: cylinders, runs", "", float(seconds[0]), float(seconds[1]), None, "")
    print()
    print_header("confidence of fittings", "there", "mean", "true or not asked for")
    confidence, true = np.array(everywhere, dtype=float).reshape(-1, 2).T
    for low, high in pairwise(CONFIDENCES):
        chosen = (confidence >= low) & ((confidence < high) | (high == CONFIDENCES[-1]))
        if chosen.any():
            means = float(confidence[chosen].mean()), float(true[chosen].mean())
            print_row(f"{low:g} to {high:g}", str(int(chosen.sum())), *means)


def without(rooms):
    """Yield names and points of clouds without pipes."""
    for seed in range(rooms):
        yield f"room {seed}", synthetic.multi(points=150_000, cylinders=12, seed=seed).points
    for path in sorted((SHARED / "data" / "fit4cad").glob("PC*.npz"), key=lambda path: int(path.stem[2:]))[::6]:
        yield f"CAD part {path.stem}", np.load(path)["arr_0"]
    for path in sorted((SHARED / "data" / "wild").glob("*tree*")):
        yield f"tree {path.name}", cylx.read_cloud(path).points


def report_without(rooms, bars, held):
    """Print what was found in clouds without pipes: those in which a fitting was."""
    print_header("clouds", "cylinders", "caps", "other fittings", "which")
    sums, clouds, cylinders, caps = {}, Counter(), Counter(), Counter()
    for name, points in without(rooms):
        kind = name.split()[0]
        try:
            found = cylx.extract(points, runs=True)
        except cylx.CylxError as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        here = Counter(one.kind for one in found.piping.fittings)
        caps[kind] += here.pop("cap", 0)
        clouds[kind] += 1
        cylinders[kind] += len(found.cylinders)
        sums.setdefault(kind, Counter()).update(here)
        if here:
            print(f"{name}: {dict(here)}", file=sys.stderr)
    for kind, count in clouds.items():
        total = sum(sums[kind].values())
        said = ", ".join(f"{n} {what}" for what, n in sorted(sums[kind].items())) or "none"
        held_to = bars.at_most(total, 0 if held else None)
        print_row(f"{count} of {kind}", str(cylinders[kind]), str(caps[kind]), str(total), f"{said} {held_to}".strip())


def main():
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="plants of each size")
    parser.add_argument("--sizes", nargs="*", default=list(SIZES), choices=list(SIZES))
    parser.add_argument("--rooms", type=int, default=6, help="rooms without pipes")
    parser.add_argument("--bars", action="store_true", help="exit with 1 if a bar is missed")
    parser.add_argument("--only", choices=("plants", "without"))
    given = parser.parse_args()
    bars = Bars()
    if given.only != "without":
        report_plants(given.sizes, given.seeds, bars, given.bars)
        print()
    if given.only != "plants":
        report_without(given.rooms, bars, given.bars)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
