"""How often the 95 % intervals of cylx hold the truth, and how far its errors are from the Cramér-Rao bound.

One noisy cylinder of unit radius a trial (`cylx synth single`), in another attitude each time, extracted with the
defaults. Intervals: of the radius 1.96 standard deviations; of the two offsets, of the two tilts, and of all five
parameters, the ellipse that holds 95 % of a Gaussian. With 200 trials a share of 95 % has a standard error of 1.5 %.
The picture has the shares of all other levels, too.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
from pictures import COLORS, PICTURES, can_draw, open_picture, save_picture
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from single import errors_of
from tables import Bars, print_header, print_row

from cylx.config import Config
from cylx.fits.cramer_rao import covariance_bound, mean_length, outlier_information
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.pipeline import extract_cylinders
from cylx.records import PointCloud
from cylx.synthetic import single

LEVEL = 0.95
GROUPS = {"radius": [4], "two offsets": [0, 1], "two tilts": [2, 3], "all five": [0, 1, 2, 3, 4]}


class Cell(NamedTuple):
    """What one row of the table varies."""

    name: str
    theta: float = 360.0
    sigma: float = 0.01
    p: float = 0.0
    sigma_o: float = 0.04
    points: int = 5000


CELLS = (
    Cell("little noise", sigma=0.001),
    Cell("noise"),
    Cell("much noise", sigma=0.05),
    Cell("10 % outliers", p=0.1),
    Cell("30 % outliers", p=0.3),
    Cell("40 % far outliers", sigma=0.001, p=0.4, sigma_o=0.1),
    Cell("half of it", theta=180.0),
    Cell("135°, outliers", theta=135.0, sigma=0.005, p=0.1, sigma_o=0.01),
    Cell("90°, outliers", theta=90.0, sigma=0.005, p=0.1, sigma_o=0.01),
    Cell("50°, outliers", theta=50.0, sigma=0.005, p=0.1, sigma_o=0.01),
    Cell("30°, outliers", theta=30.0, sigma=0.005, p=0.1, sigma_o=0.01),
    Cell("500 points", points=500),
    Cell("200 points, half of it", theta=180.0, points=200),
)


def trial(cell, seed):
    """Extract one scene; give the levels from which its intervals hold the truth and its errors, or None."""
    scene = single(
        points=cell.points,
        height=4.0,
        sigma=cell.sigma,
        p=cell.p,
        sigma_o=cell.sigma_o,
        theta_deg=cell.theta,
        seed=seed,
    )
    turn = Rotation.random(rng=np.random.default_rng(seed))
    before = scene.cylinders[0].cylinder
    point, direction = turn.apply(np.array(before.point)), turn.apply(np.array(before.direction))
    true = Cylinder(point, direction, before.radius, before.height)
    found = extract_cylinders(
        PointCloud(turn.apply(np.array(scene.points))), Config(max_cylinders=1), threads=1
    ).cylinders
    if not found or found[0].covariance is None:
        return None
    fit, covariance = found[0].cylinder, found[0].covariance
    frame = np.array(axis_basis(fit.direction))
    along = true.direction / (true.direction @ fit.direction)
    away = true.point - fit.point
    error = np.concatenate(
        [frame @ (away - (away @ fit.direction) * along), frame @ (along - fit.direction), [true.radius - fit.radius]]
    )

    def level(which):
        return chi2.cdf(error[which] @ np.linalg.solve(covariance[np.ix_(which, which)], error[which]), len(which))

    return [level(which) for which in GROUPS.values()], errors_of(true, fit)


def bounds_of(cell):
    """Give the mean angle (degrees), offset (radii) and radius error (%) at the bound."""
    information = outlier_information(cell.sigma, cell.sigma_o, cell.p)
    covariance = covariance_bound(cell.points, 4.0, np.radians(cell.theta), cell.sigma, information)
    angle = np.degrees(mean_length(covariance[2:4, 2:4]))
    return angle, mean_length(covariance[:2, :2]), 100 * np.sqrt(2 / np.pi * covariance[4, 4])


def draw(levels):
    """Show which share of the truths each level holds, and by how much that is off."""
    figure, (left, right) = open_picture(2)
    nominal = np.linspace(0.02, 0.99, 98)
    error = 200 * np.sqrt(nominal * (1 - nominal) / len(levels))
    right.fill_between(100 * nominal, -error, error, color="#dddddd", label="two standard errors")
    for column, (name, color) in zip(levels.T, zip(GROUPS, COLORS, strict=True), strict=True):
        held = np.array([(column < level).mean() for level in nominal])
        left.plot(100 * nominal, 100 * held, color=color, label=name)
        right.plot(100 * nominal, 100 * (held - nominal), color=color)
    left.plot([0, 100], [0, 100], color="grey", linestyle=":")
    left.set(xlabel="level of the interval, %", ylabel="truths it holds, %")
    right.set(xlabel="level of the interval, %", ylabel="more than it should, %")
    left.legend(fontsize=8)
    right.legend(fontsize=8)
    save_picture(figure, PICTURES, "intervals", "Which share of the truths the intervals of each level hold")


def main():
    """Print a row a cell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200, help="a cell (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--max-ratio", type=float, metavar="BAR", help="exit with 1 if an error over its bound is more")
    a = parser.parse_args()
    bars = Bars()
    print_header(
        "cell",
        "found",
        "radius",
        "offset",
        "tilt",
        "all five",
        "angle / bound",
        "offset / bound",
        "radius / bound",
        "bar",
    )
    total = []
    with ProcessPoolExecutor(a.jobs) as pool:
        for cell in CELLS:
            done = list(pool.map(trial, [cell] * a.trials, range(a.trials), chunksize=10))
            found = [one for one in done if one is not None]
            levels = np.array([one[0] for one in found])
            ratios = np.mean([one[1] for one in found], axis=0) / bounds_of(cell)
            total.append(levels)
            shares = [f"{100 * share:.1f} %" for share in (levels < LEVEL).mean(axis=0)]
            worst = bars.at_most(float(ratios.max()), a.max_ratio)
            print_row(cell.name, f"{len(found)} of {a.trials}", *shares, *(f"{r:.2f}" for r in ratios), worst)
    levels = np.concatenate(total)
    shares = [f"{100 * share:.1f} %" for share in (levels < LEVEL).mean(axis=0)]
    print_row("all", "", *shares, "", "", "", "")
    if can_draw():
        draw(levels)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
