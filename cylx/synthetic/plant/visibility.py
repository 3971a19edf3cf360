"""Which points a scanner sees: a ray from each point to it, tested against the solids in its way.

A solid is a row: its kind, a point, a direction, and what the kind needs. A revolved solid has the skew, the range of
heights, the radius, the slope and the bulge of `Revolved`; a block has its centre, two edges and half its sides. The
directions as seen from the scanner are sorted into cells of two degrees, each with the solids that it may meet.
"""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.synthetic.plant.surfaces import BLOCK

_ELEVATIONS, _AZIMUTHS = 90, 180
_CELL_RADIUS = np.radians(1.5)  # half the diagonal of a cell of two degrees
_LEAST_COSINE = 0.1  # of the angle between ray and normal: a grazing ray returns nothing
_PIECE = 0.5  # solids are bounded by balls about pieces of this length, or twice their radius if that is more


def seen_from(
    points: FloatArray, normals: FloatArray, lifts: FloatArray, solids: FloatArray, scanners: FloatArray
) -> tuple[MaskArray, MaskArray]:
    """Return which points are seen from any of the scanners, and which are inside a solid.

    Parameters
    ----------
    points, normals : ndarray of shape (N, 3)
        Scene units; unit vectors outwards.
    lifts : ndarray of shape (N,)
        The rays start so far off the surface, scene units.
    solids : ndarray of shape (S, 15)
        See the module.
    scanners : ndarray of shape (V, 3)
        Scene units, V > 0.
    """
    seen, buried = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    starts = points + lifts[:, None] * normals
    for view, scanner in enumerate(scanners):
        offsets, members = _cells(solids, scanner)
        _look(starts, normals, scanner, offsets, members, solids, view == 0, seen, buried)
    return seen & ~buried, buried


def _cells(solids: FloatArray, scanner: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return for each cell of directions from a scanner the solids it may meet: offsets, and solids by cell."""
    elevations = np.pi * ((np.arange(_ELEVATIONS) + 0.5) / _ELEVATIONS - 0.5)
    azimuths = 2 * np.pi * ((np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS - 0.5)
    high, turned = (grid.ravel() for grid in np.meshgrid(elevations, azimuths, indexing="ij"))
    flat = np.cos(high)
    directions = np.column_stack([flat * np.cos(turned), flat * np.sin(turned), np.sin(high)])
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for index, (balls, radius) in enumerate(_bounds(solids)):
        to = balls - scanner
        distances = np.linalg.norm(to, axis=1)
        opening = np.arcsin(np.minimum(radius / np.maximum(distances, 1e-12), 1.0)) + _CELL_RADIUS
        opening[distances <= radius] = np.pi
        near = (directions @ (to / np.maximum(distances, 1e-12)[:, None]).T >= np.cos(np.minimum(opening, np.pi))).any(
            axis=1
        )
        cells = np.flatnonzero(near)
        pairs.append(np.column_stack([cells, np.full(len(cells), index)]))
    both = np.concatenate(pairs)
    both = both[np.argsort(both[:, 0], kind="stable")]
    counts = np.bincount(both[:, 0], minlength=len(directions))
    return np.concatenate([[0], np.cumsum(counts)]), np.ascontiguousarray(both[:, 1])


def _bounds(solids: FloatArray) -> list[tuple[FloatArray, float]]:
    """Return balls that cover each solid: their centres and their common radius."""
    found = []
    for row in solids:
        if row[0] == BLOCK:
            found.append((row[None, 1:4], float(np.linalg.norm(row[10:13]))))
            continue
        low, high, radius, slope = row[10:14]
        widest = max(radius + slope * low, radius + slope * high)
        length = high - low
        n = max(1, int(np.ceil(length / max(_PIECE, 2 * widest))))
        heights = low + length * (np.arange(n) + 0.5) / n
        centers = row[1:4] + heights[:, None] * (row[4:7] + row[7:10])
        lean = float(np.linalg.norm(row[4:7] + row[7:10]))
        found.append((centers, float(np.hypot(widest, 0.5 * length / n * lean)) + 0.5 * widest * (lean > 1.0 + 1e-9)))
    return found


@njit(cache=True, nogil=True)
def _meets_revolved(row: FloatArray, x: float, y: float, z: float, u: float, v: float, w: float) -> bool:
    """Tell whether the ray from (x, y, z) to (x, y, z) + (u, v, w) meets a revolved solid."""
    x, y, z = x - row[1], y - row[2], z - row[3]
    s, t = x * row[4] + y * row[5] + z * row[6], u * row[4] + v * row[5] + w * row[6]
    first, last = 0.0, 1.0
    if abs(t) < 1e-300:
        if s < row[10] or s > row[11]:
            return False
    else:
        one, other = (row[10] - s) / t, (row[11] - s) / t
        first, last = max(first, min(one, other)), min(last, max(one, other))
        if first > last:
            return False
    # from the centre of the circle at the same height, and its change along the ray
    x, u = x - s * (row[4] + row[7]), u - t * (row[4] + row[7])
    y, v = y - s * (row[5] + row[8]), v - t * (row[5] + row[8])
    z, w = z - s * (row[6] + row[9]), w - t * (row[6] + row[9])
    wide, grows = row[12] + row[13] * s, row[13] * t
    a = u * u + v * v + w * w - grows * grows + row[14] * t * t
    b = x * u + y * v + z * w - wide * grows + row[14] * s * t
    c = x * x + y * y + z * z - wide * wide + row[14] * s * s
    if (a * first + 2.0 * b) * first + c <= 0.0 or (a * last + 2.0 * b) * last + c <= 0.0:
        return True
    if a <= 0.0:
        return False
    lowest = -b / a
    return bool(first < lowest < last and c - b * b / a <= 0.0)


@njit(cache=True, nogil=True)
def _meets_block(row: FloatArray, x: float, y: float, z: float, u: float, v: float, w: float) -> bool:
    """Tell whether the ray from (x, y, z) to (x, y, z) + (u, v, w) meets a block."""
    x, y, z = x - row[1], y - row[2], z - row[3]
    first, last = 0.0, 1.0
    for k in range(3):
        if k < 2:
            i, j, m = row[4 + 3 * k], row[5 + 3 * k], row[6 + 3 * k]
        else:
            i = row[5] * row[9] - row[6] * row[8]
            j = row[6] * row[7] - row[4] * row[9]
            m = row[4] * row[8] - row[5] * row[7]
        s, t, half = x * i + y * j + z * m, u * i + v * j + w * m, row[10 + k]
        if abs(t) < 1e-300:
            if abs(s) > half:
                return False
        else:
            one, other = (-half - s) / t, (half - s) / t
            first, last = max(first, min(one, other)), min(last, max(one, other))
            if first > last:
                return False
    return True


@njit(cache=True, nogil=True)
def _meets(row: FloatArray, x: float, y: float, z: float, u: float, v: float, w: float) -> bool:
    if row[0] == BLOCK:
        return _meets_block(row, x, y, z, u, v, w)
    return _meets_revolved(row, x, y, z, u, v, w)


@njit(cache=True, nogil=True)
def _look(
    starts: FloatArray,
    normals: FloatArray,
    scanner: FloatArray,
    offsets: IndexArray,
    members: IndexArray,
    solids: FloatArray,
    first: bool,
    seen: MaskArray,
    buried: MaskArray,
) -> None:
    """Mark what one scanner sees; the first one also marks what is inside a solid."""
    for i in range(len(starts)):
        if buried[i] or (seen[i] and not first):
            continue
        x, y, z = starts[i, 0], starts[i, 1], starts[i, 2]
        u, v, w = scanner[0] - x, scanner[1] - y, scanner[2] - z
        far = np.sqrt(u * u + v * v + w * w)
        facing = u * normals[i, 0] + v * normals[i, 1] + w * normals[i, 2] > _LEAST_COSINE * far
        if not (facing or first):
            continue
        high = np.arcsin(min(1.0, max(-1.0, -w / far))) / np.pi + 0.5
        turned = np.arctan2(-v, -u) / (2.0 * np.pi) + 0.5
        cell = min(_ELEVATIONS - 1, int(_ELEVATIONS * high)) * _AZIMUTHS + min(_AZIMUTHS - 1, int(_AZIMUTHS * turned))
        hidden = False
        for k in range(offsets[cell], offsets[cell + 1]):
            row = solids[members[k]]
            if first and _meets(row, x, y, z, 0.0, 0.0, 0.0):
                buried[i] = True
                break
            if facing and not hidden and _meets(row, x, y, z, u, v, w):
                hidden = True
                if not first:
                    break
        if facing and not hidden and not buried[i]:
            seen[i] = True
