"""Run the pipeline on single things that are no cylinders and write one JSON line for each fit, all of them false.

The things are those of `tests/benchmarks/negatives.py`, drawn with other seeds, and more of their like. Planes and
uniform noise have no fits that are worth a row.
"""

import argparse
import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
from collect import done_before, judged_fits, row_of, seed_range
from labels import FALSE

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from negatives import THINGS, cone, elbow, ellipsoid, rounded_box

from cylx.config import Config
from cylx.pipeline import extract_cylinders
from cylx.records import PointCloud

NOISES = (0.0002, 0.0006, 0.002, 0.005)
"""Standard deviations, as shares of the diagonal."""
COUNTS = (8000, 20000, 40000)
SEEDS = range(100, 102)
WITHOUT_FITS = {"plane", "uniform noise"}


def prism(corners, rng, n):
    """Draw from the sides of a regular prism."""
    side, along = rng.integers(0, corners, n), rng.random((n, 1))
    turns = 2 * np.pi * np.array([side, side + 1]) / corners
    first, second = (np.column_stack([np.cos(turn), np.sin(turn)]) for turn in turns)
    return np.column_stack([first * (1 - along) + second * along, 3 * rng.random(n)])


def barrel(rise, rng, n):
    """Draw from a barrel, whose radius falls by this share towards its ends."""
    height, turn = 2 * rng.random(n) - 1, 2 * np.pi * rng.random(n)
    radius = 1 - rise * height**2
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 1.5 * height])


def oval(narrow, rng, n):
    """Draw from a cylinder whose section is an ellipse, so much narrower one way."""
    turn = 2 * np.pi * rng.random(n)
    return np.column_stack([np.cos(turn), narrow * np.sin(turn), 3 * rng.random(n)])


MORE = {
    **{f"prism of {corners} sides": partial(prism, corners) for corners in (5, 6, 7, 8)},
    **{f"barrel, {rise:g}": partial(barrel, rise) for rise in (0.08, 0.2)},
    **{f"oval, {narrow:g}": partial(oval, narrow) for narrow in (0.8, 0.9)},
    **{f"box, rounded by {radius:g}": partial(rounded_box, radius) for radius in (0.06, 0.16)},
    "ellipsoid, 1.5 : 1 : 0.95": partial(ellipsoid, (1.5, 1.0, 0.95)),
    **{f"elbow, bent about {bend} r": partial(elbow, bend) for bend in (4, 6, 12, 20)},
    "cone, half angle 7°": partial(cone, 7),
}
ALL = {**{name: draw for name, draw in THINGS.items() if name not in WITHOUT_FITS}, **MORE}


def make(name, seed, noise):
    """Make the points of a thing."""
    rng = np.random.default_rng([99, seed, list(ALL).index(name), round(1e6 * noise)])
    surface = ALL[name](rng, int(rng.choice(COUNTS))) @ np.linalg.qr(rng.standard_normal((3, 3)))[0]
    sigma = noise * np.linalg.norm(np.ptp(surface, axis=0))
    return surface + sigma * rng.standard_normal(surface.shape)


def parse():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, metavar="OUT.jsonl")
    parser.add_argument("--seeds", type=seed_range, default=SEEDS, metavar="A:B", help="of each (default: 100:102)")
    parser.add_argument("--noise", type=float, nargs="+", default=list(NOISES), metavar="SHARE", help="of the diagonal")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="only what has one of these words in its name")
    parser.add_argument("--append", action="store_true", help="keep the things that the file has already")
    return parser.parse_args()


def main():
    """Collect rows, thing by thing, and say how many fits there were and were accepted."""
    a = parse()
    names = [name for name in ALL if not a.only or any(word in name for word in a.only)]
    there = done_before(a.output) if a.append else set()
    with a.output.open("a" if a.append else "w", encoding="utf-8") as file:
        for name in names:
            for seed in a.seeds:
                for noise in a.noise:
                    scene = f"thing_{name}@{seed}, {noise:g}"
                    if scene in there:
                        continue
                    extraction = extract_cylinders(PointCloud(make(name, seed, noise)), Config())
                    rows = [row_of(scene, fit, why, FALSE, None) for fit, why in judged_fits(extraction)]
                    file.writelines(json.dumps(row) + "\n" for row in rows)
                    file.flush()
                    print(f"{scene}: {len(rows)} fits, {len(extraction.cylinders)} accepted", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
