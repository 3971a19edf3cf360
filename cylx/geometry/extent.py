"""The extent of the surface of a cylinder along its axis."""

from __future__ import annotations

import math

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import median_of_positive, sort_in_place

ARC_BINS = 24
LEAST_POINTS_OF_EXTENT = 15
"""Minimum number of points for an extent."""
FAINT = 0.2
"""A piece with less than this share of the mean of the known part's pieces shows another, passing object."""
FULL_PIECE = 12.0
"""Number of points that a piece of the height should hold."""
LEAP = 3.0
"""A gap is bridged if it is at most so many times what was filled before it: two discs on one axis are no pipe."""
LONE = 6.0
"""An outermost point is a stray if the third point from the end lies further in by more than this many usual gaps; with
evenly spread points one in sixty does."""


def visible_extent(
    heights: FloatArray, angles: FloatArray, half: float, radius: float, filled: float = 0.35, doubt: float = 1.0
) -> tuple[float, float] | None:
    """Find the extent of a surface along the axis, by pieces of its height in which the arc is filled.

    The density alone would follow a can along the table it touches. The criterion is therefore the share of the arc's
    angles that are filled.

    Parameters
    ----------
    heights, angles : ndarray of shape (n,)
        Cylinder coordinates of the points on the surface.
    half : float
        The arc is found from the points with heights within this.
    radius : float
    filled : float
        A piece is accepted if it fills this share of the median piece.
    doubt : float
        Reduced requirement for pieces within `half`, as a share: less than 1 if they have been accepted before, so that
        a growing cylinder is not cut where it is sparsely seen.

    Returns
    -------
    low, high : float
        Heights of the ends; None with fewer than 15 points.
    """
    ends = np.empty(2)
    found = _find_ends(np.ascontiguousarray(heights), np.ascontiguousarray(angles), half, radius, filled, doubt, ends)
    return (float(ends[0]), float(ends[1])) if found else None


@njit(cache=True, nogil=True)
def _find_ends(
    heights: FloatArray,
    angles: FloatArray,
    half: float,
    radius: float,
    filled: float,
    doubt: float,
    ends: FloatArray,
) -> bool:
    counts, scratch = np.zeros(ARC_BINS), np.empty(ARC_BINS)
    arc = np.zeros(ARC_BINS, np.bool_)
    core, lowest, highest = 0, math.inf, -math.inf
    for i in range(len(heights)):
        if abs(heights[i]) <= half:
            counts[_bin(angles[i])] += 1.0
            core += 1
    if core < LEAST_POINTS_OF_EXTENT:
        return False
    least = max(0.5, 0.15 * median_of_positive(counts, len(counts), scratch))
    width, on = np.int64(0), 0.0
    for b in range(ARC_BINS):
        if counts[b] > least:
            arc[b] = True
            width += 1
            on += counts[b]
    density = on / (2.0 * half)
    if density <= 0.0:
        return False
    for i in range(len(heights)):
        if arc[_bin(angles[i])]:
            lowest, highest = min(lowest, heights[i]), max(highest, heights[i])
    piece = max(0.25 * min(radius, 2.0 * half), FULL_PIECE / density)  # of a disc, a quarter of its height
    first = math.floor(lowest / piece)
    pieces = int(math.floor(highest / piece) - first) + 1
    asked = np.ones(pieces)
    for p in range(pieces):
        if abs((first + p + 0.5) * piece) <= half:
            asked[p] = doubt
    shares = _fill_shares(heights, angles, arc, width, piece, first, pieces, FAINT * density * piece * asked)
    bridge = max(3.0 * radius, FULL_PIECE / density)
    start, stop = _choose_run(shares, pieces, piece, first, half, filled * asked, bridge)
    if start < 0:
        return False
    _set_ends(heights, angles, arc, (first + start) * piece, (first + stop + 1) * piece, 2.0 * piece, ends)
    return True


@njit(cache=True, nogil=True)
def _bin(angle: float) -> int:
    return int((angle / (2.0 * math.pi) + 0.5) * ARC_BINS) % ARC_BINS


@njit(cache=True, nogil=True)
def _fill_shares(
    heights: FloatArray,
    angles: FloatArray,
    arc: MaskArray,
    width: int,
    piece: float,
    first: float,
    pieces: int,
    least: FloatArray,
) -> FloatArray:
    """Return for each piece of the height the share of the arc's bins that hold a point; 0 for pieces too sparse."""
    occupied = np.zeros((pieces, ARC_BINS), np.bool_)
    shares, counts = np.zeros(pieces), np.zeros(pieces)
    for i in range(len(heights)):
        b = _bin(angles[i])
        if arc[b]:
            p = int(math.floor(heights[i] / piece) - first)
            counts[p] += 1.0
            if not occupied[p, b]:
                occupied[p, b] = True
                shares[p] += 1.0 / width
    for p in range(pieces):
        if counts[p] < least[p]:
            shares[p] = 0.0
    return shares


@njit(cache=True, nogil=True)
def _choose_run(
    shares: FloatArray, pieces: int, piece: float, first: float, half: float, filled: FloatArray, bridge: float
) -> tuple[int, int]:
    """Return first and last piece of the run of filled ones that overlaps the known height most; gaps are bridged."""
    inside, scratch, n = np.empty(pieces), np.empty(pieces), np.int64(0)
    for p in range(pieces):
        if abs((first + p + 0.5) * piece) <= half + 0.5 * piece:
            inside[n] = shares[p]
            n += 1
    usual = median_of_positive(inside, n, scratch)
    if usual == 0.0:
        usual = 1.0
    best, start, stop, last, held, most = -1, -1, -1, -1, 0, -math.inf
    for p in range(pieces + 1):
        if p < pieces and shares[p] < filled[p] * usual:
            continue
        longest = min(bridge / piece, LEAP * held) + 1.0
        if start >= 0 and (p == pieces or p - last > longest):
            overlap = min((first + last + 1) * piece, half) - max((first + start) * piece, -half)
            if overlap > most:
                best, stop, most = start, last, overlap
            start = -1
        if p < pieces:
            held = 1 if start < 0 else held + 1
            start = p if start < 0 else start
            last = p
    return best, stop


@njit(cache=True, nogil=True)
def _set_ends(
    heights: FloatArray,
    angles: FloatArray,
    arc: MaskArray,
    low: float,
    high: float,
    margin: float,
    ends: FloatArray,
) -> None:
    """Set the ends to the outermost points between two heights that are not strays."""
    near, count = np.empty(len(heights)), 0
    for i in range(len(heights)):
        if low <= heights[i] < high and arc[_bin(angles[i])]:
            count += 1
    gap = (high - low) / max(count, 1)
    for side in range(2):
        n = np.int64(0)
        for i in range(len(heights)):
            depth = heights[i] - low if side == 0 else high - heights[i]
            if 0.0 <= depth < margin and low <= heights[i] < high and arc[_bin(angles[i])]:
                near[n] = depth
                n += 1
        sort_in_place(near, n)
        end = 0
        while end + 2 < n and near[end + 2] - near[end] > LONE * gap:
            end += 1
        depth = near[end] if n > 0 else 0.0
        ends[side] = low + depth if side == 0 else high - depth
