"""Things that are no cylinders, each alone: how many cylinders are found in them, which should be none.

Points of even density, Gaussian noise whose standard deviation is a share of the diagonal of the thing's bounding box,
an attitude of its own for every seed. Extracted in this process.
"""

import argparse
import sys
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from runs import SHARED
from tables import Bars, number, print_header, print_row

import cylx
from cylx.synthetic.surfaces import Box, Frustum, Sphere, random_directions

ORIGIN, UP = np.zeros(3), np.array([0.0, 0.0, 1.0])
SIDES = np.array([2.0, 1.5, 1.0])
SCANNED = {
    "mustard bottle": "006_mustard_bottle",
    "banana": "011_banana",
    "tennis ball": "056_tennis_ball",
}  # objects of the YCB set


def accepted(draw, weight, rng, n):
    """Draw n points, each kept with the probability that `weight` gives for it."""
    kept = np.empty((0, 3))
    while len(kept) < n:
        points, chances = weight(draw(2 * n))
        kept = np.vstack([kept, points[rng.random(len(points)) < chances]])
    return kept[:n]


def ellipsoid(semi_axes, rng, n):
    """Draw from an ellipsoid."""
    semi_axes = np.array(semi_axes, dtype=float)

    def weight(directions):
        stretch = np.linalg.norm(directions / semi_axes, axis=1)
        return directions * semi_axes, stretch * semi_axes.min()

    return accepted(lambda count: random_directions(rng, count), weight, rng, n)


def elbow(bend, rng, n):
    """Draw from a quarter of a torus: a pipe of unit radius whose axis has the radius `bend`."""

    def weight(angles):
        about, along = 2 * np.pi * angles[:, 0], 0.5 * np.pi * angles[:, 1]
        distance = bend + np.cos(about)
        points = np.column_stack([distance * np.cos(along), distance * np.sin(along), np.sin(about)])
        return points, distance / (bend + 1)

    return accepted(lambda count: rng.random((count, 2)), weight, rng, n)


def cone(half_angle_deg, rng, n):
    """Draw from the mantle of a truncated cone, of unit radius at half its height of three."""
    step = 1.5 * np.tan(np.radians(half_angle_deg))
    return Frustum(ORIGIN, UP, 1 - step, 1 + step, 3.0).sample(rng, n)


def rounded_box(radius, rng, n):
    """Draw from a box whose edges and corners are rounded."""
    core = SIDES - 2 * radius
    faces = 2 * core.prod() / core
    edges = 2 * np.pi * radius * core  # four quarters of a cylinder along each direction
    areas = np.concatenate([faces, edges, [4 * np.pi * radius**2]])
    counts = rng.multinomial(n, areas / areas.sum())
    parts = []
    for axis in range(3):
        inside = core * (rng.random((counts[axis], 3)) - 0.5)
        inside[:, axis] = rng.choice([-0.5, 0.5], counts[axis]) * SIDES[axis]
        angles = 2 * np.pi * rng.random(counts[3 + axis])
        round_edge = np.insert(np.column_stack([np.cos(angles), np.sin(angles)]), axis, 0.0, axis=1)
        along = np.zeros_like(round_edge)
        along[:, axis] = core[axis] * (rng.random(len(along)) - 0.5)
        parts += [inside, along + 0.5 * np.sign(round_edge) * core + radius * round_edge]
    corner = random_directions(rng, counts[6])
    return np.vstack([*parts, 0.5 * np.sign(corner) * core + radius * corner])


def plane(rng, n):
    """Draw from a square."""
    return np.column_stack([4 * rng.random((n, 2)), np.zeros(n)])


def wavy_sheet(rng, n):
    """Draw from a sheet with waves in two directions."""
    x, y = 4 * rng.random((2, n))
    return np.column_stack([x, y, 0.1 * (np.sin(2 * np.pi * x / 1.6) + np.sin(2 * np.pi * y / 2.1))])


THINGS = {
    "box": lambda rng, n: Box(ORIGIN, SIDES, np.eye(3)).sample(rng, n),
    "box, edges rounded by 2 % of its length": partial(rounded_box, 0.04),
    "box, edges rounded by 5 % of its length": partial(rounded_box, 0.1),
    "sphere": lambda rng, n: Sphere(ORIGIN, 1.0).sample(rng, n),
    "ellipsoid, 1 : 0.8 : 0.6": partial(ellipsoid, (1.0, 0.8, 0.6)),
    "ellipsoid, 2 : 1 : 1": partial(ellipsoid, (2.0, 1.0, 1.0)),
    **{f"cone, half angle {angle:g}°": partial(cone, angle) for angle in (3.5, 5, 10, 25)},
    **{f"elbow, bent about {bend} r": partial(elbow, bend) for bend in (2, 3)},
    "plane": plane,
    "wavy sheet": wavy_sheet,
    "uniform noise": lambda rng, n: rng.random((n, 3)),
}


def scanned(data):
    """Give the generators of the scanned objects that are there; say which are not."""
    things = {}
    for name, stem in SCANNED.items():
        path = data / "ycb" / f"{stem}.ply"
        lacking = str(path) if not path.is_file() else "" if find_spec("trimesh") else "the Python package trimesh"
        if lacking:
            print(f"{name}: left out; missing: {lacking}", file=sys.stderr)
        else:
            things[name] = partial(sample_mesh, path)
    return things


def sample_mesh(path, rng, n):
    """Draw from a mesh."""
    import trimesh

    mesh = trimesh.load(path, process=False)
    return np.asarray(mesh.sample(n, seed=int(rng.integers(2**31))))


def confidences(draw, points, noise, seed):
    """Make a scene and extract it; give the confidence of everything that is found."""
    rng = np.random.default_rng([17, seed])
    surface = draw(rng, points) @ np.linalg.qr(rng.standard_normal((3, 3)))[0]
    sigma = noise * np.linalg.norm(np.ptp(surface, axis=0))
    found = cylx.extract(surface + sigma * rng.standard_normal(surface.shape)).cylinders
    return [fit.confidence for fit in found]


def parse(argv=None):
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="seeds 0, 1, ... of each (default: %(default)s)")
    parser.add_argument("--points", type=int, default=20000, help="of a thing (default: %(default)s)")
    parser.add_argument(
        "--noise", type=float, nargs="+", default=[0.0005, 0.002, 0.005], metavar="SHARE", help="of the diagonal"
    )
    parser.add_argument("--only", nargs="+", metavar="WORD", help="only what has one of these words in its name")
    parser.add_argument(
        "--data", type=Path, default=SHARED / "data", help="folder of the scans (default: ../shared/data)"
    )
    parser.add_argument(
        "--max-found", type=int, metavar="BAR", help="exit with 1 if more cylinders are found in all scenes of a thing"
    )
    return parser.parse_args(argv)


def main():
    """Print a row a thing."""
    a = parse()
    things = {**THINGS, **scanned(a.data)}
    levels = [f"noise {noise:.2g}" for noise in a.noise]
    print_header(f"cylinders found in {a.seeds} scenes each", *levels, "surest of them", "bar")
    bars, totals = Bars(), [0] * len(a.noise)
    for name, draw in things.items():
        if a.only and not any(word in name for word in a.only):
            continue
        found = [
            [sure for seed in range(a.seeds) for sure in confidences(draw, a.points, noise, seed)] for noise in a.noise
        ]
        counts, sure = [len(each) for each in found], [value for each in found for value in each if value is not None]
        totals = [total + count for total, count in zip(totals, counts, strict=True)]
        surest = number(max(sure), 2) if sure else ""
        print_row(name, *map(str, counts), surest, bars.at_most(sum(counts), a.max_found))
    print_row("**all**", *map(str, totals), "", "")
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
