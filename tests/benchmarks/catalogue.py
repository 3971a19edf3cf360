"""How often a catalogue of nominal radii snaps the right ones, and what it does to the errors of the axis.

Pipes of the nominal sizes DN 15 to DN 300 (EN 10220), their true radii scattering by 0.2 % about the nominal ones, one
a trial, in another attitude each time, with 2000 points and a height of four radii. As many again have radii that are
of no entry: drawn evenly over the logarithm of the range of the catalogue, more than 2 % from each entry.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation
from tables import Bars, print_header, print_row

from cylx.config import Config, load_config, named_options
from cylx.pipeline import extract_cylinders
from cylx.records import PointCloud
from cylx.synthetic import single

DIAMETERS = (21.3, 26.9, 33.7, 42.4, 48.3, 60.3, 76.1, 88.9, 114.3, 139.7, 168.3, 219.1, 273.0, 323.9)
RADII = 0.5 * np.array(DIAMETERS)
SCATTER, APART = 0.002, 0.02
ARCS, NOISES = (60.0, 90.0, 180.0, 360.0), (0.005, 0.01, 0.03)
FREE = Config(max_cylinders=1)
LISTED = load_config(options={"max_cylinders": 1, **named_options(catalogue=RADII)})


def off_the_catalogue(rng):
    """Draw a radius that is of no entry."""
    while True:
        radius = np.exp(rng.uniform(*np.log([RADII.min(), RADII.max()])))
        if np.abs(radius / RADII - 1).min() > APART:
            return radius


def offset_of(fit, middle):
    """Give the distance of the true middle from the axis."""
    return np.linalg.norm(np.cross(middle - fit.cylinder.point, fit.cylinder.direction))


def trial(theta, noise, seed):
    """Give the decision about a pipe of the catalogue, its two offset errors in radii, and that about another one."""
    rng = np.random.default_rng(seed)
    points = np.array(single(points=2000, sigma=noise, theta_deg=theta, seed=seed).points)
    points = Rotation.random(rng=rng).apply(points)
    nominal = rng.choice(RADII)
    radius = nominal * (1 + SCATTER * rng.standard_normal())
    (free,), (drawn,), (other,) = (
        extract_cylinders(PointCloud(scale * points), config, threads=1).cylinders or (None,)
        for scale, config in ((radius, FREE), (radius, LISTED), (off_the_catalogue(rng), LISTED))
    )
    if None in {free, drawn, other} or drawn.nominal is None or other.nominal is None:
        return None
    decision = drawn.nominal.decision
    if decision == "snapped" and drawn.nominal.nominal_radius != nominal:
        decision = "wrong"
    offsets = [offset_of(fit, np.zeros(3)) / radius for fit in (free, drawn)]
    return decision, *offsets, other.nominal.decision == "snapped"


def main():
    """Print a row for each arc and noise."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=40, help="a cell (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--max-wrong", type=float, metavar="BAR", help="exit with 1 if a greater share is wrong, %%")
    a = parser.parse_args()
    bars = Bars()
    print_header(
        "arc, °",
        "noise, %",
        "found",
        "snapped rightly",
        "wrongly",
        "left free",
        "off the catalogue: snapped",
        "offset free, r",
        "with the catalogue, r",
        "bar on wrongly",
    )
    with ProcessPoolExecutor(a.jobs) as pool:
        for theta, noise in product(ARCS, NOISES):
            done = pool.map(trial, [theta] * a.trials, [noise] * a.trials, range(a.trials), chunksize=5)
            found = [one for one in done if one is not None]
            decisions = [one[0] for one in found]
            right, wrong = (100 * decisions.count(kind) / len(found) for kind in ("snapped", "wrong"))
            shares = [f"{share:.0f} %" for share in (right, wrong, 100 - right - wrong)]
            off = f"{100 * np.mean([one[3] for one in found]):.0f} %"
            offsets = np.mean([one[1:3] for one in found], axis=0)
            said = f"{len(found)} of {a.trials}"
            bar = bars.at_most(wrong, a.max_wrong)
            print_row(f"{theta:.0f}", f"{100 * noise:g}", said, *shares, off, *map(float, offsets), bar)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
