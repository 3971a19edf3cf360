"""The paper's single cylinder, many times: errors of axis and radius against the Cramér-Rao bound.

One noisy cylinder of unit radius a seed (`cylx synth single`), extracted in this process. The bound is the mean error
of an unbiased estimator that makes the most of all points.
"""

import argparse
import statistics
import sys
import time
from itertools import pairwise

import numpy as np
from scipy.integrate import quad
from tables import Bars, print_header, print_row

import cylx
from cylx.synthetic import single

QUANTITIES = ("axis angle, °", "axis offset, r", "radius error, %")


def outlier_information(sigma, sigma_o, p):
    """Give the Fisher information about the location of (1 - p) N(0, sigma²) + p N(0, sigma_o²), times sigma²."""
    if p == 0 or sigma == sigma_o:
        return 1.0

    def integrand(e):
        inner = (1 - p) / sigma * np.exp(-0.5 * (e / sigma) ** 2)
        outer = p / sigma_o * np.exp(-0.5 * (e / sigma_o) ** 2)
        density = inner + outer
        slope = e * (inner / sigma**2 + outer / sigma_o**2)
        return slope**2 / density / np.sqrt(2 * np.pi) if density > 0 else 0.0

    narrow, wide = sorted((sigma, sigma_o))
    edges = [0.0, narrow, 3 * narrow, 6 * narrow, 6 * narrow + wide, 6 * narrow + 3 * wide, 12 * wide + 6 * narrow]
    half = sum(quad(integrand, low, high)[0] for low, high in pairwise(edges))
    return 2 * half * sigma**2


def covariance_bound(points, height, theta, sigma, information=1.0):
    """Give the bound on the covariance of (offset along the view, offset across, two tilts, radius).

    Unit radius; points even over the height and over an arc of `theta` radians about the first axis. A point at angle
    phi and height z tells of (cos phi, sin phi, z cos phi, z sin phi, 1) times these parameters, with noise sigma.
    """
    mean_cos = np.sin(theta / 2) / (theta / 2)
    cos_cos = (1 + np.sin(theta) / theta) / 2
    sin_sin = 1 - cos_cos
    fisher = np.zeros((5, 5))
    fisher[np.ix_([0, 1, 4], [0, 1, 4])] = [[cos_cos, 0, mean_cos], [0, sin_sin, 0], [mean_cos, 0, 1]]
    fisher[[2, 3], [2, 3]] = height**2 / 12 * np.array([cos_cos, sin_sin])
    return np.linalg.inv(fisher * points * information / sigma**2)


def mean_length(covariance):
    """Give the mean length of a Gaussian vector in the plane: sqrt(pi/2) times the mean sd over all directions."""
    variances = np.linalg.eigvalsh(covariance)
    turn = np.pi * (np.arange(4096) + 0.5) / 4096
    sd = np.sqrt(variances[0] * np.cos(turn) ** 2 + variances[1] * np.sin(turn) ** 2)
    return np.sqrt(np.pi / 2) * float(sd.mean())


def mean_errors_at_the_bound(a):
    """Give the least mean angle (degrees), offset (radii) and radius error (%)."""
    information = outlier_information(a.sigma, a.sigma_o, a.p)
    covariance = covariance_bound(a.points, a.height, np.radians(a.theta), a.sigma, information)
    angle = np.degrees(mean_length(covariance[2:4, 2:4]))
    return angle, mean_length(covariance[:2, :2]), 100 * np.sqrt(2 / np.pi * covariance[4, 4])


def errors_of(true, found):
    """Give the angle (degrees), the distance of the true middle from the axis (radii) and the radius error (%)."""
    angle = np.degrees(
        np.arctan2(np.linalg.norm(np.cross(true.direction, found.direction)), found.direction @ true.direction)
    )
    offset = np.linalg.norm(np.cross(true.point - found.point, found.direction)) / true.radius
    return float(min(angle, 180 - angle)), float(offset), 100 * abs(found.radius - true.radius) / true.radius


def trial(a, seed):
    """Extract one scene; return its errors (None if nothing was found) and the seconds it took."""
    scene = single(
        points=a.points, height=a.height, sigma=a.sigma, p=a.p, sigma_o=a.sigma_o, theta_deg=a.theta, seed=seed
    )
    start = time.perf_counter()
    found = cylx.extract(scene.points, preset=a.preset, planes=a.planes, seed=seed, max_cylinders=1).cylinders
    seconds = time.perf_counter() - start
    return errors_of(scene.cylinders[0].cylinder, found[0].cylinder) if found else None, seconds


def parse(argv=None):
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", choices=("auto", "paper"), default="auto")
    parser.add_argument("--trials", type=int, default=50, help="seeds 0, 1, ... (default: %(default)s)")
    parser.add_argument("--points", type=int, default=10000)
    parser.add_argument("--height", type=float, default=4.0, help="in radii (default: %(default)s)")
    parser.add_argument("--theta", type=float, default=360.0, help="angle that is seen, degrees (default: %(default)s)")
    parser.add_argument("--sigma", type=float, default=0.01, help="noise, in radii (default: %(default)s)")
    parser.add_argument("--p", type=float, default=0.3, help="share of outliers (default: %(default)s)")
    parser.add_argument("--sigma-o", type=float, default=0.04, help="noise of outliers (default: %(default)s)")
    parser.add_argument("--planes", type=int, default=20)
    for name in ("angle", "offset", "radius"):
        parser.add_argument(f"--max-{name}", type=float, metavar="BAR", help="exit with 1 if the mean error is larger")
    return parser.parse_args(argv)


def main():
    """Run all trials and print the table."""
    a = parse()
    trials = [trial(a, seed) for seed in range(a.trials)]
    errors = np.array([error for error, _ in trials if error is not None]).reshape(-1, 3)
    bars = Bars()
    print_header(
        f"{a.preset}, {len(errors)} of {a.trials} found", "mean", "median", "max", "bound", "mean / bound", "bar"
    )
    bounds = mean_errors_at_the_bound(a)
    for name, values, bound, bar in zip(
        QUANTITIES, errors.T, bounds, (a.max_angle, a.max_offset, a.max_radius), strict=True
    ):
        mean, median, most = (float(f(values)) if len(values) else None for f in (np.mean, np.median, np.max))
        ratio = None if mean is None else mean / bound
        print_row(name, mean, median, most, bound, ratio, bars.at_most(mean if len(errors) == a.trials else None, bar))
    print(f"\nSeconds a cylinder, in a running process: {statistics.median(seconds for _, seconds in trials):.2g}")
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
