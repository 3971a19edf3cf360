"""The two sources of candidates, each alone and both: how often one cylinder is found, and how long it takes.

The scenes are those of `recall.py`, with the noise given here; and a pipe as sparse as the floor it hangs above, whose
radius is given in spacings, 80 spacings long and seen over half a turn.
"""

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
from recall import Setting, described, make_scene
from tables import print_header, print_row

import cylx
from cylx.evaluation import evaluate

SOURCES = {"slices": "[slices]", "curvature": "[curvature]", "both": "[slices, curvature]"}
COVERAGES = (30, 60, 90, 180, 360)
OUTLIERS = (0.3, 0.5, 0.7, 0.8)
RADII = (0.5, 0.75, 1.0, 1.5, 3.0)  # spacings
LENGTH = 80.0  # spacings


def thin_pipe(radius, seed):
    """Make a thin pipe above a floor, lengths in spacings; return the points and the truth."""
    rng = np.random.default_rng([29, seed])
    count = rng.poisson(np.pi * radius * LENGTH)
    turn, along = np.pi * rng.random(count), LENGTH * (rng.random(count) - 0.5)
    pipe = np.column_stack([along, radius * np.cos(turn), radius * np.sin(turn) + 10.0])
    floor = np.column_stack([1.5 * LENGTH * (rng.random((round((1.5 * LENGTH) ** 2), 2)) - 0.5), np.zeros(14400)])
    points = np.vstack([pipe, floor])
    points += 0.05 * rng.standard_normal(points.shape)
    attitude = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return points @ attitude.T, [described(attitude @ [0, 0, 10.0], attitude @ [1.0, 0, 0], radius)]


def trial(points, truth, sources):
    """Extract with these sources; return whether the cylinder is found, how many are false, and the seconds."""
    start = time.perf_counter()
    found = [fit.cylinder for fit in cylx.extract(points, overrides=[f"candidates.sources={sources}"]).cylinders]
    seconds = time.perf_counter() - start
    result = [described(shape.point, shape.direction, shape.radius) for shape in found]
    score = evaluate({"cylinders": truth}, {"cylinders": result})
    return score.matched, len(score.false), seconds


def print_cell(title, value, makers):
    """Print one row: recall, false cylinders and seconds by source, over scenes that `makers` make."""
    scenes = [make() for make in makers]
    cells = []
    for sources in SOURCES.values():
        found, false, seconds = np.array([trial(points, truth, sources) for points, truth in scenes]).T
        cells.append(f"{found.mean():.2f}, {false.mean():.2f}, {np.median(seconds):.2f}")
    print_row(title, f"{value:g}", *cells)


def main():
    """Print a row for each condition."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=10, help="a value (default: %(default)s)")
    parser.add_argument("--sigma", type=float, default=0.01, help="noise, in radii (default: %(default)s)")
    a = parser.parse_args()
    start = Setting(points=2000, sigma=a.sigma)
    cylx.extract(make_scene(start, 0)[0])  # so that nothing is compiled while it is timed
    print_header("varied", "value", *(f"{name}: recall, false a trial, seconds" for name in SOURCES))
    seeds = range(a.trials)
    for coverage in COVERAGES:
        setting = replace(start, coverage=coverage, outliers=0.1)
        print_cell("coverage, °", coverage, [lambda s=seed, x=setting: make_scene(x, s) for seed in seeds])
    for share in OUTLIERS:
        setting = replace(start, outliers=share)
        print_cell("share of outliers", share, [lambda s=seed, x=setting: make_scene(x, s) for seed in seeds])
    for radius in RADII:
        print_cell("radius, spacings", radius, [lambda s=seed, r=radius: thin_pipe(r, s) for seed in seeds])
    return 0


if __name__ == "__main__":
    sys.exit(main())
