"""Cautions: properties of a cloud that prevent cylinders from being found or make them inaccurate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.records import PointCloud, Scene

COORDINATES_SAMPLED = 100_000
"""Number of coordinates used to find the step they are stored in."""
ROUNDING = 12.0**-0.5
"""Standard deviation of the rounding error for steps of 1."""
LEAST_GAPS = 10
"""A step cannot be found with fewer gaps than this between coordinates."""
CROWDED = 8
"""With this many points per distinct value, the values are levels."""
KEYS = (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
"""Odd numbers without a pattern; they hash three coordinates to one number."""
COPIES = 0.2
"""From this share of duplicate points on, the measured spacing is too small by a tenth or more."""
MANY = 1000
"""This many copies are worth a word …"""
FEW_COPIES = 0.005
"""… unless they are a smaller share than this."""
FEWEST_ZEROS = 10
"""Fewer points at the origin than this may have been measured there."""
STRAY_DISTANCE = 5.0
"""Strays are this many times as far out as all others."""
MOST_STRAYS = 0.2
"""With more points than this far out, it is unclear which ones are strays."""
FLAT_WITHIN = 5.0
"""A cloud is flat if all points lie within this many standard deviations of the noise of one plane."""
SLENDER = 1000.0
"""A scan in degrees with heights in metres is at least this many times as high as it is wide."""


@dataclass(frozen=True, slots=True)
class Caution:
    """A likely problem.

    Parameters
    ----------
    kind : str
        One word for programs.
    fault : str
        What is wrong.
    remedy : str
        What to do about it.
    """

    kind: str
    fault: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.fault}; {self.remedy}"


def cautions(whole: PointCloud, cloud: PointCloud, scene: Scene, least: int) -> list[Caution]:
    """Return the likely problems of a cloud: all that can be found without searching for cylinders.

    Parameters
    ----------
    whole : PointCloud
        The cloud as read.
    cloud : PointCloud
        The points that are used; usable (see `cylx.scene.check_usable`).
    scene : Scene
        Spacing and noise of the cloud.
    least : int
        Minimum number of points of an accepted cylinder.
    """
    points = cloud.points
    bent = _degrees(points)
    found = [_missing(whole), _few(points, least), *damage(cloud, scene), _strays(points), bent]
    found.append(None if bent else _flat(points, scene))
    return [caution for caution in found if caution is not None]


def damage(cloud: PointCloud, scene: Scene) -> list[Caution]:
    """Return problems that make the result wrong without a sign: steps, copies, and noise that hides thin cylinders.

    Parameters
    ----------
    cloud : PointCloud
    scene : Scene
        Spacing and noise of the cloud, measured or given.
    """
    points = cloud.points[:: max(1, len(cloud.points) // COORDINATES_SAMPLED)]
    steps = [step_of(points[:, d]) for d in range(3)]
    coarse = _coarse(points, steps, scene)
    read = [Caution("columns", fault, remedy) for fault, remedy in cloud.source.doubts]
    found = [
        *read,
        coarse,
        None if coarse else _copies(cloud.points, min(steps), scene),
        _zeros(cloud.points),
        _noisy(scene),
    ]
    return [caution for caution in found if caution is not None]


def step_of(values: FloatArray) -> float:
    """Return the step in which coordinates are stored: of single precision, of a lattice, or of uneven levels.

    Parameters
    ----------
    values : ndarray of shape (n,)
        One of the coordinates of points, in any order.

    Returns
    -------
    float
        0 if there are too few values, or only the steps of double precision.

    Examples
    --------
    >>> values = np.random.default_rng(0).normal(size=1000)
    >>> step_of(values), step_of(np.round(values, 2))
    (0.0, 0.01)
    """
    if len(values) == 0:
        return 0.0
    levels = np.unique(values)
    largest = float(np.abs(levels).max())
    rounding, single = 4.0 * float(np.spacing(largest)), 0.0
    if largest < np.finfo(np.float32).max and (levels.astype(np.float32) == levels).all():
        rounding, single = 4.0 * float(np.spacing(np.float32(largest))), _single_step(values)
    gaps = np.diff(levels)
    apart = gaps[gaps > rounding]
    if len(apart) < LEAST_GAPS:
        return single
    step = float(apart.min())
    multiples = apart / step
    known = multiples < 0.05 * step / rounding  # for larger multiples the rounding of the step is no longer small
    uneven = np.abs(multiples - np.rint(multiples))[known]
    if known.mean() > 0.9 and np.quantile(uneven, 0.99) < 0.1:
        return max(single, float(f"{step:.6g}"))
    if len(values) >= CROWDED * len(levels):  # depths of a camera: the distance of levels grows with depth
        nearest = np.minimum(np.append(gaps, gaps[-1]), np.insert(gaps, 0, gaps[0]))
        return max(single, float(np.median(nearest)))
    return single


def _single_step(values: FloatArray) -> float:
    """Return the step of single precision at the size of the values."""
    return float(np.spacing(np.float32(np.median(np.abs(values)))))


def _coarse(points: FloatArray, steps: list[float], scene: Scene) -> Caution | None:
    """Return a caution if coordinates are rounded more coarsely than the measured noise, which is then wrong."""
    axis = int(np.argmax(steps))
    noise = ROUNDING * steps[axis]
    if noise <= scene.noise:
        return None
    name, given = "xyz"[axis], f"--set scene.noise={0.3 * steps[axis]:.3g}"
    if steps[axis] == _single_step(points[:, axis]):
        fault = f"so far from the origin single precision has {name} in steps of {steps[axis]:.3g} only"
        kind, remedy = "precision", f"write the scan in double precision, or give {given}"
    else:
        fault = f"{name} is written in steps of about {steps[axis]:.3g}"
        kind, remedy = "steps", f"write the scan with more digits, or give {given}"
    return Caution(kind, f"{fault}, and the noise cannot be measured", remedy)


def _copies(points: FloatArray, step: float, scene: Scene) -> Caution | None:
    """Return a caution if there are many duplicate points; in a large cloud they are estimated from a sample of keys.

    Rows of zeros are no duplicates of each other: `_zeros` counts them.
    """
    keys = np.zeros(len(points), np.uint64)
    for d, factor in enumerate(KEYS):
        keys += (points[:, d] + 0.0).view(np.uint64)  # + 0.0 turns -0.0 into 0.0
        keys *= np.uint64(factor)
        keys ^= keys >> np.uint64(29)
    sampled = np.uint64(max(1, len(keys) // COORDINATES_SAMPLED))
    some = np.sort(keys[(keys % sampled == 0) & (keys != 0)])
    share = np.count_nonzero(some[1:] == some[:-1]) / max(len(some), 1)
    count = round(share * np.count_nonzero(keys))
    by_chance = (step / scene.spacing) ** 2  # in cells as wide as a step, some points coincide by chance
    if share <= COPIES + by_chance and (count < MANY or share <= FEW_COPIES + 3.0 * by_chance):
        return None
    about = "" if sampled == 1 else "about "
    many = f"{about}{count} of {len(points)} points ({share:.0%})"
    fault = f"{many} are copies of others, and count as if they had been measured"
    return Caution("copies", fault, f"leave them out by --voxel {scene.spacing / 20:.2g}")


def _zeros(points: FloatArray) -> Caution | None:
    """Return a caution if points lie exactly at the origin: many drivers write zeros where nothing was measured."""
    count = len(points) - int(np.count_nonzero(points.any(axis=1)))
    if count < FEWEST_ZEROS:
        return None
    fault = f"{count} of {len(points)} points are (0, 0, 0), as some programs write where nothing was measured"
    return Caution("zeros", fault, "write NaN there, or leave these rows out")


def _noisy(scene: Scene) -> Caution | None:
    """Return a caution if the noise exceeds the spacing."""
    if scene.noise <= scene.spacing:
        return None
    fault = (
        f"the noise ({scene.noise:.3g}) exceeds the spacing of the points ({scene.spacing:.3g}): "
        f"cylinders with a radius below about {10 * scene.noise:.3g} cannot be told from noise"
    )
    return Caution("noise", fault, "expect thicker ones only")


def _missing(whole: PointCloud) -> Caution | None:
    """Return a caution if most rows of a file have no finite coordinates."""
    missing = whole.rows - len(whole.points)
    if 2 * missing <= whole.rows:
        return None
    fault = f"{missing} of {whole.rows} rows have no finite coordinates, and take no part"
    return Caution("missing", fault, "look whether the scan was written whole")


def _few(points: FloatArray, least: int) -> Caution | None:
    """Return a caution if the cloud has fewer points than a cylinder needs."""
    if len(points) >= least:
        return None
    fault = f"there are {len(points)} points, and no cylinder is accepted with fewer than {least}"
    return Caution("few", fault, "take more points, or lower verification.min_inliers")


def _strays(points: FloatArray) -> Caution | None:
    """Return a caution if some points are far away from all others."""
    middle = np.median(points, axis=0)
    out = np.sort(np.abs(points - middle).max(axis=1))
    first = int((1.0 - MOST_STRAYS) * len(out))
    tail = out[max(first, 1) :]
    apart = np.flatnonzero(tail[1:] > STRAY_DISTANCE * tail[:-1])
    if not len(apart) or tail[0] == 0:
        return None
    last = float(tail[apart[0]])
    strays, digits = len(tail) - int(apart[0]) - 1, max(0, 2 - math.floor(math.log10(last)))
    low, high = (",".join(f"{x:.{digits}f}" for x in middle + sign * 1.01 * last) for sign in (-1.0, 1.0))
    which = f"{strays} points lie" if strays > 1 else "1 point lies"
    fault = (
        f"{which} up to {out[-1] / last:.3g} times as far out as all others: bounds and largest radius are too large"
    )
    return Caution("strays", fault, f"leave them out by --crop {low}:{high}")


def _flat(points: FloatArray, scene: Scene) -> Caution | None:
    """Return a caution if the cloud is one plane within its noise; thin bent objects can look like that."""
    if scene.noise > scene.spacing:
        return None
    offsets = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(offsets.T @ offsets)
    heights = np.abs(offsets @ axes[:, 0])
    if float(np.quantile(heights, 0.999)) > FLAT_WITHIN * scene.noise:
        return None
    fault = f"all points lie within {FLAT_WITHIN * scene.noise:.3g} of one plane, as its noise is"
    return Caution("flat", fault, "there is no cylinder in it to be found; scan what stands out")


def _degrees(points: FloatArray) -> Caution | None:
    """Return a caution if the coordinates look like degrees of longitude and latitude with heights."""
    low, high = points.min(axis=0), points.max(axis=0)
    x, y, z = high - low
    wide = max(x, y)
    if (
        z <= SLENDER * wide
        or wide > 0.1
        or np.abs([low[0], high[0]]).max() > 180
        or np.abs([low[1], high[1]]).max() > 90
    ):
        return None
    if max(abs(low[0]), abs(low[1])) < 10 * wide:
        return None
    fault = (
        f"the scan is {z / wide:.3g} times as high as it is wide: x and y seem to be degrees beside heights in metres"
    )
    return Caution("degrees", fault, "project it to metres first")
