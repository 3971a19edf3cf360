"""What scanners see of a scene: the nearest surface in each direction, and less of it the further away it is."""

import math

import numpy as np
from solids import is_open, normals_of

GRAZING = 0.05
"""No point returns if the cosine between its ray and the normal is less than this."""


STEEP = 0.2
"""Surfaces under a smaller cosine hide a part of themselves."""


def visible(points, normals, two_sided, view, bin_width):
    """Tell which points a scanner at `view` sees, by the nearest range in bins of azimuth and elevation.

    Parameters
    ----------
    points, normals : ndarray of shape (N, 3)
        Points dense enough that a bin that looks at a surface holds some of it.
    two_sided : ndarray of shape (N,), bool
        Points of surfaces that are seen from behind as well.
    view : ndarray of shape (3,)
    bin_width : float
        Radians.

    Returns
    -------
    seen : ndarray of shape (N,), bool
    ranges, cosines : ndarray of shape (N,)
        Distance from the scanner, and cosine of the angle of incidence.
    """
    rays = points - view
    ranges = np.linalg.norm(rays, axis=1)
    cosines = -np.einsum("ij,ij->i", rays, normals) / ranges
    cosines = np.where(two_sided, np.abs(cosines), cosines)
    columns = int(2 * np.pi / bin_width)
    azimuth = ((np.arctan2(rays[:, 1], rays[:, 0]) + np.pi) / bin_width).astype(np.int64) % columns
    elevation = ((np.arcsin(rays[:, 2] / ranges) + 0.5 * np.pi) / bin_width).astype(np.int64)
    bins = elevation * columns + azimuth
    front = cosines > 0
    nearest = np.full(int(bins.max()) + 1, np.inf)
    np.minimum.at(nearest, bins[front], ranges[front])
    # over the width of a bin a surface recedes by as much as its slope says
    clipped = np.clip(cosines, STEEP, 1.0)
    slack = bin_width * ranges * (0.5 + 1.5 * np.sqrt(1.0 - clipped**2) / clipped)
    return (cosines > GRAZING) & (ranges < nearest[bins] + slack), ranges, cosines


def scan(rng, points, normals, two_sided, views, bin_width, count):
    """Choose about `count` points as scanners at `views` would: density falls with cosine over range squared.

    What is scanned densest is thinned out, as is usual with scans that are put together.

    Returns
    -------
    chosen : ndarray of shape (n,)
        Indices of the points, n at most `count`.
    ranges : ndarray of shape (n,)
        Their distance from the nearest scanner that sees them.
    """
    density, reach = np.zeros(len(points)), np.full(len(points), np.inf)
    for view in views:
        seen, ranges, cosines = visible(points, normals, two_sided, view, bin_width)
        density += np.where(seen, cosines / ranges**2, 0.0)
        reach = np.where(seen, np.minimum(reach, ranges), reach)
    low, high = 0.0, count / max(float(density.max()), 1e-300) * 1e6
    for _ in range(60):  # the factor that makes of densities, cut off at one, so many points
        factor = 0.5 * (low + high)
        low, high = (low, factor) if np.minimum(factor * density, 1.0).sum() > count else (factor, high)
    chosen = np.flatnonzero(rng.random(len(points)) < np.minimum(low * density, 1.0))
    return chosen, reach[chosen]


def scan_lines(points, normals, two_sided, views, count):
    """Give about `count` points on the rays of scanners at `views`, which are at equal steps of azimuth and elevation.

    Of the points that a scanner sees in a step, the one nearest to its ray is moved onto the ray within its tangent
    plane. Surfaces are seen in lines, so that of an upright edge, or of a thin pipe, there may be only a few.

    Returns
    -------
    chosen : ndarray of shape (n,)
        Indices of the points that were moved.
    moved : ndarray of shape (n, 3)
        Where to.
    ranges : ndarray of shape (n,)
        Their distance from the scanner that sees them.
    """
    step = 0.006
    for _ in range(4):  # the number of points falls with the square of the step, about
        parts = [_lines_of(points, normals, two_sided, view, step) for view in views]
        step *= math.sqrt(sum(len(part[0]) for part in parts) / count)
    chosen, moved, ranges = (np.concatenate(column) for column in zip(*parts, strict=True))
    return chosen, moved, ranges


def _lines_of(points, normals, two_sided, view, step):
    seen, ranges, _ = visible(points, normals, two_sided, view, step)
    chosen = np.flatnonzero(seen)
    rays = points[chosen] - view
    azimuth = np.arctan2(rays[:, 1], rays[:, 0]) / step
    elevation = np.arcsin(rays[:, 2] / ranges[chosen]) / step
    column, row = np.round(azimuth), np.round(elevation)
    order = np.argsort((azimuth - column) ** 2 + (elevation - row) ** 2, kind="stable")
    steps = (row * 4.0 * math.ceil(math.pi / step) + column)[order].astype(np.int64)
    best = order[np.unique(steps, return_index=True)[1]]
    chosen, rays, column, row = chosen[best], rays[best], column[best] * step, row[best] * step
    ray = np.stack([np.cos(row) * np.cos(column), np.cos(row) * np.sin(column), np.sin(row)], axis=1)
    normal = normals[chosen]
    facing = np.einsum("ij,ij->i", ray, normal)
    reach = np.einsum("ij,ij->i", rays, normal) / np.where(np.abs(facing) > 1e-6, facing, 1e-6)
    moved = view + reach[:, None] * ray
    near = np.linalg.norm(moved - points[chosen], axis=1) < step * ranges[chosen] / STEEP
    return chosen[near], moved[near], reach[near]


def scanned(rng, sketch, views, *, bin_width, dense, count, lines=False):
    """Give what scanners see of a sketch.

    Parameters
    ----------
    sketch : Sketch
    views : sequence of ndarray of shape (3,)
        Where the scanners are.
    bin_width : float
        Directions that are nearer to each other hide each other, radians.
    dense : int
        Points to choose from: enough for some in each bin.
    count : int
        Points to choose, at most.
    lines : bool
        Whether the points are on scan lines, or random.

    Returns
    -------
    draft : Draft
    ranges : ndarray of shape (n,)
        Distance of each point from the nearest scanner that sees it.
    """
    clouds = sketch.clouds(rng, dense)
    surfaces = [part.surface for part in sketch.parts]
    normals = np.concatenate([normals_of(surface, cloud) for surface, cloud in zip(surfaces, clouds, strict=True)])
    two_sided = np.repeat([is_open(surface) for surface in surfaces], [len(cloud) for cloud in clouds])
    whole = sketch.draft(clouds)
    if lines:
        chosen, moved, ranges = scan_lines(whole.points, normals, two_sided, views, count)
        return whole._replace(points=moved, labels=whole.labels[chosen]), ranges
    chosen, ranges = scan(rng, whole.points, normals, two_sided, views, bin_width, count)
    return whole._replace(points=whole.points[chosen], labels=whole.labels[chosen]), ranges
