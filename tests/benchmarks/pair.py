"""Two scans of one can, a pure translation apart: the angle between the two axes that were found.

The true angle is zero whatever the can is like, so that this error owes nothing to a reference.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from runs import extract, require_scenes, truth_of, warm_up
from tables import Bars, print_header, print_row

from cylx.evaluation import evaluate


def angle_between(first, second):
    """Give the angle between two axes of a result, degrees."""
    u, v = (np.array(cylinder["axis_direction"]) for cylinder in (first, second))
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v)), abs(u @ v))))


def main():
    """Print a row a scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="PAIR.ply", nargs="+", type=Path)
    parser.add_argument("--max-angle", type=float, metavar="BAR", help="exit with 1 if an angle is larger, degrees")
    a = parser.parse_args()
    require_scenes(a.scenes)
    bars = Bars()
    print_header("scene", "cans found", "false", "angle between their axes, °", "between their radii, %", "bar")
    with tempfile.TemporaryDirectory() as folder:
        warm_up(folder)
        for scene in a.scenes:
            truth = json.loads(truth_of(scene).read_text(encoding="utf-8"))
            result = extract(scene, folder)[1] or {"cylinders": []}
            score = evaluate(truth, result)
            by_id = {cylinder["id"]: cylinder for cylinder in result["cylinders"]}
            cans = [by_id[pair.result_id] for pair in score.pairs]
            angle = radii = None
            if len(cans) == 2:
                angle = angle_between(*cans)
                radii = 100 * abs(cans[0]["radius"] / cans[1]["radius"] - 1)
            counts = f"{score.matched} of {score.truth}", str(len(score.false))
            print_row(scene.stem, *counts, angle, radii, bars.at_most(angle, a.max_angle))
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
