"""Jin and Lee: spheres that roll within a pipe, and a line through their centres.

After Y.-H. Jin and W.-H. Lee, "Fast cylinder shape matching using random sample consensus in large scale point
cloud", Applied Sciences 9 (2019), and the paper's description of it: no normals; spheres fitted in small neighbourhoods
of points by RANSAC; axis and radius from all spheres. The centres of a straight pipe lie on the axis, which principal
components distinguish from a bend.

Our readings: a neighbourhood is a ball; if no radius is given, balls of many sizes are tried, as the sphere has to be
as large as the pipe. A sphere is the one through four points with the most points near its surface (a least-squares
sphere of a small patch has twice the pipe's radius). Lines are found by RANSAC over the centres, one after the other,
and fitted by principal components. The radius is the median of those of the spheres. The lengths and bends of pipes,
which the original also finds, are left out, as in the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.baselines.limits import Limits
from cylx.baselines.proposal import Proposal
from cylx.config import JinConfig
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import canonical_direction
from cylx.geometry.kernels import njit
from cylx.records import Frame, stream

SMALLEST, LARGEST = 6.0, 0.25
"""Radii of neighbourhoods: in spacings, and as a share of the extent."""
ENOUGH_OF_A_BALL = 2000
"""Maximum number of points used in a neighbourhood."""
LEAST_POINTS_OF_BALL = 8
NEAR_IN_RADII = 1.5
"""Centres within this many radii of a sphere's centre show whether the pipe is straight there."""


def find_by_spheres(
    frame: Frame,
    limits: Limits,
    config: JinConfig,
    *,
    seed: int,
    threads: int,
) -> Iterator[Proposal]:
    """Find cylinders as lines of spheres, the one with the most spheres first.

    Parameters
    ----------
    frame : Frame
    limits : Limits
    config : JinConfig
        Resolved.
    seed : int
    threads : int
        Does not change the result.

    Yields
    ------
    Proposal
    """
    spheres = _find_spheres(frame, limits.radii, config, seed, threads)
    spheres = spheres[_straight(spheres, config.min_linearity)]
    rng = stream(seed, "centre lines")
    while len(spheres) >= config.min_spheres:
        pairs = rng.integers(len(spheres), size=(config.line_iterations, 2))
        member = _best_line(spheres, pairs, config.line_distance, limits)
        if int(member.sum()) < config.min_spheres:
            return
        own = spheres[member]
        point = own[:, :3].mean(axis=0)
        direction = canonical_direction(np.linalg.svd(own[:, :3] - point)[2][0])
        yield Proposal.spanning(point, direction, float(np.median(own[:, 3])), own[:, :3], len(own))
        spheres = spheres[~member]


def _find_spheres(frame: Frame, radii: tuple[float, float], config: JinConfig, seed: int, threads: int) -> FloatArray:
    """Search for a sphere about each of many points; return centre and radius of those found, shape (n, 4)."""
    rng = stream(seed, "ball places")
    extent = float(np.linalg.norm(np.ptp(frame.points, axis=0)))
    lowest, highest = min(SMALLEST, LARGEST * extent), LARGEST * extent
    reaches = np.exp(rng.uniform(math.log(lowest), math.log(highest), config.seeds))
    if config.neighbourhood is not None:
        reaches[:] = config.neighbourhood / frame.spacing
    seeds = rng.integers(len(frame.points), size=config.seeds)
    distance = (config.distance or 0.0) / frame.spacing
    cells = Cells(frame.points, frame.codes)

    def work(k: int) -> FloatArray | None:
        place, reach = frame.points[seeds[k]], float(reaches[k])
        ball = np.array([*place, 0.0, 0.0, 1.0, 0.0])
        near = frame.points[cells.near_cylinder(ball, -reach, reach, 0.0, reach)]
        near = near[((near - place) ** 2).sum(axis=1) < reach * reach]
        near = near[:: max(1, len(near) // ENOUGH_OF_A_BALL)]
        if len(near) < LEAST_POINTS_OF_BALL:
            return None
        samples = stream(seed, "ball samples", k).integers(len(near), size=(config.iterations, 4))
        sphere = np.empty(4)
        count = _search_sphere(near, samples, distance, radii[0], radii[1], sphere)
        return sphere if count >= max(LEAST_POINTS_OF_BALL, config.min_share * len(near)) else None

    with ThreadPoolExecutor(threads) as pool:
        found = [sphere for sphere in pool.map(work, range(config.seeds)) if sphere is not None]
    return np.array(found).reshape(-1, 4)


@njit(cache=True, nogil=True)
def _search_sphere(
    points: FloatArray, samples: IndexArray, distance: float, least: float, greatest: float, best: FloatArray
) -> int:
    """Fill `best` with centre and radius of the sphere through four points with most support; return the support."""
    record = 0
    for k in range(len(samples)):
        a = samples[k, 0]
        ax, ay, az = points[a, 0], points[a, 1], points[a, 2]
        m = np.empty((3, 4))
        for row in range(3):
            i = samples[k, row + 1]
            x, y, z = points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az
            m[row, 0], m[row, 1], m[row, 2], m[row, 3] = x, y, z, 0.5 * (x * x + y * y + z * z)
        det = _det(m, 0, 1, 2)
        if det == 0.0:
            continue
        cx, cy, cz = _det(m, 3, 1, 2) / det, _det(m, 0, 3, 2) / det, _det(m, 0, 1, 3) / det
        radius = math.sqrt(cx * cx + cy * cy + cz * cz)
        if not (least <= radius <= greatest):
            continue
        cx, cy, cz = cx + ax, cy + ay, cz + az
        count = 0
        for i in range(len(points)):
            dx, dy, dz = points[i, 0] - cx, points[i, 1] - cy, points[i, 2] - cz
            if abs(math.sqrt(dx * dx + dy * dy + dz * dz) - radius) < distance:
                count += 1
        if count > record:
            record = count
            best[0], best[1], best[2], best[3] = cx, cy, cz, radius
    return record


@njit(cache=True, nogil=True)
def _det(m: FloatArray, a: int, b: int, c: int) -> float:
    """Return the determinant of three columns of a matrix of three rows."""
    return float(
        m[0, a] * (m[1, b] * m[2, c] - m[1, c] * m[2, b])
        - m[0, b] * (m[1, a] * m[2, c] - m[1, c] * m[2, a])
        + m[0, c] * (m[1, a] * m[2, b] - m[1, b] * m[2, a])
    )


def _straight(spheres: FloatArray, linearity: float) -> MaskArray:
    """Return which spheres lie where the pipe is straight: their neighbours' centres spread along a line."""
    straight = np.zeros(len(spheres), np.bool_)
    for k, sphere in enumerate(spheres):
        near = spheres[((spheres[:, :3] - sphere[:3]) ** 2).sum(axis=1) < (NEAR_IN_RADII * sphere[3]) ** 2, :3]
        if len(near) < 4:
            continue
        variances = np.linalg.svd(near - near.mean(axis=0), compute_uv=False) ** 2
        straight[k] = variances[0] >= linearity * variances.sum()
    return straight


def _best_line(spheres: FloatArray, pairs: IndexArray, distance: float, limits: Limits) -> MaskArray:
    """Return the spheres on the best supported line through two centres."""
    best = np.zeros(len(spheres), np.bool_)
    for i, j in pairs:
        line = spheres[j, :3] - spheres[i, :3]
        length = float(np.linalg.norm(line))
        radius = 0.5 * (spheres[i, 3] + spheres[j, 3])
        if length < radius or not limits.admit(line / length):
            continue
        offsets = spheres[:, :3] - spheres[i, :3]
        along = offsets @ (line / length)
        off = np.sqrt(np.maximum(0.0, (offsets**2).sum(axis=1) - along**2))
        member = (off < distance * radius) & (np.abs(spheres[:, 3] - radius) < distance * radius)
        if member.sum() > best.sum():
            best = member
    return best
