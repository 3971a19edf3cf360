"""Points on everything that is built, as far as scanners see it, and how well each part is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.synthetic.plant.layout import Layout
from cylx.synthetic.plant.network import Straight
from cylx.synthetic.plant.surfaces import PipingSurface
from cylx.synthetic.plant.visibility import seen_from

_PROBE = 40000  # points that estimate the share of the surface that is seen
_NEAR_WELD = 2.0  # a tee is seen by the points so many radii of the branch about its weld


@dataclass(frozen=True, slots=True, eq=False)
class Item:
    """A surface with the cylinder and the fitting it belongs to, by index, -1 for none.

    Parameters
    ----------
    surface : PipingSurface
        The surface.
    cylinder, fitting : int
        Indices.
    missing : bool
        Whether the cloud has none of it.
    """

    surface: PipingSurface
    cylinder: int = -1
    fitting: int = -1
    missing: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Points on the outer surface, seen or not.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Without noise.
    cylinders, fittings : ndarray of shape (N,), int32
        Indices, -1 for none.
    seen : ndarray of shape (N,), bool
        Whether a scanner sees the point, and the cloud has this part.
    """

    points: FloatArray
    cylinders: NDArray[np.int32]
    fittings: NDArray[np.int32]
    seen: MaskArray


def draw(
    rng: np.random.Generator, items: Sequence[Item], layout: Layout, scanners: FloatArray, total: int
) -> tuple[Drawn, NDArray[np.int64]]:
    """Draw points evenly until `total` of them are seen.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the points.
    items : sequence of Item
        All surfaces.
    layout : Layout
        Knows the gaps and the tees.
    scanners : ndarray of shape (V, 3)
        Metres.
    total : int
        Number of points to see, >= 0.

    Returns
    -------
    drawn : Drawn
        All points that were drawn, but for those inside something.
    chosen : ndarray of shape (total,), int64
        Indices of those that are in the cloud.
    """
    solids = np.concatenate([item.surface.solids() for item in items])
    parts = [_batch(rng, items, layout, solids, scanners, max(_PROBE, total // 2))]
    while (seen := sum(int(part.seen.sum()) for part in parts)) < total:
        share = max(seen / sum(len(part.points) for part in parts), 0.01)
        parts.append(_batch(rng, items, layout, solids, scanners, round(1.05 * (total - seen) / share) + 1000))
    drawn = Drawn(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.cylinders for part in parts]),
        np.concatenate([part.fittings for part in parts]),
        np.concatenate([part.seen for part in parts]),
    )
    return drawn, rng.choice(np.flatnonzero(drawn.seen), total, replace=False)


def _batch(
    rng: np.random.Generator, items: Sequence[Item], layout: Layout, solids: FloatArray, scanners: FloatArray, n: int
) -> Drawn:
    """Draw n points over all surfaces; leave out those inside something."""
    areas = np.array([item.surface.area for item in items])
    counts = np.diff(np.floor(n * np.cumsum(areas) / areas.sum() + rng.random()), prepend=0).astype(int)
    samples = [item.surface.sample(rng, int(count)) for item, count in zip(items, counts, strict=True)]
    points = np.concatenate([sample[0] for sample in samples])
    normals = np.concatenate([sample[1] for sample in samples])
    lifts = np.repeat([item.surface.lift for item in items], counts)
    cylinders = np.repeat([item.cylinder for item in items], counts).astype(np.int32)
    fittings = np.repeat([item.fitting for item in items], counts).astype(np.int32)
    seen, buried = seen_from(points, normals, lifts, solids, scanners)
    seen &= ~np.repeat([item.missing for item in items], counts)
    by_cylinder = np.argsort(cylinders, kind="stable")
    bounds = np.searchsorted(cylinders[by_cylinder], np.arange(len(layout.straights) + 1))
    own = [by_cylinder[low:high] for low, high in pairwise(bounds)]
    for index, straight in enumerate(layout.straights):
        _leave_gaps(straight, points, own[index], seen)
    for index, joining in enumerate(layout.joinings):
        if joining.kind in {"tee", "cross"}:
            main, *branches = joining.joins
            for branch in branches:
                pipe, header = layout.straights[branch], layout.straights[main]
                _mark_weld(index, header, pipe, points, own[main], own[branch], fittings)
    kept = ~buried
    return Drawn(points[kept], cylinders[kept], fittings[kept], seen[kept])


def _leave_gaps(straight: Straight, points: FloatArray, own: NDArray[np.int64], seen: MaskArray) -> None:
    heights = (points[own] - straight.start) @ straight.direction
    for span in straight.spans:
        if span.kind == "gap":
            seen[own[(heights > span.low) & (heights < span.high)]] = False


def _mark_weld(
    index: int,
    header: Straight,
    branch: Straight,
    points: FloatArray,
    on_header: NDArray[np.int64],
    on_branch: NDArray[np.int64],
    fittings: NDArray[np.int32],
) -> None:
    """Mark the points of the header and of the branch that are near their weld."""
    reach = _NEAR_WELD * branch.size.radius
    across = points[on_header] - branch.start
    along = across @ branch.direction
    aside = np.linalg.norm(across - along[:, None] * branch.direction, axis=1)
    fittings[on_header[(along > 0) & (aside < reach)]] = index
    heights = (points[on_branch] - branch.start) @ branch.direction
    fittings[on_branch[heights < branch.root + reach]] = index
