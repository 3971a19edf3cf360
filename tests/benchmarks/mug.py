"""A real mug on a table, seen by one stereo camera: the cloud of PCL's cylinder tutorial, points with z < 1.5 m.

The mug is compared with the second of the two published results; everything else that is found is listed.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from runs import SHARED, extract, give_up, warm_up
from tables import Bars, number, print_header, print_row

SCAN = Path("pcl", "table_scene_mug_stereo_textured.pcd")
FARTHEST = 1.5  # metres; what is behind the table
SAME_ANGLE_DEG, SAME_OFFSET, SAME_RADIUS = 15.0, 0.5, 0.2  # within these a cylinder is the mug, however badly found


def write_foreground(scan, path):
    """Write the points in front as a PLY file; return how many there are."""
    from cylx.io import read_cloud, write_cloud

    points = read_cloud(scan).points
    near = points[points[:, 2] < FARTHEST]
    write_cloud(path, near, dtype="f4")
    return len(near)


def published_mug(references):
    """Read the second published result as a cylinder of a truth."""
    published = references["pcl/table_scene_mug_stereo_textured"]["published"][1]
    return {"axis_point": published["point"], "axis_direction": published["axis"], "radius": published["radius"]}


def differences(reference, cylinder):
    """Give the axis angle (degrees), the distance of the middle from the reference axis, and that of the radii (mm)."""
    axis, direction = (np.array(each["axis_direction"]) for each in (reference, cylinder))
    axis = axis / np.linalg.norm(axis)
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(axis, direction)), abs(axis @ direction)))
    between = np.array(cylinder["axis_point"]) - reference["axis_point"]
    offset = np.linalg.norm(np.cross(between, axis))
    return float(angle), 1000 * float(offset), 1000 * abs(cylinder["radius"] - reference["radius"])


def is_mug(reference, cylinder):
    """Say whether a cylinder can be meant to be the mug."""
    angle, offset, radius = differences(reference, cylinder)
    size = 1000 * reference["radius"]
    return angle < SAME_ANGLE_DEG and offset < SAME_OFFSET * size and radius < SAME_RADIUS * size


def print_cylinders(reference, cylinders):
    """List cylinders with their distance from the mug."""
    print_header(
        "found",
        "radius, mm",
        "height, mm",
        "coverage, °",
        "points",
        "rms, mm",
        "angle to the mug, °",
        "off its axis, mm",
    )
    for cylinder in cylinders:
        name = f"{cylinder['id']}" + (", the mug" if is_mug(reference, cylinder) else "")
        sizes = [1000 * cylinder["radius"], 1000 * cylinder["height"], cylinder["coverage_deg"]]
        angle, offset, _ = differences(reference, cylinder)
        print_row(name, *sizes, str(cylinder["inliers"]), 1000 * cylinder["rmse"], angle, offset)


def main():
    """Extract, then print the mug's table and the list."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--data", type=Path, default=SHARED / "data", help="folder of the scans (default: ../shared/data)"
    )
    parser.add_argument(
        "--max-angle", type=float, metavar="BAR", help="exit with 1 if the axis is farther off, degrees"
    )
    parser.add_argument("--max-radius", type=float, metavar="BAR", help="exit with 1 if the radius is farther off, mm")
    a = parser.parse_args()
    lacking = [str(path) for path in (a.data / SCAN, a.data / "references.json") if not path.is_file()]
    if lacking:
        give_up(f"missing: {', '.join(lacking)}; the scan is in PCL's collection of test data")
    reference = published_mug(json.loads((a.data / "references.json").read_text(encoding="utf-8")))
    bars = Bars()
    with tempfile.TemporaryDirectory() as folder:
        count = write_foreground(a.data / SCAN, Path(folder, "mug.ply"))
        warm_up(folder)
        run, result = extract(Path(folder, "mug.ply"), folder)
    cylinders = [] if result is None else result["cylinders"]
    mugs = sorted((differences(reference, each) for each in cylinders if is_mug(reference, each)), key=sum)
    angle, offset, radius = mugs[0] if mugs else (None, None, None)
    print_header("the mug against the published result", "difference", "bar")
    print_row("axis angle, °", angle, bars.at_most(angle, a.max_angle))
    print_row("axis offset, mm", offset, "")
    print_row("radius, mm", radius, bars.at_most(radius, a.max_radius))
    print(f"\nAll that is found in {count} points, in {number(run.seconds, 2)} s and {run.peak_mb:.0f} MB:\n")
    print_cylinders(reference, cylinders)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
