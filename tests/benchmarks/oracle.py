"""Median errors of what cylx finds over those of least squares on the points that are known to lie on each cylinder.

Nobody tells cylx which points belong together; this is what that costs. Ratios are of medians over the cylinders that
cylx found.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from runs import extract, require_scenes, truth_of, warm_up
from single import errors_of
from tables import Bars, print_header, print_row

from cylx.evaluation import evaluate
from cylx.fits.robust import WeightSchedule, fit_cylinder
from cylx.geometry.cylinder import Cylinder
from cylx.io import read_cloud

WIDE = 1e6


def shape_of(entry):
    """Make the cylinder of an entry of a truth or a result."""
    direction = np.array(entry["axis_direction"])
    return Cylinder(entry["axis_point"], direction / np.linalg.norm(direction), entry["radius"], entry["height"])


def least_squares(true, points):
    """Fit a cylinder to its points, from the truth."""
    start = np.array([*true.point, *true.direction, true.radius])
    wide = WIDE * true.radius
    fit = fit_cylinder(
        points, start, low=-np.inf, high=np.inf, schedule=WeightSchedule(wide, wide, 1.0, np.inf), steps=50
    )
    return Cylinder(fit[0][:3], fit[0][3:6], fit[0][6], true.height)


def main():
    """Print a row a scene, and the ratios over all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="SCENE.ply", nargs="+", type=Path, help="with SCENE.labels.npy beside it")
    parser.add_argument("--max-ratio", type=float, metavar="BAR", help="exit with 1 if a ratio over all is larger")
    a = parser.parse_args()
    require_scenes(a.scenes)
    bars = Bars()
    names = [f"{what}, {of}" for of in ("cylx", "least squares") for what in ("angle, °", "offset, r", "radius, %")]
    print_header("scene", "cylinders", *names)
    families = {}
    with tempfile.TemporaryDirectory() as folder:
        warm_up(folder)
        for scene in a.scenes:
            truth = json.loads(truth_of(scene).read_text(encoding="utf-8"))
            labels = np.load(scene.with_name(f"{scene.stem}.labels.npy"))
            points = read_cloud(scene).points
            result = extract(scene, folder)[1] or {"cylinders": []}
            by_id = {cylinder["id"]: cylinder for cylinder in result["cylinders"]}
            errors = []
            for pair in evaluate(truth, result).pairs:
                true = shape_of(truth["cylinders"][pair.truth_id])
                ideal = least_squares(true, points[labels == pair.truth_id])
                errors.append([*errors_of(true, shape_of(by_id[pair.result_id])), *errors_of(true, ideal)])
            medians = np.median(errors, axis=0)
            families.setdefault(scene.stem.rpartition("_")[0], []).append(medians)
            print_row(scene.stem, str(len(errors)), *map(float, medians))
    print()
    print_header("family", "angle: cylx / least squares", "offset", "radius", "bar")
    for family, medians in families.items():
        mean = np.mean(medians, axis=0)
        ratios = mean[:3] / mean[3:]
        print_row(family, *map(float, ratios), bars.at_most(float(ratios.max()), a.max_ratio))
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
