"""One cylinder under conditions that get worse: how often it is found, and how often something else is.

One cylinder of unit radius a trial, in an attitude of its own, extracted in this process. What is not varied is 1000
points on the full turn and a height of four radii, with noise of a hundredth and no outliers. Outliers are uniform in a
box twice as wide and high as the cylinder; the floor is a square eight radii wide, as dense as the cylinder.
"""

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pictures import COLORS, PICTURES, can_draw, mark_values, open_picture, save_picture
from tables import number, print_header, print_row

import cylx
from cylx.evaluation import evaluate
from cylx.synthetic import single

HALF_FLOOR = 4.0  # radii
ERRORS = ("angle, °", "offset, r", "radius, %")


@dataclass(frozen=True)
class Setting:
    """How a scene is made; lengths in radii."""

    points: int = 1000
    height: float = 4.0
    coverage: float = 360.0
    outliers: float = 0.0  # share of all points
    floor: bool = False
    sigma: float = 0.01


@dataclass(frozen=True)
class Sweep:
    """What is varied: a field of the setting, what it is called, its values, and whether the cylinder also stands."""

    title: str
    values: tuple
    floors: tuple = (False,)
    logarithmic: bool = False


SWEEPS = {
    "coverage": Sweep("coverage, °", (30, 45, 60, 90, 120, 180, 270, 360)),
    "height": Sweep("height, r", (0.5, 0.75, 1, 1.5, 2, 3, 4)),
    "points": Sweep("points", (50, 70, 100, 200, 400, 1000, 2000), logarithmic=True),
    "outliers": Sweep("share of outliers", (0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8), floors=(False, True)),
}


def floor_points(rng, setting):
    """Draw the floor the cylinder stands on, but for what is under it."""
    density = setting.points / (np.radians(setting.coverage) * setting.height)
    count = rng.poisson(density * (2 * HALF_FLOOR) ** 2)
    xy = HALF_FLOOR * (2 * rng.random((count, 2)) - 1)
    xy = xy[np.linalg.norm(xy, axis=1) > 1]
    level = np.full(len(xy), -0.5 * setting.height)
    return np.column_stack([xy, level]) + setting.sigma * rng.standard_normal((len(xy), 3))


def make_scene(setting, seed):
    """Make a scene; return its points and its truth."""
    rng = np.random.default_rng([23, seed])
    cylinder = single(
        points=setting.points, height=setting.height, sigma=setting.sigma, theta_deg=setting.coverage, seed=seed
    )
    points = np.vstack([cylinder.points, floor_points(rng, setting)]) if setting.floor else cylinder.points
    count = round(len(points) * setting.outliers / (1 - setting.outliers))
    box = np.array([4.0, 4.0, 2 * setting.height])
    points = np.vstack([points, box * (rng.random((count, 3)) - 0.5)])
    turn, shift = np.linalg.qr(rng.standard_normal((3, 3)))[0], rng.uniform(-10, 10, 3)
    points = rng.permutation(points) @ turn.T + shift
    shape = cylinder.cylinders[0].cylinder
    return points, [described(turn @ shape.point + shift, turn @ shape.direction, shape.radius)]


def described(point, direction, radius):
    """Describe a cylinder as a truth or a result does."""
    return {"axis_point": point.tolist(), "axis_direction": direction.tolist(), "radius": radius}


def trial(setting, seed):
    """Extract one scene; return what it is worth."""
    points, truth = make_scene(setting, seed)
    found = [fit.cylinder for fit in cylx.extract(points).cylinders]
    result = [described(shape.point, shape.direction, shape.radius) for shape in found]
    return evaluate({"cylinders": truth}, {"cylinders": result})


def median_errors(scores):
    """Give the median errors of those that were found; None if none was."""
    if not scores:
        return [None] * len(ERRORS)
    rows = [(score.angle_deg.median, score.offset.median, 100 * score.radius.median) for score in scores]
    return [float(value) for value in np.median(rows, axis=0)]


def run_sweep(name, sweep, trials, start):
    """Print the table of a sweep; return (value, recall, false cylinders a trial) row by row, by the floor."""
    both = len(sweep.floors) > 1
    print_header(sweep.title, *(["stands"] if both else []), "found", "recall", "false a trial", *ERRORS)
    curves = {floor: [] for floor in sweep.floors}
    for floor in sweep.floors:
        for value in sweep.values:
            setting = replace(start, floor=floor, **{name: value})
            scores = [trial(setting, seed) for seed in range(trials)]
            hits = [score for score in scores if score.matched]
            recall, false = len(hits) / trials, sum(len(score.false) for score in scores) / trials
            curves[floor].append((value, recall, false))
            place = ["on a floor" if floor else "alone"] if both else []
            rates = [f"{len(hits)} of {trials}", f"{recall:.2f}", f"{false:.2f}"]
            print_row(f"{value:g}", *place, *rates, *(number(error, 2) for error in median_errors(hits)))
    return curves


def draw_sweep(name, sweep, trials, curves, folder):
    """Draw the curves of a sweep."""
    figure, (axis,) = open_picture()
    for color, size, (floor, rows) in zip(COLORS, (8, 4), curves.items(), strict=False):
        values, recall, false = zip(*rows, strict=True)
        label = ", on a floor" if floor else ", alone" if len(curves) > 1 else ""
        axis.plot(values, recall, "o-", color=color, markersize=size, label=f"recall{label}")
        axis.plot(values, false, "x--", color=color, markersize=size, label=f"false a trial{label}")
    if sweep.logarithmic:
        axis.set_xscale("log")
    mark_values(axis, sweep.values)
    axis.set_ylim(bottom=-0.03, top=max(1.05, axis.get_ylim()[1]))
    axis.set_xlabel(sweep.title)
    axis.set_ylabel(f"share, number a trial ({trials} trials)")
    axis.legend(frameon=False, fontsize="small")
    save_picture(figure, folder, f"recall-{name}", f"recall and false cylinders a trial, by {sweep.title}")


def main():
    """Print and draw one sweep after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20, help="a value (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=SWEEPS, metavar="NAME", help=f"some of: {' '.join(SWEEPS)}")
    parser.add_argument("--points", type=int, default=Setting.points, help="where not varied (default: %(default)s)")
    parser.add_argument("--sigma", type=float, default=Setting.sigma, help="noise, in radii (default: %(default)s)")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help="where they go (default: docs/pictures)")
    a = parser.parse_args()
    draws = can_draw()
    for name in a.only or SWEEPS:
        curves = run_sweep(name, SWEEPS[name], a.trials, Setting(points=a.points, sigma=a.sigma))
        if draws:
            draw_sweep(name, SWEEPS[name], a.trials, curves, a.pictures)
        else:
            print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
