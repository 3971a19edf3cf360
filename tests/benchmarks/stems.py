"""Stems of made plots against their truth: found, bias and error of the diameter, false ones; whole plots and clips.

    python stems.py --seeds 100:106 --side 16 --scanner terrestrial

A stem counts if its diameter is at least 10 cm and at least 90 degrees of it are seen at breast height.
"""

import argparse
import math
import time

import numpy as np

from cylx.records import PointCloud
from cylx.stems import find_stems
from cylx.synthetic.stand import forest

LEAST_DBH, LEAST_ARC = 0.10, math.radians(90.0)
SAME_PLACE = 0.15


def match(plot, found):
    """Give (true, found) pairs, the true stems that were missed, and the stems that are none."""
    left = list(found)
    pairs, missed = [], []
    for true in plot.stems:
        near = [
            one for one in left if np.hypot(one.foot[0] - true.x, one.foot[1] - true.y) < SAME_PLACE + 0.3 * true.dbh
        ]
        counts = true.dbh >= LEAST_DBH and true.arc >= LEAST_ARC
        if near:
            best = min(near, key=lambda one: abs(one.dbh - true.dbh))
            left.remove(best)
            if counts:
                pairs.append((true, best))
        elif counts:
            missed.append(true)
    return pairs, missed, left


def clip_differences(plot, found, side):
    """Compare the stems of the middle quarter with those of that part alone: lost, new, and largest change of a DBH."""
    low, high = 0.25 * side - 3.0, 0.75 * side + 3.0
    inside = ((plot.points[:, :2] > low) & (plot.points[:, :2] < high)).all(axis=1)
    alone = find_stems(PointCloud(plot.points[inside])).stems
    inner = [[one for one in stems if all(low + 3 < x < high - 3 for x in one.foot[:2])] for stems in (found, alone)]
    change, lost, more = 0.0, 0, list(inner[1])
    for one in inner[0]:
        near = [other for other in more if np.hypot(*(one.foot[:2] - other.foot[:2])) < 0.1]
        if near:
            more.remove(near[0])
            change = max(change, abs(near[0].dbh / one.dbh - 1.0))
        else:
            lost += 1
    return len(inner[0]), lost, len(more), change


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="100:104")
    parser.add_argument("--side", type=float, default=16.0)
    parser.add_argument("--scanner", choices=["terrestrial", "mobile"], default="terrestrial")
    parser.add_argument("--clips", action="store_true")
    args = parser.parse_args()
    first, last = map(int, args.seeds.split(":"))
    errors, spread, counts = [], [], np.zeros(3, int)
    for seed in range(first, last):
        stations, slope = (1, 2, 4)[seed % 3], 0.15 * (seed % 4)
        origin = (432000.0, 5410000.0, 300.0) if seed % 2 else (0.0, 0.0, 0.0)
        plot = forest(seed, side=args.side, scanner=args.scanner, stations=stations, slope=slope)
        began = time.perf_counter()
        found = find_stems(PointCloud(plot.points + origin)).stems
        seconds = time.perf_counter() - began
        moved = [(one, one.foot - origin) for one in found]
        for one, foot in moved:
            object.__setattr__(one, "foot", foot)
        pairs, missed, false = match(plot, found)
        errors += [one.dbh / true.dbh - 1.0 for true, one in pairs]
        spread += [(one.dbh - true.dbh) / one.dbh_sd for true, one in pairs]
        counts += [len(pairs), len(missed), len(false)]
        print(
            f"seed {seed}: {len(plot.points)} points, {stations} stations, slope {slope:.2f}: {len(pairs)} found, "
            f"{len(missed)} missed, {len(false)} false, {seconds:.0f} s",
            *(f"clip: {x}" for x in ([clip_differences(plot, found, args.side)] if args.clips else [])),
            flush=True,
        )
        for true in missed:
            print(f"   missed: dbh {true.dbh:.3f}, {math.degrees(true.arc):.0f} degrees at {true.x:.1f} {true.y:.1f}")
        for one in false:
            print(f"   false: dbh {one.dbh:.3f}, {math.degrees(one.arc):.0f} degrees, quality {one.quality:.2f}")
    e, z = np.array(errors), np.array(spread)
    print(
        f"{args.scanner}: found {counts[0]} of {counts[0] + counts[1]}, false {counts[2]}, "
        f"bias {100 * e.mean():.2f} %, rmse {100 * math.sqrt((e**2).mean()):.2f} %, "
        f"largest {100 * np.abs(e).max():.1f} %, "
        f"within one standard deviation {100 * (np.abs(z) < 1).mean():.0f} %, two {100 * (np.abs(z) < 2).mean():.0f} %"
    )


if __name__ == "__main__":
    main()
