"""Scans of others and the cylinders that are known to be in them: where they lie, and what of a fit agrees with them.

`../shared/data` has three kinds: `fit4cad`, CAD parts sampled without noise (Romanengo et al., Computers & Graphics
2021); `kinect`, depth-camera scenes of the Object Segmentation Database; `wild`, stems, columns and parts. Each has its
own limits of what is right, as what is known of it is more or less exact.
"""

import json
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from labels import AMBIGUOUS, FALSE, TRUE
from scipy.spatial import cKDTree

from cylx.io import read_cloud

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
NOISES = (0.0, 0.05, 0.2, 0.5)
"""Noise that is added to CAD parts, in spacings."""
SPACING_SAMPLE, SPACING_NEIGHBOURS = 2000, 8
"""The spacing of a part is that of the neighbours of so many points."""


class Limits(NamedTuple):
    """Errors of angle (degrees), offset (radii) and radius (relative) within which a fit is a cylinder."""

    angle: float
    offset: float
    radius: float

    def hold(self, errors):
        """Tell whether errors are within them."""
        return bool(errors[0] < self.angle and errors[1] < self.offset and errors[2] < self.radius)


CAD_RIGHT, CAD_NEAR, CAD_NEAR_OF_ARCS = Limits(3.0, 0.1, 0.05), Limits(12.0, 0.35, 0.2), Limits(8.0, 0.2, 0.12)
DEPTH_RIGHT, DEPTH_NEAR = Limits(5.0, 0.25, 0.08), Limits(15.0, 0.5, 0.2)
LEAST_OVERLAP = 0.25
"""A fit lies beside a cylinder that is known along this share of the shorter of the two."""
LEAST_UPRIGHT = 0.5
"""A fit whose direction has less of the upright than this is no stem."""
BEYOND_PROFILE = 0.6
"""A fit may go on so many metres past the ends of a stem's profile."""
MILLIMETRES = 100.0
"""A stem that is higher than this is given in millimetres."""


class Scan(NamedTuple):
    """A scan and what is known of it.

    Parameters
    ----------
    name : str
        Kind, what it is of, and, after `@`, what makes it another scan of the same.
    cloud : PointCloud
    judge : callable
        Gives the label and the index of the true cylinder, or None, of a fitted cylinder.
    """

    name: str
    cloud: object
    judge: object


def errors_of(point, direction, radius, cylinder):
    """Give the angle (degrees), the offset at the known point (radii) and the relative error of the radius."""
    direction = np.asarray(direction) / np.linalg.norm(direction)
    aside = np.asarray(point) - cylinder.point
    aside = aside - (aside @ cylinder.direction) * cylinder.direction
    angle = np.degrees(np.arccos(min(1.0, abs(direction @ cylinder.direction))))
    return angle, np.linalg.norm(aside) / radius, abs(cylinder.radius / radius - 1.0)


def judge_all(errors, right, near):
    """Give label and owner of a fit from its errors against all that is known; each may have several versions."""
    for k, versions in enumerate(errors):
        if any(right.hold(each) for each in versions):
            return TRUE, k
    close = any(near.hold(each) for versions in errors for each in versions)
    return (AMBIGUOUS if close else FALSE), None


def cad_parts(data=DATA, noises=NOISES, every=1, start=0, near=CAD_NEAR):
    """Give the CAD parts, each with all noises; every so manyth, from a first one."""
    truth = read_json(data / "fit4cad" / "truth.json")
    names = sorted(truth, key=lambda name: int(re.sub(r"\D", "", name)))
    for name in names[start::every]:
        points = np.load(data / "fit4cad" / f"{name}.npz")["arr_0"].astype(np.float64)
        for noise in noises:
            yield Scan(f"fit4cad_{name}@{noise:g}", as_cloud(noisy(points, noise)), judge_of_part(truth[name], near))


def judge_of_part(known, near=CAD_NEAR):
    """Give the judge of a CAD part."""

    def judge(cylinder):
        errors = [[errors_of(each["axis_point"], each["axis_direction"], each["radius"], cylinder)] for each in known]
        return judge_all(errors, CAD_RIGHT, near)

    return judge


def noisy(points, noise):
    """Add noise of so many spacings."""
    if noise == 0:
        return points
    sample = np.random.default_rng(0).choice(len(points), min(SPACING_SAMPLE, len(points)), replace=False)
    reach = cKDTree(points).query(points[sample], SPACING_NEIGHBOURS + 1)[0][:, -1]
    spacing = np.median(reach) * np.sqrt(np.pi / (SPACING_NEIGHBOURS + 1))
    return points + np.random.default_rng(1).normal(0.0, noise * spacing, points.shape)


def depth_scenes(data=DATA, every=1, start=0):
    """Give the depth-camera scenes."""
    known = read_json(data / "kinect" / "references.json")
    for name in list(known)[start::every]:
        cloud = read_cloud(data / "kinect" / f"{name}.pcd")
        yield Scan(f"depth_{name}", cloud, judge_of_depth(known[name]["cylinders"]))


def judge_of_depth(known):
    """Give the judge of a depth-camera scene; an open mug may be fitted by either wall."""

    def judge(cylinder):
        errors = [
            [
                errors_of(version["point"], version["axis"], version["radius"], cylinder)
                for version in [each, *each.get("alternatives", [])]
            ]
            for each in known
        ]
        return judge_all(errors, DEPTH_RIGHT, DEPTH_NEAR)

    return judge


def wild_scans(data=DATA, every=1, start=0):
    """Give the stems, columns and parts."""
    known = read_json(data / "wild" / "references.json")
    for name in list(known)[start::every]:
        cloud = read_cloud(data / "wild" / name)
        yield Scan(f"wild_{name}", cloud, judge_of_wild(known[name], cloud.points))


def judge_of_wild(known, points):
    """Give the judge of a scan; what is not known, but borne out by its points, is left out of the fit."""

    def judge(cylinder):
        for k, each in enumerate(known["refs"]):
            if (on_cylinder if each["kind"] == "cylinder" else on_stem)(cylinder, each):
                return TRUE, k
        if known["never_all"]:
            return FALSE, None
        doubtful = known.get("neutral") or borne_out(points, cylinder)
        return (AMBIGUOUS if doubtful else FALSE), None

    return judge


def on_cylinder(cylinder, known):
    """Tell whether a fit is a known cylinder, by the tolerances that this has."""
    allowed = known["tolerances"]
    axis, point = np.asarray(known["axis"]) / np.linalg.norm(known["axis"]), np.asarray(known["point"])
    ends = np.sort([(end - point) @ axis for end in (cylinder.start, cylinder.end)])
    low, high = max(ends[0], -known["length"] / 2), min(ends[1], known["length"] / 2)
    if high - low < LEAST_OVERLAP * min(known["length"], ends[1] - ends[0]):
        return False
    limits = Limits(allowed["angle_deg"], allowed["offset_r"], allowed["radius_pct"] / 100)
    return limits.hold(errors_of(point + axis * (low + high) / 2, axis, known["radius"], cylinder))


def on_stem(cylinder, known):
    """Tell whether a fit is a piece of a stem, whose place and diameter are known by height."""
    allowed, profile = known["tolerances"], known["profile"]
    heights = np.array([each["h"] for each in profile])
    slack = BEYOND_PROFILE * (1000.0 if heights[-1] > MILLIMETRES else 1.0)
    height = cylinder.point[2] - known["ground_z"]
    if abs(cylinder.direction[2]) < LEAST_UPRIGHT or not heights[0] - slack <= height <= heights[-1] + slack:
        return False
    x, y, diameter = (np.interp(height, heights, [each[key] for each in profile]) for key in ("x", "y", "d"))
    apart = np.hypot(cylinder.point[0] - x, cylinder.point[1] - y)
    if (
        abs(2 * cylinder.radius / diameter - 1) > allowed["radius_pct"] / 100
        or apart > allowed["offset_r"] * diameter / 2
    ):
        return False
    ends = np.sort([cylinder.start[2], cylinder.end[2]]) - known["ground_z"]
    first = int(np.clip(np.searchsorted(heights, ends[0]), 0, len(profile) - 3))
    last = int(np.clip(np.searchsorted(heights, ends[1]), first + 2, len(profile) - 1))
    along = [profile[last][key] - profile[first][key] for key in ("x", "y", "h")]
    return min(angle_between(cylinder.direction, way) for way in (along, known["axis"])) <= allowed["angle_deg"]


def borne_out(points, cylinder, share=0.6, least=90):
    """Tell whether many of the points about a fit lie on a circle like it, nearly all the way round."""
    offsets = points - cylinder.point
    heights = offsets @ cylinder.direction
    across = offsets - heights[:, None] * cylinder.direction
    distances = np.linalg.norm(across, axis=1)
    near = (np.abs(heights) < cylinder.height / 2) & (distances < 1.6 * cylinder.radius)
    on = np.abs(distances / cylinder.radius - 1.0) < 0.1
    enough = (near & on).sum() >= least and (near & on).sum() >= share * near.sum()
    if not enough or cylinder.height < 0.5 * cylinder.radius:
        return False
    one = np.linalg.svd(cylinder.direction[None])[2][1:]
    turns = np.arctan2(*(across[near & on] @ one.T).T)
    return len(np.unique(((turns + np.pi) / np.radians(10.0)).astype(int))) >= least / 10


def angle_between(one, other):
    """Give the angle of two directions, either way, in degrees."""
    cosine = abs(np.dot(one, other)) / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arccos(min(1.0, cosine))))


def as_cloud(points):
    """Make a cloud of points."""
    from cylx.records import PointCloud

    return PointCloud(points)


def read_json(path):
    """Read a file of references; say what is missing if it is not there."""
    if not path.is_file():
        raise SystemExit(f"{path} is not there; give --data the folder that has {path.parent.name}/{path.name}")
    return json.loads(path.read_text(encoding="utf-8"))
