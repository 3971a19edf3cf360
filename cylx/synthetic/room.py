"""A room with cylinders, planes, boxes, spheres, cones and noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.placement import Room
from cylx.synthetic.scene import NOISE, OTHER_SURFACE, SyntheticScene, demand, true_cylinder
from cylx.synthetic.surfaces import Box, Frustum, Mantle, Sphere, Surface, Wall

_OBJECTS_A_ROOM = 10  # they fit easily into a room 12.5 largest radii wide; more objects get a larger room
_WIDTH_IN_RADII = 12.5
_HEIGHT_IN_WIDTHS = 0.75


def multi(
    *,
    points: int = 100000,
    cylinders: int = 5,
    planes: int = 1,
    boxes: int = 2,
    spheres: int = 2,
    cones: int = 1,
    noise: float = 0.05,
    sigma: float = 0.002,
    seed: int = 0,
    radius_min: float = 0.04,
    radius_max: float = 0.16,
    coverage_min_deg: float = 150.0,
    room: float | None = None,
) -> SyntheticScene:
    """Make a room with cylinders and other objects; nothing touches.

    Parameters
    ----------
    points : int
        Number of points, noise included, > 0.
    cylinders, boxes, spheres, cones : int
        Number of each, >= 0. Cones are frustums with a half-angle of 8 to 20 degrees.
    planes : int
        0 to 6: the floor, then four walls, then the ceiling.
    noise : float
        Share of the points that are uniform in the room, in [0, 1].
    sigma : float
        Standard deviation of the other points about their surface, each coordinate, scene units, >= 0.
    seed : int
        Random seed, >= 0.
    radius_min, radius_max : float
        Range of the cylinders' radii, scene units; log-uniform. The other objects are about as large as the largest.
    coverage_min_deg : float
        Each cylinder is visible over an angle between this and 360 degrees.
    room : float, optional
        Width and depth of the room, scene units; its height is three quarters of it. By default 12.5 of the largest
        radii, and more if there are more than ten objects.

    Raises
    ------
    UsageError
        If a parameter is out of its range, or the room is too small for the objects.

    Examples
    --------
    >>> scene = multi(points=5000, cylinders=3, seed=1)
    >>> len(scene.points), len(scene.cylinders), int((scene.labels == NOISE).sum())
    (5000, 3, 250)
    """
    counts = {"cylinders": cylinders, "planes": planes, "boxes": boxes, "spheres": spheres, "cones": cones}
    demand(points > 0, "points", f"must be > 0, not {points}")
    demand(0 <= noise <= 1, "noise", f"must be in [0, 1], not {noise}")
    demand(0 <= sigma < np.inf, "sigma", f"must be >= 0, not {sigma}")
    demand(seed >= 0, "seed", f"must be >= 0, not {seed}")
    _check_furniture(counts, (radius_min, radius_max), coverage_min_deg, room)
    rng = np.random.default_rng(seed)
    crowding = max(1.0, (cylinders + boxes + spheres + cones) / _OBJECTS_A_ROOM)
    width = _WIDTH_IN_RADII * radius_max * crowding ** (1 / 3) if room is None else room
    space = Room(np.array([width, width, _HEIGHT_IN_WIDTHS * width]))
    mantles = _place_cylinders(rng, space, cylinders, (radius_min, radius_max), coverage_min_deg)
    clutter = _place_clutter(rng, space, counts, radius_max)
    cloud, labels, clean = _draw(rng, [*mantles, *clutter], points - round(noise * points), sigma)
    labels[labels >= cylinders] = OTHER_SURFACE
    scattered = space.size * rng.random((points - len(cloud), 3))
    order = rng.permutation(points)
    return SyntheticScene(
        points=np.concatenate([cloud, scattered])[order],
        labels=np.concatenate([labels, np.full(len(scattered), NOISE)])[order].astype(np.int32),
        cylinders=tuple(true_cylinder(mantle.shape, seen) for mantle, seen in zip(mantles, clean, strict=False)),
        sigma=float(sigma),
        family="multi",
        seed=int(seed),
        params={
            "points": points,
            **counts,
            "noise": noise,
            "radius_min": radius_min,
            "radius_max": radius_max,
            "coverage_min_deg": coverage_min_deg,
            "room": float(width),
        },
    )


def _check_furniture(
    counts: Mapping[str, int], radii: tuple[float, float], coverage_min_deg: float, room: float | None
) -> None:
    for name, count in counts.items():
        demand(count >= 0, name, f"must be >= 0, not {count}")
    demand(counts["planes"] <= 6, "planes", f"must be <= 6, not {counts['planes']}")
    demand(0 < radii[0] <= radii[1] < np.inf, "radius_min", f"must be > 0 and <= radius_max, not {radii[0]}")
    demand(0 < coverage_min_deg <= 360, "coverage_min_deg", f"must be in (0, 360], not {coverage_min_deg}")
    demand(room is None or 0 < room < np.inf, "room", f"must be > 0, not {room}")


def _place_cylinders(
    rng: np.random.Generator, space: Room, count: int, radii: tuple[float, float], coverage_min_deg: float
) -> list[Mantle]:
    mantles = []
    drawn = np.exp(rng.uniform(np.log(radii[0]), np.log(radii[1]), count))
    for radius in np.sort(drawn)[::-1]:  # the largest first, while there is space
        height = min(rng.uniform(5, 12) * radius, 0.6 * space.size[0])
        middle, direction = space.place(rng, height, radius, "cylinders")
        arc = np.radians(rng.uniform(coverage_min_deg, 360))
        mantles.append(Mantle(Cylinder(middle, direction, radius, height), rng.uniform(0, 2 * np.pi), arc))
    return mantles


def _place_clutter(rng: np.random.Generator, space: Room, counts: Mapping[str, int], scale: float) -> list[Surface]:
    """Place the objects other than cylinders; `scale` is their typical size, scene units."""
    clutter: list[Surface] = []
    for _ in range(counts["boxes"]):
        sides = scale * rng.uniform(0.75, 2.5, 3)
        center, _ = space.place(rng, 0.0, 0.5 * float(np.linalg.norm(sides)), "boxes")
        clutter.append(Box(center, sides, np.linalg.qr(rng.standard_normal((3, 3)))[0]))
    for _ in range(counts["spheres"]):
        radius = scale * rng.uniform(0.35, 1.0)
        center, _ = space.place(rng, 0.0, radius, "spheres")
        clutter.append(Sphere(center, radius))
    for _ in range(counts["cones"]):
        wide = scale * rng.uniform(0.5, 1.0)
        narrow = wide * rng.uniform(0.3, 0.6)
        height = (wide - narrow) / np.tan(np.radians(rng.uniform(8, 20)))
        middle, direction = space.place(rng, height, wide, "cones")
        clutter.append(Frustum(middle, direction, narrow, wide, height))
    (x, y, z) = space.size
    walls = [(2, 0.0), (1, 0.0), (0, 0.0), (1, y), (0, x), (2, z)]
    return clutter + [Wall(space.size, axis, level) for axis, level in walls[: counts["planes"]]]


def _draw(
    rng: np.random.Generator, surfaces: Sequence[Surface], total: int, sigma: float
) -> tuple[FloatArray, IndexArray, list[FloatArray]]:
    """Draw points at even density; return the noisy ones, the index of their surface, and the exact ones by surface."""
    demand(surfaces or total == 0, "noise", "must be 1 if there is no surface")
    areas = np.array([surface.area for surface in surfaces])
    cuts = np.round(total * np.cumsum(areas) / areas.sum()) if surfaces else areas
    shares = np.diff(cuts, prepend=0).astype(int)
    clean = [surface.sample(rng, share) for surface, share in zip(surfaces, shares, strict=True)]
    cloud = np.concatenate([np.empty((0, 3)), *clean])
    return cloud + sigma * rng.standard_normal(cloud.shape), np.repeat(np.arange(len(shares)), shares), clean
