"""The paper's single cylinder, many times: errors of axis and radius against the Cramér-Rao bound.

One noisy cylinder of unit radius a seed (`cylx synth single`), extracted in this process. The bound is the mean error
of an unbiased estimator that makes the most of all points.
"""

import argparse
import statistics
import sys
import time

import numpy as np
from tables import Bars, print_header, print_row

import cylx
from cylx.fits.cramer_rao import mean_errors_at_bound
from cylx.synthetic import single

QUANTITIES = ("axis angle, °", "axis offset, r", "radius error, %")


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
    bounds = mean_errors_at_bound(a.points, a.height, np.radians(a.theta), a.sigma, a.sigma_o, a.p)
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
