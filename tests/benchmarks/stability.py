"""How much of what is found depends on the seed, and whether radii scatter over scenes as much as they say.

Each scene is extracted once with each seed, in this process. An object of one run is the same as one of another if the
axes, the radii and the places along the axis agree. The share is that of the objects that all runs found, among
those that any did.

A `references.json` names the cylinders of scenes. Of an object that is in several scenes, the radii that the first run
found are compared with their mean: the mean squared deviation, in stated standard deviations, is 1 if these are right.
Names count up to a bracket, unless it says that the inside is meant. Scenes are the files that the references name, if
no others are given.
"""

import argparse
import json
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from runs import SHARED, give_up
from tables import Bars, print_header, print_row

import cylx
from cylx.errors import CylxError

KINDS = ("kinect", "wild")
"""Folders of the shared data that have references."""
MOST_ANGLE_DEG, MOST_OFFSET, MOST_RADIUS = 5.0, 0.25, 0.08
"""Angle, offset in radii, and relative difference of radii of what is the same."""
LEAST_OVERLAP = 0.25
"""Share of the shorter of two that lies beside the other along the axis."""
SPECIFIC = re.compile(r"\s*\((?!inside\)).*\)$")
"""What is left out of a name."""


class Known(NamedTuple):
    """A cylinder of a references file."""

    name: str
    cylinder: cylx.Cylinder


class Radius(NamedTuple):
    """The radius of a known object in one scene, what it was found to be, and the stated standard deviation."""

    known: float
    found: float
    deviation: float


def is_same(one, other):
    """Say whether two cylinders are the same object."""
    if abs(one.radius / other.radius - 1) > MOST_RADIUS:
        return False
    cosine = abs(float(one.direction @ other.direction))
    if cosine < np.cos(np.radians(MOST_ANGLE_DEG)):
        return False
    heights = np.sort([(end - other.point) @ other.direction for end in (one.start, one.end)])
    low, high = max(heights[0], -0.5 * other.height), min(heights[1], 0.5 * other.height)
    if high - low < LEAST_OVERLAP * min(one.height, other.height):
        return False
    middle = other.point + 0.5 * (low + high) * other.direction
    return bool(np.linalg.norm(np.cross(middle - one.point, one.direction)) < MOST_OFFSET * other.radius)


def pairs_of(ones, others):
    """Pair what is the same, each at most once, the most alike radii first."""
    alike = [
        (abs(one.radius / other.radius - 1), i, j)
        for i, one in enumerate(ones)
        for j, other in enumerate(others)
        if is_same(one, other)
    ]
    pairs = {}
    for _, i, j in sorted(alike):
        if i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def common(runs):
    """Count the objects that all runs found, and those that any did."""
    objects = [[cylinder] for cylinder in runs[0]]
    for run in runs[1:]:
        pairs = pairs_of([one[0] for one in objects], run)
        for i, j in pairs.items():
            objects[i].append(run[j])
        objects += [[run[j]] for j in range(len(run)) if j not in pairs.values()]
    return sum(len(one) == len(runs) for one in objects), len(objects)


def read_references(path):
    """Read the known cylinders of each scene; what has no one radius is left out."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return {scene: [known_of(one) for one in entry.get("cylinders", entry.get("refs", [])) if "radius" in one]
            for scene, entry in content.items() if isinstance(entry, dict)}  # fmt: skip


def known_of(entry):
    """Make a known cylinder of its entry."""
    shape = cylx.Cylinder(entry["point"], entry["axis"], entry["radius"], entry["length"])
    return Known(SPECIFIC.sub("", entry.get("name") or entry["what"]), shape)


def find_scenes(references):
    """Find the files that references are about, beside them."""
    scenes = {}
    for path in references:
        for name, known in read_references(path).items():
            beside = [path.parent / name, *sorted(path.parent.glob(f"{name}.*"))]
            scenes |= {file: known for file in beside[:1] + beside[1:2] if file.is_file()}
    return scenes


def mean_square(radii):
    """Return the mean squared deviation of radii from their mean, in stated deviations."""
    found, deviations = (np.array(column) for column in list(zip(*radii, strict=True))[1:])
    mean = np.average(found, weights=deviations**-2)
    return float((((found - mean) / deviations) ** 2).sum() / (len(found) - 1))


def is_one_object(radii):
    """Say whether radii are known well enough to be those of one object in several scenes."""
    known = [one.known for one in radii]
    return len(radii) > 1 and max(known) < (1 + MOST_RADIUS) * min(known)


def look_at(scene, known, seeds):
    """Extract a scene with each seed; give what each run found, and the radii of known objects by name."""
    cloud = cylx.read_cloud(scene)
    runs = [cylx.extract(cloud, seed=seed).cylinders for seed in seeds]
    shapes = [[fit.cylinder for fit in run] for run in runs]
    radii = {}
    for i, j in pairs_of([one.cylinder for one in known], shapes[0]).items():
        if runs[0][j].radius_sd:
            radius = Radius(known[i].cylinder.radius, shapes[0][j].radius, runs[0][j].radius_sd)
            radii.setdefault(known[i].name, []).append(radius)
    return shapes, radii


def main():
    """Print a row a scene, and a row an object that is in several scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="SCENE", nargs="*", type=Path, help="(default: those of the references)")
    parser.add_argument(
        "--references", nargs="*", type=Path, metavar="FILE",
        help="references.json of known cylinders (default: those of ../shared/data, as far as they are there)",
    )  # fmt: skip
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1], help="(default: 0 1)")
    parser.add_argument("--min-share", type=float, metavar="BAR", help="exit with 1 if a smaller share is found by all")
    parser.add_argument("--max-deviation", type=float, metavar="BAR", help="exit with 1 if radii scatter more")
    a = parser.parse_args()
    references = a.references
    if references is None:
        references = [path for kind in KINDS if (path := SHARED / "data" / kind / "references.json").is_file()]
    known = find_scenes(references)
    scenes = a.scenes or sorted(known)
    if not scenes:
        give_up("no scenes: name some, or give --references a file that lies beside its scenes")
    known = {path.resolve(): names for path, names in known.items()}
    bars, both, either, radii = Bars(), 0, 0, {}
    print_header("scene", "found by all", "by any", "share", "bar")
    for scene in scenes:
        try:
            runs, own = look_at(scene, known.get(scene.resolve(), []), a.seeds)
        except CylxError as error:
            give_up(str(error))
        counts = common(runs)
        both, either = both + counts[0], either + counts[1]
        for name, found in own.items():
            radii.setdefault((scene.parent, name), []).extend(found)
        print_row(scene.stem, *map(str, counts), counts[0] / counts[1] if counts[1] else None, "")
    share = both / either if either else None
    print_row("all", str(both), str(either), share, bars.at_least(share, a.min_share))
    print()
    print_header("object", "scenes", "radius", "mean squared deviation", "bar")
    for (_, name), found in sorted(radii.items()):
        if is_one_object(found):
            square = mean_square(found)
            mean = float(np.mean([one.found for one in found]))
            print_row(name, str(len(found)), mean, square, bars.at_most(square, a.max_deviation))
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
